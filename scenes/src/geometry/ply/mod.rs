//! PLY files in and out: faces make a [`Mesh`](super::Mesh), points with normals make [`Disc`](super::Disc)s.
//!
//! Vertex properties: `x y z`, `nx ny nz` (needed without faces), `red green blue` (0 to 255 or 65535, or 0.0 to 1.0 as
//! float),
//! `radius` in metres (estimated from the points' spacing when absent), `filled` (1: not measured, see
//! [`Disc::filled`](super::Disc::filled)) and `confidence` ([`Disc::confidence`](super::Disc::confidence); 1 when
//! absent). Any number type is accepted. Other properties are skipped, other elements with a warning; elements that may
//! hold the surface in another form than `face` and `tristrips` are refused.

mod header;
mod read;
mod row;
mod strips;
mod write;

pub use read::read;
pub(crate) use read::scan;
pub(crate) use write::encode;
pub use write::write;
