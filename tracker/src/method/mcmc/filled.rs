//! Rectangle that a person at a place would fill in an image, which birth maps and rescues compare with the
//! foreground.

use std::ops::Range;

use crate::likelihood::Layers;
use crate::silhouette::{Body, Silhouette, View};

/// Upper fraction of a standing person's height, which a sitting person reaches and a chair does not.
pub(super) const UPPER_BODY: f64 = 0.4;

/// Pixels that a person at a place would fill in one camera.
#[derive(Debug, Clone)]
pub(super) struct Filled {
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
    /// Pixels of the rectangle that the room does not hide.
    pub(super) visible_px: u32,
    /// Upper rows of the rectangle, a fraction [`UPPER_BODY`] of them, and the pixels there that the room does not
    /// hide.
    pub(super) upper_rows: Range<usize>,
    pub(super) upper_visible_px: u32,
    /// Pixels of the person's innermost shape, hidden or not.
    pub(super) area_px: u32,
}

impl Filled {
    /// Rectangle in the middle of a body's innermost shape in one camera, which a person at the place nearly always
    /// fills.
    pub(super) fn of(layers: &Layers, camera: usize, body: &Body) -> Self {
        let view: &View = &layers.views()[camera];
        let mut core = Silhouette::default();
        layers.draw(layers.innermost(camera), body, &mut core);
        let (mut columns, mut widest) = (0..0, 0);
        for row in core.row_range() {
            let width = core.row_width(row);
            if width.len() > widest {
                (columns, widest) = (width.clone(), width.len());
            }
        }
        // The narrower middle of an ellipse's widest row is inside it over most of its rows.
        let inset = columns.len() / 6;
        let columns = (columns.start + inset)..(columns.end - inset).min(view.width as usize);
        let rows = core.row_range();
        let upper_rows = rows.start..rows.start + (UPPER_BODY * rows.len() as f64).round() as usize;
        let visible_px = |rows: &Range<usize>| {
            let pixels = rows.clone().flat_map(|v| columns.clone().map(move |u| (u, v)));
            pixels.filter(|(u, v)| core.contains(*u as u32, *v as u32)).count() as u32
        };
        Self {
            visible_px: visible_px(&rows),
            upper_visible_px: visible_px(&upper_rows),
            area_px: core.area_px,
            rows,
            upper_rows,
            columns,
        }
    }
}
