//! Likelihood of the cameras' masks for a state: `L(S) = E(S) · R(S) · V(S)`, in logarithms.
//!
//! T. Osawa, X. Wu, K. Sudo, K. Wakabayashi and T. Yasuno, "MCMC based multiple people tracking using 3D environmental
//! information" (in Japanese, conference paper LI-007), equations 5 to 8.
//!
//! * [`prior`] — E(S), people stand on walkable floor; R(S), people do not interpenetrate.
//! * [`Counts`] and [`LikelihoodRule`] — V(S): the pixel counts of the masks, and the rules that turn them into a likelihood.
//! * [`Layers`] — the silhouettes that are counted: one or more shapes of each body, in each camera.
//! * [`Simulation`] — the counts of a changing state, updated from the changed pixels alone.
//! * [`oracle`] — the same counts by one ray through every pixel: slow, and simple. Tests compare the two.

mod cover;
mod layers;
pub mod oracle;
pub mod prior;
#[cfg(test)]
mod property;
#[cfg(test)]
mod random_body;
mod rule;
mod simulation;
mod summed_area;

pub use layers::Layers;
pub use rule::{Counts, LikelihoodRule, PreparedLikelihood};
pub use simulation::{Simulation, pack};
pub use summed_area::SummedArea;
