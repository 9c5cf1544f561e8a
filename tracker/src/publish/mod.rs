//! Results of a run, published while it runs.
//!
//! * [`mqtt`] — people, events and counts to a broker.
//! * [`metrics`] — figures of the run for Prometheus.

pub mod metrics;
pub mod mqtt;
