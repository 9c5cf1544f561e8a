//! Residual of a state: foreground that no person explains, and pixels of people whom a single camera sees.
//!
//! The distance of a person whom only one camera sees is uncertain: by a metre where the feet are hidden. When
//! another camera begins to see that person, it shows foreground that nobody explains at a place where the first
//! camera shows no unexplained foreground.

use super::filled::Filled;
use super::person::Person;
use crate::likelihood::{Layers, Simulation, SummedArea};
use crate::silhouette::Silhouette;

/// A camera shows an unexplained person where this fraction of the pixels is unexplained foreground …
const PLAIN: f64 = 0.75;
/// … and is not asked about a place of which people seen by it alone cover this fraction.
const TAKEN: f64 = 0.5;

/// Residual of a state in all cameras, as tables for counting.
#[derive(Debug, Clone, Default)]
pub(super) struct LeftOver {
    /// Residual of each camera; `None` for cameras without a mask.
    cameras: Vec<Option<LeftInCamera>>,
    /// Packed image of the people whom one camera alone sees (reused memory).
    lone: Vec<u64>,
}

/// Residual of a state in one camera.
#[derive(Debug, Clone, Default)]
struct LeftInCamera {
    /// Foreground pixels that nobody explains.
    unexplained: SummedArea,
    /// Pixels that people seen by this camera alone cover, arms and legs included.
    covered: SummedArea,
}

/// Pixels in one camera at the place of a person.
struct Under {
    visible: u32,
    unexplained: u32,
    covered: u32,
}

impl LeftInCamera {
    fn under(&self, filled: &Filled) -> Under {
        let count = |sums: &SummedArea| sums.count(&filled.rows, &filled.columns).min(filled.visible_px);
        Under {
            visible: filled.visible_px,
            unexplained: count(&self.unexplained),
            covered: count(&self.covered),
        }
    }
}

impl Under {
    fn is_plain(&self) -> bool {
        f64::from(self.unexplained) >= PLAIN * f64::from(self.visible)
    }

    fn is_taken(&self) -> bool {
        !self.is_plain() && f64::from(self.covered) >= TAKEN * f64::from(self.visible)
    }
}

impl LeftOver {
    /// Pixels and unexplained foreground pixels that a person filling these rectangles would explain, for each camera
    /// that is asked.
    ///
    /// In a camera whose foreground there is explained already, a new person explains nothing, which is evidence
    /// against the place. A camera is not asked where it alone sees the person who covers the place while another
    /// camera shows most of an unexplained person: both may be the same person, tracked at a wrong distance.
    pub(super) fn at(&self, filled: &[Filled]) -> impl Iterator<Item = (usize, [u32; 2])> {
        let seen = || {
            filled
                .iter()
                .zip(&self.cameras)
                .enumerate()
                .filter(|(_, (filled, _))| filled.visible_px > 0)
                .filter_map(|(camera, (filled, left))| Some((camera, left.as_ref()?.under(filled))))
        };
        let elsewhere = seen().any(|(_, under)| under.is_plain());
        seen()
            .filter(move |(_, under)| !(elsewhere && under.is_taken()))
            .map(|(camera, under)| (camera, [under.visible, under.unexplained]))
    }

    /// Whether some camera shows most of an unexplained person who would fill these rectangles.
    pub(super) fn is_plain(&self, filled: &[Filled]) -> bool {
        let seen = filled.iter().zip(&self.cameras).filter(|(filled, _)| filled.visible_px > 0);
        seen.filter_map(|(filled, left)| Some(left.as_ref()?.under(filled))).any(|under| under.is_plain())
    }

    /// Computes the residual of the simulation's present state, which consists of these people.
    pub(super) fn restart(&mut self, layers: &Layers, simulation: &Simulation, people: &[Person]) {
        self.cameras.resize_with(layers.views().len(), || None);
        let is_seen = |person: &Person, camera: usize| {
            let layer = layers.innermost(camera);
            simulation.in_use(layer) && person.silhouettes[layer].visible_px > 0
        };
        let is_lone = |person: &&Person| {
            (0..layers.views().len()).filter(|camera| is_seen(person, *camera)).count() == 1
        };
        for (camera, (sums, view)) in self.cameras.iter_mut().zip(layers.views()).enumerate() {
            let layer = layers.outermost(camera);
            if simulation.in_use(layer) {
                let LeftInCamera { unexplained, covered } = sums.get_or_insert_default();
                let (columns, words) = (view.width as usize, view.words_per_row);
                unexplained.restart(columns, words, simulation.unexplained(layer));
                self.lone.clear();
                self.lone.resize(words * view.height as usize, 0);
                for person in people.iter().filter(is_lone) {
                    paint(&person.silhouettes[layer], words, &mut self.lone);
                }
                covered.restart(columns, words, self.lone.iter().copied());
            } else {
                *sums = None;
            }
        }
    }
}

/// Paints a silhouette into a packed image with this many words a row.
pub(super) fn paint(silhouette: &Silhouette, words_per_row: usize, image: &mut [u64]) {
    for (row, bits) in silhouette.rows() {
        let start = row * words_per_row + silhouette.word_range().start;
        for (word, bits) in image[start..].iter_mut().zip(bits) {
            *word |= bits;
        }
    }
}
