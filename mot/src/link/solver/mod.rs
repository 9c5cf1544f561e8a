//! Solvers for the tracks of least cost over a graph.
//!
//! * [`exact`] — the optimum, with its certificate; the default;
//! * [`greedy`] — Pirsiavash's two-pass dynamic programming;
//! * [`constrained`] — with the constraint on moving directions ([`direction`]).

pub mod constrained;
pub mod direction;
pub mod exact;
pub mod greedy;
mod labels;
mod tracks;
