//! A room's shell: floor, ceiling, walls with doorways, and the end of a corridor behind each doorway.

use glam::{Vec2, Vec3};
use nalgebra::Point2;

use super::furniture::Block;
use super::surface::Surfaces;
use super::texture::Material;
use scenes::polygon::Polygon;

/// A doorway in a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Door {
    /// 0: y = 0, 1: x = width, 2: y = depth, 3: x = 0.
    pub(super) wall: usize,
    /// Middle of the doorway on the floor, on the wall's inner side.
    pub(super) middle: Vec2,
    /// Direction into the room.
    pub(super) inwards: Vec2,
}

/// Width of a doorway.
pub(super) const DOOR_WIDTH_M: f32 = 1.0;
/// Height of a doorway.
const DOOR_HEIGHT_M: f32 = 2.08;
/// Depth of the corridor behind a doorway.
pub(super) const CORRIDOR_M: f32 = 1.7;
/// Excess of the corridor's width over its doorway, on either side.
const CORRIDOR_RIM_M: f32 = 0.35;
/// Depth of a door's zone in the room.
const ZONE_M: f32 = 0.8;

/// Materials of the parts of a shell.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShellMaterials {
    pub floor: Material,
    pub ceiling: Material,
    pub walls: [Material; 4],
    pub frame: Material,
}

impl Door {
    /// A door in the middle `share` (0 to 1) of a wall of a room of that size.
    pub(super) fn new(wall: usize, share: f32, size: Vec3) -> Self {
        let (start, along, inwards) = wall_frame(wall, size);
        Self { wall, middle: start + along * share, inwards }
    }

    fn sideways(&self) -> Vec2 {
        self.inwards.perp()
    }

    /// A rectangle on the floor around the door: from `behind` metres before the wall to `ahead` metres into the room.
    fn rectangle(&self, half_width: f32, behind: f32, ahead: f32) -> Polygon {
        let corner = |along: f32, across: f32| {
            let p = self.middle + self.inwards * along + self.sideways() * across;
            Point2::new(f64::from(p.x), f64::from(p.y))
        };
        Polygon(vec![
            corner(-behind, -half_width),
            corner(ahead, -half_width),
            corner(ahead, half_width),
            corner(-behind, half_width),
        ])
    }

    /// Floor where people appear and disappear.
    pub(super) fn zone(&self) -> Polygon {
        self.rectangle(0.5 * DOOR_WIDTH_M, 0.0, ZONE_M)
    }

    /// Floor of the doorway and the corridor behind it that a person's middle can be on, `clearance` off its walls.
    pub(super) fn passage(&self, clearance: f32) -> Polygon {
        self.rectangle(0.5 * DOOR_WIDTH_M - clearance, CORRIDOR_M - clearance, clearance + 0.05)
    }

    /// Floor of the corridor behind the door, doorway included.
    pub(super) fn corridor(&self) -> Polygon {
        self.rectangle(0.5 * DOOR_WIDTH_M + CORRIDOR_RIM_M, CORRIDOR_M, 0.0)
    }

    /// Floor that furniture must leave free.
    pub(super) fn kept_free(&self) -> Polygon {
        self.rectangle(0.5 * DOOR_WIDTH_M + 0.15, 0.0, 1.3)
    }

    /// Place in the corridor from which people come, out of sight or nearly so.
    pub(super) fn outside(&self) -> Point2<f64> {
        let p = self.middle - self.inwards * (CORRIDOR_M - 0.5);
        Point2::new(f64::from(p.x), f64::from(p.y))
    }
}

/// Beginning of a wall (as seen from the room, on its right), its edge along the floor, and the direction into the
/// room.
///
/// Along the edge, the room is on the left.
fn wall_frame(wall: usize, size: Vec3) -> (Vec2, Vec2, Vec2) {
    let (w, d) = (size.x, size.y);
    match wall % 4 {
        0 => (Vec2::ZERO, Vec2::X * w, Vec2::Y),
        1 => (Vec2::new(w, 0.0), Vec2::Y * d, Vec2::NEG_X),
        2 => (Vec2::new(w, d), Vec2::NEG_X * w, Vec2::NEG_Y),
        _ => (Vec2::new(0.0, d), Vec2::NEG_Y * d, Vec2::X),
    }
}

