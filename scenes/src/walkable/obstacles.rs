//! Which cells are obstructed: surfaces above them, without strays, and without the rim of table tops.

use super::survey::{STOREY_M, Survey};
use super::{Grid, WalkableOptions};

/// A board is at most this many storeys thick: one, or two if it lies across their border.
const BOARD_STOREYS: u32 = 2;
/// Nothing of a board is lower than this above the floor, metres; below it, it would stop legs.
const BOARD_FROM_M: f64 = 0.5;

/// The cells in which nobody can stand.
pub(super) fn of(survey: &Survey, options: &WalkableOptions) -> Grid {
    let cell_m = survey.floor.cell_m;
    let enough = (options.obstructed_fraction * cell_m * cell_m) as f32;
    let mut blocked = survey.floor.with(survey.obstructing_m2.iter().map(|area| *area >= enough).collect());
    remove_strays(&mut blocked, survey, options);
    free_rims(&blocked.closed(options.close_m), survey, options)
}

/// Clears patches that are both small and low: a few stray discs.
fn remove_strays(blocked: &mut Grid, survey: &Survey, options: &WalkableOptions) {
    let smallest = options.stray_area_m2 / (blocked.cell_m * blocked.cell_m);
    let pole_storeys = (options.pole_height_m / STOREY_M).round() as u32;
    for patch in blocked.patches() {
        let storeys = patch.iter().fold(0, |all, &i| all | survey.storeys[i]);
        if (patch.len() as f64) < smallest && storeys.count_ones() < pole_storeys {
            for i in patch {
                blocked.bits[i] = false;
            }
        }
    }
}

/// Frees the rim of boards (table tops, shelves on a wall): legs stand under them, and bodies lean over them. What is
/// high, like a wall, and what reaches down, like a sofa, has no rim.
fn free_rims(blocked: &Grid, survey: &Survey, options: &WalkableOptions) -> Grid {
    let low = ((BOARD_FROM_M - options.ankle_m) / STOREY_M).round().clamp(0.0, 31.0) as u32;
    let is_board = |i: usize| {
        let storeys = survey.storeys[i];
        // A cell that closing has filled holds nothing: it takes after its neighbours.
        storeys != 0 && storeys.trailing_zeros() >= low && storeys.count_ones() <= BOARD_STOREYS
    };
    let near_open = blocked.inverted().dilated(options.lean_m);
    blocked.with(
        (0..blocked.bits.len()).map(|i| blocked.bits[i] && !(near_open.bits[i] && is_board(i))).collect(),
    )
}
