//! Non-maximum suppression.

use super::Found;

/// Keeps what overlaps with nothing surer by more than `max_overlap` (IoU). `found` comes the surest first, and so does
/// the result.
pub fn keep_surest(found: &[Found], max_overlap: f64) -> Vec<Found> {
    let mut kept: Vec<Found> = Vec::new();
    for candidate in found {
        if kept.iter().all(|k| k.pixel_box.iou(&candidate.pixel_box) <= max_overlap) {
            kept.push(*candidate);
        }
    }
    kept
}
