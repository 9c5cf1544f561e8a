//! Experiments on tracking heads by CONDENSATION, as in section 5 of Y. Matsumoto, T. Kato, T. Wada, "An Occlusion
//! Robust Weight Integration Method for Multi-camera CONDENSATION" (in Japanese), in a synthetic hall, beside the
//! paper's numbers: occlusion by integration (5.1), entries (5.2), accuracy (5.4, tables 3 and 4), time (table 2).
//!
//! `cargo bench -p tests --bench condensation [-- occlusion|entries|accuracy|time]`
#![forbid(unsafe_code)]

use std::collections::BTreeSet;

use nalgebra::Point3;
use rayon::prelude::*;
use synthetic::{PersonTruth, SyntheticRoom, WalkerOptions};
use tests::chain::StepResult;
use tests::hall::{
    behind_the_screen, empty_pictures, error_m, going_round, hall, hidden_from, nearest, passing_through,
    pictures, recording, step, tracker,
};
use tracker::method::condensation::camera_edges::CameraEdges;
use tracker::method::condensation::integration::Integration;
use tracker::method::condensation::{Condensation, CondensationOptions};
use tracker::{Moment, PersonEstimate, TrackId};

/// Pictures a second.
const RATE_HZ: f64 = 12.0;
/// Largest distance of a track from a head that it is on, metres.
const ON_HEAD_M: f64 = 0.3;
/// Number of consecutive moments off the head after which it counts as lost.
const LOST_MOMENTS: u32 = 5;

fn main() -> StepResult<()> {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let is_asked = |name: &str| asked.is_empty() || asked.iter().any(|a| a == name);
    if is_asked("occlusion") {
        occlusion()?;
    }
    if is_asked("entries") {
        entries()?;
    }
    if is_asked("accuracy") {
        accuracy()?;
    }
    if is_asked("time") {
        time()?;
    }
    Ok(())
}

/// Ten people, one at a time, walk behind a screen that hides their heads from half of the cameras, and turn around there.
fn occlusion() -> StepResult<()> {
    const TRIALS: u64 = 10;
    let variants =
        [("published", CondensationOptions::published()), ("default", CondensationOptions::default())];
    let mut lost = vec![[0; Integration::ALL.len()]; variants.len()];
    let mut found = lost.clone();
    for trial in 1..=TRIALS {
        let room = hall(trial, 6, true)?;
        let empty = empty_pictures(&room);
        let walkers = behind_the_screen(trial);
        let mut groups = Vec::new();
        for (_, options) in &variants {
            let mut trials = Vec::new();
            for integration in Integration::ALL {
                let options = CondensationOptions { integration, ..options.clone() };
                trials.push(HeadTrial::new(tracker(&room, &empty, options)?));
            }
            groups.push((trials[0].tracker.edges().clone(), trials));
        }
        follow_behind_screen(&room, &walkers, &mut groups);
        for (v, (_, trials)) in groups.iter().enumerate() {
            for (i, trial) in trials.iter().enumerate() {
                found[v][i] += u32::from(trial.who.is_some());
                lost[v][i] += u32::from(trial.who.is_some() && trial.is_lost);
            }
        }
    }
    println!(
        "occlusion: of {TRIALS} people, followed before it / lost by it (paper: product loses 10, pairs-angle 0)"
    );
    for ((name, _), (found, lost)) in variants.iter().zip(found.iter().zip(&lost)) {
        for (integration, (found, lost)) in Integration::ALL.iter().zip(found.iter().zip(lost)) {
            println!("  {name:<10} {:<12} {found:>3} {lost:>3}", integration.name());
        }
    }
    Ok(())
}

/// One tracker in one trial.
struct HeadTrial {
    tracker: Condensation,
    /// Track on the head before it was hidden.
    who: Option<TrackId>,
    /// Whether the head has been hidden since.
    was_hidden: bool,
    off: u32,
    is_lost: bool,
}

impl HeadTrial {
    fn new(tracker: Condensation) -> Self {
        Self { tracker, who: None, was_hidden: false, off: 0, is_lost: false }
    }

