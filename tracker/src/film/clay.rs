//! The room as if made of clay: its static depth, lit from beside the camera.
//!
//! The simulated panel shows the geometry that predicts occlusion, and nothing of the real picture: what looks
//! wrong here is wrong in the room model.

use nalgebra::{Point2, Vector3};

use crate::stage::StageCamera;

/// Where nothing is known to be.
pub(super) const VOID: [u8; 3] = [38, 42, 50];
/// Clay, fully lit.
const CLAY: [f64; 3] = [232.0, 225.0, 214.0];
/// Neighbours this many pixels away give the slope: near enough for legs of tables, far enough for noisy depth.
const REACH_PX: usize = 2;
/// Distance at which the clay has half faded into the void, metres.
const HAZE_M: f64 = 14.0;

/// The picture, per pinhole pixel, row by row.
pub(super) fn render(camera: &StageCamera) -> Vec<[u8; 3]> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let k = &camera.pinhole.intrinsics;
    let point = |u: usize, v: usize| {
        let z = camera.static_z_m.get(v * width + u).copied().filter(|z| z.is_finite() && *z > 0.0)?;
        Some(k.unproject(&Point2::new(u as f64, v as f64))? * f64::from(z))
    };
    let light = Vector3::new(0.35, -0.55, -1.0).normalize();
    let shade = |u: usize, v: usize| {
        let here = point(u, v)?;
        let across = slope(
            here,
            u.checked_sub(REACH_PX).and_then(|u| point(u, v)),
            in_range(u, width).and_then(|u| point(u, v)),
        );
        let down = slope(
            here,
            v.checked_sub(REACH_PX).and_then(|v| point(u, v)),
            in_range(v, height).and_then(|v| point(u, v)),
        );
        let normal = down.zip(across).and_then(|(d, a)| a.cross(&d).try_normalize(1e-12));
        let lit = normal.map_or(0.6, |n| 0.30 + 0.70 * n.dot(&light).abs());
        let clear = HAZE_M / (HAZE_M + here.z);
        let mix = |i: usize| CLAY[i] * lit * clear + f64::from(VOID[i]) * (1.0 - clear);
        Some([0, 1, 2].map(|i| mix(i).clamp(0.0, 255.0) as u8))
    };
    (0..height)
        .flat_map(|v| (0..width).map(move |u| (u, v)))
        .map(|(u, v)| shade(u, v).unwrap_or(VOID))
        .collect()
}

fn in_range(at: usize, end: usize) -> Option<usize> {
    Some(at + REACH_PX).filter(|at| *at < end)
}

/// The step to the neighbour on the same surface: of the two, the one whose depth differs less.
fn slope(
    here: Vector3<f64>,
    before: Option<Vector3<f64>>,
    after: Option<Vector3<f64>>,
) -> Option<Vector3<f64>> {
    match (before.map(|p| here - p), after.map(|p| p - here)) {
        (Some(a), Some(b)) if a.z.abs() < b.z.abs() => Some(a),
        (a, b) => b.or(a),
    }
}
