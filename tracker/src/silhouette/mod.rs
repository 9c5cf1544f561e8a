//! Predicted silhouette of a person in a camera: the image of an upright ellipsoid that stands on the floor, without
//! the parts that the room hides (section 3.1 and figure 5 of T. Osawa, X. Wu, K. Sudo, K. Wakabayashi and T. Yasuno,
//! "MCMC based multiple people tracking using 3D environmental information", in Japanese, conference paper LI-007).
//!
//! * [`Body`] — the ellipsoid: position, radius, height. [`Shape`] — others around the same axis.
//! * [`View`] — a prepared camera: rays of its pinhole pixels and the static depth along them.
//! * [`Silhouette`] — the pixels of one body in one view that the static room leaves visible, packed 64 to a word.
//! * [`contour`] — the outline as points in space, and the box around the whole body, for films and files.
//! * [`visibility`] — visible fraction of each body before the room *and* the other bodies.
//!
//! The image of an ellipsoid in a pinhole camera is exact here, not a polygon: its outline is a conic ([`ImageConic`]),
//! its rows are spans between the roots of a quadratic, and its depth at a pixel solves the ray–quadric equation.

mod body;
mod conic;
pub mod contour;
mod depth;
mod packed;
mod shape;
mod view;
pub mod visibility;

pub use body::Body;
pub use conic::{ImageConic, ImageOutline};
pub use packed::Silhouette;
pub use shape::{Ellipsoid, Shape};
pub use view::View;
