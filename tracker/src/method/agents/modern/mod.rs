//! The modern rule: each station keeps its own state of all people.
//!
//! A station keeps a Kalman filter for each person measured by itself or by others. It associates every measurement
//! itself, its own sightings and the reports of each packet, jointly per sender, by place and looks; it trusts no
//! sender's id. After a meeting the best permutation by looks decides which body carries which identity. No state is
//! fused between stations and nothing is fed back, so that a lost packet only means fewer measurements.
//!
//! One moment:
//! * [`measurement`] — validates received reports and predicts them to this station's time.
//! * [`association`], [`assignment`], [`person`], [`motion`] — data association and the filters.
//! * [`identity`], [`signature`] — identities after a meeting.
//! * [`contradiction`] — one person whom two stations measure at different distances.
//! * [`naming`], [`peer`] — one id for one person at all stations.
//! * [`existence`], [`nursery`] — births, deaths, and people who are occluded from all stations.

mod assignment;
mod association;
mod contradiction;
mod existence;
mod identity;
mod measurement;
mod motion;
mod naming;
mod nursery;
mod options;
mod peer;
mod people;
mod person;
mod signature;
mod station;
#[cfg(test)]
mod tests;

pub use options::ModernOptions;
pub use station::Modern;
