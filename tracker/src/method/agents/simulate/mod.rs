//! Simulated stations and people: experiment 2 of A. Nakazawa, S. Hiura, H. Kato, S. Inokuchi, "Tracking Multiple
//! Persons Using Distributed Vision Systems", IPSJ Journal, 2001, section 4.2, and larger experiments.
//!
//! * [`Options`], [`Layout`] — options of a simulation; the published experiment and a harder one.
//! * [`Site`] — stations with their views, and walls; a [`super::FieldOfView`].
//! * [`World`] — one trial's people.
//! * [`ImageTracking`] — sightings of one station, with all errors.
//! * [`run_trial`], [`Judge`] — a trial of any [`super::Rule`], and its evaluation: people kept, lost and confused.
//! * [`run_centralised`] — the paper's centralised variant.
//! * [`compare`] — many trials of all three systems; [`text`] and [`draw`] show the results.

mod centralised;
mod experiment;
mod figure;
mod image_tracking;
mod judge;
mod layout;
mod options;
mod site;
mod table;
#[cfg(test)]
mod tests;
mod trial;
mod world;

pub use centralised::{CentralisedOptions, run_centralised};
pub use experiment::{Comparison, Row, Speed, SweepRow, Tally, Trace, compare};
pub use figure::draw;
pub use image_tracking::{Crossing, ImageTracking, hue_difference_deg};
pub use judge::{Fates, Judge};
pub use options::{Layout, Noise, Options};
pub use site::{SimulatedStation, Site, Wall};
pub use table::text;
pub use trial::{Moment, run_trial};
pub use world::{CLOSE_M, World};
