//! Seeded rooms: a shell with doors, furniture that leaves ways between, cameras under the ceiling, lamps.

use calib::{Camera, Distortion, Intrinsics};
use glam::{Vec2, Vec3};
use nalgebra::Point2;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::furnish::{RoomKind, furnish};
use super::furniture::{Furniture, Screen, colourful, wood};
use super::light::{Lamps, bake, encode};
use super::shell::{self, Door, ShellMaterials};
use super::surface::{Surfaces, Tessellation};
use super::texture::{Material, Pattern};
use scenes::Result;
use scenes::geometry::{Geometry, point_from_vec3};
use scenes::raycast::RayScene;
use scenes::room::{Room, RoomCamera, Zone, ZoneKind};
use scenes::view::look_at;

/// Options of a room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomOptions {
    /// Seed of everything that is not fixed below.
    pub seed: u64,
    /// Office or hall.
    pub kind: RoomKind,
    /// Number of pieces of furniture that are tried; those that would block the ways are left out.
    pub furniture: usize,
    /// Number of doors, one to four.
    pub doors: usize,
    /// Number of cameras, in the corners first, then in the middle of the walls, then between; sixteen at most.
    pub cameras: usize,
    /// Width, depth and height; `None` for a size of the room's kind.
    pub size_m: Option<[f64; 3]>,
    /// Screens that hide people from the cameras on one side, besides the furniture.
    pub screens: Vec<Screen>,
    /// Width and height of the cameras' images.
    pub image_px: [u32; 2],
    /// Horizontal field of view of the cameras' pinhole twins.
    pub field_of_view_deg: f64,
    /// The cameras' lens distortion.
    pub distortion: Distortion,
}

impl Default for RoomOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            kind: RoomKind::Office,
            furniture: 9,
            doors: 2,
            cameras: 2,
            size_m: None,
            screens: Vec::new(),
            image_px: [320, 240],
            field_of_view_deg: 74.0,
            distortion: Distortion::NONE,
        }
    }
}

/// Edge of the triangles that light and vertex colours are kept on.
const CELL_M: f32 = 0.2;

/// A synthetic room with its ground truth.
pub struct SyntheticRoom {
    /// Cameras, zones and geometry, as [`Room::write`] writes them.
    pub room: Room,
    /// Width (x), depth (y) and height; one corner of the floor is the origin.
    pub size_m: [f64; 3],
    /// Furniture in the room.
    pub furniture: Vec<Furniture>,
    /// The doorways, one for each zone.
    pub(super) doors: Vec<Door>,
    pub(super) surfaces: Surfaces,
    pub(super) tessellation: Tessellation,
    /// Light at the vertices.
    pub(super) light: Vec<f32>,
    pub(super) lamps: Lamps,
    pub(super) scene: RayScene,
}

impl RoomOptions {
    /// Builds the room.
    ///
    /// # Errors
    /// [`scenes::Error::Geometry`] if the geometry could not be intersected.
    pub fn build(&self) -> Result<SyntheticRoom> {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let size = self.size(&mut rng);
        let doors = doors(self.doors.clamp(1, 4), size, &mut rng);
        let mut furniture = furnish(self.kind, self.furniture, size, &doors, &mut rng);
        furniture.extend(self.screens.iter().map(|screen| screen.furniture(self.seed)));
        let mut surfaces = Surfaces::default();
        shell::build(&mut surfaces, size, &doors, &shell_materials(self.kind, &mut rng));
        hang_pictures(&mut surfaces, size, &doors, &mut rng);
        for block in furniture.iter().flat_map(|piece| &piece.blocks) {
            surfaces.block(block);
        }
        let lamps = lamps(size);
        let mut tessellation = surfaces.tessellate(CELL_M);
        tessellation.mesh.colors = vec![[0; 3]; tessellation.mesh.vertices.len()];
        let geometry = Geometry::Mesh(std::mem::take(&mut tessellation.mesh));
        let scene = RayScene::new(&geometry)?;
        if let Geometry::Mesh(mesh) = geometry {
            tessellation.mesh = mesh;
        }
        let light = bake(&surfaces, &tessellation, &scene, &lamps);
        tessellation.mesh.colors = vertex_colors(&surfaces, &tessellation, &light);
        let zones = doors.iter().zip(["door A", "door B", "door C", "door D"]);
        let room = Room {
            cameras: self.place_cameras(size, &mut rng),
            zones: zones
                .map(|(door, name)| Zone { name: name.into(), polygon: door.zone(), kind: ZoneKind::Both })
                .collect(),
            geometry: Some(Geometry::Mesh(tessellation.mesh.clone())),
            ..Room::default()
        };
        let size_m = [size.x, size.y, size.z].map(f64::from);
        Ok(SyntheticRoom { room, size_m, furniture, doors, surfaces, tessellation, light, lamps, scene })
    }

