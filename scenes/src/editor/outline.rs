//! The outline of a polygon on the floor, as lines in a camera's image.
//!
//! A straight edge is straight in the image of a pinhole, so it is clipped there, in closed form: to the half space in
//! front of the camera and to the cone in which the lens has an image. Along the remaining part, points a few pixels
//! apart go through the lens, and a ray to the middle of each step tells whether the room hides it.

use calib::Camera;
use nalgebra::{Point2, Point3, Vector2};
use serde::Serialize;

use crate::polygon::Polygon;
use crate::raycast::RayScene;
use crate::visibility::is_hidden;

/// Length of a step along an edge, in pixels at the image's middle.
const STEP_PX: f64 = 3.0;
/// Largest number of steps of an edge, enough to cross the widest image.
const MOST_STEPS: f64 = 4096.0;
/// Distance along the camera's axis below which a point counts as behind the camera, metres.
const NEAR_M: f64 = 1e-3;
/// Distance to which lines are followed beyond the image, as a multiple of its half diagonal.
const REACH: f64 = 1.2;
/// Largest radius that is followed where the lens has no limit to its image: the tangent of 76°.
const WIDEST: f64 = 4.0;

/// An outline in an image, in pixels; parts of it may lie a little outside.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct ImageOutline {
    /// Pixel of each corner; `None` behind the camera and where the lens has no image.
    pub corners: Vec<Option<Point2<f64>>>,
    /// Lines visible to the camera.
    pub visible: Vec<Vec<Point2<f64>>>,
    /// Lines hidden by the room.
    pub hidden: Vec<Vec<Point2<f64>>>,
}

/// A camera that outlines are drawn in.
pub(super) struct OutlineDrawer<'a> {
    camera: &'a Camera,
    scene: Option<&'a RayScene>,
    eye: Point3<f64>,
    /// Largest radius on the plane z = 1 that is followed.
    widest: f64,
}

impl<'a> OutlineDrawer<'a> {
    /// A drawer for a camera; without a scene nothing is hidden.
    pub(super) fn new(camera: &'a Camera, scene: Option<&'a RayScene>) -> Self {
        Self { camera, scene, eye: camera.center(), widest: widest(camera) }
    }

    /// Outline of a polygon on the floor, metres; an open line leaves out the edge from the last corner to the first.
    pub(super) fn outline(&self, polygon: &Polygon, closed: bool) -> ImageOutline {
        let corners = &polygon.0;
        let pixel = |p: &Point2<f64>| self.camera.project(&on_floor(p));
        let mut outline =
            ImageOutline { corners: corners.iter().map(pixel).collect(), ..ImageOutline::default() };
        let edges = if closed { corners.len() } else { corners.len().saturating_sub(1) };
        let mut line = OutlinePart::default();
        for (a, b) in polygon.edges().take(edges) {
            self.follow(&a, &b, &mut line, &mut outline);
        }
        line.end(&mut outline);
        outline
    }

    /// Adds the visible and hidden parts of an edge in the image.
    fn follow(&self, a: &Point2<f64>, b: &Point2<f64>, line: &mut OutlinePart, outline: &mut ImageOutline) {
        let [a, b] = [a, b].map(|p| self.camera.camera_from_world * on_floor(p));
        let Some([a, b]) = in_front(a, b) else { return };
        let [on_a, on_b] = [a, b].map(|p| Point2::new(p.x / p.z, p.y / p.z));
        let Some([first, last]) = in_circle(on_a, on_b, self.widest) else { return };
        let k = &self.camera.intrinsics;
        let length_px = (on_b - on_a).norm() * (last - first) * k.fx.max(k.fy);
        let steps = (length_px / STEP_PX).ceil().clamp(1.0, MOST_STEPS) as usize;
        let share = |step: f64| first + (last - first) * step / steps as f64;
        // The inverse of the depth is linear in the image.
        let point = |share: f64| {
            let z = 1.0 / ((1.0 - share) / a.z + share / b.z);
            let on_plane = on_a + (on_b - on_a) * share;
            Point3::new(on_plane.x * z, on_plane.y * z, z)
        };
        let pixel = |step: usize| k.project(&point(share(step as f64)));
        let mut from = pixel(0);
        for step in 0..steps {
            let to = pixel(step + 1);
            if let (Some(from), Some(to)) = (from, to) {
                let middle = self.camera.camera_from_world.inverse() * point(share(step as f64 + 0.5));
                let is_hidden = self.scene.is_some_and(|scene| is_hidden(scene, &self.eye, &middle.xy()));
                line.step(from, to, is_hidden, outline);
            }
            from = to;
        }
    }
}

