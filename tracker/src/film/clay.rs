//! Clay rendering of the room: its static depth, lit from beside the camera.
//!
//! The simulated panel shows the geometry that predicts occlusion, and nothing of the real picture, so an error in the
//! panel is an error of the room model.

use nalgebra::Vector3;

use crate::prepared_room::PreparedCamera;

/// Colour of pixels without geometry.
pub(super) const VOID: [u8; 3] = [38, 42, 50];
/// Colour of clay, fully lit.
const CLAY: [f64; 3] = [232.0, 225.0, 214.0];
/// Radius over which the slope is estimated, pixels: reconstructed depth is noisy.
const REACH_PX: usize = 3;
/// Largest relative difference of depth on one surface.
const SAME_SURFACE: f64 = 0.04;
/// Least number of neighbours on the same surface; a pixel with fewer takes the slope of the surface around it.
const LEAST_NEIGHBOURS: usize = 8;
/// Distance at which the clay has half faded into the void, metres.
const HAZE_M: f64 = 14.0;

/// Rendered picture, for each pinhole pixel, row by row.
pub(super) fn render(camera: &PreparedCamera) -> Vec<[u8; 3]> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let to_normal = camera.pinhole.intrinsics.matrix().transpose();
    let light = Vector3::new(0.35, -0.55, -1.0).normalize();
    let mut around = Vec::with_capacity((2 * REACH_PX + 1).pow(2));
    let mut picture = Vec::with_capacity(width * height);
    for v in 0..height {
        for u in 0..width {
            let Some(here) = inverse_depth(camera, u, v) else {
                picture.push(VOID);
                continue;
            };
            around.clear();
            for y in v.saturating_sub(REACH_PX)..(v + REACH_PX + 1).min(height) {
                for x in u.saturating_sub(REACH_PX)..(u + REACH_PX + 1).min(width) {
                    let offset = [x as f64 - u as f64, y as f64 - v as f64];
                    around.extend(inverse_depth(camera, x, y).map(|inverse| (offset, inverse)));
                }
            }
            let pixel = Vector3::new(u as f64, v as f64, 1.0);
            let normal = slope(&mut around, here).and_then(|[a, b, middle]| {
                // On a plane n · X = 1 the inverse depth is (K⁻ᵀ n) · (u, v, 1).
                let plane = Vector3::new(a, b, middle - a * pixel.x - b * pixel.y);
                (to_normal * plane).try_normalize(1e-12)
            });
            let lit = normal.map_or(0.6, |n| 0.30 + 0.70 * n.dot(&light).abs());
            let clear = HAZE_M / (HAZE_M + 1.0 / here);
            let mix = |i: usize| CLAY[i] * lit * clear + f64::from(VOID[i]) * (1.0 - clear);
            picture.push([0, 1, 2].map(|i| mix(i).clamp(0.0, 255.0) as u8));
        }
    }
    picture
}

fn inverse_depth(camera: &PreparedCamera, u: usize, v: usize) -> Option<f64> {
    let z = camera.static_z_m.get(v * camera.width() as usize + u).filter(|z| z.is_finite() && **z > 0.0)?;
    Some(1.0 / f64::from(*z))
}

/// Slope of the central surface's inverse depth along u and v, and its value in the middle, from offsets with inverse
/// depths: least squares, each axis by itself. `None` where they lie on a line.
fn slope(around: &mut [([f64; 2], f64)], here: f64) -> Option<[f64; 3]> {
    let is_same = |of: f64, inverse: f64| (inverse / of - 1.0).abs() < SAME_SURFACE;
    let mut middle = here;
    if around.iter().filter(|(_, inverse)| is_same(here, *inverse)).count() < LEAST_NEIGHBOURS {
        let half = around.len() / 2;
        middle = around.select_nth_unstable_by(half, |a, b| a.1.total_cmp(&b.1)).1.1;
    }
    let (mut count, mut sum, mut sums, mut squares, mut products) = (0.0, 0.0, [0.0; 2], [0.0; 2], [0.0; 2]);
    for (offset, inverse) in around.iter().filter(|(_, inverse)| is_same(middle, *inverse)) {
        count += 1.0;
        sum += inverse;
        for axis in 0..2 {
            sums[axis] += offset[axis];
            squares[axis] += offset[axis] * offset[axis];
            products[axis] += offset[axis] * inverse;
        }
    }
    let [a, b] = [0, 1].map(|axis| {
        let spread = squares[axis] - sums[axis] * sums[axis] / count;
        (products[axis] - sums[axis] * sum / count) / spread
    });
    let value = (sum - a * sums[0] - b * sums[1]) / count;
    (a.is_finite() && b.is_finite()).then_some([a, b, value])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_noisy_plane_is_its_own_beside_another_and_under_an_outlier() {
        let mut noise = 1_u32;
        let mut around = Vec::new();
        for (x, y) in (-3..=3).flat_map(|y| (-3..=3).map(move |x| (f64::from(x), f64::from(y)))) {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let grain = 1e-5 * (f64::from(noise >> 16) / 32768.0 - 1.0);
            // A nearer surface covers the two rows at the top.
            let inverse = if y < -1.0 { 0.9 } else { 0.5 + 0.002 * x - 0.001 * y + grain };
            around.push(([x, y], inverse));
        }
        for here in [0.5, 7.0] {
            let [a, b, middle] = slope(&mut around, here).unwrap();
            assert!((a - 0.002).abs() < 2e-5 && (b + 0.001).abs() < 2e-5, "{a} {b}");
            assert!((middle - 0.5).abs() < 2e-5, "{middle}");
        }
        assert!(slope(&mut [([0.0, 0.0], 0.5)], 0.5).is_none());
    }
}
