//! A furnished room and the depth along a ray in it: every surface in turn, in f64. The tracker gets its triangles or
//! discs.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::{Point3, Rotation3, Vector3};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use scenes::geometry::{Disc, Geometry, Mesh, point_from_vec3, vec3_from_point, vector_from_vec3};

/// Uncertainty of a surface's position, metres. The tracker intersects in f32, with an error of about a micrometre.
const SURFACE_M: f64 = 1e-5;

/// Furniture and walls.
pub(super) struct FurnishedRoom {
    surfaces: Vec<RoomSurface>,
}

enum RoomSurface {
    /// A box rotated around the vertical.
    Cuboid {
        center: Point3<f64>,
        half: Vector3<f64>,
        turn: Rotation3<f64>,
    },
    Disc(Disc),
}

/// Interval of the depth of something along a camera's z, metres.
#[derive(Clone, Copy)]
pub(super) struct DepthRange {
    pub(super) from_m: f64,
    pub(super) to_m: f64,
}

impl DepthRange {
    pub(super) const NEVER: Self = Self { from_m: f64::INFINITY, to_m: f64::INFINITY };

    /// The nearer of two depths.
    pub(super) fn first(self, other: Self) -> Self {
        Self { from_m: self.from_m.min(other.from_m), to_m: self.to_m.min(other.to_m) }
    }

    /// Interval between the depths of the same surface moved a little nearer and a little farther; a miss is never met.
    fn between(a: Option<f64>, b: Option<f64>) -> Self {
        let (a, b) = (a.unwrap_or(f64::INFINITY), b.unwrap_or(f64::INFINITY));
        Self { from_m: a.min(b), to_m: a.max(b) }
    }
}

impl FurnishedRoom {
    /// Random furniture as triangles, often with walls around it, or as discs spread over it.
    pub(super) fn random(rng: &mut Pcg64Mcg) -> Self {
        let mut cuboids: Vec<_> = (0..rng.random_range(0..6)).map(|_| furniture(rng)).collect();
        if rng.random() {
            let surfaces =
                cuboids.iter().flat_map(|cuboid| discs_over(cuboid, rng)).map(RoomSurface::Disc).collect();
            return Self { surfaces };
        }
        if rng.random() {
            cuboids.push(cuboid(Point3::new(3.0, 2.5, 1.55), Vector3::new(3.7, 3.2, 1.65), 0.0));
        }
        Self { surfaces: cuboids }
    }

    /// Whether the room is of discs or of triangles; `None` for an empty room.
    pub(super) fn is_of_discs(&self) -> Option<bool> {
        self.surfaces.first().map(|surface| matches!(surface, RoomSurface::Disc(_)))
    }

    /// Geometry as in a room directory; `None` for an empty room.
    pub(super) fn geometry(&self) -> Option<Geometry> {
        let discs: Vec<Disc> = self
            .surfaces
            .iter()
            .filter_map(|s| if let RoomSurface::Disc(d) = s { Some(*d) } else { None })
            .collect();
        if !discs.is_empty() {
            return Some(Geometry::Discs(discs));
        }
        let mut mesh = Mesh::default();
        for surface in &self.surfaces {
            let RoomSurface::Cuboid { center, half, turn } = surface else { continue };
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend((0..8).map(|i| {
                let side = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
                let corner = half.component_mul(&Vector3::new(side(0), side(1), side(2)));
                vec3_from_point(&(center + turn * corner))
            }));
            // Corner i is on the far side of axis k when its bit k is set.
            for (a, b, c) in [(1, 2, 4), (2, 4, 1), (4, 1, 2)] {
                for side in [0, c] {
                    mesh.triangles.push([side, side + a, side + b].map(|i| first + i));
                    mesh.triangles.push([side + a, side + b, side + a + b].map(|i| first + i));
                }
            }
        }
        mesh.colors = vec![[0; 3]; mesh.vertices.len()];
        (!mesh.triangles.is_empty()).then_some(Geometry::Mesh(mesh))
    }

