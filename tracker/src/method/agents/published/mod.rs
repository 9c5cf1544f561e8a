//! The published rule: seeing agents with a confidence each, and one mediator per station. After A. Nakazawa, S. Hiura,
//! H. Kato, S. Inokuchi, "Tracking Multiple Persons Using Distributed Vision Systems"
//! (分散視覚エージェントを用いた複数人物追跡システム), IPSJ Journal, 2001.
//!
//! * [`agent`] — a seeing agent: one person tracked by one station.
//! * [`confidence`] — equations (1) and (2): events in the image, other agents, memory.
//! * [`colour_memory`] — frequencies of each target's colours.
//! * [`mod@reference`] — current measurements by other stations' agents.
//! * [`mediator`] — agencies for lone agents (figure 6), and agents for targets that other stations track.
//! * [`station`] — [`Published`]: one moment of a station.
//!
//! Beyond the paper: a lone agent that already tracks the person replaces the agent that the mediator would create; a
//! lone agent that no other station confirms gets a target of its own; of two agents on one person the lone one ends.

mod agent;
mod colour_memory;
mod confidence;
mod mediator;
mod options;
mod reference;
mod station;
#[cfg(test)]
mod tests;

pub use options::PublishedOptions;
pub use station::Published;
