//! Health of a camera's pictures: frozen and dark ones are set aside.

use image::RgbImage;

/// Distance between two compared rows.
const ROW_STEP: usize = 8;
/// Time of repeated pictures after which a camera is frozen, seconds…
const FREEZE_S: f64 = 0.5;
/// …and least number of repeats…
const FREEZE_REPEATS: u32 = 3;
/// …provided that before it repeated fewer than this share of its pictures: a healthy camera without noise, or a
/// recording that was stretched to a higher rate, repeats pictures, too…
const USUAL_REPEATS: f64 = 0.25;
/// …and least number of pictures before.
const LEAST_SEEN: u32 = 10;
/// Mean level of the brightest row below which a picture is dark.
const DARK_LEVEL: u32 = 10;

/// Detector of frozen pictures of one camera.
#[derive(Debug, Default)]
pub struct Health {
    /// Compared rows of the latest picture.
    latest: Vec<u8>,
    /// Number of pictures before the present run of repeats, and number of them that repeated the one before.
    seen: u32,
    repeated: u32,
    run: u32,
    run_started_s: f64,
}

impl Health {
    /// Adds a picture. Returns whether the camera has repeated it for too long.
    pub fn is_frozen(&mut self, frame: &RgbImage, time_s: f64) -> bool {
        let same = !self.latest.is_empty() && rows(frame).eq(self.latest.chunks_exact(row_bytes(frame)));
        if same {
            if self.run == 0 {
                self.run_started_s = time_s;
            }
            self.run += 1;
            let usual = self.seen < LEAST_SEEN || self.repeated as f64 > USUAL_REPEATS * self.seen as f64;
            return !usual && self.run >= FREEZE_REPEATS && time_s - self.run_started_s >= FREEZE_S;
        }
        self.latest.clear();
        rows(frame).for_each(|row| self.latest.extend_from_slice(row));
        self.seen += 1 + self.run;
        self.repeated += self.run;
        self.run = 0;
        false
    }
}

/// Whether a picture is nearly black: a covered or failing camera, or a room at night.
pub fn is_dark(frame: &RgbImage) -> bool {
    let brightest =
        rows(frame).map(|row| row.iter().map(|v| *v as u32).sum::<u32>() / row.len() as u32).max();
    brightest.is_none_or(|level| level < DARK_LEVEL)
}

fn row_bytes(frame: &RgbImage) -> usize {
    (3 * frame.width() as usize).max(1)
}

fn rows(frame: &RgbImage) -> impl Iterator<Item = &[u8]> {
    frame.as_raw().chunks_exact(row_bytes(frame)).step_by(ROW_STEP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    fn picture(level: u8) -> RgbImage {
        RgbImage::from_pixel(32, 24, Rgb([level; 3]))
    }

    #[test]
    fn a_living_camera_that_stops_is_frozen_until_it_moves_again() {
        let mut health = Health::default();
        for t in 0..20_u8 {
            assert!(!health.is_frozen(&picture(t + 50), t as f64 * 0.1));
        }
        let frozen: Vec<bool> = (20..40).map(|t| health.is_frozen(&picture(69), t as f64 * 0.1)).collect();
        assert!(!frozen[0] && !frozen[3] && frozen[8] && frozen[19], "{frozen:?}");
        assert!(!health.is_frozen(&picture(10), 4.0));
    }

    #[test]
    fn a_camera_that_always_repeats_itself_is_not_frozen() {
        let mut doubled = Health::default();
        assert!((0..100).all(|t: u32| !doubled.is_frozen(&picture((t / 2) as u8), t as f64 * 0.04)));
        assert!((0..50).all(|t: u32| !doubled.is_frozen(&picture(49), 4.0 + t as f64 * 0.04)));
        let mut still = Health::default();
        assert!((0..100).all(|t| !still.is_frozen(&picture(7), t as f64 * 0.04)));
    }

    #[test]
    fn darkness_is_told_from_a_dim_room() {
        assert!(is_dark(&picture(3)) && !is_dark(&picture(30)) && is_dark(&RgbImage::new(0, 0)));
    }
}
