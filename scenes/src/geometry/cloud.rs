//! Conversion of bare points, as of a laser scan or a sparse model, to oriented discs.

use glam::Vec3;

use super::{Disc, normals, spacing};

/// One disc a point, facing the nearest of the viewpoints, its radius from the distance to its neighbours. The points
/// must be finite, metres; `colors` has one entry a point.
pub(crate) fn discs(points: &[Vec3], colors: &[[u8; 3]], viewpoints: &[Vec3]) -> Vec<Disc> {
    let faces = normals::estimate(points, viewpoints).into_iter().zip(spacing::radii(points));
    std::iter::zip(points, colors)
        .zip(faces)
        .map(|((&center, &color), (normal, radius))| Disc {
            center,
            normal,
            radius,
            color,
            filled: false,
            confidence: 1.0,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_faces_the_camera_and_has_no_holes() {
        let points: Vec<Vec3> =
            (0..100).map(|i| Vec3::new(0.1 * (i % 10) as f32, 0.1 * (i / 10) as f32, 0.0)).collect();
        let colors: Vec<[u8; 3]> = (0..100).map(|i| [i, 2 * i, 7]).collect();
        let discs = discs(&points, &colors, &[Vec3::new(0.5, 0.5, 2.0)]);
        assert_eq!(discs.iter().map(|d| d.center).collect::<Vec<_>>(), points);
        assert_eq!(discs.iter().map(|d| d.color).collect::<Vec<_>>(), colors);
        assert!(discs.iter().all(|d| d.normal.z > 0.999 && !d.filled && (0.05..0.2).contains(&d.radius)));
    }
}