    /// Notes whether one of these people is on the head, which is hidden or not.
    fn judge(&mut self, people: &[PersonEstimate], head: &Point3<f64>, is_hidden: bool) {
        let on_head = nearest(people, head).filter(|(_, error)| *error < ON_HEAD_M).map(|(p, _)| p.id);
        self.was_hidden |= is_hidden && self.who.is_some();
        if !self.was_hidden {
            self.who = on_head.filter(|_| !is_hidden).or(self.who);
            return;
        }
        self.off = if on_head.is_some() && on_head == self.who { 0 } else { self.off + 1 };
        self.is_lost |= self.off >= LOST_MOMENTS;
    }
}

/// Follows a person through the hall, by groups of trackers that differ in the integration alone and share their edges.
fn follow_behind_screen(
    room: &SyntheticRoom,
    walkers: &WalkerOptions,
    groups: &mut [(CameraEdges, Vec<HeadTrial>)],
) {
    let sequence = recording(room, walkers, RATE_HZ, 16.0);
    for frame in sequence.frames() {
        let pictures = pictures(&frame);
        let truth = frame.people.first().filter(|p| p.inside);
        let is_hidden = truth.is_some_and(|p| 2 * hidden_from(room, &p.head) >= pictures.len());
        let moment = Moment { frame: frame.frame, time_s: frame.time_s, cameras: &pictures };
        for (edges, trials) in &mut *groups {
            edges.find(&moment);
            // Trackers know nothing of each other.
            trials.par_iter_mut().for_each(|trial| {
                let people = trial.tracker.follow(moment.time_s, edges.images());
                if let Some(truth) = truth {
                    trial.judge(&people, &truth.head, is_hidden);
                }
            });
        }
    }
}

/// Twenty people come in one after the other.
fn entries() -> StepResult<()> {
    const PEOPLE: usize = 20;
    let room = hall(21, 6, false)?;
    let empty = empty_pictures(&room);
    let mut trials = [
        ("published", tracker(&room, &empty, CondensationOptions::published())?, Entries::default()),
        ("default", tracker(&room, &empty, CondensationOptions::default())?, Entries::default()),
    ];
    let sequence = recording(&room, &passing_through(PEOPLE), RATE_HZ, 60.0);
    for frame in sequence.frames() {
        let pictures = pictures(&frame);
        for (_, tracker, entries) in &mut trials {
            entries.take(&step(tracker, &frame, &pictures)?, &frame.people);
        }
    }
    for (name, _, Entries { came, found, nobody }) in &trials {
        println!(
            "entries ({name}): {} of {} found (paper: 8 of 10; asked: 20 of 20); rows that are nobody: {nobody}",
            found.len(),
            came.len()
        );
    }
    Ok(())
}

/// People who came in, and those of them that the tracker found.
#[derive(Default)]
struct Entries {
    came: BTreeSet<u32>,
    found: BTreeSet<u32>,
    /// Rows that are on nobody's head.
    nobody: usize,
}

impl Entries {
    fn take(&mut self, people: &[PersonEstimate], truth: &[PersonTruth]) {
        for person in truth.iter().filter(|p| p.inside) {
            self.came.insert(person.id);
            if nearest(people, &person.head).is_some_and(|(_, error)| error < ON_HEAD_M) {
                self.found.insert(person.id);
            }
        }
        let is_nobody = |p: &&PersonEstimate| truth.iter().all(|t| error_m(p, &t.head) > 2.0 * ON_HEAD_M);
        self.nobody += people.iter().filter(is_nobody).count();
    }
}

/// One person and six people on a way around the hall.
fn accuracy() -> StepResult<()> {
    println!(
        "accuracy: head in space, cm (paper: 1 person 4.41, at most 34.7; 6 people 4.23, at most 18.5; asked: 4, 15)"
    );
    for (people, cameras) in [(1, 6), (6, 6), (6, 12)] {
        let room = hall(31, cameras, false)?;
        let walkers = going_round(people, 2.0);
        let sequence = recording(&room, &walkers, RATE_HZ, 16.0);
        let variants =
            [("published", CondensationOptions::published()), ("default", CondensationOptions::default())];
        let empty = empty_pictures(&room);
        let mut trackers = Vec::new();
        for (name, options) in variants {
            trackers.push((name, tracker(&room, &empty, options)?, Errors::default()));
        }
        for frame in sequence.frames() {
            let pictures = pictures(&frame);
            for (_, tracker, errors) in &mut trackers {
                let estimates = step(tracker, &frame, &pictures)?;
                for truth in frame.people.iter().filter(|p| p.inside) {
                    errors.take(truth.id, nearest(&estimates, &truth.head).map(|(p, e)| (p.id, e)));
                }
                errors.reported += estimates.len();
            }
        }
        for (name, _, errors) in &trackers {
            errors.print(&format!("{people} people, {cameras} cameras, {name}"));
        }
    }
    Ok(())
}

