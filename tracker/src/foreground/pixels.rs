//! Per-pixel background model around an empty scene: it finds the pixels of a frame that the scene does not explain,
//! and follows slow changes without absorbing the people in front of it.
//!
//! Each pixel holds its background colour. A pixel that shows another colour gathers evidence for it: a colour that
//! stays for [`PixelOptions::absorb_s`] becomes the background (a moved chair), while the old one is kept as the
//! *former* background, so that a person who was absorbed leaves no ghost when they walk on.

use image::{GrayImage, RgbImage};

use super::backdrop::{Backdrop, NOISE_UNIT};
use super::exposure::Exposure;
use super::lanes::{ExposureLanes, LANES};
use super::relight;

/// Score of a pixel exactly at the tolerance ([`PixelOptions::sensitivity`]).
pub const THRESHOLD: u8 = 64;
/// Number of frames in which every row is learnt once.
const ROWS_TURN: u32 = 4;
/// Share of the time since a switch for which a colour must have been seen to count as static.
const STEADY: f32 = 0.8;
/// Time constant with which the background follows the picture, seconds.
const FOLLOW_S: f32 = 20.0;

/// Options of the comparison of pixels with the background.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelOptions {
    /// Tolerance, in standard deviations of the noise, from which on a pixel is foreground. Default 5.
    pub sensitivity: f32,
    /// Least tolerance, levels: compression and interpolation cause errors of their own. Default 14.
    pub least_levels: f32,
    /// Largest tolerance, levels, so that people stand out before a swaying tree. Default 60.
    pub most_levels: f32,
    /// Time after which a new colour becomes the background, seconds. Default 120.
    pub absorb_s: f32,
}

impl Default for PixelOptions {
    fn default() -> Self {
        Self { sensitivity: 5.0, least_levels: 14.0, most_levels: 60.0, absorb_s: 120.0 }
    }
}

/// Images that the model learns from beside a frame, one value a pixel.
#[derive(Debug, Clone, Copy)]
pub struct ScoredFrame<'a> {
    /// Score of each pixel ([`PixelModel::score`]).
    pub score: &'a GrayImage,
    /// Foreground mask: 255, else 0.
    pub mask: &'a GrayImage,
    /// Not 0 where a believed person is seen.
    pub people: &'a GrayImage,
}

/// Background model of one camera.
#[derive(Debug, Clone)]
pub struct PixelModel {
    width: usize,
    /// Number of pixels; the vectors below are padded to a whole number of chunks.
    pixels: usize,
    /// Red, green and blue of each pixel, in 1/256 levels, in the exposure of the backdrop.
    background: Vec<[u16; 3]>,
    /// Distance from the background at which a pixel is foreground, levels.
    tolerance: Vec<u8>,
    /// [`THRESHOLD`] divided by the squared tolerance: the score of one squared level.
    scale: Vec<f32>,
    /// Least squared distance from the background that scores more than 0, squared levels.
    unlike: Vec<u16>,
    /// Colour that a pixel shows instead of its background…
    candidates: Vec<[u8; 3]>,
    /// …and the time for which it has, seconds.
    age_s: Vec<f32>,
    /// Background before the present one, if there was one.
    former: Vec<Option<[u8; 3]>>,
    has_former: bool,
    /// Whether a believed person has been seen at a pixel since it last showed its background.
    had_person: Vec<bool>,
    options: PixelOptions,
    /// Row offset that is learnt next.
    turn: u32,
}

