//! Each person of the truth with the estimate nearest to them: the basis of figures about single people.

use std::collections::BTreeMap;
use std::path::Path;

use mot::jsonl::{self, PersonLine};
use nalgebra::Point2;

use crate::chain::StepResult;

/// Largest distance of an estimate that finds a person, metres: the gate of `tracker eval`.
const GATE_M: f64 = 0.5;

/// A person of the truth at one time.
#[derive(Debug, Clone)]
pub struct Matched {
    /// Number of the frame, from 1.
    pub frame: u32,
    /// Id in the truth.
    pub id: u32,
    /// True place, metres.
    pub place: Point2<f64>,
    /// The estimate that found them.
    pub found: Option<PersonLine>,
}

impl Matched {
    /// Distance of the estimate, metres.
    pub fn error_m(&self) -> Option<f64> {
        self.found.as_ref().map(|found| (Point2::new(found.x, found.y) - self.place).norm())
    }
}

/// Matches everybody of the truth (`MOTChallenge` rows on the floor) with the estimates of a run's `tracks.jsonl`.
/// Nearest pairs first, each estimate once.
///
/// # Errors
/// A file that cannot be read, an invalid row.
pub fn matched(truth: &Path, tracks: &Path) -> StepResult<Vec<Matched>> {
    let text = std::fs::read_to_string(truth).map_err(|e| format!("{}: {e}", truth.display()))?;
    let mut frames: BTreeMap<u32, Vec<Matched>> = BTreeMap::new();
    for line in text.lines() {
        let columns: Vec<f64> = line.split(',').map_while(|value| value.trim().parse().ok()).collect();
        let [frame, id, _, _, _, _, _, x, y, _] = columns[..] else {
            return Err(format!("{}: {line}", truth.display()));
        };
        let (frame, id) = (frame as u32, id as u32);
        frames.entry(frame).or_default().push(Matched { frame, id, place: Point2::new(x, y), found: None });
    }
    for line in jsonl::read(tracks).map_err(|e| e.to_string())? {
        let Some(people) = frames.get_mut(&line.frame) else { continue };
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (i, person) in people.iter().enumerate() {
            let distances = line.people.iter().map(|p| (Point2::new(p.x, p.y) - person.place).norm());
            pairs.extend(distances.enumerate().filter(|(_, d)| *d <= GATE_M).map(|(j, d)| (d, i, j)));
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut taken = vec![false; line.people.len()];
        for (_, i, j) in pairs {
            if people[i].found.is_none() && !std::mem::replace(&mut taken[j], true) {
                people[i].found = Some(line.people[j].clone());
            }
        }
    }
    Ok(frames.into_values().flatten().collect())
}
