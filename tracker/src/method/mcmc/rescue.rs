//! Births outside the zones, at persistent evidence of a person whom no track explains.
//!
//! A track can be lost, a camera can start late, a person can have been hidden until now. The tracker therefore
//! keeps, for every cell of the floor, the time for which the cameras have shown an unexplained person there. Such a
//! person may walk, so evidence spreads to neighbouring cells at walking speed. A cell is *open* for births once its
//! evidence has lasted [`SEVERAL_S`] in several cameras, or [`LONE_S`] where only one camera sees the place.
//!
//! A camera supports a cell when most of the pixels that a person there would fill, and that no followed person
//! covers, are unexplained foreground. Every camera that sees part of the place has to support it, so that neither a
//! chair (half as tall as a person in every camera; seen steeply from above, only the upper body distinguishes the
//! two) nor the intersection of two people's rays opens a cell.

use super::births::BirthMap;
use super::filled::{Filled, UPPER_BODY};
use super::left_over::paint;
use crate::likelihood::{Layers, Simulation, SummedArea};
use crate::silhouette::{Body, Shape, Silhouette};

/// Time for which the evidence of several cameras has to last, seconds.
const SEVERAL_S: f64 = 1.0;
/// Time for which the evidence of a single camera has to last, seconds.
const LONE_S: f64 = 2.0;
/// Fraction of a person's visible core that has to be unexplained foreground: a sitting person fills 0.7 of a
/// standing person's core.
const PERSON: f64 = 0.6;
/// The same where only one camera sees the place and the distance is therefore uncertain.
const LONE_PERSON: f64 = 0.75;
/// Fraction of the upper body that has to be unexplained foreground: a sitting person fills 0.3 of it, a chair only
/// what perspective adds.
const UPPER: f64 = 0.2;
/// A camera sees a place when this fraction of a person there would be visible …
const SEES: f64 = 0.1;
/// … and sees it clearly when this fraction would be, and this many pixels of the full image.
const CLEAR: f64 = 0.5;
const CLEAR_PX: u32 = 100;
/// Fraction of its ellipse that the rectangle of a [`Filled`] covers: the middle two thirds of the width.
const RECTANGLE: f64 = 0.78;
/// Largest speed at which evidence spreads, m/s.
const WALKING_M_S: f64 = 2.0;
/// Least interval between evaluations of the floor, seconds.
const EVERY_S: f64 = 0.1;
/// Rate at which evidence fades, relative to the rate at which it grows.
const FADES: f64 = 2.0;

/// Persistence of unexplained people in each cell of the floor.
#[derive(Debug, Clone, Default)]
pub(super) struct Rescue {
    cells: Vec<Evidence>,
    before: Vec<Evidence>,
    /// Unexplained and covered pixels, one entry a camera; `None` for cameras without a mask.
    cameras: Vec<Option<Uncovered>>,
    /// Packed image of the followed people in one camera (reused memory).
    covered: Vec<u64>,
    /// Time since the last evaluation of the floor, seconds.
    waited_s: f64,
}

/// Evidence of one cell.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    /// Time for which the evidence has lasted, seconds.
    lasted_s: f64,
    is_open: bool,
}

/// Pixels of one camera's mask that the followed people explain or cover.
#[derive(Debug, Clone, Default)]
struct Uncovered {
    unexplained: SummedArea,
    /// Pixels that a followed person covers, arms and legs included.
    covered: SummedArea,
    /// Rows of the view.
    rows: usize,
    /// Pixels of the full image in one pixel of the view.
    full_px: u32,
}

/// Support of the cameras for an unexplained person at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Support {
    /// A camera that sees the place shows nobody, or no camera sees it clearly.
    Missing,
    /// Only one camera sees the place, and it shows a person.
    Lone,
    /// Two or more cameras see the place, and all show a person.
    Several,
}

impl Support {
    /// Time for which this support has to last, seconds; `None` when it supports nobody.
    fn needed_s(self) -> Option<f64> {
        match self {
            Self::Missing => None,
            Self::Lone => Some(LONE_S),
            Self::Several => Some(SEVERAL_S),
        }
    }
}

impl Rescue {
    /// Updates the evidence by a moment: `simulation` holds its masks and the people of the current tracks, drawn as
    /// `people`. `map` holds the cells of the whole floor.
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
                    // Evidence that was absent until now begins at 0 s.
                    Evidence { lasted_s, is_open: lasted_s - elapsed_s >= needed_s - 1e-9 }
                }
            };
        }
    }

    /// Clears all evidence, as after an outage.
    pub(super) fn forget(&mut self) {
        self.cells.fill(Evidence::default());
        self.waited_s = 0.0;
    }

    /// Whether any cell is open.
    pub(super) fn is_open_anywhere(&self) -> bool {
        self.cells.iter().any(|cell| cell.is_open)
    }

    /// Whether people may be born in a cell: it or a neighbour is open, since the person may have moved since the
    /// last evaluation.
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

/// Support of the cameras for an unexplained person who would fill these pixels.
fn support(filled: &[Filled], cameras: &[Option<Uncovered>]) -> Support {
    let mut shown = CameraSupport::default();
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

/// Whether the cameras show an average person at the place of `body`, no matter which track explains the foreground
/// there.
pub(super) fn is_person_shown(simulation: &Simulation, layers: &Layers, body: &Body) -> bool {
    const UPPER_CORE: Shape = Shape { bottom: 1.0 - UPPER_BODY, ..Shape::CORE };
    let mut shown = CameraSupport::default();
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

/// Pixels of a part of a person in one camera.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Pixels that neither the room hides nor a followed person covers.
    free_px: u32,
    /// Foreground pixels among these.
    found_px: u32,
}

impl Part {
    fn found(self) -> f64 {
        f64::from(self.found_px) / f64::from(self.free_px.max(1))
    }
}

/// Accumulated view of a person over the cameras.
#[derive(Debug, Clone, Copy)]
struct CameraSupport {
    seeing: u32,
    clearly: u32,
    /// Smallest foreground fraction of the whole body over the cameras.
    least: f64,
    /// Smallest foreground fraction of the upper body, over the cameras that see some of it.
    least_upper: Option<f64>,
}

impl Default for CameraSupport {
    fn default() -> Self {
        Self { seeing: 0, clearly: 0, least: 1.0, least_upper: None }
    }
}

impl CameraSupport {
    /// Adds a camera that sees some of the place. A camera that does not see the feet cannot tell the distance, so it
    /// does not see the place clearly.
    fn add_camera(&mut self, whole: Part, upper: Part, whole_px: f64, full_px: u32, has_feet: bool) {
        let free = f64::from(whole.free_px) / whole_px;
        // A followed person may hide the place from a camera; the camera then shows nobody there.
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
            // A person whose upper body is hidden cannot be distinguished from a chair.
            _ if self.least_upper.is_none_or(|found| found < UPPER) => Support::Missing,
            (1, 1) if self.least >= LONE_PERSON => Support::Lone,
            (2.., 1..) if self.least >= PERSON => Support::Several,
            _ => Support::Missing,
        }
    }
}
