//! The file of tracks.

use std::fmt::Write;

use super::Linked;
use super::fill::TrackRow;

/// MOTChallenge rows, ordered by frame and id: boxes, or floor positions.
pub fn track_file(linked: &Linked) -> String {
    let mut rows: Vec<(u32, u32, &TrackRow)> = linked
        .ids
        .iter()
        .zip(&linked.tracks)
        .flat_map(|(id, track)| track.iter().map(move |row| (row.frame, *id, row)))
        .collect();
    rows.sort_by_key(|(frame, id, _)| (*frame, *id));
    let mut text = String::with_capacity(64 * rows.len());
    for (frame, id, row) in rows {
        let score = rounded(row.score);
        // Writing to a string cannot fail.
        let _ = if let Some(b) = row.pixel_box {
            let [left, top, width, height] = [b.left, b.top, b.width, b.height].map(rounded);
            writeln!(text, "{frame},{id},{left},{top},{width},{height},{score},-1,-1,-1")
        } else {
            let (x, y) = (rounded(row.place.x), rounded(row.place.y));
            writeln!(text, "{frame},{id},-1,-1,-1,-1,{score},{x},{y},0")
        };
    }
    text
}

/// Rounded to six decimals, as detectors write them, without a negative zero.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6 + 0.0
}
