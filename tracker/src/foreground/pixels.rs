//! The per-pixel model around an empty scene: which pixels of a frame are not explained by it, and how it follows slow
//! changes without absorbing the people in front of it.
//!
//! Each pixel holds its background colour. A pixel that does not show it gathers evidence for a new one: a colour that
//! stays the same for [`PixelOptions::absorb_s`] becomes the background (a moved chair), while the old one is kept as the
//! *former* background, so that a person absorbed after all leaves no ghost when they walk on.

use image::{GrayImage, RgbImage};

use super::backdrop::{Backdrop, NOISE_UNIT};
use super::exposure::Exposure;

/// A score of this much is just as far from the background as [`PixelOptions::sensitivity`] allows.
pub const THRESHOLD: u8 = 64;
/// Every row is learnt in one frame of this many.
const ROWS_TURN: u32 = 4;
/// The background follows what it sees with this time constant, in seconds.
const FOLLOW_S: f32 = 20.0;

/// How pixels are judged.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelOptions {
    /// Standard deviations from the background at which a pixel is foreground.
    pub sensitivity: f32,
    /// Never less than this many levels, whatever the noise: compression and interpolation make errors of their own.
    pub least_levels: f32,
    /// Never more than this many levels, so that people stand out before a swaying tree.
    pub most_levels: f32,
    /// A new colour that stays for this long becomes the background, in seconds.
    pub absorb_s: f32,
}

impl Default for PixelOptions {
    fn default() -> Self {
        Self { sensitivity: 5.0, least_levels: 14.0, most_levels: 60.0, absorb_s: 120.0 }
    }
}

/// The model of one camera.
#[derive(Debug, Clone)]
pub struct PixelModel {
    width: usize,
    /// Red, green, blue of each pixel, in 1/256 levels, in the exposure of the backdrop.
    background: Vec<[u16; 3]>,
    /// The distance from the background at which a pixel is foreground, in levels.
    tolerance: Vec<u8>,
    candidates: Vec<Candidate>,
    options: PixelOptions,
    /// Which rows learn next.
    turn: u32,
}

/// What a pixel shows when it does not show its background.
#[derive(Debug, Clone, Copy, Default)]
struct Candidate {
    color: [u8; 3],
    /// For how long, in seconds.
    age_s: f32,
    /// The background before this one, if there was one.
    former: Option<[u8; 3]>,
}

impl PixelModel {
    /// A model that starts from an empty scene.
    pub fn new(backdrop: &Backdrop, options: &PixelOptions) -> Self {
        let background = backdrop.picture.pixels().map(|p| p.0.map(|v| (v as u16) << 8)).collect();
        let tolerance = backdrop.noise.pixels().map(|n| {
            let levels = options.sensitivity * n[0] as f32 * NOISE_UNIT;
            levels.clamp(options.least_levels, options.most_levels).round() as u8
        });
        Self {
            width: backdrop.picture.width() as usize,
            tolerance: tolerance.collect(),
            candidates: vec![Candidate::default(); backdrop.picture.pixels().len()],
            background,
            options: options.clone(),
            turn: 0,
        }
    }

    /// Scores every pixel: 0 where the frame shows the background as it looks in this exposure, [`THRESHOLD`] at the
    /// tolerance, growing with the square of the distance; 255 at most. `expected` becomes the background as it should
    /// look.
    pub fn score(
        &self,
        frame: &RgbImage,
        exposure: &Exposure,
        expected: &mut RgbImage,
        score: &mut GrayImage,
    ) {
        let table = exposure.table();
        let pixels = frame.as_raw().chunks_exact(3).zip(&self.background);
        let out = expected.chunks_exact_mut(3).zip(score.iter_mut());
        for (((x, background), (expected, score)), (tolerance, candidate)) in
            pixels.zip(out).zip(self.tolerance.iter().zip(&self.candidates))
        {
            let e: [u8; 3] = std::array::from_fn(|c| table[c][level(background[c]) as usize]);
            expected.copy_from_slice(&e);
            let tolerance = *tolerance as u32;
            let squared = squared_distance(x, e);
            // Most pixels show the background: they leave here.
            if 4 * squared < tolerance * tolerance {
                *score = 0;
                continue;
            }
            let mut squared = squared;
            if let Some(former) = candidate.former {
                let former: [u8; 3] = std::array::from_fn(|c| table[c][former[c] as usize]);
                squared = squared.min(squared_distance(x, former));
            }
            // The former background is no 0: it is not what the background may follow. And 1 is a shadow's mark.
            *score = (squared * THRESHOLD as u32 / (tolerance * tolerance)).clamp(2, 255) as u8;
        }
    }

