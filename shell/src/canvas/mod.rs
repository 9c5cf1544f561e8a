//! Drawing: antialiased shapes and text over a picture; the only module of the project that draws.
//!
//! Coordinates are pixels as everywhere in the project: (0, 0) is the **centre** of the top left pixel, so the results
//! of `calib::Camera::project` can be drawn as they are. Points that are not finite are left out; shapes beyond the
//! picture's rim are clipped. A film needs one conversion a frame: [`Canvas::from_image`], draw,
//! [`Canvas::into_image`].

mod color;
mod text;

use image::{GrayImage, RgbImage};
use nalgebra::Point2;
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PremultipliedColorU8, StrokeDash,
    Transform,
};

pub use color::Color;
pub use text::{Face, TextStyle, Weight};

/// Longest side of a canvas.
const MAX_SIDE_PX: u32 = 16_384;
/// Bound to which points further out are moved: the rasteriser's fixed-point numbers end not far beyond.
const FURTHEST_PX: f64 = 30_000.0;

/// Style of a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
    /// Colour of the line.
    pub color: Color,
    /// Width of the line.
    pub width_px: f32,
    /// Lengths of dash and gap; `None` for a solid line.
    pub dash_px: Option<[f32; 2]>,
}

impl Stroke {
    /// A solid line.
    pub const fn solid(color: Color, width_px: f32) -> Self {
        Self { color, width_px, dash_px: None }
    }

    /// A dashed line: dashes three widths long, gaps of two and a half.
    pub const fn dashed(color: Color, width_px: f32) -> Self {
        Self { color, width_px, dash_px: Some([3.0 * width_px, 2.5 * width_px]) }
    }
}

/// A picture being drawn on.
#[derive(Debug, Clone)]
pub struct Canvas {
    pixmap: Pixmap,
    /// Transform from the project's pixel centres to the rasteriser's pixel corners.
    to_skia: Transform,
}

impl Canvas {
    /// An empty canvas of one colour; sides are clamped to 1 … 16 384 pixels.
    pub fn new(width: u32, height: u32, ground: Color) -> Self {
        // Sides in this range are all that `Pixmap::new` asks for.
        #[expect(clippy::expect_used, clippy::missing_panics_doc)]
        let mut pixmap = Pixmap::new(width.clamp(1, MAX_SIDE_PX), height.clamp(1, MAX_SIDE_PX))
            .expect("a pixmap of 1 to 16384 pixels a side exists");
        pixmap.fill(Color { a: 255, ..ground }.skia());
        Self { pixmap, to_skia: Transform::from_translate(0.5, 0.5) }
    }

    /// A canvas that starts with a picture.
    pub fn from_image(image: &RgbImage) -> Self {
        let mut canvas = Self::new(image.width(), image.height(), Color::BLACK);
        canvas.blit(image, 0, 0);
        canvas
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.pixmap.width()
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.pixmap.height()
    }

    /// The finished picture.
    pub fn into_image(self) -> RgbImage {
        self.to_image()
    }

    /// A copy of the picture as it is now.
    pub fn to_image(&self) -> RgbImage {
        // The ground is opaque, so every pixel is, and premultiplied colours are plain ones.
        let mut image = RgbImage::new(self.width(), self.height());
        for (to, from) in image.chunks_exact_mut(3).zip(self.pixmap.data().chunks_exact(4)) {
            to.copy_from_slice(&from[..3]);
        }
        image
    }

    /// Copies a picture onto the canvas, its top left pixel at (`x`, `y`); what hangs over is cut off.
    pub fn blit(&mut self, image: &RgbImage, x: i64, y: i64) {
        let (width, height) = (i64::from(self.width()), i64::from(self.height()));
        let (left, right) = (x.clamp(0, width), (x + i64::from(image.width())).clamp(0, width));
        let (top, bottom) = (y.clamp(0, height), (y + i64::from(image.height())).clamp(0, height));
        if left >= right {
            return;
        }
        let pixels = self.pixmap.data_mut();
        for row in top..bottom {
            let to = &mut pixels[((row * width + left) * 4) as usize..((row * width + right) * 4) as usize];
            let from = ((row - y) * i64::from(image.width()) + left - x) as usize * 3;
            for (to, from) in to.chunks_exact_mut(4).zip(image.as_raw()[from..].chunks_exact(3)) {
                to[..3].copy_from_slice(from);
                to[3] = 255;
            }
        }
    }

    /// Mixes a colour (by its opacity) into every pixel whose mask is not 0; a mask of another size is cut or falls short.
    pub fn tint(&mut self, mask: &GrayImage, color: Color) {
        let t = f32::from(color.a) / 255.0;
        let (canvas_width, width) = (self.width() as usize, mask.width().max(1) as usize);
        let rows = self.pixmap.pixels_mut().chunks_exact_mut(canvas_width);
        for (pixels, mask) in rows.zip(mask.as_raw().chunks_exact(width)) {
            for (pixel, _) in pixels.iter_mut().zip(mask).filter(|(_, m)| **m != 0) {
                let mixed =
                    Color::rgb(pixel.red(), pixel.green(), pixel.blue()).mix(Color { a: 255, ..color }, t);
                // Opaque colours are always valid premultiplied ones; the old pixel stays otherwise.
                *pixel = PremultipliedColorU8::from_rgba(mixed.r, mixed.g, mixed.b, 255).unwrap_or(*pixel);
            }
        }
    }

    /// Fills a polygon.
    pub fn fill_polygon(&mut self, points: &[Point2<f64>], color: Color) {
        self.fill_rings(std::slice::from_ref(&points), color);
    }

