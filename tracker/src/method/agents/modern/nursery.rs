//! Tentative tracks: image tracks that are not associated with a person yet.

use super::measurement::Measurement;
use super::signature::MeanLook;

/// Time without a sighting after which a tentative track is deleted, seconds.
const FORGOTTEN_S: f64 = 0.5;

/// Tentative track of one image track.
#[derive(Debug, Clone, Copy)]
pub(super) struct Newcomer {
    /// Last measurement.
    pub(super) measurement: Measurement,
    /// Time for which it has been measured apart from all people, seconds.
    pub(super) lasting_s: f64,
    /// Mean looks.
    pub(super) looks: MeanLook,
    /// Time since the last measurement, seconds.
    missed_s: f64,
}

/// Tentative tracks of one station.
#[derive(Debug, Clone, Default)]
pub(super) struct Nursery {
    pub(super) list: Vec<Newcomer>,
}

impl Nursery {
    /// Advances the time by `dt` seconds and deletes tracks that were missed for too long.
    pub(super) fn advance(&mut self, dt: f64) {
        for newcomer in &mut self.list {
            newcomer.missed_s += dt;
        }
        self.list.retain(|n| n.missed_s <= FORGOTTEN_S);
    }

    /// Adds an unassociated sighting, `dt` seconds after the last frame; `is_apart`: it is certainly of no tracked
    /// person. People who enter together are crowded all the time and take longer to confirm.
    pub(super) fn add(&mut self, measurement: &Measurement, is_apart: bool, dt: f64) {
        /// Fraction of the time that counts while other people are near.
        const CROWDED: f64 = 1.0 / 3.0;
        let index =
            self.list.iter().position(|n| n.measurement.track == measurement.track).unwrap_or_else(|| {
                let looks = MeanLook::none();
                self.list.push(Newcomer { measurement: *measurement, lasting_s: 0.0, looks, missed_s: 0.0 });
                self.list.len() - 1
            });
        let newcomer = &mut self.list[index];
        newcomer.measurement = *measurement;
        newcomer.missed_s = 0.0;
        if is_apart {
            newcomer.lasting_s += if measurement.is_crowded { CROWDED * dt } else { dt };
            if let (Some(signature), false) = (&measurement.signature, measurement.is_crowded) {
                newcomer.looks.add(signature, 1.0);
            }
        }
    }

    /// Removes the tentative track of an image track that is associated with a person.
    pub(super) fn remove(&mut self, track: u32) {
        self.list.retain(|n| n.measurement.track != track);
    }
}