    /// Learns from a frame: the background follows where it shows (`score` 0 and not in `mask`); elsewhere what is seen
    /// instead gathers age. `elapsed_s` is the time since the last frame.
    pub fn learn(
        &mut self,
        frame: &RgbImage,
        exposure: &Exposure,
        score: &GrayImage,
        mask: &GrayImage,
        elapsed_s: f32,
    ) {
        let table = exposure.inverse_table();
        let elapsed_s = elapsed_s * ROWS_TURN as f32;
        let follow = (65536.0 * (elapsed_s / FOLLOW_S).clamp(0.0, 0.5)) as i32;
        let width = self.width;
        for y in (self.turn as usize..frame.height() as usize).step_by(ROWS_TURN as usize) {
            let row = y * width..(y + 1) * width;
            let frame = &frame.as_raw()[3 * row.start..3 * row.end];
            for (i, x) in row.zip(frame.chunks_exact(3)) {
                if mask.as_raw()[i] == 0 && score.as_raw()[i] == 0 {
                    let background = &mut self.background[i];
                    for c in 0..3 {
                        let seen = (table[c][x[c] as usize] as i32) << 8;
                        let old = background[c] as i32;
                        // Rounded, not cut off: a bias would drift, and the exposure's fit would follow it.
                        let step = ((seen - old) * (follow >> 4) + (1 << 11)) >> 12;
                        background[c] = (old + step).clamp(0, 65535) as u16;
                    }
                    self.candidates[i].age_s = 0.0;
                } else {
                    let seen: [u8; 3] = std::array::from_fn(|c| table[c][x[c] as usize]);
                    self.gather(i, seen, elapsed_s);
                }
            }
        }
        self.turn = (self.turn + 1) % ROWS_TURN;
    }

    fn gather(&mut self, i: usize, seen: [u8; 3], elapsed_s: f32) {
        let tolerance = self.tolerance[i] as u32;
        let candidate = &mut self.candidates[i];
        if squared_distance(&seen, candidate.color) <= tolerance * tolerance {
            candidate.age_s += elapsed_s;
        } else if candidate.age_s > 2.0 * elapsed_s {
            // Somebody passing in front of a moved chair only delays it.
            candidate.age_s -= 2.0 * elapsed_s;
        } else {
            candidate.color = seen;
            candidate.age_s = 0.0;
        }
        if candidate.age_s >= self.options.absorb_s {
            self.absorb(i);
        }
    }

    fn absorb(&mut self, i: usize) {
        let candidate = &mut self.candidates[i];
        candidate.former = Some(self.background[i].map(level));
        candidate.age_s = 0.0;
        self.background[i] = candidate.color.map(|v| (v as u16) << 8);
    }

    /// Takes what each pixel has shown lately for its background: after the light was switched. `frame` stands in where a
    /// pixel has shown nothing for long.
    pub fn adopt(&mut self, frame: &RgbImage) {
        for (i, x) in frame.as_raw().chunks_exact(3).enumerate() {
            let candidate = &mut self.candidates[i];
            let color = if candidate.age_s > 0.0 { candidate.color } else { [x[0], x[1], x[2]] };
            // The old background stays known: it may have been a body in front of the lens, or the light comes back.
            let former = Some(self.background[i].map(level));
            self.background[i] = color.map(|v| (v as u16) << 8);
            *candidate = Candidate { former, ..Candidate::default() };
        }
    }

