//! Distributed vision agents: stations that follow everybody together, with no server (seed 000).
//!
//! A *station* is one camera with its computer. Its image tracking finds people in its own mask, in metres on the
//! floor ([`Sighting`]s). A *rule* turns these, and what the station hears from others, into *agents* with target ids;
//! agents of several stations with one target id are an *agency*. Only [`Packet`]s pass between stations, one a moment
//! and station; nobody fuses anything for others, and nothing fused is fed back.
//!
//! * [`ImageTracking`] — from one camera's masks to [`Sighting`]s, with [`Looks`]: representative colours.
//! * [`Packet`] — what a station tells the others at one moment.
//! * [`Rule`] — from sightings and packets to agents, by one of two rules.
//! * [`modern`] — the rule that is used unless another is asked for.
//! * [`published`] — the paper's rule.
//! * [`FieldOfView`] — which station should see whom; [`StageView`] by the room.
//! * [`AgentStation`] — one station: all of these together.
//! * [`Agents`] — all stations of a site in one process.
//! * [`SoloStation`] — one station in a process of its own.
//! * [`Overview`] — who tracks whom now, for a terminal.
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
