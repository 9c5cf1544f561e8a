//! Appearance of a person: colour histograms of torso and legs.
//!
//! Sampled only from pixels in which a camera is predicted to see this person and nobody else, and compared by the
//! Hellinger distance `√(1 − Σ √(p q))` (D. Comaniciu, V. Ramesh and P. Meer, "Kernel-based object tracking", PAMI
//! 2003).

use image::Rgb;

use crate::CameraFrame;
use crate::observation::Colours;
use crate::silhouette::visibility::{fraction, visible_parts};
use crate::silhouette::{Body, Silhouette, View};

/// Number of levels of each colour channel.
const LEVELS: usize = 6;
/// Ranges of torso and legs, as fractions of the visible silhouette's height from its top. The part between them is a
/// jacket's hem on some people and not on others; head and feet are small and alike.
const TORSO: std::ops::Range<f64> = 0.18..0.45;
const LEGS: std::ops::Range<f64> = 0.58..0.88;
/// Least visible fraction of a person in a camera that counts: of a smaller part it is not known which one it is.
const LEAST_VISIBLE: f64 = 0.7;
/// Fraction of a row's width around its middle that is the person in every pose.
const MIDDLE: f64 = 0.5;

/// Colours of torso and legs.
#[derive(Debug, Clone, Default)]
pub struct Appearance {
    torso: Histogram,
    legs: Histogram,
}

/// Histogram of colours.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Histogram {
    /// Count of each colour; empty until a pixel is counted.
    counts: Vec<f64>,
    pixels: f64,
}

impl Appearance {
    /// Number of pixels, after fading.
    pub fn pixels(&self) -> f64 {
        self.torso.pixels.min(self.legs.pixels)
    }

    /// Adds another sample of the same person. Earlier counts are first faded to at most `remembered_px` pixels.
    pub fn add(&mut self, seen: &Self, remembered_px: f64) {
        self.torso.add(&seen.torso, remembered_px);
        self.legs.add(&seen.legs, remembered_px);
    }

    /// Distance between two appearances: 0 for the same colours in the same proportions, 1 for none in common.
    pub fn distance(&self, other: &Self) -> f64 {
        0.5 * (self.torso.distance(&other.torso) + self.legs.distance(&other.legs))
    }
}

/// Appearance of each person at this moment, over all cameras that see them well.
pub fn sample(cameras: &[CameraFrame], views: &[View], people: &[Body]) -> Vec<Appearance> {
    let mut looks = vec![Appearance::default(); people.len()];
    for (camera, view) in cameras.iter().zip(views) {
        let Some(colours) = &camera.colours else { continue };
        for (look, part) in looks.iter_mut().zip(visible_parts(view, people)) {
            if fraction(&part) >= LEAST_VISIBLE {
                look.look_at(colours, view, &part);
            }
        }
    }
    looks
}

impl Appearance {
    fn look_at(&mut self, colours: &Colours, view: &View, part: &Silhouette) {
        for (height, samples) in middle_rows(colours, view, part) {
            let histogram = if TORSO.contains(&height) {
                &mut self.torso
            } else if LEGS.contains(&height) {
                &mut self.legs
            } else {
                continue;
            };
            samples.for_each(|color| histogram.count(color));
        }
    }
}

/// Rows of a person's visible part: height, from 0 at the top to 1 at the bottom, and the colours sampled in the middle
/// of the row.
pub(crate) fn middle_rows(
    colours: &Colours,
    view: &View,
    part: &Silhouette,
) -> impl Iterator<Item = (f64, impl Iterator<Item = Rgb<u8>>)> {
    let rows = part.row_range();
    let side = u32::from(view.block);
    let middle = move |i: usize| i as u32 * side + side / 2;
    rows.clone().map(move |row| {
        let height = (row - rows.start) as f64 / rows.len() as f64;
        let width = part.row_width(row);
        let inset = (width.len() as f64 * 0.5 * (1.0 - MIDDLE)) as usize;
        let columns = width.start + inset..width.end - inset;
        let seen = columns.filter(move |column| part.contains(*column as u32, row as u32));
        (height, seen.filter_map(move |column| colours.at(middle(column), middle(row))))
    })
}

impl Histogram {
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
