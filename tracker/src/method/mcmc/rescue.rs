//! Births away from the zones, where persistent evidence shows a person whom no track explains.
//!
//! A track can be lost, a camera can come back late, a person can have been hidden until now. So the tracker keeps, for
//! every cell of the floor, for how long the cameras have shown an unexplained person there. Such a person may walk, so
//! evidence passes on to neighbouring cells at walking speed. A cell is *open* for births once its evidence has lasted
//! [`SEVERAL_S`] in several cameras, or [`LONE_S`] where one camera alone sees the place.
//!
//! A camera supports a cell when most of what a person there would fill, beside what the followed people cover, is
//! unexplained foreground. Every camera that sees part of the place has to support it, so that neither a chair (half as
//! tall as a person in all cameras; seen steeply from above only the upper body tells) nor the intersection of two people's rays opens a cell.

use super::births::{BirthMap, Filled};
use super::left_over::paint;
use crate::likelihood::{Layers, Simulation, SummedArea};
use crate::silhouette::Silhouette;

/// Seconds for which the evidence of several cameras has to last.
const SEVERAL_S: f64 = 1.0;
/// Seconds for which the evidence of a camera has to last that sees the place alone.
const LONE_S: f64 = 2.0;
/// Part of a person's visible core that has to be unexplained foreground: a person who sits fills 0.7 of a standing one's.
const PERSON: f64 = 0.6;
/// The same where one camera alone sees the place, and so knows the distance badly.
const LONE_PERSON: f64 = 0.75;
/// Part of the upper body that has to be: a person who sits fills 0.3 of it, a chair nothing but what perspective adds.
pub(super) const UPPER: f64 = 0.2;
/// A camera sees a place when this part of a person there would be visible …
const SEES: f64 = 0.1;
/// … and clearly, when this part would be, and so many pixels of the full image.
const CLEAR: f64 = 0.5;
const CLEAR_PX: u32 = 100;
/// The rectangle of a [`Filled`] holds this part of its ellipse: the middle two thirds of the width.
const RECTANGLE: f64 = 0.78;
/// Evidence follows people up to this speed, m/s.
const WALKING_M_S: f64 = 2.0;
/// The floor is looked at no more often than this, seconds.
const EVERY_S: f64 = 0.1;
/// Evidence that is absent fades this many times as fast as it grew.
const FADES: f64 = 2.0;

/// For how long each cell of the floor has shown an unexplained person.
#[derive(Debug, Clone, Default)]
pub(super) struct Rescue {
    cells: Vec<Evidence>,
    before: Vec<Evidence>,
    /// One a camera; `None` for those without a mask.
    cameras: Vec<Option<Uncovered>>,
    /// Packed image of the followed people in one camera.
    covered: Vec<u64>,
    /// Time since the floor was looked at, seconds.
    waited_s: f64,
}

/// What one cell has shown.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    /// Seconds for which the evidence has lasted.
    lasted_s: f64,
    is_open: bool,
}

/// What the followed people leave of one camera's mask.
#[derive(Debug, Clone, Default)]
struct Uncovered {
    unexplained: SummedArea,
    /// Pixels that somebody followed covers, as far as limbs reach.
    covered: SummedArea,
    /// Rows of the view.
    rows: usize,
    /// Pixels of the full image in one of the view's.
    full_px: u32,
}

/// Which cameras show an unexplained person at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Support {
    /// Some camera that sees the place does not, or none sees it clearly.
    Missing,
    /// The one camera that sees the place.
    Lone,
    /// All of two or more cameras that see it.
    Several,
}

impl Support {
    /// Seconds for which this has to last; `None` when it supports nothing.
    fn needed_s(self) -> Option<f64> {
        match self {
            Self::Missing => None,
            Self::Lone => Some(LONE_S),
            Self::Several => Some(SEVERAL_S),
        }
    }
}

