//! Figure of the trajectories of one trial, one panel per system (Nakazawa et al., figures 15 and 16).

use image::RgbImage;
use nalgebra::{Point2, Vector2};
use shell::canvas::{Canvas, Color, Stroke, TextStyle};

use super::World;
use super::experiment::Trace;

const PANEL_PX: f64 = 560.0;
const MARGIN_PX: f64 = 16.0;
const TITLE_PX: f64 = 36.0;
const TEXT: TextStyle = TextStyle::new(16.0).color(Color::INK);

/// Draws the true trajectories in grey, and over them the estimated ones of each system, one colour per person.
pub fn draw(world: &World, traces: &[(&'static str, Trace)]) -> RgbImage {
    let width = MARGIN_PX + (PANEL_PX + MARGIN_PX) * traces.len() as f64;
    let height = TITLE_PX + PANEL_PX + MARGIN_PX;
    let mut canvas = Canvas::new(width as u32, height as u32, Color::PAPER);
    for (index, (name, trace)) in traces.iter().enumerate() {
        let left = MARGIN_PX + (PANEL_PX + MARGIN_PX) * index as f64;
        canvas.text(Point2::new(left, 10.0), name, &TEXT.bold().anchor(0.0, 0.0));
        draw_panel(&mut canvas, Point2::new(left, TITLE_PX), world, trace);
    }
    canvas.into_image()
}

fn draw_panel(canvas: &mut Canvas, corner: Point2<f64>, world: &World, trace: &Trace) {
    let reach_m = world
        .site
        .stations
        .iter()
        .map(|s| s.position)
        .chain((0..world.frames()).flat_map(|frame| world.places(frame).iter().copied()))
        .fold(1.0, |reach: f64, p| reach.max(p.x.abs()).max(p.y.abs()))
        + 0.5;
    let scale = 0.5 * PANEL_PX / reach_m;
    let middle = corner + Vector2::new(0.5, 0.5) * PANEL_PX;
    let to_panel = |p: Point2<f64>| middle + Vector2::new(p.x, -p.y) * scale;
    let frame =
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| corner + Vector2::new(x, y) * PANEL_PX);
    canvas.stroke_polygon(&frame, &Stroke::solid(Color::INK.alpha(0.3), 1.0));
    for wall in &world.site.walls {
        canvas.stroke_polyline(&wall.map(to_panel), &Stroke::solid(Color::INK, 4.0));
    }
    for (index, station) in world.site.stations.iter().enumerate() {
        let at = to_panel(station.position);
        canvas.fill_circle(at, 5.0, Color::INK);
        if world.options.stations <= 16 {
            let inwards = Vector2::new(station.heading.x, -station.heading.y) * 14.0;
            canvas.text(at + inwards, &index.to_string(), &TEXT.anchor(0.5, 0.5));
        }
    }
    for person in 0..world.options.people {
        let way: Vec<Point2<f64>> = (0..world.frames()).map(|f| to_panel(world.places(f)[person])).collect();
        canvas.stroke_polyline(&way, &Stroke::solid(Color::INK.alpha(0.25), 5.0));
    }
    for person in 0..world.options.people {
        let color = Color::of_id(person as u32);
        let found: Vec<Option<Point2<f64>>> =
            trace.iter().map(|places| places[person].map(to_panel)).collect();
        for stretch in found.split(Option::is_none) {
            let stretch: Vec<Point2<f64>> = stretch.iter().flatten().copied().collect();
            canvas.stroke_polyline(&stretch, &Stroke::solid(color, 1.8));
        }
        if let Some(last) = found.iter().rev().find_map(|place| *place) {
            let label = TEXT.on_plate(color).color(color.text_on()).anchor(0.5, 0.5);
            canvas.text(last, &person.to_string(), &label);
        }
    }
}
