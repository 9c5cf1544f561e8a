//! Text: glyph outlines become paths, so that any size, weight and halo is drawn by the same rasteriser as the rest.
//!
//! The sans face is Ubuntu Light; on pictures its thin stems get lost, so heavier weights stroke the outline too.

use std::sync::LazyLock;

use ab_glyph::{Font as _, FontRef, OutlineCurve, PxScaleFont, ScaleFont as _};
use nalgebra::Point2;
use tiny_skia::{FillRule, LineJoin, Paint, Path, PathBuilder};

use super::{Canvas, Color};

/// A typeface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Face {
    /// Ubuntu: labels and titles.
    #[default]
    Sans,
    /// Hack, all letters equally wide: numbers that change from frame to frame.
    Mono,
}

/// Thickness of the stems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weight {
    /// The sans face's own weight.
    Light,
    /// Weight of most text.
    #[default]
    Regular,
    /// Weight of ids and titles.
    Bold,
}

/// Look of a text, and the point of its box that is placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextStyle {
    /// Height of a line, from the highest ascender to the lowest descender.
    pub size_px: f32,
    /// Colour of the letters.
    pub color: Color,
    /// Typeface.
    pub face: Face,
    /// Weight of the stems.
    pub weight: Weight,
    /// Colour of a rounded plate behind the text.
    pub plate: Option<Color>,
    /// Colour of a rim around each letter, for text straight on a picture.
    pub halo: Option<Color>,
    /// Point of the text's box that is placed: (0, 0) its top left corner, (1, 1) its bottom right one.
    pub anchor: [f32; 2],
}

impl TextStyle {
    /// Plain dark text of size `size_px`, placed by its top left corner.
    pub const fn new(size_px: f32) -> Self {
        Self {
            size_px,
            color: Color::INK,
            face: Face::Sans,
            weight: Weight::Regular,
            plate: None,
            halo: None,
            anchor: [0.0, 0.0],
        }
    }

    /// The same style in another colour.
    #[must_use]
    pub const fn color(self, color: Color) -> Self {
        Self { color, ..self }
    }

    /// The same style in the mono face.
    #[must_use]
    pub const fn mono(self) -> Self {
        Self { face: Face::Mono, ..self }
    }

    /// The same style in bold.
    #[must_use]
    pub const fn bold(self) -> Self {
        Self { weight: Weight::Bold, ..self }
    }

    /// The same style on a plate of this colour, in letters that contrast with it.
    #[must_use]
    pub fn on_plate(self, plate: Color) -> Self {
        Self { plate: Some(plate), color: plate.text_on(), ..self }
    }

    /// The same style with a rim of this colour around the letters.
    #[must_use]
    pub const fn halo(self, halo: Color) -> Self {
        Self { halo: Some(halo), ..self }
    }

    /// The same style, placed by another point of its box: `anchor(0.5, 1.0)` stands centred above the point.
    #[must_use]
    pub const fn anchor(self, x: f32, y: f32) -> Self {
        Self { anchor: [x, y], ..self }
    }

    /// Space between the letters and the plate's rim.
    fn padding_px(&self) -> f32 {
        if self.plate.is_some() { 0.22 * self.size_px } else { 0.0 }
    }

    /// Width of the stroke that thickens the stems.
    fn embolden_px(&self) -> f32 {
        let em_share = match (self.face, self.weight) {
            (_, Weight::Light) | (Face::Mono, Weight::Regular) => 0.0,
            (Face::Sans, Weight::Regular) => 0.025,
            (Face::Mono, Weight::Bold) => 0.035,
            (Face::Sans, Weight::Bold) => 0.055,
        };
        em_share * self.size_px
    }

    /// Width and height of the text with its plate, pixels.
    pub fn size(&self, text: &str) -> [f32; 2] {
        let font = self.face.font().as_scaled(self.size_px);
        let width = text.lines().map(|line| layout(line, &font).1).fold(0.0, f32::max);
        let lines = text.lines().count().max(1) as f32;
        let pad = self.padding_px();
        // A plate looks centred around the letters when it is padded less above and below: lines carry their own space.
        [width + 2.0 * pad, lines * self.size_px + 0.5 * pad]
    }
}