impl Rescue {
    /// Takes in a moment: `simulation` holds its masks and the people now believed to be there, drawn as `people`. `map` has
    /// the cells of the whole floor.
    pub(super) fn observe(
        &mut self,
        layers: &Layers,
        simulation: &Simulation,
        people: &[Vec<Silhouette>],
        map: &BirthMap,
        dt_s: f64,
    ) {
        self.waited_s += dt_s;
        if self.waited_s < EVERY_S {
            return;
        }
        let elapsed_s = std::mem::take(&mut self.waited_s);
        self.restart(layers, simulation, people);
        self.cells.resize(map.len(), Evidence::default());
        std::mem::swap(&mut self.cells, &mut self.before);
        self.cells.clone_from(&self.before);
        let reach_m = WALKING_M_S * elapsed_s;
        for (i, cell) in self.cells.iter_mut().enumerate() {
            let own_s = self.before[i].lasted_s;
            *cell = match support(map.filled(i), &self.cameras).needed_s() {
                None => Evidence { lasted_s: (own_s - FADES * elapsed_s).max(0.0), is_open: false },
                Some(needed_s) => {
                    let around = map.near(i, reach_m).map(|j| self.before[j].lasted_s);
                    let lasted_s = around.fold(own_s, f64::max) + elapsed_s;
                    // Evidence that was never there before has just begun.
                    Evidence { lasted_s, is_open: lasted_s - elapsed_s >= needed_s - 1e-9 }
                }
            };
        }
    }

    /// Forgets all evidence: after an outage.
    pub(super) fn forget(&mut self) {
        self.cells.fill(Evidence::default());
        self.waited_s = 0.0;
    }

    /// Whether any cell is open.
    pub(super) fn is_open_anywhere(&self) -> bool {
        self.cells.iter().any(|cell| cell.is_open)
    }

    /// Whether people may be born in a cell: it or one beside it is open, since they may have moved since it was looked at.
    pub(super) fn is_open(&self, map: &BirthMap, cell: usize) -> bool {
        let is_open = |i: usize| self.cells.get(i).is_some_and(|cell| cell.is_open);
        is_open(cell) || map.near(cell, 0.0).any(is_open)
    }

    fn restart(&mut self, layers: &Layers, simulation: &Simulation, people: &[Vec<Silhouette>]) {
        self.cameras.resize_with(layers.views().len(), || None);
        for (camera, (left, view)) in self.cameras.iter_mut().zip(layers.views()).enumerate() {
            let layer = layers.outermost(camera);
            if !simulation.in_use(layer) {
                *left = None;
                continue;
            }
            let (columns, words) = (view.width as usize, view.words_per_row);
            self.covered.clear();
            self.covered.resize(words * view.height as usize, 0);
            for silhouettes in people {
                paint(&silhouettes[layer], words, &mut self.covered);
            }
            let left = left.get_or_insert_default();
            left.unexplained.restart(columns, words, simulation.unexplained(layer));
            left.covered.restart(columns, words, self.covered.iter().copied());
            left.rows = view.height as usize;
            left.full_px = u32::from(view.block).pow(2);
        }
    }
}

/// Which cameras show an unexplained person who would fill the images so.
fn support(filled: &[Filled], cameras: &[Option<Uncovered>]) -> Support {
    let (mut seeing, mut clear, mut least) = (0, 0, f64::INFINITY);
    for (filled, camera) in filled.iter().zip(cameras) {
        let Some(camera) = camera.as_ref().filter(|_| filled.visible_px > 0) else { continue };
        let parts = [(&filled.rows, filled.visible_px), (&filled.upper_rows, filled.upper_visible_px)];
        let [(free_px, found), (_, found_above)] = parts.map(|(rows, visible_px)| {
            let count = |sums: &SummedArea| sums.count(rows, &filled.columns).min(visible_px);
            let free_px = visible_px - count(&camera.covered);
            (free_px, f64::from(count(&camera.unexplained).min(free_px)) / f64::from(free_px.max(1)))
        });
        let whole_px = RECTANGLE * f64::from(filled.area_px);
        let visible = f64::from(filled.visible_px) / whole_px;
        if visible < SEES {
            continue;
        }
        seeing += 1;
        let free = f64::from(free_px) / whole_px;
        if free < SEES {
            // Somebody followed hides the place from this camera, which supports nothing.
            return Support::Missing;
        }
        // Without the feet a camera does not know how far away somebody is.
        let has_feet = filled.rows.end < camera.rows;
        clear += u32::from(has_feet && free >= CLEAR && free_px * camera.full_px >= CLEAR_PX);
        // Where the upper body is hidden, nothing tells a person from a chair.
        if found_above < UPPER {
            return Support::Missing;
        }
        least = least.min(found);
    }
    match (seeing, clear) {
        (1, 1) if least >= LONE_PERSON => Support::Lone,
        (2.., 1..) if least >= PERSON => Support::Several,
        _ => Support::Missing,
    }
}
