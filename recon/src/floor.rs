//! The floor, as [`scenes::floor`] finds it, with errors of this crate.

use nalgebra::Isometry3;

use crate::plumb::Plumb;
use crate::{Error, Result};

pub use scenes::floor::{FloorOptions, FloorReport, Plane, SurfacePoint, metric, world_frame};

/// Finds the floor among `points`, as [`scenes::floor::find`].
///
/// # Errors
/// [`Error::Room`] when no plane can be a floor, naming the problem of the best.
pub fn find(
    points: &[SurfacePoint],
    cameras: &[Isometry3<f64>],
    plumb: &[Plumb],
    options: &FloorOptions,
) -> Result<(Plane, FloorReport)> {
    scenes::floor::find(points, cameras, plumb, options).map_err(Error::Room)
}
