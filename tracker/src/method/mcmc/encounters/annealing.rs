//! Search for the most probable exchanges by simulated annealing (S. Kirkpatrick, C. D. Gelatt, M. P. Vecchi, "Optimization by
//! simulated annealing", Science 220, 1983).
//!
//! A step changes the decision of one encounter, of two of the same tracks (an exchange that is moved, or undone soon after), or of
//! two or three that follow each other with a track in common: names that went round in a circle.

use std::collections::BTreeMap;

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::window::{Sums, Window};
use super::{EXCHANGE_NATS, Encounter};

/// Number of steps for each encounter, and least and largest number of all.
const STEPS_EACH: usize = 16;
const LEAST_STEPS: usize = 1000;
const MOST_STEPS: usize = 6000;
/// Temperatures of the first and last step: log probabilities are divided by them.
const FIRST_TEMPERATURE: f64 = 0.6;
const LAST_TEMPERATURE: f64 = 0.1;
/// Shares of steps that change one encounter, and two of the same tracks; the others change some with a track in common.
const ONE: f64 = 0.25;
const SAME_TRACKS: f64 = 0.25;
/// Share of these that change three.
const THREE: f64 = 0.3;
/// Largest distance in the list of encounters with a track in common, and number of attempts to find one.
const NEAR: usize = 60;
const ATTEMPTS: usize = 20;
/// Loss by the places, in nats at temperature 1, beyond which no step is taken.
const HOPELESS_NATS: f64 = 25.0;

/// Most probable exchanges that were found, from the present ones, among one or more encounters.
pub(super) fn most_probable(window: &Window, encounters: &[Encounter], rng: &mut Pcg64Mcg) -> Vec<bool> {
    let mut now: Vec<bool> = encounters.iter().map(|encounter| encounter.is_exchange).collect();
    let by_tracks = ByTracks::new(window, encounters.len());
    let mut sums = Sums::default();
    let mut traits_nats = window.log_density(&now, &mut sums);
    let (mut gain, mut best_gain, mut best) = (0.0, 0.0, now.clone());
    let steps = (STEPS_EACH * encounters.len()).clamp(LEAST_STEPS, MOST_STEPS);
    let mut changed: Vec<usize> = Vec::new();
    for step in 0..steps {
        let done = step as f64 / steps as f64;
        let temperature = FIRST_TEMPERATURE * (LAST_TEMPERATURE / FIRST_TEMPERATURE).powf(done);
        propose(window, &by_tracks, rng, &mut changed);
        let by_places: f64 = changed
            .iter()
            .map(|i| (encounters[*i].place_nats - EXCHANGE_NATS) * if now[*i] { -1.0 } else { 1.0 })
            .sum();
        if by_places < -HOPELESS_NATS {
            continue;
        }
        toggle(&mut now, &changed);
        let then = window.log_density(&now, &mut sums);
        let difference = by_places + then - traits_nats;
        if difference >= 0.0 || rng.random::<f64>() < (difference / temperature).exp() {
            traits_nats = then;
            gain += difference;
            if gain > best_gain + 1e-6 {
                best_gain = gain;
                best.clone_from(&now);
            }
        } else {
            toggle(&mut now, &changed);
        }
    }
    best
}

/// Changes the decisions of these encounters.
fn toggle(exchanges: &mut [bool], changed: &[usize]) {
    for i in changed {
        exchanges[*i] = !exchanges[*i];
    }
}

/// Encounters by their two tracks.
struct ByTracks {
    /// Encounters of the same two tracks.
    groups: Vec<Vec<usize>>,
    /// Group of each encounter.
    group: Vec<usize>,
}

impl ByTracks {
    fn new(window: &Window, count: usize) -> Self {
        let mut numbers: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        let (mut groups, mut group): (Vec<Vec<usize>>, Vec<usize>) = (Vec::new(), Vec::new());
        for i in 0..count {
            let [a, b] = window.tracks(i);
            let number = *numbers.entry([a.min(b), a.max(b)]).or_insert(groups.len());
            if number == groups.len() {
                groups.push(Vec::new());
            }
            groups[number].push(i);
            group.push(number);
        }
        Self { groups, group }
    }

    /// All encounters of the tracks of one.
    fn of(&self, encounter: usize) -> &[usize] {
        &self.groups[self.group[encounter]]
    }
}

/// Draws the encounters whose decision a step changes.
fn propose(window: &Window, by_tracks: &ByTracks, rng: &mut Pcg64Mcg, changed: &mut Vec<usize>) {
    let count = by_tracks.group.len();
    let first = rng.random_range(0..count);
    changed.clear();
    changed.push(first);
    let kind: f64 = rng.random();
    if kind < ONE {
        return;
    }
    if kind < ONE + SAME_TRACKS {
        let same = by_tracks.of(first);
        let other = same[rng.random_range(0..same.len())];
        if other != first {
            changed.push(other);
        }
        return;
    }
    let wanted = if rng.random::<f64>() < THREE { 2 } else { 1 };
    for _ in 0..wanted {
        let low = first.saturating_sub(NEAR);
        let high = (first + NEAR).min(count - 1);
        let tracks = window.tracks(first);
        let mut attempts = (0..ATTEMPTS).map(|_| rng.random_range(low..=high));
        let other = attempts
            .find(|i| !changed.contains(i) && window.tracks(*i).iter().any(|track| tracks.contains(track)));
        changed.extend(other);
    }
}
