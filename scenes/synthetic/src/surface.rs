//! Flat textured surfaces, and the mesh of small triangles that they become.

use glam::{Quat, Vec2, Vec3};

use super::furniture::Block;
use super::texture::{Material, Pattern};
use scenes::geometry::Mesh;

/// A rectangle with a material. Its visible side is the one from which `u`, `v` turn counter-clockwise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quad {
    pub origin: Vec3,
    /// Edges, metres.
    pub u: Vec3,
    pub v: Vec3,
    pub material: Material,
}

impl Quad {
    pub(super) fn normal(&self) -> Vec3 {
        self.u.cross(self.v).normalize_or_zero()
    }

    /// Colour at a point of the rectangle. A poster fills the rectangle, all other patterns have their natural size.
    pub(super) fn color(&self, point: Vec3) -> Vec3 {
        let place = self.place(point);
        match self.material.pattern {
            Pattern::Poster => self.material.color(place / Vec2::new(self.u.length(), self.v.length())),
            _ => self.material.color(place),
        }
    }

    /// Coordinates of a point on the rectangle, metres along its edges.
    fn place(&self, point: Vec3) -> Vec2 {
        let offset = point - self.origin;
        Vec2::new(offset.dot(self.u.normalize_or_zero()), offset.dot(self.v.normalize_or_zero()))
    }
}

/// All surfaces of a room.
#[derive(Debug, Clone, Default)]
pub(super) struct Surfaces {
    pub quads: Vec<Quad>,
}

/// Surfaces cut into triangles: light and colours are kept at the vertices.
#[derive(Debug, Clone, Default)]
pub(super) struct Tessellation {
    /// The mesh, at first without colours.
    pub mesh: Mesh,
    /// Surface that each triangle is a part of.
    pub quad_of_triangle: Vec<u32>,
    /// Surface that each vertex is a part of.
    pub quad_of_vertex: Vec<u32>,
}

impl Surfaces {
    pub(super) fn quad(&mut self, origin: Vec3, u: Vec3, v: Vec3, material: Material) {
        self.quads.push(Quad { origin, u, v, material });
    }

    /// The six sides of a box, seen from outside. The front is at −y of its own frame.
    pub(super) fn block(&mut self, block: &Block) {
        let turn = Quat::from_rotation_z(block.yaw);
        let (x, y, z) =
            (turn * Vec3::X * block.half.x, turn * Vec3::Y * block.half.y, Vec3::Z * block.half.z);
        let front = block.front.unwrap_or(block.material);
        let c = block.center;
        let sides = [
            (-x - y - z, x, z, front),
            (x - y - z, y, z, block.material),
            (x + y - z, -x, z, block.material),
            (-x + y - z, -y, z, block.material),
            (-x - y + z, x, y, block.material),
            (-x + y - z, x, -y, block.material),
        ];
        for (corner, u, v, material) in sides {
            self.quad(c + corner, 2.0 * u, 2.0 * v, material);
        }
    }

    /// Cuts every surface into triangles with edges no longer than `cell_m`.
    pub(super) fn tessellate(&self, cell_m: f32) -> Tessellation {
        let mut t = Tessellation::default();
        for (index, quad) in (0_u32..).zip(&self.quads) {
            let columns = (quad.u.length() / cell_m).ceil().max(1.0) as u32;
            let rows = (quad.v.length() / cell_m).ceil().max(1.0) as u32;
            let first = t.mesh.vertices.len() as u32;
            for (row, column) in (0..=rows).flat_map(|r| (0..=columns).map(move |c| (r, c))) {
                let (s, r) = (column as f32 / columns as f32, row as f32 / rows as f32);
                t.mesh.vertices.push(quad.origin + quad.u * s + quad.v * r);
                t.quad_of_vertex.push(index);
            }
            for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
                let at = |dr: u32, dc: u32| first + (row + dr) * (columns + 1) + column + dc;
                t.mesh.triangles.push([at(0, 0), at(0, 1), at(1, 1)]);
                t.mesh.triangles.push([at(0, 0), at(1, 1), at(1, 0)]);
                t.quad_of_triangle.extend([index; 2]);
            }
        }
        t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn material() -> Material {
        Material { base: Vec3::ONE, accent: Vec3::ZERO, pattern: Pattern::Plaster, seed: 1 }
    }

    #[test]
    fn a_box_is_closed_and_faces_outwards() {
        let mut surfaces = Surfaces::default();
        let (center, half) = (Vec3::new(1.0, 2.0, 0.5), Vec3::new(0.4, 0.3, 0.5));
        surfaces.block(&Block { center, half, yaw: 0.4, material: material(), front: None });
        let mesh = surfaces.tessellate(0.2).mesh;
        // The divergence theorem: the signed volume of a closed surface is that of the box.
        let (mut volume, mut area) = (0.0, 0.0);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.vertices[i as usize] - center);
            volume += a.dot(b.cross(c)) / 6.0;
            area += 0.5 * (b - a).cross(c - a).length();
        }
        assert_relative_eq!(volume, 8.0 * half.x * half.y * half.z, max_relative = 1e-4);
        let expected = 8.0 * (half.x * half.y + half.y * half.z + half.z * half.x);
        assert_relative_eq!(area, expected, max_relative = 1e-4);
    }

    #[test]
    fn places_on_a_surface_are_metres() {
        let quad = Quad { origin: Vec3::X, u: Vec3::Y * 3.0, v: Vec3::Z * 2.0, material: material() };
        assert_eq!(quad.place(Vec3::new(1.0, 1.5, 0.25)), Vec2::new(1.5, 0.25));
        assert_eq!(quad.normal(), Vec3::X);
    }
}