    fn size(&self, rng: &mut Pcg64Mcg) -> Vec3 {
        if let Some(size_m) = self.size_m {
            return Vec3::from(size_m.map(|s| s as f32));
        }
        let mut about = |value: f32, by: f32| value + by * rng.random_range(-1.0..1.0);
        match self.kind {
            RoomKind::Office => Vec3::new(about(6.2, 0.6), about(5.2, 0.5), about(2.7, 0.15)),
            RoomKind::Hall => Vec3::new(about(18.0, 3.0), about(12.0, 2.0), about(5.0, 0.6)),
        }
    }

    fn place_cameras(&self, size: Vec3, rng: &mut Pcg64Mcg) -> Vec<RoomCamera> {
        /// Distance of the cameras from the walls.
        const INSET: f32 = 0.28;
        let intrinsics = Intrinsics {
            distortion: self.distortion,
            ..Intrinsics::from_horizontal_fov(self.image_px[0], self.image_px[1], self.field_of_view_deg)
        };
        let corners = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)];
        let middles = [(0.5, 0.0), (0.5, 1.0), (0.0, 0.5), (1.0, 0.5)];
        let long = [(0.25, 0.0), (0.75, 1.0), (0.75, 0.0), (0.25, 1.0)];
        let short = [(0.0, 0.25), (1.0, 0.75), (1.0, 0.25), (0.0, 0.75)];
        let places = [corners, middles, long, short].concat();
        let inner = size - Vec3::splat(2.0 * INSET);
        places
            .iter()
            .take(self.cameras)
            .enumerate()
            .map(|(i, (sx, sy))| {
                let mut jitter = |reach: f32| rng.random_range(-reach..reach);
                let below = 0.35 + 0.06 * (size.z - 2.7) + jitter(0.08).abs();
                let eye = Vec3::new(INSET + sx * inner.x, INSET + sy * inner.y, size.z - below);
                let target = Vec3::new(
                    size.x * (0.5 + jitter(0.06)),
                    size.y * (0.5 + jitter(0.06)),
                    0.75 + jitter(0.15),
                );
                RoomCamera {
                    name: format!("cam{i}"),
                    camera: Camera {
                        intrinsics: intrinsics.clone(),
                        camera_from_world: look_at(&point_from_vec3(eye), &point_from_vec3(target)),
                    },
                    reference: None,
                }
            })
            .collect()
    }
}

impl SyntheticRoom {
    /// Tells whether a point of the floor is in the room and outside all furniture.
    pub fn is_free(&self, p: &Point2<f64>) -> bool {
        (0.0..=self.size_m[0]).contains(&p.x)
            && (0.0..=self.size_m[1]).contains(&p.y)
            && !self.furniture.iter().any(|piece| piece.footprint.contains(p))
    }

    /// Tells whether a point of the floor is in the room, not in a corridor behind a door.
    pub fn is_inside(&self, p: &Point2<f64>) -> bool {
        (0.0..=self.size_m[0]).contains(&p.x) && (0.0..=self.size_m[1]).contains(&p.y)
    }

    pub(super) fn size(&self) -> Vec3 {
        Vec3::from(self.size_m.map(|s| s as f32))
    }
}

/// A door in each of some walls, away from the corners.
fn doors(count: usize, size: Vec3, rng: &mut Pcg64Mcg) -> Vec<Door> {
    let mut walls = [0, 1, 2, 3];
    walls.shuffle(rng);
    let mut chosen: Vec<usize> = walls.into_iter().take(count).collect();
    chosen.sort_unstable();
    chosen.into_iter().map(|wall| Door::new(wall, rng.random_range(0.3..0.7), size)).collect()
}

