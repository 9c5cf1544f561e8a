//! Results of a run, published while it runs.
//!
//! * [`mqtt`] — people, events and counts to a broker.

pub mod mqtt;
