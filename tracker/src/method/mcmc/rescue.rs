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

use super::births::BirthMap;
use super::filled::{Filled, UPPER_BODY};
use super::left_over::paint;
use crate::likelihood::{Layers, Simulation, SummedArea};
use crate::silhouette::{Body, Shape, Silhouette};

/// Seconds for which the evidence of several cameras has to last.
const SEVERAL_S: f64 = 1.0;
/// Seconds for which the evidence of a camera has to last that sees the place alone.
const LONE_S: f64 = 2.0;
/// Part of a person's visible core that has to be unexplained foreground: a person who sits fills 0.7 of a standing one's.
const PERSON: f64 = 0.6;
/// The same where one camera alone sees the place, and so knows the distance badly.
const LONE_PERSON: f64 = 0.75;
/// Part of the upper body that has to be: a person who sits fills 0.3 of it, a chair nothing but what perspective adds.
const UPPER: f64 = 0.2;
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
    let mut shown = Shown::default();
    for (filled, camera) in filled.iter().zip(cameras) {
        let Some(camera) = camera.as_ref().filter(|_| filled.visible_px > 0) else { continue };
        let parts = [(&filled.rows, filled.visible_px), (&filled.upper_rows, filled.upper_visible_px)];
        let [whole, upper] = parts.map(|(rows, visible_px)| {
            let count = |sums: &SummedArea| sums.count(rows, &filled.columns).min(visible_px);
            let free_px = visible_px - count(&camera.covered);
            Part { free_px, found_px: count(&camera.unexplained).min(free_px) }
        });
        let whole_px = RECTANGLE * f64::from(filled.area_px);
        if f64::from(filled.visible_px) >= SEES * whole_px {
            shown.add_camera(whole, upper, whole_px, camera.full_px, filled.rows.end < camera.rows);
        }
    }
    shown.support()
}

/// Whether the cameras show an average person at the place of `body`, whoever explains the foreground there.
pub(super) fn is_person_shown(simulation: &Simulation, layers: &Layers, body: &Body) -> bool {
    const UPPER_CORE: Shape = Shape { bottom: 1.0 - UPPER_BODY, ..Shape::CORE };
    let mut shown = Shown::default();
    for (camera, view) in layers.views().iter().enumerate() {
        let layer = layers.innermost(camera);
        if !simulation.in_use(layer) {
            continue;
        }
        let core = Silhouette::new(view, &Shape::CORE.of(body));
        let upper = Silhouette::new(view, &UPPER_CORE.of(body));
        let part =
            |s: &Silhouette| Part { free_px: s.visible_px, found_px: simulation.foreground_under(layer, s) };
        let whole_px = f64::from(core.area_px);
        if core.visible_px > 0 && f64::from(core.visible_px) >= SEES * whole_px {
            let full_px = u32::from(view.block).pow(2);
            let has_feet = core.row_range().end < view.height as usize;
            shown.add_camera(part(&core), part(&upper), whole_px, full_px, has_feet);
        }
    }
    shown.support() != Support::Missing
}

/// What one camera shows of a part of a person, pixels.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Neither hidden by the room nor covered by somebody followed.
    free_px: u32,
    /// Foreground of these.
    found_px: u32,
}

impl Part {
    fn found(self) -> f64 {
        f64::from(self.found_px) / f64::from(self.free_px.max(1))
    }
}

/// What the cameras show of a person, gathered camera by camera.
#[derive(Debug, Clone, Copy)]
struct Shown {
    seeing: u32,
    clearly: u32,
    /// The smallest part found of the whole.
    least: f64,
    /// The smallest part found of the upper body, by the cameras that see some of it.
    least_upper: Option<f64>,
}

impl Default for Shown {
    fn default() -> Self {
        Self { seeing: 0, clearly: 0, least: 1.0, least_upper: None }
    }
}

impl Shown {
    /// Takes in a camera that sees some of the place. Without the feet it does not know how far away somebody is.
    fn add_camera(&mut self, whole: Part, upper: Part, whole_px: f64, full_px: u32, has_feet: bool) {
        let free = f64::from(whole.free_px) / whole_px;
        // Somebody followed may hide the place from a camera that sees it: then it shows nobody.
        let found = if free < SEES { 0.0 } else { whole.found() };
        self.seeing += 1;
        self.clearly += u32::from(has_feet && free >= CLEAR && whole.free_px * full_px >= CLEAR_PX);
        self.least = self.least.min(found);
        if f64::from(upper.free_px) >= SEES * whole_px {
            let found = upper.found();
            self.least_upper = Some(self.least_upper.map_or(found, |least| least.min(found)));
        }
    }

    fn support(&self) -> Support {
        match (self.seeing, self.clearly) {
            // Where the upper body is hidden, nothing tells a person from a chair.
            _ if self.least_upper.is_none_or(|found| found < UPPER) => Support::Missing,
            (1, 1) if self.least >= LONE_PERSON => Support::Lone,
            (2.., 1..) if self.least >= PERSON => Support::Several,
            _ => Support::Missing,
        }
    }
}
