//! Left panel: the real picture with the tracker's estimates.

use image::RgbImage;
use nalgebra::{Point2, Point3};
use shell::canvas::{Canvas, Color, Stroke, TextStyle};

use super::layers::SurfaceMap;
use super::lens::PanelLens;
use super::trails::Trails;
use crate::PersonEstimate;
use crate::prepared_room::PreparedCamera;
use crate::silhouette::{Body, contour};

/// Opacity of a person's colour over their visible part.
const VISIBLE_TINT: f32 = 0.38;
/// Opacity of a person's colour over their whole silhouette, hidden or not.
const HIDDEN_TINT: f32 = 0.12;
/// Number of steps in which a trail fades.
const TRAIL_BANDS: u32 = 6;
/// Distance inside the outline at which its visibility is sampled, pixels.
const INSIDE_PX: f64 = 2.0;
/// Distance behind the static surface up to which a floor point still lies on it, metres.
const FLOOR_SLACK_M: f64 = 0.15;

/// Input of the drawing of one panel.
pub(super) struct Panel<'a> {
    pub(super) camera: &'a PreparedCamera,
    pub(super) lens: &'a PanelLens,
    pub(super) layers: &'a SurfaceMap,
    /// People with their bodies, in the order of the layers.
    pub(super) people: &'a [(&'a PersonEstimate, Body)],
    /// Index of this camera in the estimates' visible fractions.
    pub(super) index: usize,
}

