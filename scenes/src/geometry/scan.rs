//! Geometry as other programs' files have it, and its way into the room: placed in the room's world, thinned, with normals
//! and radii that the file does not state.

use glam::{DVec3, Vec3};
use nalgebra::{Point3, Similarity3};

use super::scan_vertex::ScanVertex;
use super::thinning::VoxelGrid;
use super::{Disc, Geometry, Mesh, normals, spacing, triangulate};

/// Defect of a file: the place and the problem.
pub(crate) type Defect = (String, String);

/// Greatest coordinate, metres: beyond it neighbouring numbers of single precision are more than a millimetre apart.
const FARTHEST_M: f64 = 10_000.0;

/// Number of points above which clouds are thinned unless the user says another.
pub const MOST_POINTS: usize = 2_000_000;

/// Vertices and faces of a file, in the file's world.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scan {
    pub(crate) vertices: Vec<ScanVertex>,
    /// Faces of three or more corners.
    pub(crate) polygons: Vec<Vec<u32>>,
    /// Further faces, whose corners are in range.
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) has_normals: bool,
    pub(crate) has_radii: bool,
    /// Brightest level of the colours: 1, 255 or 65535.
    pub(crate) full_level: f32,
}

impl Default for Scan {
    fn default() -> Self {
        Self {
            vertices: Vec::new(),
            polygons: Vec::new(),
            triangles: Vec::new(),
            has_normals: false,
            has_radii: false,
            full_level: 255.0,
        }
    }
}

/// Options of a scan's way into the room.
#[derive(Debug, Clone)]
pub struct Placing<'a> {
    /// Way from the file's world to the room's.
    pub room_from_scan: Similarity3<f64>,
    /// Centres of the cameras, in the room, which estimated normals are turned to.
    pub viewpoints: &'a [Vec3],
    /// Number of points above which a cloud is thinned.
    pub most_points: usize,
}

impl Default for Placing<'_> {
    /// A scan that is in the room's world already, as it is.
    fn default() -> Self {
        Self { room_from_scan: Similarity3::identity(), viewpoints: &[], most_points: usize::MAX }
    }
}

impl Placing<'_> {
    /// Place of a vertex in the room.
    pub(crate) fn place(&self, vertex: &mut ScanVertex) {
        vertex.position = (self.room_from_scan * Point3::from(vertex.position)).into();
        let turned =
            self.room_from_scan.isometry.rotation * nalgebra::Vector3::from(vertex.normal.map(f64::from));
        vertex.normal = [turned.x as f32, turned.y as f32, turned.z as f32];
        vertex.radius *= self.room_from_scan.scaling() as f32;
    }

    /// Defect of a placed vertex that lies too far from the origin.
    pub(crate) fn far_defect(&self, number: usize, vertex: &ScanVertex) -> Option<Defect> {
        let place = DVec3::from(vertex.position);
        // A number too large for single precision is none; the checks of the geometry name it.
        if !place.as_vec3().is_finite() || place.abs().max_element() <= FARTHEST_M {
            return None;
        }
        let nearby = (place / 1000.0).floor() * 1000.0;
        let so_far = self.room_from_scan.isometry.translation.vector;
        let problem = format!(
            "lies at ({:.0}, {:.0}, {:.0}), more than 10 km from the origin, where a millimetre is lost: move geometry \
             and cameras to the origin, as with `scenes import … --shift={},{},0`",
            place.x,
            place.y,
            place.z,
            so_far.x.round() - nearby.x,
            so_far.y.round() - nearby.y
        );
        Some((format!("vertex {number}"), problem))
    }
}

impl Scan {
    /// Tells whether the scan is a bare cloud.
    pub(crate) fn is_cloud(&self) -> bool {
        self.polygons.is_empty() && self.triangles.is_empty()
    }