impl PixelModel {
    /// Model of an empty scene.
    pub fn new(backdrop: &Backdrop, options: &PixelOptions) -> Self {
        // Padded to a whole chunk.
        let pixels = backdrop.noise.len().next_multiple_of(LANES);
        let mut background: Vec<[u16; 3]> =
            backdrop.picture.pixels().map(|p| p.0.map(|v| (v as u16) << 8)).collect();
        background.resize(pixels, [0; 3]);
        let tolerance = |noise: u8| {
            let levels = options.sensitivity * noise as f32 * NOISE_UNIT;
            levels.clamp(options.least_levels, options.most_levels).round() as u8
        };
        let mut tolerance: Vec<u8> = backdrop.noise.iter().map(|noise| tolerance(*noise)).collect();
        tolerance.resize(pixels, u8::MAX);
        let scale: Vec<f32> =
            tolerance.iter().map(|t| THRESHOLD as f32 / (*t as f32).max(1.0).powi(2)).collect();
        Self {
            width: backdrop.picture.width() as usize,
            pixels: backdrop.noise.len(),
            unlike: scale.iter().map(|scale| least_unlike(*scale)).collect(),
            scale,
            tolerance,
            candidates: vec![[0; 3]; pixels],
            age_s: vec![0.0; pixels],
            former: vec![None; pixels],
            has_former: false,
            had_person: vec![false; pixels],
            background,
            options: options.clone(),
            turn: 0,
        }
    }

    /// Scores every pixel: 0 where the frame shows the background in this exposure, [`THRESHOLD`] at the tolerance,
    /// growing with the square of the distance up to 255. `expected` becomes the background in this exposure.
    pub fn score(
        &self,
        frame: &RgbImage,
        exposure: &Exposure,
        expected: &mut RgbImage,
        score: &mut GrayImage,
    ) {
        let line = ExposureLanes::new(exposure);
        let table = exposure.table();
        let (chunks, rest) = frame.as_raw().as_chunks::<{ 3 * LANES }>();
        let (looks, rest_looks) = expected.as_chunks_mut::<{ 3 * LANES }>();
        let (scores, rest_scores) = score.as_chunks_mut::<LANES>();
        for (chunk, ((x, looks), scores)) in chunks.iter().zip(looks).zip(scores).enumerate() {
            self.score_chunk(chunk, (&line, &table), x, looks, scores);
        }
        if !rest.is_empty() {
            let (mut x, mut looks, mut scores) = ([0; 3 * LANES], [0; 3 * LANES], [0; LANES]);
            x[..rest.len()].copy_from_slice(rest);
            self.score_chunk(chunks.len(), (&line, &table), &x, &mut looks, &mut scores);
            rest_looks.copy_from_slice(&looks[..rest_looks.len()]);
            rest_scores.copy_from_slice(&scores[..rest_scores.len()]);
        }
    }

    /// Scores the pixels of one chunk of the image.
    fn score_chunk(
        &self,
        chunk: usize,
        (line, table): (&ExposureLanes, &[[u8; 256]; 3]),
        x: &[u8; 3 * LANES],
        looks: &mut [u8; 3 * LANES],
        scores: &mut [u8; LANES],
    ) {
        let squares = line.compare(&self.background.as_flattened().as_chunks().0[chunk], x, looks);
        let unlike = &self.unlike.as_chunks::<LANES>().0[chunk];
        // Nearly all of the image is background.
        let any = squares
            .iter()
            .zip(unlike)
            .fold(0, |any, (squared, unlike)| any | if squared >= unlike { u16::MAX } else { 0 });
        if any == 0 {
            *scores = [0; LANES];
            return;
        }
        let scale = &self.scale.as_chunks::<LANES>().0[chunk];
        for ((squared, scale), score) in squares.iter().zip(scale).zip(&mut *scores) {
            *score = score_of(*squared, *scale);
        }
        if !self.has_former {
            return;
        }
        for (i, former) in self.former[chunk * LANES..][..LANES].iter().enumerate() {
            if let (Some(former), 1..) = (former, scores[i]) {
                let former: [u8; 3] = std::array::from_fn(|c| table[c][former[c] as usize]);
                let again = squared_distance(&x[3 * i..], former) as f32 * scale[i];
                // The former background does not score 0, because the background must not follow it, nor 1, which marks
                // shadows.
                scores[i] = scores[i].min(again.clamp(2.0, 255.0) as u8);
            }
        }
    }