impl Face {
    fn font(self) -> &'static FontRef<'static> {
        fn load(bytes: &'static [u8]) -> FontRef<'static> {
            // The bytes are compiled in, and the tests draw with both fonts.
            #[expect(clippy::expect_used)]
            FontRef::try_from_slice(bytes).expect("a font compiled into the program is sound")
        }
        static SANS: LazyLock<FontRef<'static>> = LazyLock::new(|| load(epaint_default_fonts::UBUNTU_LIGHT));
        static MONO: LazyLock<FontRef<'static>> = LazyLock::new(|| load(epaint_default_fonts::HACK_REGULAR));
        match self {
            Self::Sans => &SANS,
            Self::Mono => &MONO,
        }
    }
}

/// Glyphs of one line with their offsets, and the width of the line.
fn layout(line: &str, font: &PxScaleFont<&FontRef<'static>>) -> (Vec<(ab_glyph::GlyphId, f32)>, f32) {
    let (mut x, mut last) = (0.0, None);
    let mut glyphs = Vec::with_capacity(line.len());
    for c in line.chars() {
        let id = font.glyph_id(c);
        if let Some(last) = last {
            x += font.kern(last, id);
        }
        glyphs.push((id, x));
        x += font.h_advance(id);
        last = Some(id);
    }
    (glyphs, x)
}

impl Canvas {
    /// Draws a text (lines parted by `\n`) with its anchor point at `at`; returns the box it covers:
    /// left, top, right, bottom, plate included.
    pub fn text(&mut self, at: Point2<f64>, text: &str, style: &TextStyle) -> [f64; 4] {
        let [width, height] = style.size(text);
        let left = at.x as f32 - style.anchor[0] * width;
        let top = at.y as f32 - style.anchor[1] * height;
        if let Some(plate) = style.plate {
            self.fill_rounded_rectangle(
                [f64::from(left), f64::from(top), f64::from(left + width), f64::from(top + height)],
                f64::from(0.28 * style.size_px),
                plate,
            );
        }
        let font = style.face.font().as_scaled(style.size_px);
        let pad = style.padding_px();
        let inner = width - 2.0 * pad;
        let mut builder = PathBuilder::new();
        for (row, line) in text.lines().enumerate() {
            let (glyphs, line_width) = layout(line, &font);
            let baseline = top + 0.25 * pad + row as f32 * style.size_px + font.ascent();
            let start = left + pad + style.anchor[0] * (inner - line_width);
            for (glyph, x) in glyphs {
                push_outline(&mut builder, style.face.font(), glyph, [start + x, baseline], style.size_px);
            }
        }
        if let Some(path) = builder.finish() {
            if let Some(halo) = style.halo {
                self.stroke_glyphs(&path, halo, 0.18 * style.size_px + style.embolden_px());
            }
            self.fill_glyphs(&path, style.color);
            if style.embolden_px() > 0.0 {
                self.stroke_glyphs(&path, style.color, style.embolden_px());
            }
        }
        [left, top, left + width, top + height].map(f64::from)
    }

    fn fill_glyphs(&mut self, path: &Path, color: Color) {
        let mut paint = Paint::default();
        paint.set_color(color.skia());
        self.pixmap.fill_path(path, &paint, FillRule::Winding, self.to_skia, None);
    }

