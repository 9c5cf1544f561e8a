//! The floor plan: the room from straight above with its cameras and zones, and a mapping from metres to pixels, so
//! that callers can draw people's paths.

mod cache;
mod ground;
mod mapping;
mod marks;
mod outline;

use std::path::PathBuf;

use glam::Vec2;
use image::RgbImage;
use nalgebra::{Point2, Vector2};

use crate::Result;
use crate::room::Room;
use crate::view::extent;
use crate::visibility::floor_nearby;
use crate::walkable::WalkableMap;
use shell::canvas::{Canvas, Color, Stroke, TextStyle};

pub use mapping::Mapping;

/// Options of a drawn plan.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanOptions {
    /// Longest side of the picture, with its margins; at least 200.
    pub longest_side_px: u32,
    /// Height at which the room is cut open; by default 2 m, or 30 cm below a lower ceiling.
    pub cut_height_m: Option<f64>,
    /// Whether zones, cameras and the outline of the walkable floor are drawn.
    pub marks: bool,
    /// Walkable floor to outline among the marks; by default the room's own, or the one derived from its geometry.
    pub walkable: Option<WalkableMap>,
    /// Title above the plan.
    pub title: Option<String>,
    /// Places on the floor that have to be on the plan besides the room, metres, such as people's paths.
    pub places: Vec<Point2<f64>>,
    /// Directory of the room, in whose cache the rendered ground is kept. Without it everything is rendered anew.
    pub room_dir: Option<PathBuf>,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self {
            longest_side_px: 1200,
            cut_height_m: None,
            marks: true,
            walkable: None,
            title: None,
            places: Vec::new(),
            room_dir: None,
        }
    }
}

/// Free space around the room on the plan.
const RIM_M: f64 = 0.35;
/// Space left, above, right and below for the axes' numbers and the scale bar.
const MARGIN_PX: [f64; 4] = [46.0, 16.0, 16.0, 62.0];
/// Additional space for a title.
const TITLE_PX: f64 = 34.0;
/// Half side of the shown floor for a room in which nothing has a place.
const EMPTY_ROOM_M: f64 = 5.0;
/// Style of the numbers and names around the plan.
const NOTES: TextStyle = TextStyle::new(15.0).color(Color::rgb(92, 96, 104));

/// A drawn floor plan.
#[derive(Debug, Clone)]
pub struct FloorPlan {
    canvas: Canvas,
    mapping: Mapping,
}

impl FloorPlan {
    /// Draws the plan of a room; for a room without geometry, its zones, cameras and walkable floor.
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] when the geometry cannot be intersected.
    pub fn new(room: &Room, options: &PlanOptions) -> Result<Self> {
        let (low, high) = shown(room, &options.places);
        let title_px = if options.title.is_some() { TITLE_PX } else { 0.0 };
        let [left, top, right, bottom] = MARGIN_PX;
        let size = high - low;
        let longest = f64::from(options.longest_side_px.max(200));
        let px_per_m = ((longest - left - right) / size.x).min((longest - top - bottom - title_px) / size.y);
        let mapping = Mapping { low, high, px_per_m, corner_px: Vector2::new(left, top + title_px) };
        let width = (left + right + size.x * px_per_m).round() as u32;
        let height = (top + bottom + title_px + size.y * px_per_m).round() as u32;
        let mut plan = Self { canvas: Canvas::new(width, height, Color::PAPER), mapping };
        plan.draw_ground(room, options)?;
        plan.draw_grid();
        if options.marks {
            marks::draw(&mut plan, room, options)?;
        }
        plan.draw_frame(options.title.as_deref());
        Ok(plan)
    }

    /// Mapping of the floor to pixels.
    pub fn mapping(&self) -> Mapping {
        self.mapping
    }

    /// The finished picture.
    pub fn into_image(self) -> RgbImage {
        self.canvas.into_image()
    }

    /// Draws a person's path (metres on the floor): a line in their colour with a light casing, a dot at its beginning
    /// and a label, if not empty, at its end.
    pub fn trajectory(&mut self, places: &[Point2<f64>], color: Color, label: &str) {
        let line: Vec<Point2<f64>> = places.iter().map(|p| self.mapping.pixel(p)).collect();
        let (Some(first), Some(last)) = (line.first(), line.last()) else { return };
        self.canvas.stroke_polyline(&line, &Stroke::solid(Color::WHITE.alpha(0.75), 5.5));
        self.canvas.stroke_polyline(&line, &Stroke::solid(color, 3.0));
        self.canvas.fill_circle(*first, 6.5, Color::WHITE);
        self.canvas.fill_circle(*first, 4.8, color);
        if label.is_empty() {
            self.canvas.fill_circle(*last, 5.0, color);
        } else {
            let style = TextStyle::new(17.0).bold().on_plate(color).anchor(0.5, 0.5);
            self.canvas.text(*last, label, &style);
        }
    }

    fn draw_ground(&mut self, room: &Room, options: &PlanOptions) -> Result<()> {
        let Some(geometry) = &room.geometry else { return Ok(()) };
        let Some((_, top)) = extent(geometry) else { return Ok(()) };
        let cut_m = options.cut_height_m.map_or_else(|| default_cut_m(top.z), |cut| cut as f32);
        let [left, upper, right, lower] = self.mapping.frame();
        let first = self.mapping.floor(&Point2::new(left.ceil(), upper.ceil()));
        let raster = ground::Raster {
            width: (right.floor() - left.ceil() + 1.0).max(1.0) as u32,
            height: (lower.floor() - upper.ceil() + 1.0).max(1.0) as u32,
            origin: Vec2::new(first.x as f32, first.y as f32),
            pixel_m: (1.0 / self.mapping.px_per_m) as f32,
        };
        let picture = match &options.room_dir {
            Some(room_dir) => cache::picture(room_dir, geometry, &raster, cut_m)?,
            None => ground::picture(geometry, &raster, cut_m)?,
        };
        self.canvas.blit(&picture, left.ceil() as i64, upper.ceil() as i64);
        Ok(())
    }

    /// Lines a metre apart (or 2, 5, 10, … where that would be too dense), numbered along the left and the lower side.
    fn draw_grid(&mut self) {
        const LEAST_PX: f64 = 42.0;
        let step = nice_step(LEAST_PX / self.mapping.px_per_m);
        let [left, top, right, bottom] = self.mapping.frame();
        let line = Stroke::solid(Color::INK.alpha(0.13), 1.0);
        let Mapping { low, high, .. } = self.mapping;
        for x in multiples(step, low.x, high.x) {
            let u = self.mapping.pixel(&Point2::new(x, low.y)).x;
            self.canvas.stroke_polyline(&[Point2::new(u, top), Point2::new(u, bottom)], &line);
            self.canvas.text(Point2::new(u, bottom + 6.0), &format!("{x}"), &NOTES.anchor(0.5, 0.0));
        }
        for y in multiples(step, low.y, high.y) {
            let v = self.mapping.pixel(&Point2::new(low.x, y)).y;
            self.canvas.stroke_polyline(&[Point2::new(left, v), Point2::new(right, v)], &line);
            self.canvas.text(Point2::new(left - 8.0, v), &format!("{y}"), &NOTES.anchor(1.0, 0.5));
        }
    }

    /// The frame, the names of the axes, the scale bar and the title.
    fn draw_frame(&mut self, title: Option<&str>) {
        let [left, top, right, bottom] = self.mapping.frame();
        let rim = Stroke::solid(Color::INK.alpha(0.5), 1.0);
        self.canvas.stroke_rounded_rectangle([left, top, right, bottom], 0.0, &rim);
        let below = bottom + 42.0;
        self.canvas.text(Point2::new(left, below), "x right, y up (m)", &NOTES.anchor(0.0, 0.5));

        let length_m = nice_step(90.0 / self.mapping.px_per_m);
        let bar = Stroke::solid(Color::INK, 2.0);
        let b = Point2::new(right, below);
        let a = b - Vector2::new(length_m * self.mapping.px_per_m, 0.0);
        self.canvas.stroke_polyline(&[a, b], &bar);
        for end in [a, b] {
            let tick = Vector2::new(0.0, 5.0);
            self.canvas.stroke_polyline(&[end - tick, end + tick], &bar);
        }
        let label = TextStyle::new(15.0).anchor(1.0, 0.5);
        self.canvas.text(a - Vector2::new(10.0, 0.0), &format!("{length_m} m"), &label);
        if let Some(title) = title {
            let style = TextStyle::new(22.0).anchor(0.0, 1.0);
            self.canvas.text(Point2::new(left, top - 9.0), title, &style);
        }
    }
}

