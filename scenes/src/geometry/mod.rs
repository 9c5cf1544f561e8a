//! Geometry of a room: triangles, or discs around oriented points. World coordinates, metres.

mod defect;
pub mod files;
pub mod gltf;
mod las;
mod meshed;
mod normals;
mod obj;
pub mod ply;
pub(crate) mod sample;
pub mod scan;
pub(crate) mod scan_vertex;
mod shape_hash;
mod spacing;
mod texture;
mod thinning;
mod triangulate;

use glam::Vec3;
use nalgebra::{Isometry3, Point3, Vector3};

/// A room's static geometry.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// A triangle mesh.
    Mesh(Mesh),
    /// Oriented points, rendered as discs.
    Discs(Vec<Disc>),
}

/// A triangle mesh with a colour a vertex.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertices, metres.
    pub vertices: Vec<Vec3>,
    /// Corners of each triangle, as indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
    /// Red, green, blue of each vertex.
    pub colors: Vec<[u8; 3]>,
}

/// A flat disc: an oriented point with the radius it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Centre, metres.
    pub center: Vec3,
    /// Unit normal, towards the side from which it was seen.
    pub normal: Vec3,
    /// Radius, metres.
    pub radius: f32,
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Whether the disc was not measured, but filled in from a plane of the room that stereo could not see.
    pub filled: bool,
    /// Confidence: number of further views that measured the same surface there, on average over the disc; 0 for discs
    /// that were filled in.
    pub confidence: f32,
}

impl Geometry {
    /// Number of triangles or discs.
    pub fn len(&self) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.triangles.len(),
            Self::Discs(discs) => discs.len(),
        }
    }

    /// Tells whether there is nothing that a ray could hit.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Smallest and largest corner of the axis-aligned box around all vertices or disc centres, metres; `None` without
    /// any.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let grow = |b: Option<(Vec3, Vec3)>, p: Vec3| {
            Some(b.map_or((p, p), |(low, high)| (low.min(p), high.max(p))))
        };
        match self {
            Self::Mesh(mesh) => mesh.vertices.iter().copied().fold(None, grow),
            Self::Discs(discs) => discs.iter().map(|d| d.center).fold(None, grow),
        }
    }

    /// Moves and turns all surfaces.
    pub fn transform(&mut self, b_from_a: &Isometry3<f64>) {
        let moved = |place: Vec3| vec3_from_point(&(b_from_a * point_from_vec3(place)));
        match self {
            Self::Mesh(mesh) => mesh.vertices.iter_mut().for_each(|vertex| *vertex = moved(*vertex)),
            Self::Discs(discs) => {
                for disc in discs {
                    disc.center = moved(disc.center);
                    disc.normal = vec3_from_vector(&(b_from_a * vector_from_vec3(disc.normal))).normalize();
                }
            }
        }
    }

    /// First defect for which this geometry is unusable: the place in it, and the problem.
    ///
    /// Numbers that are not finite, indices out of range, normals that are not of unit length, radii that are not
    /// positive.
    pub fn defect(&self) -> Option<(String, String)> {
        match self {
            Self::Mesh(mesh) => defect::of_mesh(mesh),
            Self::Discs(discs) => defect::of_discs(discs),
        }
    }
}

impl Mesh {
    /// The three corners of a triangle, metres.
    pub fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|i| self.vertices[i as usize])
    }
}

/// Converts a point of the estimating crates' `f64` to the `f32` of rendering.
pub fn vec3_from_point(p: &Point3<f64>) -> Vec3 {
    vec3_from_vector(&p.coords)
}

/// Converts a direction of the estimating crates' `f64` to the `f32` of rendering.
pub fn vec3_from_vector(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}

/// Converts a point of rendering to the `f64` of estimation.
pub fn point_from_vec3(v: Vec3) -> Point3<f64> {
    vector_from_vec3(v).into()
}

/// Converts a direction of rendering to the `f64` of estimation.
pub fn vector_from_vec3(v: Vec3) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}
