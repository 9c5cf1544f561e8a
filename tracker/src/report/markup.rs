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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escape("<a b='\"&'>"), "&lt;a b=&#39;&quot;&amp;&#39;&gt;");
    }
}
