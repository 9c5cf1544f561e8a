//! Ways to find the tracks of least cost over a graph.
//!
//! * [`exact`] — the optimum, with its proof; what is used unless something else is asked for;
//! * [`greedy`] — Pirsiavash's two-pass dynamic programming;
//! * [`constrained`] — with the constraint on moving directions ([`direction`]).

pub mod constrained;
pub mod direction;
pub mod exact;
pub mod greedy;
mod labels;
mod tracks;
