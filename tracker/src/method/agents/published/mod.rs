//! The published rule (Nakazawa, Hiura, Kato & Inokuchi, 分散視覚エージェントを用いた複数人物追跡システム, IPSJ Journal 2001;
//! seed 000): seeing agents that know how confident they are, and one mediator a station.
//!
//! * [`agent`] — a seeing agent: one person, followed by one station.
//! * [`confidence`] — equations (1) and (2): events in the image, other agents, memory.
//! * [`colour_memory`] — frequencies of each target's colours.
//! * [`mod@reference`] — what other stations' agents see.
//! * [`mediator`] — agents that track alone find agencies (figure 6); agents for targets known elsewhere.
//! * [`station`] — [`Published`]: one moment of a station.
//!
//! Beyond the paper: an agent that image tracking has found takes the place of the one that the mediator would create;
//! a target of its own for somebody whom nobody else knows; the end of the lone one of two agents on one person.

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
