//! Colours, and the palette that distinguishes people.

use image::Rgb;

/// A colour with opacity, sRGB, not premultiplied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Color {
    /// Red.
    pub r: u8,
    /// Green.
    pub g: u8,
    /// Blue.
    pub b: u8,
    /// Opacity: 255 covers what is below.
    pub a: u8,
}

/// Colours of Okabe & Ito (2008), which viewers with any of the common colour-vision deficiencies can tell apart, in an
/// order that sets neighbours far apart. Black is left out: on pictures it is taken for shadow.
const PEOPLE: [Color; 7] = [
    Color::rgb(213, 94, 0),    // vermilion
    Color::rgb(86, 180, 233),  // sky blue
    Color::rgb(0, 158, 115),   // bluish green
    Color::rgb(240, 228, 66),  // yellow
    Color::rgb(204, 121, 167), // reddish purple
    Color::rgb(0, 114, 178),   // blue
    Color::rgb(230, 159, 0),   // orange
];

impl Color {
    /// White.
    pub const WHITE: Self = Self::rgb(255, 255, 255);
    /// Black.
    pub const BLACK: Self = Self::rgb(0, 0, 0);
    /// Almost black, slightly blue: text and lines on light ground.
    pub const INK: Self = Self::rgb(33, 37, 44);
    /// Warm white: the ground of plans and figures.
    pub const PAPER: Self = Self::rgb(250, 249, 246);

    /// An opaque colour.
    pub const fn rgb(r: u8, g: u8, b: u8) -> Self {
        Self { r, g, b, a: 255 }
    }

    /// The same colour with another opacity, 0 to 1.
    #[must_use]
    pub fn alpha(self, opacity: f32) -> Self {
        Self { a: (opacity.clamp(0.0, 1.0) * 255.0).round() as u8, ..self }
    }

    /// A mixture: this colour at `t = 0`, the other at 1.
    #[must_use]
    pub fn mix(self, other: Self, t: f32) -> Self {
        let t = t.clamp(0.0, 1.0);
        let between = |a: u8, b: u8| (f32::from(a) + (f32::from(b) - f32::from(a)) * t).round() as u8;
        Self {
            r: between(self.r, other.r),
            g: between(self.g, other.g),
            b: between(self.b, other.b),
            a: between(self.a, other.a),
        }
    }

    /// The colour of a person, by id: Okabe and Ito's seven, then their lighter and their darker shades.
    pub fn of_id(id: u32) -> Self {
        let base = PEOPLE[id as usize % PEOPLE.len()];
        match id as usize / PEOPLE.len() % 3 {
            0 => base,
            1 => base.mix(Self::WHITE, 0.45),
            _ => base.mix(Self::BLACK, 0.35),
        }
    }

    /// Black or white, whichever reads better on this colour (WCAG relative luminance).
    #[must_use]
    pub fn text_on(self) -> Self {
        let linear = |c: u8| (f32::from(c) / 255.0).powf(2.2);
        let luminance = 0.2126 * linear(self.r) + 0.7152 * linear(self.g) + 0.0722 * linear(self.b);
        // At this luminance the contrast ratios (L + 0.05) / 0.05 and 1.05 / (L + 0.05) are equal.
        if luminance > 0.179 { Self::INK } else { Self::WHITE }
    }

    pub(super) fn skia(self) -> tiny_skia::Color {
        tiny_skia::Color::from_rgba8(self.r, self.g, self.b, self.a)
    }
}

impl From<Rgb<u8>> for Color {
    fn from(Rgb([r, g, b]): Rgb<u8>) -> Self {
        Self::rgb(r, g, b)
    }
}

impl From<Color> for Rgb<u8> {
    fn from(c: Color) -> Self {
        Self([c.r, c.g, c.b])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn linear(c: Color) -> Vector3<f64> {
        Vector3::new(c.r, c.g, c.b).map(|v| (f64::from(v) / 255.0).powf(2.2))
    }

    /// Distance in CIE L*a*b* between two colours given in linear RGB.
    fn lab_distance(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
        let lab = |c: Vector3<f64>| {
            let xyz = Matrix3::new(0.4124, 0.3576, 0.1805, 0.2126, 0.7152, 0.0722, 0.0193, 0.1192, 0.9505)
                * c.map(|v| v.max(0.0));
            let f = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
            let (x, y, z) = (f(xyz.x / 0.9505), f(xyz.y), f(xyz.z / 1.089));
            Vector3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
        };
        (lab(a) - lab(b)).norm()
    }

    #[test]
    fn people_differ_for_every_common_kind_of_eye() {
        // Viénot, Brettel & Mollon 1999: what a protanope and a deuteranope see, in linear RGB.
        let normal = Matrix3::identity();
        let protanope = Matrix3::new(0.11238, 0.88762, 0.0, 0.11238, 0.88762, 0.0, 0.00401, -0.00401, 1.0);
        let deuteranope = Matrix3::new(0.29275, 0.70725, 0.0, 0.29275, 0.70725, 0.0, -0.02234, 0.02234, 1.0);
        for eye in [normal, protanope, deuteranope] {
            for i in 0..7 {
                for j in 0..i {
                    let d = lab_distance(eye * linear(Color::of_id(i)), eye * linear(Color::of_id(j)));
                    assert!(d > 10.0, "ids {i} and {j} are {d} apart, 2.3 is just noticeable");
                }
            }
        }
        let all: std::collections::HashSet<_> = (0..21).map(|i| format!("{:?}", Color::of_id(i))).collect();
        assert_eq!(all.len(), 21);
    }

    #[test]
    fn text_contrasts_with_its_plate() {
        assert_eq!(Color::WHITE.text_on(), Color::INK);
        assert_eq!(Color::BLACK.text_on(), Color::WHITE);
        assert_eq!(Color::of_id(3).text_on(), Color::INK); // yellow
        assert_eq!(Color::of_id(5).text_on(), Color::WHITE); // blue
    }

    #[test]
    fn mixtures_run_from_one_colour_to_the_other() {
        let (a, b) = (Color::rgb(0, 100, 200), Color::rgb(200, 100, 0).alpha(0.0));
        assert_eq!((a.mix(b, 0.0), a.mix(b, 1.0)), (a, b));
        assert_eq!(a.mix(b, 0.5), Color { r: 100, g: 100, b: 100, a: 128 });
    }
}
