//! Groups: people who walk together.
//!
//! Two people walk together while both walk (at least [`WALKING_M_S`]), are within [`NEAR_M`] of each other, and their
//! velocities differ by at most [`SAME_M_S`]. They belong together if that lasted for [`TOGETHER_S`] in all, and for half
//! of the time in which both walked. People who belong together, directly or through others, are a group.

use std::collections::BTreeMap;
use std::fmt::Write;

use mot::jsonl::{FrameLine, PersonLine};
use nalgebra::Vector2;

use crate::TrackId;

/// Least speed of walking, m/s.
const WALKING_M_S: f64 = 0.4;
/// Largest distance of two people who walk together, metres.
const NEAR_M: f64 = 1.6;
/// Largest difference of their velocities, m/s.
const SAME_M_S: f64 = 0.5;
/// Time for which they walk together, seconds.
const TOGETHER_S: f64 = 4.0;
/// Share of the time in which both walk.
const TOGETHER_SHARE: f64 = 0.5;
/// Longest time between two lines that counts in full, seconds.
const LONGEST_STEP_S: f64 = 1.0;
/// Time after which a person who is not seen is gone, seconds.
const GONE_S: f64 = 60.0;

/// Two people while both are there.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::struct_field_names)] // All are seconds.
struct Pair {
    first_s: f64,
    last_s: f64,
    together_s: f64,
    walking_s: f64,
}

/// A group of people.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// First time at which two of them walked together, seconds.
    pub first_s: f64,
    /// Last time.
    pub last_s: f64,
    /// Tracks by ascending id; at least two.
    pub ids: Vec<TrackId>,
}

/// Finder of groups. Its memory grows with the people who are there, and with the groups.
#[derive(Debug, Clone, Default)]
pub struct Groups {
    pairs: BTreeMap<(TrackId, TrackId), Pair>,
    seen_s: BTreeMap<TrackId, f64>,
    belonging: Vec<((TrackId, TrackId), Pair)>,
    last_s: Option<f64>,
}

impl Groups {
    /// Takes the next line of `tracks.jsonl`.
    pub fn step(&mut self, line: &FrameLine) {
        let last_s = self.last_s.replace(line.time).unwrap_or(line.time);
        let step_s = (line.time - last_s).clamp(0.0, LONGEST_STEP_S);
        for person in &line.people {
            self.seen_s.insert(person.id, line.time);
        }
        let velocity = |p: &PersonLine| Vector2::new(p.vx, p.vy);
        let walking: Vec<&PersonLine> =
            line.people.iter().filter(|p| velocity(p).norm() >= WALKING_M_S).collect();
        for (i, a) in walking.iter().enumerate() {
            for b in &walking[i + 1..] {
                let distance_m = Vector2::new(a.x - b.x, a.y - b.y).norm();
                let is_together = distance_m <= NEAR_M && (velocity(a) - velocity(b)).norm() <= SAME_M_S;
                let key = (a.id.min(b.id), a.id.max(b.id));
                if let Some(pair) = self.pairs.get_mut(&key) {
                    pair.walking_s += step_s;
                    if is_together {
                        (pair.last_s, pair.together_s) = (line.time, pair.together_s + step_s);
                    }
                } else if is_together {
                    let (first_s, last_s) = (line.time, line.time);
                    self.pairs.insert(key, Pair { first_s, last_s, together_s: 0.0, walking_s: 0.0 });
                }
            }
        }
        self.retire(|seen_s| line.time - seen_s > GONE_S);
    }

    /// Decides about the pairs one of whom is gone.
    fn retire(&mut self, is_gone: impl Fn(f64) -> bool) {
        let gone: Vec<TrackId> =
            self.seen_s.iter().filter(|(_, s)| is_gone(**s)).map(|(id, _)| *id).collect();
        if gone.is_empty() {
            return;
        }
        for id in &gone {
            self.seen_s.remove(id);
        }
        let belonging = &mut self.belonging;
        self.pairs.retain(|key, pair| {
            let is_over = gone.contains(&key.0) || gone.contains(&key.1);
            let belongs = pair.together_s >= TOGETHER_S && pair.together_s >= TOGETHER_SHARE * pair.walking_s;
            if is_over && belongs {
                belonging.push((*key, *pair));
            }
            !is_over
        });
    }

    /// The groups, by the time at which they were first seen.
    pub fn finish(mut self) -> Vec<Group> {
        self.retire(|_| true);
        let mut groups: Vec<Group> = Vec::new();
        for ((a, b), pair) in self.belonging {
            let is_of = |group: &Group| group.ids.contains(&a) || group.ids.contains(&b);
            let mut joined = Group { first_s: pair.first_s, last_s: pair.last_s, ids: vec![a, b] };
            for group in groups.extract_if(.., |group| is_of(group)) {
                joined.first_s = joined.first_s.min(group.first_s);
                joined.last_s = joined.last_s.max(group.last_s);
                joined.ids.extend(group.ids);
            }
            joined.ids.sort_unstable();
            joined.ids.dedup();
            groups.push(joined);
        }
        groups.sort_by(|a, b| a.first_s.total_cmp(&b.first_s).then_with(|| a.ids.cmp(&b.ids)));
        groups
    }
}

/// `groups.csv`: first and last time together, seconds, number of people, ids.
pub(super) fn csv(groups: &[Group]) -> String {
    let mut text = String::from("first,last,people,ids\n");
    for group in groups {
        let ids: Vec<String> = group.ids.iter().map(ToString::to_string).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{},{},{}", group.first_s, group.last_s, ids.len(), ids.join(" "));
    }
    text
}