impl Panel<'_> {
    /// Scales a length so that it looks alike at every panel size.
    fn px(&self, length: f32) -> f32 {
        length * (self.lens.height as f32 / 480.0).clamp(0.75, 2.5)
    }

    fn panel_of_pinhole(&self, pixel: &Point2<f64>) -> Option<Point2<f64>> {
        self.camera.to_real(pixel)
    }

    /// Tints the visible parts of all people.
    pub(super) fn tint(&self, picture: &mut RgbImage) {
        let colors: Vec<Color> = self.people.iter().map(|(person, _)| Color::of_id(person.id.0)).collect();
        self.lens.for_each_pixel(picture, &self.layers.surfaces, |pixel, surface| {
            if let Some(color) = surface.owner().and_then(|i| colors.get(i)) {
                let mixed = Color::from(*pixel).mix(*color, VISIBLE_TINT);
                *pixel = mixed.into();
            }
        });
    }

    /// Draws the outlines of all people, over a pale tint of the whole body if asked for: the only mark of hidden
    /// parts.
    pub(super) fn silhouettes(&self, canvas: &mut Canvas, is_tinted: bool) {
        for (index, (person, body)) in self.people.iter().enumerate() {
            let color = Color::of_id(person.id.0);
            let around = contour::points(body, &self.camera.pinhole.center());
            let outline: Vec<Point2<f64>> =
                around.iter().filter_map(|p| self.camera.pinhole.project(p)).collect();
            if is_tinted {
                let on_panel: Vec<Point2<f64>> =
                    outline.iter().filter_map(|p| self.panel_of_pinhole(p)).collect();
                canvas.fill_polygon(&on_panel, color.alpha(HIDDEN_TINT));
            }
            self.stroke_outline(canvas, index, &outline, color);
        }
    }

    /// Draws an outline: solid where the body is predicted visible, dashed where it is hidden.
    fn stroke_outline(&self, canvas: &mut Canvas, index: usize, outline: &[Point2<f64>], color: Color) {
        let Some(first) = outline.first() else { return };
        let center = outline.iter().fold(first.coords * 0.0, |sum, p| sum + p.coords) / outline.len() as f64;
        let is_visible = |p: &Point2<f64>| {
            let inwards = center - p.coords;
            let inside = *p + inwards * (INSIDE_PX / inwards.norm().max(INSIDE_PX));
            self.layers.owner_at(inside) == Some(index)
        };
        let solid = Stroke::solid(color, self.px(2.2));
        let dashed = Stroke::dashed(color.alpha(0.85), self.px(1.6));
        let mut run: Vec<Point2<f64>> = Vec::new();
        let mut was_visible = is_visible(first);
        for p in outline.iter().chain(std::iter::once(first)) {
            let visible = is_visible(p);
            let Some(at) = self.panel_of_pinhole(p) else { continue };
            run.push(at);
            if visible != was_visible {
                canvas.stroke_polyline(&run, if was_visible { &solid } else { &dashed });
                run = vec![at];
                was_visible = visible;
            }
        }
        canvas.stroke_polyline(&run, if was_visible { &solid } else { &dashed });
    }

    /// Draws the trails of all people; they fade with age, and are faint where something stands before the floor.
    pub(super) fn trails(&self, canvas: &mut Canvas, trails: &Trails) {
        for (person, _) in self.people {
            let places: Vec<(u32, Option<Point2<f64>>)> = trails
                .of(person.id)
                .map(|(age, place)| {
                    let floor = Point3::new(place.x, place.y, 0.0);
                    let band = ((1.0 - age) * f64::from(TRAIL_BANDS)).ceil().max(0.0) as u32;
                    let at = self.camera.real.project(&floor);
                    (2 * band + u32::from(self.is_hidden(&floor)), at)
                })
                .collect();
            // Places of one strength are one line, which reaches to the first place of the next.
            let mut from = 0;
            for line in places.chunk_by(|a, b| a.0 == b.0) {
                let to = (from + line.len() + 1).min(places.len());
                let points: Vec<Point2<f64>> = places[from..to].iter().filter_map(|(_, at)| *at).collect();
                let (band, is_hidden) = (places[from].0 / 2, places[from].0 % 2 == 1);
                let strength = band as f32 / TRAIL_BANDS as f32 * if is_hidden { 0.3 } else { 0.9 };
                let color = Color::of_id(person.id.0).alpha(strength);
                canvas.stroke_polyline(&points, &Stroke::solid(color, self.px(2.5)));
                from += line.len();
            }
        }
    }

    fn is_hidden(&self, floor: &Point3<f64>) -> bool {
        let seen = self.camera.pinhole.camera_from_world * floor;
        let Some(pixel) = self.camera.pinhole.intrinsics.project(&seen) else { return true };
        let (u, v) = (pixel.x.round(), pixel.y.round());
        let is_inside =
            u >= 0.0 && v >= 0.0 && u < self.camera.width() as f64 && v < self.camera.height() as f64;
        let static_z = is_inside
            .then(|| self.camera.static_z_m.get(v as usize * self.camera.width() as usize + u as usize))
            .flatten();
        static_z.is_some_and(|z| f64::from(*z) + FLOOR_SLACK_M < seen.z)
    }

    /// Draws each person's id above the head, with the share of the body that is predicted visible.
    pub(super) fn labels(&self, canvas: &mut Canvas) {
        for (person, body) in self.people {
            if contour::bounding_box(body, &self.camera.real).is_none() {
                continue;
            }
            let head = Point3::new(body.x_m, body.y_m, body.height_m);
            let Some(at) = self.camera.real.project(&head) else {
                continue;
            };
            let visible = person.visible.get(self.index).copied().unwrap_or(0.0);
            let color = Color::of_id(person.id.0);
            let is_lost = visible < 0.05;
            let plate =
                TextStyle::new(self.px(19.0)).bold().on_plate(if is_lost { color.alpha(0.6) } else { color });
            let share = TextStyle::new(self.px(14.0)).on_plate(Color::INK.alpha(0.72));
            let (name, percent) = (person.id.to_string(), format!("{:.0} %", 100.0 * visible));
            let [name_width, height] = plate.size(&name).map(f64::from);
            let [share_width, share_height] = share.size(&percent).map(f64::from);
            let gap = f64::from(self.px(2.0));
            let total = name_width + gap + share_width;
            // Kept inside the panel, so that a person at the border still has a label.
            let left = (at.x - 0.5 * total).clamp(0.0, (f64::from(self.lens.width) - total).max(0.0));
            let top = (at.y - height - f64::from(self.px(6.0)))
                .clamp(0.0, (f64::from(self.lens.height) - height).max(0.0));
            canvas.text(Point2::new(left, top), &name, &plate);
            let beside = Point2::new(left + name_width + gap, top + height - share_height);
            canvas.text(beside, &percent, &share);
        }
    }

    /// Draws the caption of the panel in its corner.
    pub(super) fn caption(&self, canvas: &mut Canvas, text: &str) {
        let style = TextStyle::new(self.px(15.0)).mono().on_plate(Color::INK.alpha(0.72));
        let corner = f64::from(self.px(6.0));
        canvas.text(Point2::new(corner, corner), text, &style);
    }
}
