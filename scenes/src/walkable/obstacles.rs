//! Obstructed cells: surfaces above them, without strays, and without the rim of table tops.

use super::survey::{BAND_M, Survey};
use super::{Grid, WalkableOptions};

/// Largest number of height bands of a board: one, or two if it lies across their border.
const BOARD_BANDS: u32 = 2;
/// Least height of a board above the floor, metres; a lower one would stop legs.
const BOARD_FROM_M: f64 = 0.5;

/// Share of its own area that a cell must hold: a wall stays as thin as it is, even if it makes the cells around it
/// dense.
const OWN_SHARE: f64 = 0.1;

/// Cells in which no person can stand.
pub(super) fn of(survey: &Survey, options: &WalkableOptions) -> Grid {
    let mut blocked = dense_cells(survey, options);
    remove_strays(&mut blocked, survey, options);
    free_rims(&blocked.closed(options.close_m), survey, options)
}

/// Cells with surface in them, amid enough of it. Spurious points of stereo lie thinly everywhere; real things are
/// dense, even where they are seen at a grazing angle and a cell here and there is empty.
fn dense_cells(survey: &Survey, options: &WalkableOptions) -> Grid {
    let grid = &survey.floor;
    let cell_m2 = grid.cell_m * grid.cell_m;
    let own = (OWN_SHARE * cell_m2) as f32;
    let candidates = grid.with(survey.obstructing_m2.iter().map(|area| *area >= own).collect());
    let mut dense = candidates.cleared();
    for i in candidates.set_cells() {
        let (cells, sum) = grid
            .within(i, options.window_m)
            .fold((0_u32, 0.0), |(n, sum), k| (n + 1, sum + survey.obstructing_m2[k]));
        dense.bits[i] = f64::from(sum) >= options.obstructed_fraction * f64::from(cells) * cell_m2;
    }
    dense
}

/// Clears patches that are both small and low: a few stray discs.
fn remove_strays(blocked: &mut Grid, survey: &Survey, options: &WalkableOptions) {
    let smallest = options.stray_area_m2 / (blocked.cell_m * blocked.cell_m);
    let pole_bands = (options.pole_height_m / BAND_M).round() as u32;
    for patch in blocked.patches() {
        let height_bands = patch.iter().fold(0, |all, &i| all | survey.height_bands[i]);
        if (patch.len() as f64) < smallest && height_bands.count_ones() < pole_bands {
            for i in patch {
                blocked.bits[i] = false;
            }
        }
    }
}

/// Frees the rim of boards (table tops, shelves on a wall): legs stand under them, and bodies lean over them. High
/// things, like a wall, and things that reach down, like a sofa, have no rim.
fn free_rims(blocked: &Grid, survey: &Survey, options: &WalkableOptions) -> Grid {
    let low = ((BOARD_FROM_M - options.ankle_m) / BAND_M).round().clamp(0.0, 31.0) as u32;
    let is_board = |i: usize| {
        let height_bands = survey.height_bands[i];
        // A cell filled by closing holds nothing: it takes after its neighbours.
        height_bands != 0 && height_bands.trailing_zeros() >= low && height_bands.count_ones() <= BOARD_BANDS
    };
    let near_open = blocked.inverted().dilated(options.lean_m);
    blocked.with(
        (0..blocked.bits.len()).map(|i| blocked.bits[i] && !(near_open.bits[i] && is_board(i))).collect(),
    )
}
