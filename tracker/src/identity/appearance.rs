//! Appearance of a person: colour histograms of torso and legs.
//!
//! Sampled only from pixels in which a camera is predicted to see this person and nobody else.

use image::Rgb;
use mot::histogram::Histogram;

use crate::CameraFrame;
use crate::observation::Colours;
use crate::silhouette::visibility::{fraction, visible_parts};
use crate::silhouette::{Body, Silhouette, View};

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

impl Appearance {
    /// Number of pixels, after fading.
    pub fn pixels(&self) -> f64 {
        self.torso.pixels().min(self.legs.pixels())
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
