//! Derivation of the walkable map from geometry.
//!
//! 1. The floor that was seen; its patches, strays aside, give a convex hull.
//! 2. Inside the hull, a cell is free unless it is obstructed.
//! 3. Free cells count where floor was seen, where some camera saw a surface behind a person who would stand there, and
//!    a little way on from such cells: the space behind the walls has neither floor nor view, and no way to it.
//! 4. Of the cells without floor, those behind walls are taken out: the surfaces around them, above the furniture, show
//!    them mostly their backs. Discs know the side from which cameras saw them; triangles do not.
//! 5. Zones are walkable regardless of the geometry: people do come in there.
//! 6. Pockets too small to walk into are closed.

use glam::Vec3;
use nalgebra::Point2;
use rayon::prelude::*;

use super::survey::Survey;
use super::{Grid, WalkableOptions, obstacles};
use crate::Result;
use crate::geometry::{Disc, Geometry, vec3_from_point};
use crate::polygon::Polygon;
use crate::raycast::RayScene;
use crate::room::{RoomCamera, Zone};

/// Patches of floor closer than this belong together: furniture casts shadows between them. Metres.
const GAP_M: f64 = 0.5;
/// A patch of floor smaller than this share of all floor is a stray.
const STRAY_FLOOR_SHARE: f64 = 0.02;
/// Heights of a standing body that a camera may see, metres.
const BODY_HEIGHTS_M: [f32; 4] = [0.4, 0.8, 1.2, 1.6];
/// Number of these heights that one camera must look past: a single one may show through a hole in a reconstructed
/// wall.
const SEEN_PARTS: usize = 2;

/// Heights at which the surfaces around a place are looked at, metres: above most furniture.
const AROUND_HEIGHTS_M: [f32; 3] = [1.5, 1.65, 1.8];
/// Number of directions in which they are looked at.
const AROUND_DIRECTIONS: u32 = 16;

/// Derives the grid; `None` when nothing is below head height, so that everywhere is walkable.
pub(super) fn from_geometry(
    geometry: &Geometry,
    cameras: &[RoomCamera],
    zones: &[Zone],
    options: &WalkableOptions,
) -> Result<Option<Grid>> {
    let zone_bounds: Vec<_> = zones.iter().map(|zone| zone.polygon.bounds()).collect();
    let Some(survey) = Survey::of(geometry, &zone_bounds, options) else { return Ok(None) };
    let blocked = obstacles::of(&survey, options);

    let mut free = survey.floor.cleared();
    free.fill(&floor_hull(&survey));
    for (bit, blocked) in free.bits.iter_mut().zip(&blocked.bits) {
        *bit &= !blocked;
    }
    let scene = RayScene::new(geometry)?;
    let eyes: Vec<Vec3> = cameras.iter().map(|c| vec3_from_point(&c.camera.center())).collect();
    let known: Vec<bool> = (0..free.bits.len())
        .into_par_iter()
        .map(|i| free.bits[i] && (survey.floor.bits[i] || is_looked_past(&scene, &eyes, &free, i)))
        .collect();
    let steps = (options.hidden_reach_m / free.cell_m).round() as usize;
    let mut walkable = free.reached_from(&free.with(known), steps);

    if let Geometry::Discs(discs) = geometry {
        let outside: Vec<bool> = (0..walkable.bits.len())
            .into_par_iter()
            .map(|i| {
                walkable.bits[i] && !survey.floor.bits[i] && is_behind(&scene, discs, walkable.center(i))
            })
            .collect();
        for (bit, outside) in walkable.bits.iter_mut().zip(outside) {
            *bit &= !outside;
        }
    }

    let mut zone_cells = walkable.cleared();
    for zone in zones {
        zone_cells.fill(&zone.polygon);
    }
    for i in zone_cells.set_cells() {
        walkable.bits[i] = true;
    }
    close_pockets(&mut walkable, &zone_cells, options);
    Ok(Some(walkable))
}

/// Convex hull of the seen floor; without floor, of everything obstructing.
fn floor_hull(survey: &Survey) -> Polygon {
    let seen = &survey.floor;
    let grown = seen.dilated(0.5 * GAP_M);
    let floor_of = |patch: &[usize]| patch.iter().copied().filter(|&i| seen.bits[i]).collect::<Vec<_>>();
    let least = STRAY_FLOOR_SHARE * seen.set_cells().count() as f64;
    let mut cells: Vec<usize> = grown
        .patches()
        .iter()
        .map(|patch| floor_of(patch))
        .filter(|floor| floor.len() as f64 >= least)
        .flatten()
        .collect();
    if cells.is_empty() {
        cells = (0..seen.bits.len()).filter(|&i| survey.obstructing_m2[i] > 0.0).collect();
    }
    // The corners of the cells, so that the outermost are inside.
    let half = 0.5 * seen.cell_m;
    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
    let corner = |i: usize| corners.map(|(x, y)| seen.center(i) + nalgebra::Vector2::new(x, y));
    Polygon::convex_hull(cells.into_iter().flat_map(corner).collect())
}

/// Tells whether some camera looks past enough of a body in the cell, onto a surface behind it.
fn is_looked_past(scene: &RayScene, eyes: &[Vec3], grid: &Grid, cell: usize) -> bool {
    let place = grid.center(cell);
    let body = BODY_HEIGHTS_M.map(|z| Vec3::new(place.x as f32, place.y as f32, z));
    eyes.iter().any(|&eye| body.iter().filter(|&&part| looks_past(scene, eye, part)).count() >= SEEN_PARTS)
}

/// Tells whether the line from the eye hits a surface, and not before the part. A line without a hit proves nothing: in
/// a reconstruction it goes through a hole in a wall, or through space that no camera saw.
fn looks_past(scene: &RayScene, eye: Vec3, part: Vec3) -> bool {
    scene.cast(eye, part - eye).is_some_and(|hit| hit.distance > 1.0)
}

/// Tells whether the surfaces around a place, above the furniture, show their backs: cameras saw them from the other
/// side, so that the place is behind them.
fn is_behind(scene: &RayScene, discs: &[Disc], place: Point2<f64>) -> bool {
    let (mut fronts, mut backs) = (0_u32, 0_u32);
    for z in AROUND_HEIGHTS_M {
        for direction in 0..AROUND_DIRECTIONS {
            let angle = direction as f32 * std::f32::consts::TAU / AROUND_DIRECTIONS as f32;
            let ray = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let Some(hit) = scene.cast(Vec3::new(place.x as f32, place.y as f32, z), ray) else { continue };
            let is_front = discs[hit.primitive as usize].normal.dot(ray) < 0.0;
            if is_front { fronts += 1 } else { backs += 1 }
        }
    }
    backs > fronts
}

/// Clears patches that are small, hold no zone and are not the largest.
fn close_pockets(walkable: &mut Grid, zone_cells: &Grid, options: &WalkableOptions) {
    let least = options.pocket_area_m2 / (walkable.cell_m * walkable.cell_m);
    let patches = walkable.patches();
    let largest = patches.iter().map(Vec::len).max().unwrap_or(0);
    for patch in patches {
        let small = (patch.len() as f64) < least && patch.len() < largest;
        if small && !patch.iter().any(|&i| zone_cells.bits[i]) {
            for i in patch {
                walkable.bits[i] = false;
            }
        }
    }
}
