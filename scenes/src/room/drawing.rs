//! Checks of one name and of one outline that a person has drawn: a zone, region or line.

use crate::polygon::Polygon;

/// Largest number of corners of a zone, region or line: the check visits every pair of edges.
pub(super) const MOST_CORNERS: usize = 1000;

/// Defect of a name that people read and files hold.
pub(super) fn name_defect(name: &str) -> Option<String> {
    if name.trim().is_empty() {
        return Some("it has no name; give it one".into());
    }
    name.contains(char::is_control)
        .then(|| "its name holds a line break or another control character; rename it".into())
}

/// Defect of a drawn outline: no area, too many corners, or an outline that meets itself.
pub(super) fn outline_defect(polygon: &Polygon) -> Option<String> {
    let corners = polygon.0.len();
    if corners > MOST_CORNERS {
        return Some(format!("it has {corners} corners; {MOST_CORNERS} are the most"));
    }
    // A bow tie may have no area, too, but its problem is the crossing.
    let Some((a, b)) = polygon.crossing().filter(|_| corners >= 3) else { return polygon.defect() };
    let edge = |i: usize| format!("{} to {}", i + 1, (i + 1) % corners + 1);
    Some(format!(
        "its outline meets itself: the edge from corner {} and the one from {} cross or touch; move a corner",
        edge(a),
        edge(b)
    ))
}
