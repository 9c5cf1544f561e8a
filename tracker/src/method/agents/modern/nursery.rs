//! Sightings that belong to nobody yet.

use super::measurement::Measurement;
use super::signature::MeanLook;

/// Time after which an image track that is no longer seen is forgotten, seconds.
const FORGOTTEN_S: f64 = 0.5;

/// An image track that nobody's state takes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Newcomer {
    /// Its last measurement.
    pub(super) measurement: Measurement,
    /// Time for which it has been there apart from others, seconds.
    pub(super) lasting_s: f64,
    /// Its looks.
    pub(super) looks: MeanLook,
    missed_s: f64,
}

/// Image tracks that nobody's state takes.
#[derive(Debug, Clone, Default)]
pub(super) struct Nursery {
    pub(super) list: Vec<Newcomer>,
}

impl Nursery {
    /// Lets `dt` seconds pass.
    pub(super) fn wait(&mut self, dt: f64) {
        for newcomer in &mut self.list {
            newcomer.missed_s += dt;
        }
        self.list.retain(|n| n.missed_s <= FORGOTTEN_S);
    }

    /// A sighting that nobody takes; `is_apart`: it is surely not of somebody known. People who come in together are
    /// crowded all the time: they take longer.
    pub(super) fn add(&mut self, measurement: &Measurement, is_apart: bool, dt: f64) {
        /// Share of the time that counts where other people are near.
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

    /// Forgets a track that somebody's state takes.
    pub(super) fn remove(&mut self, track: u32) {
        self.list.retain(|n| n.measurement.track != track);
    }
}
