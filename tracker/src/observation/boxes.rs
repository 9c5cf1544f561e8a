//! Boxes that a detector drew around people.

use std::sync::Arc;

/// Box around one person in a camera's pinhole image at the working size. Pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct PersonBox {
    /// Column of the left edge.
    pub left: f64,
    /// Row of the upper edge.
    pub top: f64,
    /// Column of the right edge.
    pub right: f64,
    /// Row of the lower edge.
    pub bottom: f64,
    /// Whether the image's border cuts the box at its left, upper, right and lower edge: the person may go on beyond.
    pub cut: [bool; 4],
    /// Appearance vector of a re-identification network, of any length; `None` without one.
    pub appearance: Option<Arc<[f32]>>,
}