/// Adds the shell of a room to its surfaces.
pub(super) fn build(surfaces: &mut Surfaces, size: Vec3, doors: &[Door], materials: &ShellMaterials) {
    surfaces.quad(Vec3::ZERO, Vec3::X * size.x, Vec3::Y * size.y, materials.floor);
    surfaces.quad(Vec3::Z * size.z, Vec3::Y * size.y, Vec3::X * size.x, materials.ceiling);
    for (wall, material) in (0..4).zip(&materials.walls) {
        let (start, along, _) = wall_frame(wall, size);
        let (length, direction) = (along.length(), along.normalize());
        let mut panel = |from: f32, to: f32, bottom: f32, top: f32| {
            // Seen from the room, "up × along" faces it when u runs backwards.
            let origin = (start + direction * from).extend(bottom);
            let (u, v) = ((direction * (to - from)).extend(0.0), Vec3::Z * (top - bottom));
            surfaces.quad(origin + u, -u, v, *material);
        };
        let mut openings: Vec<f32> = doors
            .iter()
            .filter(|door| door.wall == wall)
            .map(|door| (door.middle - start).dot(direction))
            .collect();
        openings.sort_unstable_by(f32::total_cmp);
        let mut from = 0.0;
        for middle in openings {
            let (left, right) = (middle - 0.5 * DOOR_WIDTH_M, middle + 0.5 * DOOR_WIDTH_M);
            panel(from, left, 0.0, size.z);
            panel(left, right, DOOR_HEIGHT_M, size.z);
            from = right;
        }
        panel(from, length, 0.0, size.z);
    }
    for door in doors {
        corridor(surfaces, door, size.z, materials);
    }
}

/// The corridor's end behind a doorway, a box that is open towards the room, and the door's frame.
fn corridor(surfaces: &mut Surfaces, door: &Door, height: f32, materials: &ShellMaterials) {
    let half = 0.5 * DOOR_WIDTH_M + CORRIDOR_RIM_M;
    let (inwards, side) = (door.inwards.extend(0.0), door.sideways().extend(0.0));
    let middle = door.middle.extend(0.0);
    let (far, up) = (middle - inwards * CORRIDOR_M, Vec3::Z * height);
    let wall = materials.walls[(door.wall + 2) % 4];
    // Floor and ceiling; side walls; the far wall; and the wall's outer side to the left and right of the doorway.
    surfaces.quad(far - side * half, inwards * CORRIDOR_M, side * 2.0 * half, materials.floor);
    surfaces.quad(far - side * half + up, side * 2.0 * half, inwards * CORRIDOR_M, materials.ceiling);
    surfaces.quad(far + side * half, inwards * CORRIDOR_M, up, wall);
    surfaces.quad(middle - side * half, -inwards * CORRIDOR_M, up, wall);
    surfaces.quad(far - side * half, side * 2.0 * half, up, wall);
    for direction in [-1.0_f32, 1.0] {
        surfaces.block(&Block {
            center: middle
                + side * (direction * (0.5 * DOOR_WIDTH_M + 0.03))
                + Vec3::Z * (0.5 * DOOR_HEIGHT_M),
            half: Vec3::new(0.04, 0.03, 0.5 * DOOR_HEIGHT_M),
            yaw: door.inwards.to_angle(),
            material: materials.frame,
            front: None,
        });
    }
    surfaces.block(&Block {
        center: middle + Vec3::Z * (DOOR_HEIGHT_M + 0.03),
        half: Vec3::new(0.04, 0.5 * DOOR_WIDTH_M + 0.06, 0.03),
        yaw: door.inwards.to_angle(),
        material: materials.frame,
        front: None,
    });
}
