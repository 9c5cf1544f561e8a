//! Non-maximum suppression.

use super::DetectedPerson;

/// Keeps each detection that overlaps none with a higher score by more than `max_overlap` (IoU). `found` is sorted by
/// descending score, and so is the result.
pub fn keep_surest(found: &[DetectedPerson], max_overlap: f64) -> Vec<DetectedPerson> {
    let mut kept: Vec<DetectedPerson> = Vec::new();
    for candidate in found {
        if kept.iter().all(|k| k.pixel_box.iou(&candidate.pixel_box) <= max_overlap) {
            kept.push(*candidate);
        }
    }
    kept
}