    /// Fills what lies inside an odd number of rings: polygons with holes, or several at once.
    pub fn fill_rings<R: AsRef<[Point2<f64>]>>(&mut self, rings: &[R], color: Color) {
        let mut builder = PathBuilder::new();
        for ring in rings {
            push_points(&mut builder, ring.as_ref(), true);
        }
        if let Some(path) = builder.finish() {
            self.fill_path(&path, color);
        }
    }

    /// Draws a polygon's closed outline.
    pub fn stroke_polygon(&mut self, points: &[Point2<f64>], stroke: &Stroke) {
        self.stroke_points(points, true, stroke);
    }

    /// Draws an open line through points.
    pub fn stroke_polyline(&mut self, points: &[Point2<f64>], stroke: &Stroke) {
        self.stroke_points(points, false, stroke);
    }

    /// Fills a disc.
    pub fn fill_circle(&mut self, center: Point2<f64>, radius_px: f64, color: Color) {
        if let Some(path) = circle(center, radius_px) {
            self.fill_path(&path, color);
        }
    }

    /// Draws a circle.
    pub fn stroke_circle(&mut self, center: Point2<f64>, radius_px: f64, stroke: &Stroke) {
        if let Some(path) = circle(center, radius_px) {
            self.stroke_path(&path, stroke);
        }
    }

    /// Fills an upright rectangle (left, top, right, bottom) with rounded corners.
    pub fn fill_rounded_rectangle(&mut self, bounds: [f64; 4], corner_px: f64, color: Color) {
        if let Some(path) = rounded_rectangle(bounds, corner_px) {
            self.fill_path(&path, color);
        }
    }

    /// Draws the outline of an upright rectangle (left, top, right, bottom) with rounded corners.
    pub fn stroke_rounded_rectangle(&mut self, bounds: [f64; 4], corner_px: f64, stroke: &Stroke) {
        if let Some(path) = rounded_rectangle(bounds, corner_px) {
            self.stroke_path(&path, stroke);
        }
    }

    fn stroke_points(&mut self, points: &[Point2<f64>], closed: bool, stroke: &Stroke) {
        let mut builder = PathBuilder::new();
        push_points(&mut builder, points, closed);
        if let Some(path) = builder.finish() {
            self.stroke_path(&path, stroke);
        }
    }

    fn fill_path(&mut self, path: &Path, color: Color) {
        let mut paint = Paint::default();
        paint.set_color(color.skia());
        self.pixmap.fill_path(path, &paint, FillRule::EvenOdd, self.to_skia, None);
    }

    fn stroke_path(&mut self, path: &Path, stroke: &Stroke) {
        let mut paint = Paint::default();
        paint.set_color(stroke.color.skia());
        let style = tiny_skia::Stroke {
            width: stroke.width_px,
            line_cap: if stroke.dash_px.is_some() { LineCap::Butt } else { LineCap::Round },
            line_join: LineJoin::Round,
            dash: stroke.dash_px.and_then(|[on, off]| StrokeDash::new(vec![on, off], 0.0)),
            ..Default::default()
        };
        self.pixmap.stroke_path(path, &paint, &style, self.to_skia, None);
    }
}

/// Adds a line through the finite ones of some points.
fn push_points(builder: &mut PathBuilder, points: &[Point2<f64>], closed: bool) {
    let mut started = false;
    for p in points.iter().filter(|p| p.x.is_finite() && p.y.is_finite()) {
        let [x, y] = [p.x, p.y].map(|c| c.clamp(-FURTHEST_PX, FURTHEST_PX) as f32);
        if started {
            builder.line_to(x, y);
        } else {
            builder.move_to(x, y);
        }
        started = true;
    }
    if started && closed {
        builder.close();
    }
}

/// A circle's path; `None` when it is not finite, empty, or wholly beyond what can be drawn.
fn circle(center: Point2<f64>, radius_px: f64) -> Option<Path> {
    let drawable = center.coords.iter().all(|c| c.abs() < FURTHEST_PX) && radius_px < FURTHEST_PX;
    // NaN fails every comparison, so only finite circles come through.
    (drawable && radius_px > 0.0)
        .then(|| PathBuilder::from_circle(center.x as f32, center.y as f32, radius_px as f32))
        .flatten()
}

fn rounded_rectangle(bounds: [f64; 4], corner_px: f64) -> Option<Path> {
    /// Length of a cubic's handles for a quarter circle, as a share of its radius.
    const HANDLE: f32 = 0.552_284_8;
    if !(bounds.iter().all(|b| b.is_finite()) && bounds[0] < bounds[2] && bounds[1] < bounds[3]) {
        return None;
    }
    let [left, top, right, bottom] = bounds.map(|b| b.clamp(-FURTHEST_PX, FURTHEST_PX) as f32);
    let r = (corner_px as f32).clamp(0.0, 0.5 * (right - left).min(bottom - top));
    let h = r * (1.0 - HANDLE);
    let mut path = PathBuilder::new();
    path.move_to(left + r, top);
    path.line_to(right - r, top);
    path.cubic_to(right - h, top, right, top + h, right, top + r);
    path.line_to(right, bottom - r);
    path.cubic_to(right, bottom - h, right - h, bottom, right - r, bottom);
    path.line_to(left + r, bottom);
    path.cubic_to(left + h, bottom, left, bottom - h, left, bottom - r);
    path.line_to(left, top + r);
    path.cubic_to(left, top + h, left + h, top, left + r, top);
    path.close();
    path.finish()
}

#[cfg(test)]
mod tests;
