//! Any geometry as triangles, for programs that show meshes: discs become hexagons.

use super::{Geometry, Mesh};

/// Corners of the polygon that stands for a disc.
const CORNERS: u32 = 6;

impl Geometry {
    /// The surfaces as a mesh: a mesh as it is, each disc as a hexagon of its area that faces the way it does.
    pub fn to_mesh(&self) -> Mesh {
        let discs = match self {
            Self::Mesh(mesh) => return mesh.clone(),
            Self::Discs(discs) => discs,
        };
        // A regular hexagon's area is 3√3/2 of its radius squared.
        let radius_ratio = (std::f32::consts::PI / (1.5 * 3.0_f32.sqrt())).sqrt();
        let mut mesh = Mesh::default();
        for (disc, number) in discs.iter().zip(0_u32..) {
            let (x, y) = disc.normal.any_orthonormal_pair();
            let corner = |i: u32| {
                let (sin, cos) = (std::f32::consts::TAU * i as f32 / CORNERS as f32).sin_cos();
                disc.center + radius_ratio * disc.radius * (x * cos + y * sin)
            };
            mesh.vertices.extend((0..CORNERS).map(corner));
            mesh.colors.extend([disc.color; CORNERS as usize]);
            let first = number * CORNERS;
            mesh.triangles.extend((1..CORNERS - 1).map(|i| [first, first + i, first + i + 1]));
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Disc;
    use glam::Vec3;

    #[test]
    fn discs_become_hexagons_of_their_area_and_side() {
        let disc = Disc {
            center: Vec3::new(1.0, 2.0, 3.0),
            normal: Vec3::new(0.6, 0.0, 0.8),
            radius: 0.5,
            color: [1, 2, 3],
            filled: false,
            confidence: 1.0,
        };
        let mesh = Geometry::Discs(vec![disc, Disc { normal: -Vec3::Z, ..disc }]).to_mesh();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len(), mesh.colors[11]), (12, 8, [1, 2, 3]));
        for (disc_normal, triangles) in
            [(disc.normal, &mesh.triangles[..4]), (-Vec3::Z, &mesh.triangles[4..])]
        {
            let crosses = triangles.iter().map(|t| {
                let [a, b, c] = mesh.corners(*t);
                0.5 * (b - a).cross(c - a)
            });
            let sum: Vec3 = crosses.sum();
            let expected = std::f32::consts::PI * 0.25 * disc_normal;
            assert!(sum.distance(expected) < 1e-4, "{sum} {expected}");
        }
    }
}