    /// Learns from a frame: the background follows the picture where it is visible (`score` 0 and not in `mask`);
    /// elsewhere the colour seen instead gathers age, except under believed people. Where such a person has gone and
    /// the former background shows, it becomes the background again. `elapsed_s` is the time since the last frame,
    /// seconds.
    pub fn learn(&mut self, frame: &RgbImage, exposure: &Exposure, judged: ScoredFrame<'_>, elapsed_s: f32) {
        let table = exposure.inverse_table();
        let elapsed_s = elapsed_s * ROWS_TURN as f32;
        let follow = (65536.0 * (elapsed_s / FOLLOW_S).clamp(0.0, 0.5)) as i32;
        let width = self.width;
        for y in (self.turn as usize..frame.height() as usize).step_by(ROWS_TURN as usize) {
            let row = y * width..(y + 1) * width;
            let pixels = frame.as_raw()[3 * row.start..3 * row.end].as_chunks::<3>().0;
            let [mask, score, people] =
                [judged.mask, judged.score, judged.people].map(|image| &image.as_raw()[row.clone()]);
            let known = mask.iter().zip(score).zip(people);
            for ((i, x), ((mask, score), person)) in row.zip(pixels).zip(known) {
                let seen: [u8; 3] = std::array::from_fn(|c| table[c][x[c] as usize]);
                if mask | score == 0 {
                    for (background, seen) in self.background[i].iter_mut().zip(seen) {
                        let old = i32::from(*background);
                        // Rounded, not truncated: a bias would drift, and the exposure's fit would follow it.
                        let step = (((i32::from(seen) << 8) - old) * (follow >> 4) + (1 << 11)) >> 12;
                        *background = (old + step).clamp(0, 65535) as u16;
                    }
                    self.age_s[i] = 0.0;
                    self.had_person[i] = *person > 0;
                } else if *person > 0 {
                    self.had_person[i] = true;
                    self.age_s[i] = (self.age_s[i] - elapsed_s).max(0.0);
                } else if !(self.had_person[i] && self.restore_former(i, seen)) {
                    self.gather(i, seen, elapsed_s);
                }
            }
        }
        self.turn = (self.turn + 1) % ROWS_TURN;
    }

    fn gather(&mut self, i: usize, seen: [u8; 3], elapsed_s: f32) {
        let (candidate, age_s) = (&mut self.candidates[i], &mut self.age_s[i]);
        if is_near(&seen, *candidate, self.tolerance[i]) {
            *age_s += elapsed_s;
        } else if *age_s > 2.0 * elapsed_s {
            // A person passing in front of a moved chair only delays it.
            *age_s -= 2.0 * elapsed_s;
        } else {
            *candidate = seen;
            *age_s = 0.0;
        }
        if *age_s >= self.options.absorb_s {
            let candidate = *candidate;
            self.replace(i, candidate);
        }
    }

    /// Restores the former background if the pixel shows it, and returns whether it did. The absorbed colour was a
    /// person's and is forgotten, so that it is foreground when it returns.
    fn restore_former(&mut self, i: usize, seen: [u8; 3]) -> bool {
        let Some(former) = self.former[i].filter(|former| is_near(&seen, *former, self.tolerance[i])) else {
            return false;
        };
        self.background[i] = former.map(|v| u16::from(v) << 8);
        self.former[i] = None;
        self.age_s[i] = 0.0;
        self.had_person[i] = false;
        true
    }

    /// Gives a pixel a new background. The old one is kept: it may be a body that has left, or the earlier light that
    /// returns.
    fn replace(&mut self, i: usize, color: [u8; 3]) {
        self.former[i] = Some(self.background[i].map(level));
        self.has_former = true;
        self.age_s[i] = 0.0;
        self.background[i] = color.map(|v| u16::from(v) << 8);
    }

