//! Zones, regions, lines, cameras with their fields of view, and the walkable floor, drawn on a plan.

use nalgebra::{Point2, Rotation2, Vector2, Vector3};

use super::outline::outlines;
use super::{FloorPlan, PlanOptions};
use crate::Result;
use crate::polygon::Polygon;
use crate::room::{Line, Region, Room, RoomCamera, Zone, ZoneKind};
use crate::walkable::{self, WalkableMap};
use shell::canvas::{Color, Stroke, TextStyle};

/// Colour of zones: teal, which is no person's colour.
const ZONE: Color = Color::rgb(0, 134, 139);
/// Colour of regions: violet.
const REGION: Color = Color::rgb(118, 68, 160);
/// Colour of lines: dark magenta.
const LINE: Color = Color::rgb(173, 20, 87);
/// Colour of cameras: slate.
const CAMERA: Color = Color::rgb(52, 73, 110);
/// Colour of the walkable floor's rim.
const WALKABLE: Color = Color::rgb(46, 125, 50);
/// Length of a view cone on the plan, metres, and its least share of the plan's width.
const CONE_M: f64 = 1.5;
const CONE_SHARE: f64 = 0.1;
/// Side of the cells in which the walkable floor is looked up.
const CELL_M: f64 = 0.05;

pub(super) fn draw(plan: &mut FloorPlan, room: &Room, options: &PlanOptions) -> Result<()> {
    match (&options.walkable, &options.room_dir) {
        (Some(map), _) => draw_walkable(plan, map),
        (None, Some(room_dir)) => draw_walkable(plan, &walkable::cached(room_dir, room)?),
        (None, None) => draw_walkable(plan, &WalkableMap::of_room(room)?),
    }
    room.zones.iter().for_each(|zone| draw_area(plan, &zone.polygon, ZONE));
    room.regions.iter().for_each(|region| draw_area(plan, &region.polygon, REGION));
    room.lines.iter().for_each(|line| draw_line(plan, line));
    room.cameras.iter().for_each(|camera| draw_cone(plan, camera));
    // Names are drawn last, over everything.
    room.zones.iter().for_each(|zone| name_zone(plan, zone));
    room.regions.iter().for_each(|region| name_region(plan, region));
    room.lines.iter().for_each(|line| name_line(plan, line));
    room.cameras.iter().for_each(|camera| draw_camera(plan, camera));
    Ok(())
}

fn draw_walkable(plan: &mut FloorPlan, map: &WalkableMap) {
    if map.area_m2().is_none() {
        return; // Everywhere is walkable: there is no rim.
    }
    let mapping = plan.mapping;
    // Cells finer than two pixels are not visible on large sites.
    let cell = CELL_M.max(2.0 / mapping.px_per_m);
    for line in outlines(|p| map.contains(p.x, p.y), mapping.low, mapping.high, cell) {
        let line: Vec<Point2<f64>> = line.iter().map(|p| mapping.pixel(p)).collect();
        plan.canvas.stroke_polygon(&line, &Stroke::solid(Color::WHITE.alpha(0.5), 3.0));
        let rim = Stroke { color: WALKABLE, width_px: 1.4, dash_px: Some([6.0, 4.0]) };
        plan.canvas.stroke_polygon(&line, &rim);
    }
}

fn draw_area(plan: &mut FloorPlan, polygon: &Polygon, color: Color) {
    let corners: Vec<Point2<f64>> = polygon.0.iter().map(|p| plan.mapping.pixel(p)).collect();
    plan.canvas.fill_polygon(&corners, color.alpha(0.25));
    plan.canvas.stroke_polygon(&corners, &Stroke::solid(color, 2.0));
}

/// A line, with an arrow across its longest piece: from left to right is in.
fn draw_line(plan: &mut FloorPlan, line: &Line) {
    const ARROW_PX: f64 = 15.0;
    let points: Vec<Point2<f64>> = line.points.iter().map(|p| plan.mapping.pixel(p)).collect();
    plan.canvas.stroke_polyline(&points, &Stroke::solid(Color::WHITE.alpha(0.75), 6.0));
    plan.canvas.stroke_polyline(&points, &Stroke::solid(LINE, 3.5));
    if let Some((middle, inward)) = arrow(plan, line) {
        let (from, to) = (middle - inward * ARROW_PX, middle + inward * ARROW_PX);
        plan.canvas.arrow(from, to, &Stroke::solid(LINE, 2.5));
    }
}

