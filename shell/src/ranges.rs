//! Ranges of the numbers in files and options, one constant a kind.
//!
//! A misplaced digit, a number in millimetres or a hostile file must be refused where it comes in: further inside, it is
//! an allocation of all memory, a loop without an end, or an overflow. Each range is far beyond what is useful.
//!
//! ```
//! use shell::ranges::FRAMES;
//! assert_eq!(FRAMES.defect(5.0), None);
//! assert_eq!(FRAMES.defect(1e12).unwrap(), "is 1e12; give 0 to 1000000 frames");
//! ```

use std::fmt;
use std::str::FromStr;

/// Coordinates in a room, on each axis.
pub const ROOM_M: Range = Range::new(-10_000.0, 10_000.0, "metres from the room's origin");
/// Sizes of things: squares of a chessboard, radii, heights.
pub const SIZE_M: Range = Range::new(1e-6, 10_000.0, "metres");
/// Distances between points of a room that are known.
pub const DISTANCE_M: Range = Range::new(1e-6, 100_000.0, "metres");
/// Heights of people's heads, and distances at which people match.
pub const BODY_M: Range = Range::new(0.0, 100.0, "metres");
/// Places and sizes in pictures, which boxes of people may leave.
pub const PIXELS: Range = Range::new(-1e6, 1e6, "pixels");
/// Distances in pictures.
pub const PIXEL_DISTANCE: Range = Range::new(0.0, 1e6, "pixels");
/// Sides of pictures.
pub const SIDE_PX: Range = Range::new(1.0, 20_000.0, "pixels");
/// Focal lengths and principal points.
pub const LENS_PX: Range = Range::new(-1e7, 1e7, "pixels");
/// Coefficients of a lens's distortion.
pub const DISTORTION: Range = Range::new(-1e4, 1e4, "");
/// Numbers of frames.
pub const FRAMES: Range = Range::new(0.0, 1e6, "frames");
/// Numbers of frames, at least one.
pub const SOME_FRAMES: Range = Range::new(1.0, 1e6, "frames");
/// Numbers by which frames are called; a service counts on for years.
pub const FRAME_NUMBER: Range = Range::new(1.0, 4e9, "");
/// Frames a second.
pub const RATE_HZ: Range = Range::new(1e-4, 100_000.0, "frames a second");
/// Waits and intervals.
pub const SECONDS: Range = Range::new(0.0, 1e7, "seconds");
/// Intervals that are longer than none.
pub const INTERVAL_S: Range = Range::new(1e-3, 1e7, "seconds");
/// Times, on any clock: those since 1970 are 1.8e9.
pub const TIME_S: Range = Range::new(-1e11, 1e11, "seconds");
/// Worker threads.
pub const THREADS: Range = Range::new(1.0, 1024.0, "threads");
/// Repetitions of work, parts of a set.
pub const COUNT: Range = Range::new(1.0, 1e6, "");
/// Hypotheses of a person.
pub const HYPOTHESES: Range = Range::new(1.0, 100_000.0, "hypotheses");
/// Areas in pictures.
pub const AREA_PX2: Range = Range::new(0.0, 1e12, "square pixels");
/// Distances of colours, of which 1 is the largest that occurs.
pub const COLOR_DISTANCE: Range = Range::new(0.0, 1000.0, "");
/// Messages and events that wait.
pub const WAITING: Range = Range::new(100.0, 1e7, "events");
/// Times that hypotheses are weighed.
pub const LAYERS: Range = Range::new(1.0, 1000.0, "layers");
/// People in a room at once.
pub const PEOPLE: Range = Range::new(1.0, 10_000.0, "people");
/// Costs, scores and thresholds.
pub const COST: Range = Range::new(-1e9, 1e9, "");

/// Smallest and largest number of a kind, both included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Smallest number.
    pub least: f64,
    /// Largest number.
    pub most: f64,
    /// Unit in words, for error lines; empty for none.
    pub unit: &'static str,
}

impl Range {
    /// Range from the smallest to the largest number.
    pub const fn new(least: f64, most: f64, unit: &'static str) -> Self {
        Self { least, most, unit }
    }

    /// Whether a number is in the range; NaN is in none.
    pub fn contains(&self, value: f64) -> bool {
        (self.least..=self.most).contains(&value)
    }

    /// Defect of a number out of the range, as in `is 1e12; give 0 to 1000000 frames`.
    pub fn defect(&self, value: f64) -> Option<String> {
        (!self.contains(value)).then(|| format!("is {}; give {self}", shown(value)))
    }

    /// Parser of a number in the range, for the command line.
    pub fn number(self) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
        move |text| self.parse(text)
    }

    /// Parser of a whole number in the range, for the command line.
    pub fn whole<T: FromStr>(self) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
        move |text| {
            let value = self.parse(text)?;
            // The text may be `1e3`, or have a fraction.
            let number = if value.fract() == 0.0 { text.trim().parse().ok() } else { None };
            number.ok_or_else(|| format!("give a whole number, {self}"))
        }
    }

    fn parse(&self, text: &str) -> Result<f64, String> {
        let number = text.trim().parse().ok().filter(|value| self.contains(*value));
        number.ok_or_else(|| format!("give {self}"))
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gap = if self.unit.is_empty() { "" } else { " " };
        write!(f, "{} to {}{gap}{}", shown(self.least), shown(self.most), self.unit)
    }
}

/// A number for an error line: neither 300 digits nor 300 zeros.
pub fn shown(value: f64) -> String {
    let size = value.abs();
    if size >= 1e10 || (size > 0.0 && size < 1e-3) { format!("{value:e}") } else { format!("{value}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_a_range_are_refused_with_the_range() {
        for value in [f64::NAN, f64::INFINITY, -10_000.5, 1e308] {
            let line = ROOM_M.defect(value).unwrap();
            assert!(
                line.contains("-10000 to 10000 metres from the room's origin") && line.len() < 100,
                "{line}"
            );
        }
        for value in [-10_000.0, -0.0, 3.25, 10_000.0] {
            assert_eq!(ROOM_M.defect(value), None);
        }
    }

    #[test]
    fn arguments_are_numbers_in_their_range() {
        assert_eq!(THREADS.whole::<usize>()("8"), Ok(8));
        assert_eq!(RATE_HZ.number()("12.5"), Ok(12.5));
        for text in ["0", "1000000000", "-1", "many", "", "NaN", "1e400"] {
            assert_eq!(THREADS.whole::<usize>()(text), Err("give 1 to 1024 threads".into()), "{text}");
        }
        for text in ["1.5", "1e2"] {
            assert!(THREADS.whole::<usize>()(text).unwrap_err().contains("whole number"), "{text}");
        }
        assert!(RATE_HZ.number()("0").unwrap_err().contains("1e-4 to 100000 frames a second"));
    }
}