    /// The scan as a room's geometry, in the room's world.
    ///
    /// # Errors
    /// The first defect for which it is unusable.
    pub(crate) fn into_geometry(mut self, placing: &Placing<'_>) -> Result<Geometry, Defect> {
        for (i, vertex) in self.vertices.iter_mut().enumerate() {
            placing.place(vertex);
            if let Some(defect) = placing.far_defect(i, vertex) {
                return Err(defect);
            }
        }
        self.placed_geometry(placing)
    }

    /// [`Self::into_geometry`] of a scan whose vertices are placed already.
    pub(crate) fn placed_geometry(mut self, placing: &Placing<'_>) -> Result<Geometry, Defect> {
        let geometry = if self.is_cloud() {
            self.thin(placing.most_points);
            if !self.has_normals {
                self.face(placing.viewpoints)?;
            }
            Geometry::Discs(self.discs()?)
        } else {
            Geometry::Mesh(self.mesh()?)
        };
        if geometry.is_empty() {
            let problem = "there are no points; leave `geometry` out of scene.toml if the room is empty";
            return Err(("element vertex".into(), problem.into()));
        }
        geometry.defect().map_or(Ok(geometry), Err)
    }

    /// Thins a cloud of more points than `most`: one point a voxel.
    fn thin(&mut self, most: usize) {
        let before = self.vertices.len();
        if before <= most {
            return;
        }
        let mut grid = VoxelGrid::new(most);
        self.vertices.iter().for_each(|vertex| grid.add(vertex));
        self.take_thinned(grid, before as u64);
    }

    /// Takes the vertices of a thinned cloud, and tells of it.
    pub(crate) fn take_thinned(&mut self, grid: VoxelGrid, before: u64) {
        let side_m = grid.side_m();
        self.vertices = grid.into_vertices();
        // Their spacing is another one now.
        self.has_radii = false;
        tracing::warn!(
            "the cloud's {before} points were thinned to {}, one in a cube of {:.1} mm (--most-points: another number)",
            self.vertices.len(),
            1000.0 * side_m
        );
    }

    fn color(&self, vertex: &ScanVertex) -> [u8; 3] {
        // Conversions saturate: levels beyond the range are black or white.
        vertex.color.map(|level| match self.full_level {
            full if full <= 1.0 => (255.0 * level) as u8,
            full if full <= 255.0 => level as u8,
            full => (255.0 / full * level).round() as u8,
        })
    }

    /// Estimates the normals of a bare cloud.
    fn face(&mut self, viewpoints: &[Vec3]) -> Result<(), Defect> {
        let centers: Vec<Vec3> = self.vertices.iter().map(position).collect();
        if let Some(i) = centers.iter().position(|center| !center.is_finite()) {
            return Err(not_finite(i));
        }
        for (vertex, normal) in self.vertices.iter_mut().zip(normals::estimate(&centers, viewpoints)) {
            vertex.normal = normal.to_array();
        }
        Ok(())
    }

    fn discs(&self) -> Result<Vec<Disc>, Defect> {
        let mut discs = Vec::with_capacity(self.vertices.len());
        for (i, vertex) in self.vertices.iter().enumerate() {
            let (center, normal) = (position(vertex), Vec3::from(vertex.normal));
            if !(center.is_finite() && normal.is_finite()) {
                return Err(not_finite(i));
            }
            // `Geometry::defect` reports zero normals.
            let normal = normal.try_normalize().unwrap_or(Vec3::ZERO);
            // A confidence that is not finite counts as 0: no computation depends on it, so the file is not refused.
            let confidence = if vertex.confidence.is_finite() { vertex.confidence } else { 0.0 };
            let ScanVertex { radius, filled, .. } = *vertex;
            discs.push(Disc { center, normal, radius, color: self.color(vertex), filled, confidence });
        }
        if !self.has_radii {
            let centers: Vec<Vec3> = discs.iter().map(|d| d.center).collect();
            for (disc, radius) in discs.iter_mut().zip(spacing::radii(&centers)) {
                disc.radius = radius;
            }
        }
        Ok(discs)
    }

