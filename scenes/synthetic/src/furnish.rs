//! Random placement of furniture: off the doors, with ways between, and with no place cut off.

use glam::{Vec2, Vec3};
use nalgebra::Point2;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::floor::{CLEARANCE_M, FreeFloor};
use super::furniture::{Furniture, Kind};
use super::shell::Door;
use scenes::polygon::Polygon;

/// Kind of room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RoomKind {
    /// About 6 × 5 × 2.7 m, furnished.
    #[default]
    Office,
    /// About 18 × 12 × 5 m with pillars and some furniture.
    Hall,
}

/// Width that furniture leaves free for people to walk through.
const WAY_M: f64 = 0.75;

/// Furnishes a room of that kind and size: up to `count` pieces (or tables with their chairs).
pub(super) fn furnish(
    room: RoomKind,
    count: usize,
    size: Vec3,
    doors: &[Door],
    rng: &mut Pcg64Mcg,
) -> Vec<Furniture> {
    /// Number of places tried for each piece.
    const ATTEMPTS: usize = 60;
    let order: &[Kind] = match room {
        RoomKind::Office => &[
            Kind::Pillar,
            Kind::Table,
            Kind::Sofa,
            Kind::Shelf,
            Kind::Boxes,
            Kind::Cabinet,
            Kind::Table,
            Kind::Boxes,
            Kind::Shelf,
        ],
        RoomKind::Hall => {
            &[Kind::Pillar, Kind::Pillar, Kind::Table, Kind::Cabinet, Kind::Boxes, Kind::Sofa, Kind::Shelf]
        }
    };
    let mut pieces: Vec<Furniture> = Vec::new();
    for kind in order.iter().cycle().take(count) {
        for _ in 0..ATTEMPTS {
            let mut group = propose(*kind, size, rng);
            if fits(&group, &pieces, size, doors) {
                pieces.append(&mut group);
                break;
            }
        }
    }
    pieces
}

/// Tells whether a group fits: in the room, off the doors and the others, with every place reachable.
fn fits(group: &[Furniture], others: &[Furniture], size: Vec3, doors: &[Door]) -> bool {
    let inside = |p: &Point2<f64>| {
        (0.0..=f64::from(size.x)).contains(&p.x) && (0.0..=f64::from(size.y)).contains(&p.y)
    };
    let apart = group.iter().all(|piece| {
        piece.footprint.0.iter().all(inside)
            && doors.iter().all(|door| distance_m(&piece.footprint, &door.kept_free()) > 0.0)
            && others.iter().all(|other| distance_m(&piece.footprint, &other.footprint) > WAY_M)
    });
    if !apart {
        return false;
    }
    let all: Vec<Furniture> = others.iter().chain(group).cloned().collect();
    let floor = FreeFloor::new(size, doors, &all, CLEARANCE_M);
    let reached = floor.reachable(&doors[0].outside()).len();
    // No door is cut off, and almost no corner.
    reached as f64 > 0.97 * floor.free_cells().count() as f64
        && doors.iter().all(|door| floor.reachable(&door.outside()).len() == reached)
}

/// The shortest way between two convex polygons, 0 if they overlap.
fn distance_m(a: &Polygon, b: &Polygon) -> f64 {
    let one_way =
        |a: &Polygon, b: &Polygon| a.0.iter().map(|p| b.distance_m(p)).fold(f64::INFINITY, f64::min);
    // Two long boxes can cross without a corner in the other: their centres decide.
    let crossing = a.contains(&b.center()) || b.contains(&a.center());
    if crossing { 0.0 } else { one_way(a, b).min(one_way(b, a)) }
}

/// A piece of furniture at a random place; a table with its chairs.
fn propose(kind: Kind, size: Vec3, rng: &mut Pcg64Mcg) -> Vec<Furniture> {
    let piece = kind.size(size.z, rng);
    if kind.wants_wall() {
        let wall = rng.random_range(0..4_u8);
        // The piece's back is at +y: on wall 0 (y = 0) it is turned by half a turn.
        let yaw = std::f32::consts::FRAC_PI_2 * [2.0, 3.0, 0.0, 1.0][usize::from(wall)];
        let off = 0.5 * piece.y + 0.02;
        let along = |length: f32, rng: &mut Pcg64Mcg| {
            rng.random_range(0.5 * piece.x + 0.1..(length - 0.5 * piece.x - 0.1).max(0.5 * piece.x + 0.2))
        };
        let at = match wall {
            0 => Vec2::new(along(size.x, rng), off),
            1 => Vec2::new(size.x - off, along(size.y, rng)),
            2 => Vec2::new(along(size.x, rng), size.y - off),
            _ => Vec2::new(off, along(size.y, rng)),
        };
        return vec![Furniture::new(kind, piece, at, yaw, rng)];
    }
    let at = Vec2::new(rng.random_range(0.25..0.75) * size.x, rng.random_range(0.25..0.75) * size.y);
    let yaw = if kind == Kind::Pillar { 0.0 } else { rng.random_range(-0.4..0.4) };
    let mut group = vec![Furniture::new(kind, piece, at, yaw, rng)];
    if kind == Kind::Table {
        for side in [-1.0_f32, 1.0] {
            let chair = Kind::Chair.size(size.z, rng);
            let along = rng.random_range(-0.25..0.25) * piece.x;
            let place = at
                + Vec2::from_angle(yaw)
                    .rotate(Vec2::new(along, side * (0.5 * piece.y + 0.5 * chair.y - 0.12)));
            // A chair's back is turned away from the table.
            let turn = if side > 0.0 { 0.0 } else { std::f32::consts::PI };
            let yaw = yaw + turn + rng.random_range(-0.2..0.2);
            group.push(Furniture::new(Kind::Chair, chair, place, yaw, rng));
        }
    }
    group
}
