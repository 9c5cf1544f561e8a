//! Accuracy for people who are mostly hidden from a camera.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Point3;
use scenes::room::Room;

use super::Matched;
use crate::chain::StepResult;

/// Accuracy for hidden people.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HiddenPeople {
    /// Number of rows of the truth that count.
    pub people: usize,
    /// Share of them that is found.
    pub recall: f64,
    /// Mean error of the found ones, metres.
    pub mean_m: f64,
}

/// Accuracy for the people of the office of whom, in one camera's image, at least half is hidden: by the rendered truth
/// in `truth_visible.csv`. A person outside an image does not count as hidden in it.
///
/// # Errors
/// A file that cannot be read, an invalid row.
pub fn hidden_people(office: &Path, matched: &[Matched]) -> StepResult<HiddenPeople> {
    const HIDDEN: f64 = 0.5;
    let room = Room::read(&office.join("room")).map_err(|e| e.to_string())?;
    let file = office.join("truth_visible.csv");
    let text = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    let mut hidden: BTreeSet<(u32, u32, &str)> = BTreeSet::new();
    for line in text.lines().skip(1) {
        let bad = || format!("{}: {line}", file.display());
        let [frame, id, camera, visible] = line.split(',').collect::<Vec<_>>()[..] else { return Err(bad()) };
        if visible.parse::<f64>().map_err(|_| bad())? <= HIDDEN {
            hidden.insert((frame.parse().map_err(|_| bad())?, id.parse().map_err(|_| bad())?, camera));
        }
    }
    let counts = |row: &&Matched| {
        room.cameras.iter().any(|entry| {
            let middle = entry.camera.project(&Point3::new(row.place.x, row.place.y, 0.9));
            let in_image = middle.is_some_and(|pixel| entry.camera.intrinsics.contains(&pixel));
            in_image && hidden.contains(&(row.frame, row.id, entry.name.as_str()))
        })
    };
    let rows: Vec<&Matched> = matched.iter().filter(counts).collect();
    let errors: Vec<f64> = rows.iter().filter_map(|row| row.error_m()).collect();
    Ok(HiddenPeople {
        people: rows.len(),
        recall: errors.len() as f64 / rows.len().max(1) as f64,
        mean_m: errors.iter().sum::<f64>() / errors.len().max(1) as f64,
    })
}
