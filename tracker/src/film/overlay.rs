//! The left panel: the real picture with what the tracker believes.

use nalgebra::{Point2, Point3};
use scenes::canvas::{Canvas, Color, Stroke, TextStyle};

use super::layers::Layers;
use super::lens::Lens;
use super::trails::Trails;
use crate::PersonEstimate;
use crate::silhouette::{Body, contour};
use crate::stage::StageCamera;

/// How far inside the outline its visibility is read, pixels.
const INSIDE_PX: f64 = 2.0;
/// A floor point this much behind the static surface still lies on it, metres.
const FLOOR_SLACK_M: f64 = 0.15;

/// What the drawing of one panel needs.
pub(super) struct Panel<'a> {
    pub(super) camera: &'a StageCamera,
    pub(super) lens: &'a Lens,
    pub(super) layers: &'a Layers,
    /// The people, with their bodies, in the order of the layers.
    pub(super) people: &'a [(&'a PersonEstimate, Body)],
    /// Index of this camera in the estimates' visible fractions.
    pub(super) index: usize,
}

impl Panel<'_> {
    /// A length that reads alike at every scale.
    fn px(&self, length: f32) -> f32 {
        length * (self.lens.height as f32 / 480.0).clamp(0.75, 2.5)
    }

    fn panel_of_pinhole(&self, pixel: &Point2<f64>) -> Option<Point2<f64>> {
        self.camera.to_real(pixel).map(|real| self.lens.panel(real))
    }

    /// Tints what is predicted visible of everybody, dims what is predicted hidden, draws the outlines.
    pub(super) fn silhouettes(&self, canvas: &mut Canvas, is_tinted: bool) {
        for (index, (person, body)) in self.people.iter().enumerate() {
            let color = Color::of_id(person.id.0);
            let around = contour::points(body, &self.camera.pinhole.center());
            let outline: Vec<Point2<f64>> =
                around.iter().filter_map(|p| self.camera.pinhole.project(p)).collect();
            let on_panel: Vec<Point2<f64>> =
                outline.iter().filter_map(|p| self.panel_of_pinhole(p)).collect();
            if is_tinted {
                canvas.fill_polygon(&on_panel, color.alpha(0.12));
                let pixels = self.layers.owner.len();
                let visible = self.lens.mask(pixels, |i| usize::from(self.layers.owner[i]) == index + 1);
                canvas.tint(&visible, color.alpha(0.38));
            }
            self.stroke_outline(canvas, index, &outline, color);
        }
    }

    /// Solid where the body is predicted visible, dashed where it is hidden.
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

    /// Draws where everybody has just walked; fading with age, and faint where something stands before the floor.
    pub(super) fn trails(&self, canvas: &mut Canvas, trails: &Trails) {
        for (person, _) in self.people {
            let color = Color::of_id(person.id.0);
            let mut before: Option<Point2<f64>> = None;
            for (age, place) in trails.of(person.id) {
                let floor = Point3::new(place.x, place.y, 0.0);
                let at = self.camera.real.project(&floor).map(|real| self.lens.panel(real));
                if let (Some(from), Some(to)) = (before, at) {
                    let strength = (1.0 - age) as f32 * if self.is_hidden(&floor) { 0.3 } else { 0.9 };
                    canvas.stroke_polyline(&[from, to], &Stroke::solid(color.alpha(strength), self.px(2.5)));
                }
                before = at;
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

    /// Names everybody above the head, with the share of the body that is predicted visible.
    pub(super) fn labels(&self, canvas: &mut Canvas) {
        for (person, body) in self.people {
            if contour::bounding_box(body, &self.camera.real).is_none() {
                continue;
            }
            let head = Point3::new(body.x_m, body.y_m, body.height_m);
            let Some(at) = self.camera.real.project(&head).map(|real| self.lens.panel(real)) else {
                continue;
            };
            let visible = person.visible.get(self.index).copied().unwrap_or(0.0);
            let color = Color::of_id(person.id.0);
            let is_lost = visible < 0.05;
            let plate = TextStyle::new(self.px(19.0)).bold().on_plate(if is_lost {
                color.alpha(0.55)
            } else {
                color
            });
            let share =
                TextStyle::new(self.px(13.0)).mono().color(Color::WHITE).halo(Color::BLACK.alpha(0.7));
            let (name, percent) = (person.id.to_string(), format!("{:.0} %", 100.0 * visible));
            let [name_width, height] = plate.size(&name).map(f64::from);
            let [share_width, share_height] = share.size(&percent).map(f64::from);
            let gap = f64::from(self.px(3.0));
            let total = name_width + gap + share_width;
            // Kept inside the panel, so that somebody half out of the picture still has a name.
            let left = (at.x - 0.5 * total).clamp(0.0, (f64::from(self.lens.width) - total).max(0.0));
            let top = (at.y - height - f64::from(self.px(6.0)))
                .clamp(0.0, (f64::from(self.lens.height) - height).max(0.0));
            canvas.text(Point2::new(left, top), &name, &plate);
            let beside = Point2::new(left + name_width + gap, top + 0.5 * (height - share_height));
            canvas.text(beside, &percent, &share);
        }
    }

    /// Says what the panel shows, in its corner.
    pub(super) fn caption(&self, canvas: &mut Canvas, text: &str) {
        let style = TextStyle::new(self.px(15.0)).mono().on_plate(Color::INK.alpha(0.72));
        let corner = f64::from(self.px(6.0));
        canvas.text(Point2::new(corner, corner), text, &style);
    }
}
