//! HTML and SVG helpers of all sections.

use std::fmt::Write;
use std::io::Cursor;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use shell::canvas::Color;

/// Escapes text for use between tags and in quoted attributes.
pub(super) fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c => safe.push(c),
        }
    }
    safe
}

/// A colour in CSS notation.
pub(super) fn css(color: Color) -> String {
    format!("#{:02x}{:02x}{:02x}", color.r, color.g, color.b)
}

/// A picture as a `data:` URL.
pub(super) fn data_url(image: &RgbImage, quality: u8) -> String {
    let mut bytes = Cursor::new(Vec::new());
    // Encoding to memory fails only for empty pictures; the page then shows the caption alone.
    if JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(image).is_err() {
        return "data:,".into();
    }
    format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(bytes.into_inner()))
}

/// SVG path `M x,y L x,y …` through points.
pub(super) fn path(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let mut path = String::new();
    for (index, (x, y)) in points.into_iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(path, "{}{x:.1},{y:.1}", if index == 0 { "M" } else { "L" });
    }
    path
}

/// Round ticks of an axis from 0 to `end`, with steps of 1, 2 or 5 times a power of ten; at most about `count` of them.
pub(super) fn ticks(end: f64, count: usize) -> Vec<f64> {
    if !(end > 0.0 && end.is_finite()) || count == 0 {
        return vec![0.0];
    }
    let raw = end / count as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw).unwrap_or(raw);
    (0..=(end / step + 1e-9) as usize).map(|i| i as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escape("<a b='\"&'>"), "&lt;a b=&#39;&quot;&amp;&#39;&gt;");
    }

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(ticks(25.0, 6), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0]);
        let fine = ticks(0.9, 5);
        assert!(fine.len() == 5 && (fine[4] - 0.8).abs() < 1e-12, "{fine:?}");
        for end in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(ticks(end, 5), [0.0]);
        }
    }
}