/// Pixel in the middle of a line's longest piece, and the inward direction there.
fn arrow(plan: &FloorPlan, line: &Line) -> Option<(Point2<f64>, Vector2<f64>)> {
    let pieces = line.pieces();
    let (a, b) = pieces.max_by(|(a, b), (c, d)| (b - a).norm().total_cmp(&(d - c).norm()))?;
    let (a, b) = (plan.mapping.pixel(&a), plan.mapping.pixel(&b));
    let along = (b - a).try_normalize(0.0)?;
    // Rows count downward: the right of a direction (x, y) is (−y, x).
    Some((nalgebra::center(&a, &b), Vector2::new(-along.y, along.x)))
}

fn name_region(plan: &mut FloorPlan, region: &Region) {
    let center = plan.mapping.pixel(&region.polygon.center());
    plan.canvas.text(center, &region.name, &name_style(REGION));
}

/// The name stands on the outer side of the line, where its arrow begins.
fn name_line(plan: &mut FloorPlan, line: &Line) {
    const AWAY_PX: f64 = 28.0;
    let Some((middle, inward)) = arrow(plan, line) else { return };
    plan.canvas.text(middle - inward * AWAY_PX, &line.name, &name_style(LINE));
}

fn name_style(color: Color) -> TextStyle {
    TextStyle::new(17.0).color(color.mix(Color::BLACK, 0.45)).halo(Color::WHITE.alpha(0.85)).anchor(0.5, 0.5)
}

fn name_zone(plan: &mut FloorPlan, zone: &Zone) {
    let way = match zone.kind {
        ZoneKind::Entry => "\nentry",
        ZoneKind::Exit => "\nexit",
        ZoneKind::Both => "",
    };
    let center = plan.mapping.pixel(&zone.polygon.center());
    plan.canvas.text(center, &format!("{}{way}", zone.name), &name_style(ZONE));
}

/// Directions on the floor of the image's left and right edge; `None` for a camera that looks straight down or up.
fn edges(camera: &RoomCamera) -> Option<[Vector2<f64>; 2]> {
    /// Share of the optical axis in the floor's plane below which a camera has no direction on a plan.
    const LEAST_AHEAD: f64 = 0.08;
    let k = &camera.camera.intrinsics;
    let world_from_camera = camera.camera.camera_from_world.rotation.inverse();
    let ahead = (world_from_camera * Vector3::z()).xy();
    if ahead.norm() < LEAST_AHEAD {
        return None;
    }
    let middle = 0.5 * (f64::from(k.height) - 1.0);
    let angle = |u: f64| k.unproject(&Point2::new(u, middle)).map(|ray| ray.x.atan2(ray.z));
    let (left, right) = (angle(-0.5)?, angle(f64::from(k.width) - 0.5)?);
    // On a plan with y up, the image's right is clockwise.
    Some([left, right].map(|a| Rotation2::new(-a) * ahead.normalize()))
}

fn draw_cone(plan: &mut FloorPlan, camera: &RoomCamera) {
    const STEPS: usize = 24;
    let center = camera.camera.center().xy();
    let Some([left, right]) = edges(camera) else { return };
    let sweep = left.angle(&right);
    let reach_m = CONE_M.max(CONE_SHARE * (plan.mapping.high.x - plan.mapping.low.x));
    let arc = |radius_m: f64| -> Vec<Point2<f64>> {
        let rim =
            (0..=STEPS).map(|i| center + Rotation2::new(-sweep * i as f64 / STEPS as f64) * left * radius_m);
        std::iter::once(center).chain(rim).map(|p| plan.mapping.pixel(&p)).collect()
    };
    // Three nested sectors fade out with distance.
    for sector in [1.0, 0.72, 0.44].map(|share| arc(reach_m * share)) {
        plan.canvas.fill_polygon(&sector, CAMERA.alpha(0.13));
    }
    for side in [left, right] {
        let line = [center, center + side * reach_m].map(|p| plan.mapping.pixel(&p));
        plan.canvas.stroke_polyline(&line, &Stroke::solid(CAMERA.alpha(0.55), 1.3));
    }
}

fn draw_camera(plan: &mut FloorPlan, camera: &RoomCamera) {
    let at = plan.mapping.pixel(&camera.camera.center().xy());
    plan.canvas.fill_circle(at, 8.0, Color::WHITE);
    plan.canvas.fill_circle(at, 6.5, CAMERA);
    plan.canvas.fill_circle(at, 2.5, Color::WHITE);
    // Beside the camera, on the side of the plan's middle, so that the name stays on it.
    let [left, _, right, _] = plan.mapping.frame();
    let (offset, anchor) = if at.x > 0.5 * (left + right) { (-13.0, 1.0) } else { (13.0, 0.0) };
    let style = TextStyle::new(17.0).bold().on_plate(CAMERA).anchor(anchor, 0.5);
    plan.canvas.text(at + Vector2::new(offset, 0.0), &camera.name, &style);
}
