//! Histograms of colours, compared by the Hellinger distance `√(1 − Σ √(p q))` (D. Comaniciu, V. Ramesh and P. Meer,
//! "Kernel-based object tracking", PAMI 2003).

use image::Rgb;

/// Number of levels of each colour channel.
const LEVELS: usize = 6;

/// Histogram of colours.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Histogram {
    /// Count of each colour; empty until a pixel is counted.
    counts: Vec<f64>,
    pixels: f64,
}

impl Histogram {
    /// Number of pixels, after fading.
    pub fn pixels(&self) -> f64 {
        self.pixels
    }

    /// Counts a pixel.
    pub fn count(&mut self, pixel: Rgb<u8>) {
        self.counts.resize(LEVELS.pow(3), 0.0);
        let level = |value: u8| usize::from(value) * LEVELS / 256;
        let [r, g, b] = pixel.0.map(level);
        self.counts[(r * LEVELS + g) * LEVELS + b] += 1.0;
        self.pixels += 1.0;
    }

    /// Adds another histogram. Earlier counts are first faded to at most `remembered_px` pixels.
    pub fn add(&mut self, other: &Self, remembered_px: f64) {
        if other.counts.is_empty() {
            return;
        }
        self.counts.resize(LEVELS.pow(3), 0.0);
        let fade = if self.pixels > remembered_px { remembered_px / self.pixels } else { 1.0 };
        for (own, new) in self.counts.iter_mut().zip(&other.counts) {
            *own = *own * fade + new;
        }
        self.pixels = self.pixels * fade + other.pixels;
    }

    /// Hellinger distance: 0 for the same colours in the same proportions, 1 for none in common or an empty histogram.
    pub fn distance(&self, other: &Self) -> f64 {
        if self.pixels == 0.0 || other.pixels == 0.0 {
            return 1.0;
        }
        let common: f64 = self.counts.iter().zip(&other.counts).map(|(p, q)| (p * q).sqrt()).sum();
        (1.0 - common / (self.pixels * other.pixels).sqrt()).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn of(pixels: &[[u8; 3]]) -> Histogram {
        let mut histogram = Histogram::default();
        for pixel in pixels {
            histogram.count(Rgb(*pixel));
        }
        histogram
    }

    #[test]
    fn distances_are_hellingers() {
        let (red, blue) = ([250, 0, 0], [0, 0, 250]);
        assert_relative_eq!(of(&[red, blue]).distance(&of(&[blue, red, red, blue])), 0.0, epsilon = 1e-7);
        assert_relative_eq!(of(&[red]).distance(&of(&[blue])), 1.0);
        // Half in common: Σ √(p q) = √(1 · ½).
        let half = (1.0 - 0.5_f64.sqrt()).sqrt();
        assert_relative_eq!(of(&[red]).distance(&of(&[red, blue])), half, epsilon = 1e-12);
        assert_relative_eq!(of(&[]).distance(&of(&[red])), 1.0);
    }

    #[test]
    fn old_looks_fade() {
        let (red, blue) = ([250, 0, 0], [0, 0, 250]);
        let mut memory = of(&[red; 100]);
        memory.add(&of(&[blue; 10]), 10.0);
        assert_relative_eq!(memory.distance(&of(&[red, blue])), 0.0, epsilon = 1e-7);
        assert_relative_eq!(memory.pixels, 20.0);
    }
}