/// Part of the floor to show: geometry, cameras, zones and walkable regions, and a rim; without either geometry or
/// walkable regions also the floor that the cameras see.
fn shown(room: &Room, places: &[Point2<f64>]) -> (Point2<f64>, Point2<f64>) {
    let is_finite = |p: &&Point2<f64>| p.x.is_finite() && p.y.is_finite();
    let mut places: Vec<Point2<f64>> = places.iter().filter(is_finite).copied().collect();
    places.extend(room.cameras.iter().map(|c| c.camera.center().xy()));
    if let Some((a, b)) = room.geometry.as_ref().and_then(extent) {
        places.extend([a, b].map(|p| Point2::new(f64::from(p.x), f64::from(p.y))));
    }
    if room.geometry.is_none() && room.walkable.is_none() {
        // The extent of the room is unknown: show the floor as far as its cameras see a person.
        places.extend(room.cameras.iter().flat_map(|c| floor_nearby(&c.camera)));
    }
    let regions = room.zones.iter().map(|z| &z.polygon).chain(room.walkable.iter().flatten());
    places.extend(regions.flat_map(|polygon| &polygon.0));
    places.retain(|p| p.x.is_finite() && p.y.is_finite());
    if places.is_empty() {
        places = vec![Point2::new(-EMPTY_ROOM_M, -EMPTY_ROOM_M), Point2::new(EMPTY_ROOM_M, EMPTY_ROOM_M)];
    }
    let rim = Vector2::new(RIM_M, RIM_M);
    let low = places.iter().fold(places[0], |low, p| low.inf(p));
    let high = places.iter().fold(places[0], |high, p| high.sup(p));
    (low - rim, high + rim)
}

/// Default height of the cut, metres: below the ceiling, but above the furniture.
fn default_cut_m(top_m: f32) -> f32 {
    if top_m > 2.0 { 2.0_f32.min(top_m - 0.3) } else { top_m + 0.05 }
}

/// The smallest of 1, 2, 5, 10, 20, 50, … that is not below the given length.
fn nice_step(least: f64) -> f64 {
    let decades = (0..9).map(|power| 10_f64.powi(power));
    let mut steps = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|factor| factor * decade));
    steps.find(|step| *step >= least).unwrap_or(1e9)
}

/// The multiples of a step in a range.
fn multiples(step: f64, low: f64, high: f64) -> impl Iterator<Item = f64> {
    ((low / step).ceil() as i64..=(high / step).floor() as i64).map(move |i| i as f64 * step)
}

#[cfg(test)]
mod tests;
