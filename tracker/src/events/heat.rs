//! Heat map: seconds that people spent on each cell of the floor.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use image::RgbImage;
use mot::jsonl::FrameLine;
use nalgebra::{Point2, Vector2};
use scenes::plan::{FloorPlan, PlanOptions};
use scenes::polygon::Polygon;
use scenes::room::Room;
use shell::canvas::{Color, TextStyle};

use crate::Result;
use crate::plan::beyond_the_room;

/// Side of a cell, metres.
const CELL_M: f64 = 0.25;
/// Longest time between two lines that counts in full, seconds: in a longer gap nobody was seen.
const LONGEST_STEP_S: f64 = 1.0;
/// Least time on a cell that is reported, seconds.
const LEAST_S: f64 = 0.005;
/// Largest number of cells: 250 m by 250 m. Positions beyond are left out.
const MOST_CELLS: usize = 1_000_000;
/// Colours from the coolest to the hottest cell: light yellow, orange, dark red; no colour of a zone.
const COLORS: [Color; 4] =
    [Color::rgb(255, 237, 160), Color::rgb(254, 178, 76), Color::rgb(240, 59, 32), Color::rgb(128, 0, 38)];

/// Seconds of presence by cell.
#[derive(Debug, Clone, Default)]
pub(super) struct HeatMap {
    /// Cells by column and row: the cell (0, 0) lies between the origin and (`CELL_M`, `CELL_M`).
    seconds: BTreeMap<(i32, i32), f64>,
    last_s: Option<f64>,
}

impl HeatMap {
    /// Adds the time since the last line where everybody of the line is.
    pub(super) fn step(&mut self, line: &FrameLine) {
        let last_s = self.last_s.replace(line.time).unwrap_or(line.time);
        let step_s = (line.time - last_s).clamp(0.0, LONGEST_STEP_S);
        for person in &line.people {
            // The conversion saturates.
            let cell = ((person.x / CELL_M).floor() as i32, (person.y / CELL_M).floor() as i32);
            if self.seconds.len() < MOST_CELLS || self.seconds.contains_key(&cell) {
                *self.seconds.entry(cell).or_default() += step_s;
            }
        }
    }

    /// Adds the seconds of a `heat.csv`; rows that are none are ignored.
    pub(super) fn add_csv(&mut self, text: &str) {
        for row in text.lines().skip(1) {
            let mut numbers = row.split(',').map(str::parse::<f64>);
            let (Some(Ok(x)), Some(Ok(y)), Some(Ok(seconds))) =
                (numbers.next(), numbers.next(), numbers.next())
            else {
                continue;
            };
            let cell = ((x / CELL_M).floor() as i32, (y / CELL_M).floor() as i32);
            *self.seconds.entry(cell).or_default() += seconds.max(0.0);
        }
    }

    /// `heat.csv`: the middle of each visited cell, metres, and the seconds, in rows from the south-west.
    pub(super) fn csv(&self) -> String {
        let mut text = String::from("x,y,seconds\n");
        let mut cells: Vec<_> = self.seconds.iter().filter(|(_, seconds)| **seconds >= LEAST_S).collect();
        cells.sort_by_key(|((column, row), _)| (*row, *column));
        for (cell, seconds) in cells {
            let middle = middle(*cell);
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{},{},{seconds:.2}", middle.x, middle.y);
        }
        text
    }

    /// `heat.png`: the cells over the floor plan.
    ///
    /// # Errors
    /// Geometry that cannot be drawn.
    pub(super) fn picture(&self, room: &Room, room_dir: &Path) -> Result<RgbImage> {
        let hottest_s = self.seconds.values().copied().fold(0.0, f64::max);
        let places = self.seconds.keys().map(|cell| middle(*cell));
        let shown = self.seconds.iter().filter(|(_, seconds)| **seconds >= LEAST_S);
        let patch = |(cell, seconds): (&(i32, i32), &f64)| {
            let corner = |side: f64| middle(*cell) + Vector2::repeat(side * CELL_M);
            (Polygon::rectangle(corner(-0.5), corner(0.5)), color(share(*seconds, hottest_s)).alpha(0.72))
        };
        let options = PlanOptions {
            places: beyond_the_room(room, places),
            patches: shown.map(patch).collect(),
            room_dir: Some(room_dir.to_owned()),
            title: Some(format!("Time spent on each {:.0} cm of the floor", 100.0 * CELL_M)),
            ..PlanOptions::default()
        };
        let mut plan = FloorPlan::new(room, &options)?;
        draw_legend(&mut plan, hottest_s);
        Ok(plan.into_image())
    }
}

/// Share of the colour scale, which is the root of the time: a place where people pass is seen beside one where they
/// stand for hours.
fn share(seconds: f64, hottest_s: f64) -> f64 {
    if hottest_s > 0.0 { (seconds / hottest_s).sqrt() } else { 0.0 }
}

fn middle((column, row): (i32, i32)) -> Point2<f64> {
    Point2::new((f64::from(column) + 0.5) * CELL_M, (f64::from(row) + 0.5) * CELL_M)
}

fn color(share: f64) -> Color {
    let at = share.clamp(0.0, 1.0) * (COLORS.len() - 1) as f64;
    let first = (at as usize).min(COLORS.len() - 2);
    COLORS[first].mix(COLORS[first + 1], (at - first as f64) as f32)
}

/// The colour scale, below the plan; left out where the plan is too narrow for it.
fn draw_legend(plan: &mut FloorPlan, hottest_s: f64) {
    /// Width of the scale at most and at least, and of the labels at its ends.
    const WIDTH_PX: [f64; 2] = [160.0, 30.0];
    const LABELS_PX: [f64; 2] = [32.0, 70.0];
    const STEPS: u32 = 40;
    let [left, right, middle] = plan.footer();
    let width = (right - left - LABELS_PX[0] - LABELS_PX[1]).min(WIDTH_PX[0]);
    if width < WIDTH_PX[1] {
        return;
    }
    let (x, y) = (0.5 * (left + LABELS_PX[0] + right - LABELS_PX[1] - width), middle - 6.0);
    let step_px = width / f64::from(STEPS);
    for i in 0..STEPS {
        let from = x + f64::from(i) * step_px;
        let corners = [(from, y), (from + step_px, y), (from + step_px, y + 12.0), (from, y + 12.0)];
        let shade = color(f64::from(i) / f64::from(STEPS - 1));
        plan.canvas_mut().fill_polygon(&corners.map(|(x, y)| Point2::new(x, y)), shade);
    }
    let style = TextStyle::new(15.0);
    let canvas = plan.canvas_mut();
    canvas.text(Point2::new(x - 8.0, middle), "0 s", &style.anchor(1.0, 0.5));
    let hottest = super::words::duration(hottest_s);
    canvas.text(Point2::new(x + width + 8.0, middle), &hottest, &style.anchor(0.0, 0.5));
}
