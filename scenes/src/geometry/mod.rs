//! What stands in a room: triangles, or discs around oriented points. World coordinates, metres.

use glam::Vec3;

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
    /// Unit normal, towards the side it was seen from.
    pub normal: Vec3,
    /// Radius, metres.
    pub radius: f32,
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Not measured: filled in from a plane of the room that stereo could not see.
    pub filled: bool,
}
