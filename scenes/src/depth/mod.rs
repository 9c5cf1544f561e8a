//! Depth maps of the empty room as seen by a fixed camera: metres along its z axis, a number a pixel.
//!
//! The room's cameras do not move, so each map is computed once and [`cached`] beside the room.

mod cache;
pub mod png;
#[cfg(test)]
mod tests;

use calib::Camera;
use nalgebra::Point2;
use rayon::prelude::*;

use crate::geometry::{vec3_from_point, vec3_from_vector};
use crate::raycast::RayScene;

pub use cache::{cached, cached_all};

/// Distance to the room along a camera's z axis, for each of its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Metres along the camera's z, row by row; 0.0 where nothing is hit.
    pub z_m: Vec<f32>,
}

/// Depth of a surface, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceDepth {
    /// Metres along the camera's z.
    pub z_m: f64,
    /// Standard deviation, metres: that of reconstructed surfaces, and at the edges of things the half of the step, since
    /// a picture's edge and the map's are some pixels apart.
    pub sigma_m: f64,
}

/// Standard deviation of a reconstructed surface's depth, as a share of it.
const RELATIVE_SIGMA: f64 = 0.012;
/// Distance within which a depth step makes a pixel's depth uncertain, pixels.
const AROUND_PX: u32 = 2;

impl DepthMap {
    /// Depth map of a room without geometry.
    pub fn nothing(width: u32, height: u32) -> Self {
        Self { width, height, z_m: vec![0.0; width as usize * height as usize] }
    }

    /// Depth at column `u`, row `v`, metres; 0.0 where nothing is hit, and outside the image.
    pub fn at(&self, u: u32, v: u32) -> f32 {
        if u < self.width && v < self.height {
            self.z_m[v as usize * self.width as usize + u as usize]
        } else {
            0.0
        }
    }

    /// Depth of the surface behind a pixel of the map; `None` where nothing is hit, and outside the image.
    pub fn surface_at(&self, pixel: &Point2<f64>) -> Option<SurfaceDepth> {
        let (u, v) = (pixel.x.round(), pixel.y.round());
        if !(u >= 0.0 && v >= 0.0 && u < f64::from(self.width) && v < f64::from(self.height)) {
            return None;
        }
        let (u, v) = (u as u32, v as u32);
        let z = Some(self.at(u, v)).filter(|z| *z > 0.0)?;
        let (mut nearest, mut farthest) = (z, z);
        for row in v.saturating_sub(AROUND_PX)..=v + AROUND_PX {
            for column in u.saturating_sub(AROUND_PX)..=u + AROUND_PX {
                let near = self.at(column, row);
                if near > 0.0 {
                    (nearest, farthest) = (nearest.min(near), farthest.max(near));
                }
            }
        }
        let (z_m, spread_m) = (f64::from(z), f64::from(farthest - nearest));
        Some(SurfaceDepth { z_m, sigma_m: (RELATIVE_SIGMA * z_m).hypot(0.5 * spread_m) })
    }

    /// Fraction of pixels that see a surface.
    pub fn coverage(&self) -> f64 {
        self.z_m.iter().filter(|z| **z > 0.0).count() as f64 / self.z_m.len().max(1) as f64
    }
}

/// Renders the depth of a scene in a camera, its distortion included, one ray through the centre of each pixel.
///
/// For simulation pass the [pinhole](calib::Intrinsics::pinhole) twin. Rows run in parallel; the result does not depend
/// on the number of threads. Pixels to which the lens gives no ray are empty.
pub fn render(scene: &RayScene, camera: &Camera) -> DepthMap {
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let mut map = DepthMap::nothing(width, height);
    let origin = vec3_from_point(&camera.center());
    let world_from_camera = camera.camera_from_world.rotation.inverse();
    map.z_m.par_chunks_mut(width.max(1) as usize).enumerate().for_each(|(v, row)| {
        for (u, z) in row.iter_mut().enumerate() {
            // The direction has z = 1 in the camera, so the distance is metres along the camera's z.
            *z = camera
                .intrinsics
                .unproject(&Point2::new(u as f64, v as f64))
                .and_then(|direction| scene.cast(origin, vec3_from_vector(&(world_from_camera * direction))))
                .map_or(0.0, |hit| hit.distance);
        }
    });
    map
}
