//! A vertex of a file of geometry.

/// Grey level of elements without a colour, of 255.
const GREY: f32 = 180.0;

/// A vertex as its file has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScanVertex {
    /// In the file's world; one far away needs the digits of a double.
    pub(crate) position: [f64; 3],
    /// Of any length; zero where the file states none.
    pub(crate) normal: [f32; 3],
    /// Red, green, blue, of `full_level` of its [`Scan`](super::scan::Scan).
    pub(crate) color: [f32; 3],
    /// In the file's unit.
    pub(crate) radius: f32,
    /// As [`Disc::filled`](super::Disc::filled).
    pub(crate) filled: bool,
    /// As [`Disc::confidence`](super::Disc::confidence).
    pub(crate) confidence: f32,
}

impl Default for ScanVertex {
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            normal: [0.0; 3],
            color: [GREY; 3],
            radius: 0.0,
            filled: false,
            confidence: 1.0,
        }
    }
}
