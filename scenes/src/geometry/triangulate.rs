//! Triangulation of polygonal faces by ear clipping in the face's own plane (concave faces included).

use glam::{Vec2, Vec3};

/// Largest number of corners that are clipped, since that is cubic in the worst case; larger faces count as convex.
const MOST_CORNERS_TO_CUT: usize = 512;

/// Appends the triangles of one face. Indices must be in range; fewer than three corners yield nothing.
pub(super) fn face(corners: &[u32], vertices: &[Vec3], triangles: &mut Vec<[u32; 3]>) {
    if let &[a, b, c] = corners {
        triangles.push([a, b, c]);
        return;
    }
    let mut left = corners.to_vec();
    if left.len() <= MOST_CORNERS_TO_CUT {
        let flat = FacePlane::of(&left, vertices);
        while left.len() > 3 {
            let Some(ear) = (0..left.len()).find(|&i| flat.is_ear(&left, vertices, i)) else { break };
            let n = left.len();
            triangles.push([left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]]);
            left.remove(ear);
        }
    }
    // Three corners are left, or the face is degenerate or too large to cut: a fan.
    for i in 1..left.len().saturating_sub(1) {
        triangles.push([left[0], left[i], left[i + 1]]);
    }
}

/// Axes of the plane of a face, in which its corners run counter-clockwise.
struct FacePlane {
    x: Vec3,
    y: Vec3,
}

impl FacePlane {
    fn of(corners: &[u32], vertices: &[Vec3]) -> Self {
        // Newell: the sum of the corner triangles' normals is the face's, concave or not.
        let origin = vertices[corners[0] as usize];
        let normal: Vec3 = corners
            .windows(2)
            .map(|w| (vertices[w[0] as usize] - origin).cross(vertices[w[1] as usize] - origin))
            .sum();
        let (x, y) = normal.try_normalize().unwrap_or(Vec3::Z).any_orthonormal_pair();
        Self { x, y }
    }

    fn place(&self, vertices: &[Vec3], corner: u32) -> Vec2 {
        let p = vertices[corner as usize];
        Vec2::new(p.dot(self.x), p.dot(self.y))
    }

    /// Tells whether corner `i` is convex and no other corner lies in its triangle.
    fn is_ear(&self, left: &[u32], vertices: &[Vec3], i: usize) -> bool {
        let n = left.len();
        let ids = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        let [a, b, c] = ids.map(|id| self.place(vertices, id));
        let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
        side(a, b, c) > 0.0
            && left.iter().filter(|id| !ids.contains(id)).all(|&id| {
                let p = self.place(vertices, id);
                !(side(a, b, p) >= 0.0 && side(b, c, p) >= 0.0 && side(c, a, p) >= 0.0)
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(triangles: &[[u32; 3]], vertices: &[Vec3]) -> f32 {
        let corner = |i: u32| vertices[i as usize];
        triangles
            .iter()
            .map(|&[a, b, c]| 0.5 * (corner(b) - corner(a)).cross(corner(c) - corner(a)).length())
            .sum()
    }

    #[test]
    fn a_concave_face_keeps_its_area() {
        // An L in a tilted plane: a fan from its first corner would cover the notch.
        let l = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        let vertices: Vec<Vec3> = l.iter().map(|&(x, y)| Vec3::new(x, 0.6 * y, 0.8 * y)).collect();
        for reversed in [false, true] {
            for start in 0..6 {
                let mut corners: Vec<u32> = (0..6).map(|i| (i + start) % 6).collect();
                if reversed {
                    corners.reverse();
                }
                let mut triangles = Vec::new();
                face(&corners, &vertices, &mut triangles);
                assert_eq!(triangles.len(), 4);
                assert!((area(&triangles, &vertices) - 3.0).abs() < 1e-5, "{corners:?}: {triangles:?}");
            }
        }
    }

    #[test]
    fn degenerate_faces_end() {
        let vertices = vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::X * 3.0];
        let mut triangles = Vec::new();
        face(&[0, 1, 2, 3], &vertices, &mut triangles);
        assert_eq!(triangles.len(), 2);
        face(&[0, 1], &vertices, &mut triangles);
        assert_eq!(triangles.len(), 2);
    }
}