    /// Adopts the colour that each pixel has shown lately as its background, after the light was switched; `frame` is
    /// used where a pixel has shown no colour for long. Where a person stands in front of a background that is known in
    /// the new light, that background is taken.
    pub fn adopt(&mut self, frame: &RgbImage) {
        let (width, height) = frame.dimensions();
        let longest_s = self.age_s.iter().fold(0.0, |longest: f32, age| longest.max(*age));
        let steady: Vec<bool> = self.age_s.iter().map(|age| *age >= STEADY * longest_s).collect();
        let mut lately = frame.clone();
        for (i, pixel) in lately.pixels_mut().enumerate() {
            if self.age_s[i] > 0.0 {
                pixel.0 = self.candidates[i];
            }
        }
        let mut before = RgbImage::new(width, height);
        self.picture(&mut before);
        let relit = relight::relit(&before, &lately);
        for (i, pixel) in lately.pixels().enumerate() {
            match &relit {
                Some(relit) if !relit.explained[i] => {
                    let expected = &relit.expected.as_raw()[3 * i..];
                    self.replace(i, [expected[0], expected[1], expected[2]]);
                    // A shadow that the new light casts matches no known surface either, but it stays in place.
                    self.former[i] = steady[i].then_some(pixel.0);
                }
                _ => self.replace(i, pixel.0),
            }
        }
    }

    /// Forgets the colours that pixels showed before: [`Self::watch`] begins.
    pub fn begin_watch(&mut self) {
        self.age_s.fill(0.0);
    }

    /// Gathers the colour of every pixel, in every row, for [`Self::adopt`], in the frame's own exposure.
    pub fn watch(&mut self, frame: &RgbImage, elapsed_s: f32) {
        for (i, x) in frame.as_raw().chunks_exact(3).enumerate() {
            let (candidate, age_s) = (&mut self.candidates[i], &mut self.age_s[i]);
            if is_near(x, *candidate, self.tolerance[i]) {
                *age_s += elapsed_s;
            } else if *age_s > elapsed_s {
                *age_s -= elapsed_s;
            } else {
                *candidate = [x[0], x[1], x[2]];
                *age_s = 0.0;
            }
        }
    }

    /// Distance from the background at which each pixel is foreground, levels.
    pub fn tolerance(&self) -> &[u8] {
        &self.tolerance[..self.pixels]
    }

    /// Writes the background in the backdrop's exposure into a picture.
    pub fn picture(&self, into: &mut RgbImage) {
        for (into, background) in into.chunks_exact_mut(3).zip(&self.background) {
            into.copy_from_slice(&background.map(level));
        }
    }
}

/// Score of a pixel at this squared distance from its background: 0 within half the tolerance.
fn score_of(squared: u16, scale: f32) -> u8 {
    /// Adding this number moves an integer into a float's lowest bits; unlike a cast, that is vectorised.
    const WHOLE: f32 = (1 << 23) as f32;
    let times = times(squared, scale);
    let score = if times < LEAST { 0.0 } else { times.min(255.0) };
    (score.floor() + WHOLE).to_bits() as u8
}

/// Half the tolerance, as a score: nearer pixels show the background.
const LEAST: f32 = THRESHOLD as f32 / 4.0;

fn times(squared: u16, scale: f32) -> f32 {
    // A value exactly at an integer score must not fall below it by rounding.
    f32::from(squared) * scale + 0.01
}

/// Least squared distance that scores more than 0.
fn least_unlike(scale: f32) -> u16 {
    let about = ((LEAST / scale) as u16).saturating_sub(2);
    (about..u16::MAX).find(|squared| times(*squared, scale) >= LEAST).unwrap_or(u16::MAX)
}

/// Whether two colours differ by no more than a pixel's tolerance.
fn is_near(seen: &[u8], color: [u8; 3], tolerance: u8) -> bool {
    squared_distance(seen, color) <= u32::from(tolerance) * u32::from(tolerance)
}

/// Nearest whole level.
fn level(fixed: u16) -> u8 {
    (fixed.saturating_add(128) >> 8) as u8
}

fn squared_distance(a: &[u8], b: [u8; 3]) -> u32 {
    let d = |c: usize| a[c].abs_diff(b[c]) as u32;
    d(0) * d(0) + d(1) * d(1) + d(2) * d(2)
}

#[cfg(test)]
mod tests;