    fn stroke_glyphs(&mut self, path: &Path, color: Color, width_px: f32) {
        let mut paint = Paint::default();
        paint.set_color(color.skia());
        let stroke = tiny_skia::Stroke { width: width_px, line_join: LineJoin::Round, ..Default::default() };
        self.pixmap.stroke_path(path, &paint, &stroke, self.to_skia, None);
    }
}

/// Adds a glyph's outline to the path, its origin at `origin` (baseline, left).
fn push_outline(
    builder: &mut PathBuilder,
    font: &FontRef<'static>,
    glyph: ab_glyph::GlyphId,
    origin: [f32; 2],
    size_px: f32,
) {
    let Some(outline) = font.outline(glyph) else { return };
    let scale = size_px / font.height_unscaled();
    let place = |p: ab_glyph::Point| (origin[0] + p.x * scale, origin[1] - p.y * scale);
    let mut last = None;
    for curve in outline.curves {
        let (start, end) = match &curve {
            OutlineCurve::Line(a, b) => (*a, *b),
            OutlineCurve::Quad(a, _, c) => (*a, *c),
            OutlineCurve::Cubic(a, _, _, d) => (*a, *d),
        };
        if last != Some(start) {
            if last.is_some() {
                builder.close();
            }
            let (x, y) = place(start);
            builder.move_to(x, y);
        }
        match curve {
            OutlineCurve::Line(_, b) => {
                let (x, y) = place(b);
                builder.line_to(x, y);
            }
            OutlineCurve::Quad(_, b, c) => {
                let ((x1, y1), (x, y)) = (place(b), place(c));
                builder.quad_to(x1, y1, x, y);
            }
            OutlineCurve::Cubic(_, b, c, d) => {
                let ((x1, y1), (x2, y2), (x, y)) = (place(b), place(c), place(d));
                builder.cubic_to(x1, y1, x2, y2, x, y);
            }
        }
        last = Some(end);
    }
    if last.is_some() {
        builder.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ink(canvas: Canvas) -> Vec<(u32, u32)> {
        let picture = canvas.into_image();
        picture.enumerate_pixels().filter(|(_, _, p)| p.0 != [255; 3]).map(|(x, y, _)| (x, y)).collect()
    }

    #[test]
    fn text_stays_in_the_box_it_reports_for_every_face_and_anchor() {
        for face in [Face::Sans, Face::Mono] {
            for anchor in [[0.0, 0.0], [0.5, 0.5], [1.0, 1.0]] {
                let style = TextStyle { face, anchor, ..TextStyle::new(24.0) };
                let mut canvas = Canvas::new(300, 200, Color::WHITE);
                let [left, top, right, bottom] =
                    canvas.text(Point2::new(150.0, 100.0), "gÅ 17 | 4,2 m\nÄj", &style);
                let ink = ink(canvas);
                assert!(ink.len() > 200);
                for (x, y) in ink {
                    let (x, y) = (f64::from(x), f64::from(y));
                    assert!(x >= left - 2.0 && x <= right + 2.0 && y >= top - 2.0 && y <= bottom + 2.0);
                }
                let expected = [
                    150.0 - f64::from(anchor[0]) * (right - left),
                    100.0 - f64::from(anchor[1]) * (bottom - top),
                ];
                assert!((left - expected[0]).abs() < 0.01 && (top - expected[1]).abs() < 0.01);
            }
        }
    }

    #[test]
    fn mono_digits_are_equally_wide_and_bold_is_heavier() {
        let mono = TextStyle::new(20.0).mono();
        assert!((mono.size("111")[0] - mono.size("888")[0]).abs() < 1e-3);
        let amount = |weight| {
            let mut canvas = Canvas::new(200, 50, Color::WHITE);
            canvas.text(Point2::new(5.0, 5.0), "Person 7", &TextStyle { weight, ..TextStyle::new(24.0) });
            canvas.into_image().pixels().map(|p| 255 - u64::from(p.0[1])).sum::<u64>()
        };
        assert!(
            amount(Weight::Light) < amount(Weight::Regular) && amount(Weight::Regular) < amount(Weight::Bold)
        );
    }

    #[test]
    fn no_text_draws_nothing() {
        let mut canvas = Canvas::new(50, 50, Color::WHITE);
        canvas.text(Point2::new(5.0, 5.0), "", &TextStyle::new(20.0));
        canvas.text(Point2::new(f64::NAN, 5.0), "x", &TextStyle::new(20.0));
        assert!(ink(canvas).is_empty());
    }
}
