//! `tracks.jsonl` under the ids of the whole recording, with people filled in at the moments at which they were lost.

use std::collections::BTreeMap;

use super::Linked;
use crate::TrackId;
use crate::count;
use crate::jsonl::{FrameLine, PersonLine, rounded};

/// Renames all people, and interpolates them between their detections.
pub(super) fn mended(mut lines: Vec<FrameLine>, linked: &Linked) -> Vec<FrameLine> {
    // For each id its last detection: index of the line, and the person.
    let mut latest: BTreeMap<u32, (usize, PersonLine)> = BTreeMap::new();
    for index in 0..lines.len() {
        let mut people = std::mem::take(&mut lines[index].people);
        for person in &mut people {
            let id = linked.renamed.get(&person.id.0).copied().unwrap_or(person.id.0);
            person.id = TrackId(id);
            if let Some((before, seen)) = latest.insert(id, (index, person.clone())) {
                let (first, last) = (&lines[before], &lines[index]);
                let ends = [(first.frame, first.time, &seen), (last.frame, last.time, &*person)];
                let between: Vec<PersonLine> =
                    lines[before + 1..index].iter().map(|lost| interpolated(ends, lost.frame)).collect();
                for (line, person) in lines[before + 1..index].iter_mut().zip(between) {
                    line.people.push(person);
                }
            }
        }
        lines[index].people = people;
    }
    for line in &mut lines {
        line.people.sort_by_key(|p| p.id.0);
        let present = line.people.iter().map(|p| p.confidence);
        line.count = count::distribution(present).into_iter().map(rounded).collect();
    }
    lines
}

/// A person on a straight line between two moments (frame, time, person).
fn interpolated(ends: [(u32, f64, &PersonLine); 2], frame: u32) -> PersonLine {
    let [(first, first_time, a), (last, last_time, b)] = ends;
    let t = f64::from(frame - first) / f64::from(last - first);
    let mix = |a: f64, b: f64| rounded(a + (b - a) * t);
    let speed = |a: f64, b: f64| {
        if last_time > first_time { rounded((b - a) / (last_time - first_time)) } else { 0.0 }
    };
    let visible =
        a.visible.iter().filter_map(|(name, v)| Some((name.clone(), mix(*v, *b.visible.get(name)?))));
    PersonLine {
        id: b.id,
        x: mix(a.x, b.x),
        y: mix(a.y, b.y),
        radius: mix(a.radius, b.radius),
        height: mix(a.height, b.height),
        vx: speed(a.x, b.x),
        vy: speed(a.y, b.y),
        sigma: [mix(a.sigma[0], b.sigma[0]), mix(a.sigma[1], b.sigma[1])],
        confidence: mix(a.confidence, b.confidence),
        visible: visible.collect(),
    }
}
