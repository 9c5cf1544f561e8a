//! Representative colours of a person (Nakazawa et al., section 3.1).

use image::Rgb;

use crate::identity::appearance;
use crate::observation::Colours;
use crate::silhouette::{Silhouette, View};

/// Colour of clothes. Shade changes hue and saturation little, and brightness much.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Colour {
    /// Hue, degrees, 0 to 360.
    pub hue_deg: f32,
    /// Saturation, 0 (grey) to 1.
    pub saturation: f32,
    /// Brightness, 0 to 1.
    pub value: f32,
}

/// Representative colours of a person in one camera at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Looks {
    /// Three colours, from the head down.
    pub colours: [Colour; 3],
}

/// Bands of the body in which colours are measured, in fractions of the visible silhouette's height from its top:
/// chest, hip, legs. Heads and feet are left out because they are small and alike.
const BANDS: [std::ops::Range<f64>; 3] = [0.18..0.38, 0.38..0.55, 0.58..0.88];
/// Minimum number of samples of a band.
const LEAST_SAMPLES: u32 = 6;

impl Colour {
    /// The colour of mean red, green and blue levels, 0 to 255 (hexcone model; Smith, "Color gamut transform pairs",
    /// SIGGRAPH 1978).
    pub fn of_levels([r, g, b]: [f64; 3]) -> Self {
        let (most, least) = (r.max(g).max(b), r.min(g).min(b));
        let range = most - least;
        let sixths = if range <= 0.0 {
            0.0
        } else if r >= most {
            ((g - b) / range).rem_euclid(6.0)
        } else if g >= most {
            (b - r) / range + 2.0
        } else {
            (r - g) / range + 4.0
        };
        let saturation = if most > 0.0 { range / most } else { 0.0 };
        Self { hue_deg: (60.0 * sixths) as f32, saturation: saturation as f32, value: (most / 255.0) as f32 }
    }
}

impl Looks {
    /// Mean colours of the bands of a person's visible silhouette; `None` when a band has too few samples.
    pub fn of_part(colours: &Colours, view: &View, part: &Silhouette) -> Option<Self> {
        let mut sums = [([0.0; 3], 0_u32); 3];
        for (height, samples) in appearance::middle_rows(colours, view, part) {
            let Some(band) = BANDS.iter().position(|band| band.contains(&height)) else { continue };
            let (sum, count) = &mut sums[band];
            for Rgb(levels) in samples {
                sum.iter_mut().zip(levels).for_each(|(sum, level)| *sum += f64::from(level));
                *count += 1;
            }
        }
        if sums.iter().any(|(_, count)| *count < LEAST_SAMPLES) {
            return None;
        }
        let colours = sums.map(|(sum, count)| Colour::of_levels(sum.map(|level| level / f64::from(count))));
        Some(Self { colours })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_the_hexcone() {
        // Corners of the cube, and a colour worked out by hand: range 100 of 200, a quarter of the way from red to yellow.
        let of = Colour::of_levels;
        let cases = [
            ([255.0, 0.0, 0.0], [0.0, 1.0, 1.0]),
            ([255.0, 255.0, 0.0], [60.0, 1.0, 1.0]),
            ([0.0, 255.0, 255.0], [180.0, 1.0, 1.0]),
            ([255.0, 0.0, 255.0], [300.0, 1.0, 1.0]),
            ([51.0, 51.0, 51.0], [0.0, 0.0, 0.2]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([204.0, 127.5, 102.0], [15.0, 0.5, 0.8]),
        ];
        for (levels, expected) in cases {
            let Colour { hue_deg, saturation, value } = of(levels);
            for (found, expected) in [hue_deg, saturation, value].into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-4, "{levels:?}: {:?}", of(levels));
            }
        }
    }
}