/// The line that is being drawn.
#[derive(Default)]
struct OutlinePart {
    points: Vec<Point2<f64>>,
    is_hidden: bool,
}

impl OutlinePart {
    /// Continues the line by a step, or ends it and begins another.
    fn step(&mut self, from: Point2<f64>, to: Point2<f64>, is_hidden: bool, outline: &mut ImageOutline) {
        let goes_on = self.points.last().is_some_and(|last| (last - from).amax() < 1e-6);
        if !goes_on || is_hidden != self.is_hidden {
            std::mem::take(self).end(outline);
            *self = Self { points: vec![from], is_hidden };
        }
        self.points.push(to);
    }

    fn end(self, outline: &mut ImageOutline) {
        if !self.points.is_empty() {
            if self.is_hidden { &mut outline.hidden } else { &mut outline.visible }.push(self.points);
        }
    }
}

fn on_floor(p: &Point2<f64>) -> Point3<f64> {
    Point3::new(p.x, p.y, 0.0)
}

/// Largest radius on the plane z = 1 at which there can be something to draw: a little outside the image, and within
/// the radius at which the lens model folds back.
fn widest(camera: &Camera) -> f64 {
    let k = &camera.intrinsics;
    let fold = k.distortion.max_radius();
    let (right, bottom) = (f64::from(k.width) - 0.5, f64::from(k.height) - 0.5);
    let corners = [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)];
    let radius = |(u, v)| k.unproject(&Point2::new(u, v)).map_or(WIDEST, |ray| ray.xy().norm());
    let image = corners.map(radius).into_iter().fold(0.0, f64::max);
    (REACH * image).min(fold * (1.0 - 1e-9))
}

/// Part of a segment, in camera coordinates, in front of the camera; `None` if it is wholly behind.
fn in_front(a: Point3<f64>, b: Point3<f64>) -> Option<[Point3<f64>; 2]> {
    let cut = |from: Point3<f64>, to: Point3<f64>| {
        let share = (NEAR_M - from.z) / (to.z - from.z);
        Point3::from((from + (to - from) * share).xy().coords.push(NEAR_M))
    };
    match (a.z >= NEAR_M, b.z >= NEAR_M) {
        (true, true) => Some([a, b]),
        (true, false) => Some([a, cut(a, b)]),
        (false, true) => Some([cut(a, b), b]),
        // The comparison is false for NaN, too.
        (false, false) => None,
    }
}

/// Part of a segment, as shares of its length, within a circle around the origin.
fn in_circle(a: Point2<f64>, b: Point2<f64>, radius: f64) -> Option<[f64; 2]> {
    let along: Vector2<f64> = b - a;
    let (square, half, rest) =
        (along.norm_squared(), a.coords.dot(&along), a.coords.norm_squared() - radius * radius);
    if square == 0.0 {
        return (rest <= 0.0).then_some([0.0, 1.0]);
    }
    let discriminant = half * half - square * rest;
    if !(discriminant >= 0.0 && discriminant.is_finite()) {
        return None;
    }
    let [first, last] = [-1.0, 1.0].map(|sign| (-half + sign * discriminant.sqrt()) / square);
    let (first, last) = (first.max(0.0), last.min(1.0));
    (first < last).then_some([first, last])
}
