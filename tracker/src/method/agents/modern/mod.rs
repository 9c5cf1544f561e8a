//! The modern rule: each station keeps its own state of everybody.
//!
//! A station keeps a Kalman filter of each person whom it sees or hears of. It assigns every measurement itself, its own
//! sightings and the reports of each packet, jointly per sender, by place and looks; it trusts no sender's label. After
//! people have met, the looks decide by the best permutation which body carries which identity. No state is fused
//! between stations and nothing is fed back, so that a lost packet only thins out what a station knows.
//!
//! One moment:
//! * [`measurement`] — checks what is heard and brings it to this station's time.
//! * [`association`], [`assignment`], [`person`], [`motion`] — which measurement is of whom; the filters.
//! * [`identity`], [`signature`] — who is who after a meeting.
//! * [`contradiction`] — one person whom two stations see at different distances.
//! * [`naming`], [`peer`] — one id for one person at all stations.
//! * [`existence`], [`nursery`] — newcomers, people who have gone, and people whom nobody can see.

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
