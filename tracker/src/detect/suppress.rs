//! Non-maximum suppression.

use super::Found;

/// Keeps each detection that overlaps none with a higher score by more than `max_overlap` (IoU). `found` is sorted by
/// descending score, and so is the result.
pub fn keep_surest(found: &[Found], max_overlap: f64) -> Vec<Found> {
    let mut kept: Vec<Found> = Vec::new();
    for candidate in found {
        if kept.iter().all(|k| k.pixel_box.iou(&candidate.pixel_box) <= max_overlap) {
            kept.push(*candidate);
        }
    }
    kept
}