/// Errors of people after they are first found.
#[derive(Default)]
struct Errors {
    on_head_m: Vec<f64>,
    missed: usize,
    before: usize,
    reported: usize,
    found: Vec<(u32, TrackId)>,
    switches: usize,
}

impl Errors {
    fn take(&mut self, person: u32, nearest: Option<(TrackId, f64)>) {
        let known = self.found.iter().position(|(p, _)| *p == person);
        match nearest.filter(|(_, error)| *error < 0.5) {
            Some((id, error)) => {
                self.on_head_m.push(error);
                match known {
                    Some(k) => {
                        self.switches += usize::from(self.found[k].1 != id);
                        self.found[k].1 = id;
                    }
                    None => self.found.push((person, id)),
                }
            }
            None if known.is_some() => self.missed += 1,
            None => self.before += 1,
        }
    }

    fn print(&self, what: &str) {
        let mut sorted = self.on_head_m.clone();
        if sorted.is_empty() {
            println!("  {what:<34} nobody found; {} rows", self.reported);
            return;
        }
        sorted.sort_by(f64::total_cmp);
        let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
        let at = |share: f64| 100.0 * sorted[(share * (sorted.len() as f64 - 1.0)) as usize];
        println!(
            "  {what:<34} mean {:>5.2}  95 % {:>5.1}  maximum {:>5.1}; {} rows, {} of them nobody; {} moments before found, \
             {} lost; {} switches",
            100.0 * mean,
            at(0.95),
            at(1.0),
            self.reported,
            self.reported - sorted.len().min(self.reported),
            self.before,
            self.missed,
            self.switches
        );
    }
}

/// Table 2: milliseconds a moment for one and for six people, on one core.
fn time() -> StepResult<()> {
    println!(
        "time: ms a moment on one core (paper, 7 PCs: 1 person 3.6, 6 people 11.6; asked: 2 without gradients)"
    );
    // The pictures are rendered on all cores.
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| e.to_string())?;
    println!("  cameras people layers  hypotheses  weights  integration     sum  gradients  gates");
    for cameras in [6, 12] {
        let room = hall(31, cameras, false)?;
        let empty = empty_pictures(&room);
        for people in [1, 6] {
            let walkers = going_round(people, 1.0);
            let sequence = recording(&room, &walkers, RATE_HZ, 10.0);
            let mut trackers = Vec::new();
            for options in [CondensationOptions::published(), CondensationOptions::default()] {
                let layers = options.layers;
                trackers.push((layers, tracker(&room, &empty, options)?, [0.0; 5], 0_u32));
            }
            for frame in sequence.frames() {
                let pictures = pictures(&frame);
                for (_, tracker, sums, moments) in &mut trackers {
                    let before = spent_ms(tracker);
                    let is_full = tracker.hypotheses().count() == people;
                    one_core.install(|| step(tracker, &frame, &pictures))?;
                    if is_full {
                        let after = spent_ms(tracker);
                        *moments += 1;
                        sums.iter_mut().zip(after.iter().zip(before)).for_each(|(s, (a, b))| *s += a - b);
                    }
                }
            }
            for (layers, _, sums, moments) in &trackers {
                if *moments == 0 {
                    println!("  {cameras:>7} {people:>6} {layers:>6}  never all of them followed at once");
                    continue;
                }
                let [h, w, i, e, g] = sums.map(|s| s / f64::from(*moments));
                println!(
                    "  {cameras:>7} {people:>6} {layers:>6} {h:>11.3} {w:>8.3} {i:>12.3} {:>7.3} {e:>10.2} {g:>6.2}   ({moments} \
                     moments)",
                    h + w + i
                );
            }
        }
    }
    Ok(())
}

fn spent_ms(tracker: &Condensation) -> [f64; 5] {
    let spent = tracker.step_times();
    [&spent.hypotheses, &spent.weights, &spent.integration, &spent.edges, &spent.gates]
        .map(|w| 1e3 * w.total_s())
}