    /// Gathers what is seen at every pixel, in every row: what [`Self::adopt`] then takes. In the frame's own exposure.
    pub fn watch(&mut self, frame: &RgbImage, elapsed_s: f32) {
        for (i, x) in frame.as_raw().chunks_exact(3).enumerate() {
            let tolerance = self.tolerance[i] as u32;
            let candidate = &mut self.candidates[i];
            if squared_distance(x, candidate.color) <= tolerance * tolerance {
                candidate.age_s += elapsed_s;
            } else if candidate.age_s > elapsed_s {
                candidate.age_s -= elapsed_s;
            } else {
                candidate.color = [x[0], x[1], x[2]];
                candidate.age_s = 0.0;
            }
        }
    }

    /// Where a pixel is too far from its background, in levels.
    pub fn tolerance(&self) -> &[u8] {
        &self.tolerance
    }

    /// The background in the backdrop's exposure.
    pub fn picture(&self, into: &mut RgbImage) {
        for (into, background) in into.chunks_exact_mut(3).zip(&self.background) {
            into.copy_from_slice(&background.map(level));
        }
    }
}

/// The nearest whole level.
fn level(fixed: u16) -> u8 {
    (fixed.saturating_add(128) >> 8) as u8
}

fn squared_distance(a: &[u8], b: [u8; 3]) -> u32 {
    let d = |c: usize| a[c].abs_diff(b[c]) as u32;
    d(0) * d(0) + d(1) * d(1) + d(2) * d(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Luma, Rgb};

    fn flat(color: [u8; 3]) -> RgbImage {
        RgbImage::from_pixel(16, 12, Rgb(color))
    }

    fn model(absorb_s: f32) -> PixelModel {
        let backdrop = Backdrop { picture: flat([100, 110, 120]), noise: GrayImage::new(16, 12) };
        PixelModel::new(&backdrop, &PixelOptions { absorb_s, ..PixelOptions::default() })
    }

    /// Shows a colour for a time at 10 frames a second; returns the last score of a pixel.
    fn show(model: &mut PixelModel, color: [u8; 3], seconds: f32) -> u8 {
        let (mut expected, mut score) = (flat([0; 3]), GrayImage::new(16, 12));
        for _ in 0..(10.0 * seconds) as usize {
            let frame = flat(color);
            model.score(&frame, &Exposure::default(), &mut expected, &mut score);
            let mask = GrayImage::from_fn(16, 12, |u, v| {
                Luma([255 * u8::from(score.get_pixel(u, v)[0] >= THRESHOLD)])
            });
            model.learn(&frame, &Exposure::default(), &score, &mask, 0.1);
        }
        score.get_pixel(3, 3)[0]
    }

    #[test]
    fn the_threshold_is_at_the_tolerance() {
        let model = model(60.0);
        let (mut expected, mut score) = (flat([0; 3]), GrayImage::new(16, 12));
        let levels = PixelOptions::default().least_levels as u8;
        for (more, found) in [(0, 0), (levels / 2 - 1, 0), (levels, THRESHOLD), (2 * levels, 255)] {
            model.score(&flat([100 + more, 110, 120]), &Exposure::default(), &mut expected, &mut score);
            assert_eq!(score.get_pixel(5, 5)[0], found, "{more} levels");
        }
        assert_eq!(expected, flat([100, 110, 120]));
    }

    #[test]
    fn a_person_who_stands_for_a_minute_stays_and_a_chair_is_absorbed_in_the_end() {
        let mut model = model(120.0);
        assert_eq!(show(&mut model, [30, 30, 60], 60.0), 255, "a person still stands out after a minute");
        assert_eq!(show(&mut model, [30, 30, 60], 65.0), 0, "a chair does not after two");
        // When it goes, the old background is known at once.
        assert!(show(&mut model, [100, 110, 120], 0.1) < THRESHOLD / 8);
    }

    #[test]
    fn slow_change_is_followed() {
        let mut model = model(120.0);
        for step in 0..40_u8 {
            assert_eq!(show(&mut model, [100 + step, 110, 120], 10.0), 0, "after {step} levels");
        }
    }

    #[test]
    fn after_a_switch_what_is_seen_is_adopted() {
        let mut model = model(120.0);
        for _ in 0..20 {
            model.watch(&flat([40, 50, 60]), 0.1);
        }
        model.adopt(&flat([200, 200, 200]));
        assert_eq!(show(&mut model, [40, 50, 60], 0.1), 0);
    }
}