fn shell_materials(kind: RoomKind, rng: &mut Pcg64Mcg) -> ShellMaterials {
    let mut walls = [Pattern::Plaster, Pattern::Wallpaper, Pattern::Plaster, Pattern::Wallpaper];
    walls.shuffle(rng);
    let warm = rng.random_range(0.0..1.0_f32);
    let wall_base = Vec3::new(0.84, 0.82, 0.78).lerp(Vec3::new(0.74, 0.8, 0.82), warm);
    let walls = walls.map(|pattern| Material {
        base: wall_base,
        accent: Vec3::new(0.5, 0.44, 0.4).lerp(Vec3::new(0.36, 0.46, 0.5), warm),
        pattern,
        seed: rng.random(),
    });
    let floor = Material {
        base: if kind == RoomKind::Office { Vec3::new(0.74, 0.56, 0.38) } else { Vec3::new(0.6, 0.6, 0.58) },
        accent: Vec3::new(0.45, 0.42, 0.4),
        pattern: if kind == RoomKind::Office { Pattern::Boards } else { Pattern::Tiles },
        seed: rng.random(),
    };
    let ceiling = Material {
        base: Vec3::splat(0.88),
        accent: Vec3::splat(0.8),
        pattern: Pattern::Plaster,
        seed: rng.random(),
    };
    ShellMaterials { floor, ceiling, walls, frame: wood(rng) }
}

/// Pictures on the walls, off the doors: thin boxes, since walls have holes only for doors.
fn hang_pictures(surfaces: &mut Surfaces, size: Vec3, doors: &[Door], rng: &mut Pcg64Mcg) {
    for wall in 0..4 {
        let length = if wall % 2 == 0 { size.x } else { size.y };
        let count = (length / 2.2) as usize;
        for k in 0..count {
            let share = (k as f32 + rng.random_range(0.3..0.7)) / count as f32;
            let place = Door::new(wall, share, size);
            let half = Vec3::new(rng.random_range(0.22..0.5), 0.012, rng.random_range(0.2..0.4));
            if doors.iter().any(|d| d.wall == wall && d.middle.distance(place.middle) < 0.7 + half.x) {
                continue;
            }
            let center = place.middle + place.inwards * half.y;
            surfaces.block(&super::furniture::Block {
                center: center.extend(rng.random_range(1.45..1.75)),
                half,
                yaw: place.inwards.to_angle() + std::f32::consts::FRAC_PI_2,
                material: wood(rng),
                front: Some(colourful(Pattern::Poster, rng)),
            });
        }
    }
}

/// Lamps about 3 m apart, just below the ceiling.
fn lamps(size: Vec3) -> Lamps {
    let spacing = 1.2 * size.z;
    let (columns, rows) = ((size.x / spacing).round().max(1.0), (size.y / spacing).round().max(1.0));
    let mut places = Vec::new();
    for j in 0..rows as u32 {
        for i in 0..columns as u32 {
            let at = Vec2::new((i as f32 + 0.5) / columns, (j as f32 + 0.5) / rows) * size.truncate();
            places.push(at.extend(size.z - 0.03));
        }
    }
    Lamps { places, strength: 0.55 * size.z * size.z * 0.6 }
}

/// Colour of each vertex in the finished room: its surface's colours around it, lit.
fn vertex_colors(surfaces: &Surfaces, tessellation: &Tessellation, light: &[f32]) -> Vec<[u8; 3]> {
    let vertices = tessellation.mesh.vertices.iter().zip(&tessellation.quad_of_vertex).zip(light);
    vertices
        .map(|((vertex, quad), light)| {
            let quad = &surfaces.quads[*quad as usize];
            let (u, v) = (quad.u.normalize_or_zero(), quad.v.normalize_or_zero());
            let around = (0..16).map(|k| {
                let offset = u * ((k % 4) as f32 - 1.5) + v * ((k / 4) as f32 - 1.5);
                quad.color(*vertex + offset * (CELL_M / 4.0)).powf(2.2)
            });
            encode(around.sum::<Vec3>() / 16.0 * *light)
        })
        .collect()
}
