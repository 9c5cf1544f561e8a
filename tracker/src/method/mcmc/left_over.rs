//! What a state leaves to be explained: where foreground is that nobody accounts for, and whom a camera sees alone.
//!
//! How far away somebody is whom one camera alone sees is known badly: where their feet are hidden, by a metre. Another camera
//! that comes to see them has foreground that nobody explains, where by the first camera nobody is missing.

use super::filled::Filled;
use super::person::Person;
use crate::likelihood::{Layers, Simulation, SummedArea};
use crate::silhouette::Silhouette;

/// A camera has a person whom nobody explains where this part of what they would fill is unexplained …
const PLAIN: f64 = 0.75;
/// … and says nothing of a place where somebody covers this part.
const TAKEN: f64 = 0.5;

/// What a state leaves to be explained of a moment, ready to be counted.
#[derive(Debug, Clone, Default)]
pub(super) struct LeftOver {
    /// One a camera; `None` for those that are left out.
    cameras: Vec<Option<LeftInCamera>>,
    /// The packed image of those whom one camera alone sees: memory that is used again.
    lone: Vec<u64>,
}

/// The same in one camera.
#[derive(Debug, Clone, Default)]
struct LeftInCamera {
    /// Foreground that nobody explains.
    unexplained: SummedArea,
    /// Pixels on which somebody is expected whom no other camera sees, as far as limbs reach.
    covered: SummedArea,
}

/// What there is in one camera where a person would be seen. Pixels.
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
    /// What a person would explain who fills the images so: of each camera that has a say, the pixels, and those of them that
    /// are foreground nobody explains.
    ///
    /// A camera misses nobody where somebody is expected already, which speaks against a place. It has no say where it sees
    /// that one alone and another camera has most of a person whom nobody explains: it may well have that person, at a wrong
    /// distance.
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

    /// Whether some camera has most of a person who fills the images so, and whom nobody explains.
    pub(super) fn is_plain(&self, filled: &[Filled]) -> bool {
        let seen = filled.iter().zip(&self.cameras).filter(|(filled, _)| filled.visible_px > 0);
        seen.filter_map(|(filled, left)| Some(left.as_ref()?.under(filled))).any(|under| under.is_plain())
    }

    /// Takes in what the simulation's present state, made up of these people, leaves unexplained.
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

/// Paints a silhouette into a packed image of so many words a row.
pub(super) fn paint(silhouette: &Silhouette, words_per_row: usize, image: &mut [u64]) {
    for (row, bits) in silhouette.rows() {
        let start = row * words_per_row + silhouette.word_range().start;
        for (word, bits) in image[start..].iter_mut().zip(bits) {
            *word |= bits;
        }
    }
}