    /// Depth at which a ray (of length 1 along the camera's z) first meets a surface.
    pub(super) fn depth(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> DepthRange {
        self.surfaces.iter().map(|s| s.depth(eye, ray)).fold(DepthRange::NEVER, DepthRange::first)
    }
}

/// Depth of the floor, z = 0.
pub(super) fn floor_depth(eye: &Point3<f64>, ray: &Vector3<f64>) -> DepthRange {
    if ray.z >= 0.0 {
        return DepthRange::NEVER;
    }
    DepthRange::between(Some((eye.z - SURFACE_M) / -ray.z), Some((eye.z + SURFACE_M) / -ray.z))
}

impl RoomSurface {
    fn depth(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> DepthRange {
        match self {
            Self::Cuboid { center, half, turn } => {
                let (from, along) = (turn.inverse() * (eye - center), turn.inverse() * ray);
                let met = |growth: f64| through_cuboid(&from, &along, &half.add_scalar(growth));
                DepthRange::between(met(SURFACE_M), met(-SURFACE_M))
            }
            Self::Disc(disc) => {
                let (center, normal) = (point_from_vec3(disc.center), vector_from_vec3(disc.normal));
                let slant = normal.dot(ray);
                let t = normal.dot(&(center - eye)) / slant;
                let from_rim_m = f64::from(disc.radius) - (eye + ray * t - center).norm();
                // The intersection with a moved plane shifts, the more the plane is slanted.
                let moved = SURFACE_M / slant.abs();
                let (moved_m, from_m, to_m) = (moved * ray.norm(), t - moved, t + moved);
                match () {
                    () if to_m <= 0.0 || from_rim_m < -moved_m => DepthRange::NEVER,
                    () if from_m > 0.0 && from_rim_m > moved_m => DepthRange { from_m, to_m },
                    () => DepthRange { from_m, to_m: f64::INFINITY },
                }
            }
        }
    }
}

/// Intersection of a ray with a cuboid around the origin, from inside or outside, by its three pairs of planes.
fn through_cuboid(from: &Vector3<f64>, along: &Vector3<f64>, half: &Vector3<f64>) -> Option<f64> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (a, b) = ((-half[axis] - from[axis]) / along[axis], (half[axis] - from[axis]) / along[axis]);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (enter <= leave && leave > 0.0).then_some(if enter > 0.0 { enter } else { leave })
}

fn cuboid(center: Point3<f64>, half: Vector3<f64>, turn: f64) -> RoomSurface {
    RoomSurface::Cuboid { center, half, turn: Rotation3::from_axis_angle(&Vector3::z_axis(), turn) }
}

/// A random cupboard, pillar or screen on the floor, or a board above it.
fn furniture(rng: &mut Pcg64Mcg) -> RoomSurface {
    let mut within = |range: Range<f64>| rng.random_range(range);
    let half = Vector3::new(within(0.05..0.8), within(0.05..0.5), within(0.03..1.1));
    let above_floor = if within(0.0..1.0) < 0.3 { within(0.0..1.2) } else { 0.0 };
    let center = Point3::new(within(0.0..6.0), within(0.0..5.0), half.z + above_floor);
    cuboid(center, half, within(0.0..TAU))
}

/// Discs like those of a reconstruction: overlapping in places, with gaps in others, none exactly coplanar with
/// another.
fn discs_over(surface: &RoomSurface, rng: &mut Pcg64Mcg) -> Vec<Disc> {
    let RoomSurface::Cuboid { center, half, turn } = surface else { return Vec::new() };
    let mut one = || {
        let (axis, sign) = (rng.random_range(0..3), if rng.random() { 1.0 } else { -1.0 });
        let mut place = half.map(|h| rng.random_range(-h..h));
        place[axis] = sign * half[axis];
        let normal =
            Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)) * sign + rng.random_range(-0.1..0.1));
        Disc {
            center: vec3_from_point(&(center + turn * place)),
            normal: vec3_from_point(&(turn * normal).into()).normalize(),
            radius: rng.random_range(0.05..0.4),
            color: [0; 3],
            filled: false,
            confidence: 1.0,
        }
    };
    (0..12).map(|_| one()).collect()
}