    fn mesh(&self) -> Result<Mesh, Defect> {
        let mut mesh = Mesh {
            vertices: self.vertices.iter().map(position).collect(),
            triangles: Vec::with_capacity(self.polygons.len() + self.triangles.len()),
            colors: self.vertices.iter().map(|vertex| self.color(vertex)).collect(),
        };
        let count = self.vertices.len();
        for (i, corners) in self.polygons.iter().enumerate() {
            let place = || format!("face {i}");
            if corners.len() < 3 {
                return Err((place(), format!("has {} corners; a face needs 3", corners.len())));
            }
            if let Some(&index) = corners.iter().find(|&&index| index as usize >= count) {
                let named =
                    if index == u32::MAX { "a negative index".into() } else { format!("vertex {index}") };
                return Err((place(), format!("names {named}, but there are {count} (counted from 0)")));
            }
            triangulate::face(corners, &mesh.vertices, &mut mesh.triangles);
        }
        mesh.triangles.extend_from_slice(&self.triangles);
        Ok(mesh)
    }
}

fn position(vertex: &ScanVertex) -> Vec3 {
    DVec3::from(vertex.position).as_vec3()
}

fn not_finite(vertex: usize) -> Defect {
    (format!("vertex {vertex}"), "a number is not finite; remove the point".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A floor of a thousand points, a centimetre apart, without normals.
    fn floor() -> Scan {
        let vertex = |i: u32| ScanVertex {
            position: [0.01 * f64::from(i % 40), 0.01 * f64::from(i / 40), 0.0],
            color: [f32::from(i as u16 % 7), 100.0, 65_535.0],
            ..ScanVertex::default()
        };
        Scan { vertices: (0..1000).map(vertex).collect(), full_level: 65_535.0, ..Scan::default() }
    }

    #[test]
    fn a_cloud_is_placed_thinned_and_faces_the_cameras() {
        // Millimetres, Y up.
        let turn = crate::exchange::placement::upright(Vector3::y()).unwrap();
        let room_from_scan = Similarity3::from_parts(Vector3::new(5.0, 0.0, 1.0).into(), turn, 1e-3);
        let mut scan = floor();
        for vertex in &mut scan.vertices {
            let [x, y, z] = vertex.position;
            vertex.position = [1000.0 * x, 1000.0 * z, -1000.0 * y];
        }
        let viewpoints = [Vec3::new(5.2, 0.1, 3.0)];
        let placing = Placing { room_from_scan, viewpoints: &viewpoints, most_points: 300 };
        let Geometry::Discs(discs) = scan.into_geometry(&placing).unwrap() else { panic!("a cloud") };
        assert!((75..=300).contains(&discs.len()), "{}", discs.len());
        let (low, high) = Geometry::Discs(discs.clone()).bounds().unwrap();
        assert!(low.distance(Vec3::new(5.0, 0.0, 1.0)) < 0.02, "{low}");
        assert!(high.distance(Vec3::new(5.39, 0.24, 1.0)) < 0.03, "{high}");
        for disc in &discs {
            assert!(disc.normal.z > 0.999 && disc.color[0] == 0 && disc.color[2] == 255, "{disc:?}");
            // 100 of 65535.
            assert_eq!(disc.color[1], 0);
            assert!((0.01..0.05).contains(&disc.radius), "{disc:?}");
        }
    }

    #[test]
    fn levels_of_any_depth_are_the_same_colour() {
        let of = |full_level: f32, level: f32| {
            let scan = Scan { full_level, ..Scan::default() };
            scan.color(&ScanVertex { color: [level; 3], ..ScanVertex::default() })[0]
        };
        for level in 0..=255_u8 {
            let value = f32::from(level);
            assert_eq!(of(255.0, value), level);
            assert_eq!(of(65_535.0, 257.0 * value), level);
        }
        assert_eq!((of(1.0, 1.0), of(1.0, 0.5), of(1.0, -1.0)), (255, 127, 0));
    }
}
