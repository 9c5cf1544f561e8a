//! Distributed vision agents: stations that track all people together, without a server. After A. Nakazawa, S. Hiura,
//! H. Kato, S. Inokuchi, "Tracking Multiple Persons Using Distributed Vision Systems", IPSJ Journal, 2001.
//!
//! A *station* is one camera with its computer. Its image tracking measures people in its own mask, in metres on the
//! floor ([`Sighting`]s). A *rule* turns these sightings and the packets of other stations into *agents* with target
//! ids; the agents of several stations with one target id are an *agency*. Stations exchange only [`Packet`]s, one per
//! station and moment. No station fuses estimates for another, and no fused estimate is fed back.
//!
//! * [`ImageTracking`] — from one camera's masks to [`Sighting`]s, with [`Looks`]: representative colours.
//! * [`Packet`] — message of a station to the others at one moment.
//! * [`Rule`] — from sightings and packets to agents; there are two rules.
//! * [`modern`] — the default rule.
//! * [`published`] — the paper's rule.
//! * [`FieldOfView`] — visible fraction of a person for each station; [`StageView`] computes it from the room.
//! * [`AgentStation`] — one station: all of these together.
//! * [`Agents`] — all stations of a site in one process.
//! * [`SoloStation`] — one station in a process of its own.
//! * [`Overview`] — current agents and targets of all stations, for a terminal.
//! * [`AgencyRecord`] — figures of agents and agencies over time.
//! * [`simulate`] — simulated stations and people, to compare rules.

mod field_of_view;
mod figures;
mod image_tracking;
mod looks;
pub mod modern;
mod options;
mod overview;
mod packet;
pub mod published;
mod rule;
mod sighting;
pub mod simulate;
mod solo;
mod station;
mod system;
#[cfg(test)]
mod test_views;
#[cfg(test)]
mod together_tests;

pub use field_of_view::StageView;
pub use figures::AgencyRecord;
pub use image_tracking::ImageTracking;
pub use looks::{Colour, Looks};
pub use options::{AgentsOptions, RuleOptions};
pub use overview::Overview;
pub use packet::{AgentId, MediatorMessage, Packet, Report, StationId, TargetId};
pub use rule::{Belief, FieldOfView, Followed, Restart, Rule, Step};
pub use sighting::{Sighting, Sightings};
pub use solo::SoloStation;
pub use station::AgentStation;
pub use system::Agents;
