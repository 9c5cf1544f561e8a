//! Tracks of true paths with a tracker's errors: position errors that last, late births, early deaths, gaps.

use std::collections::BTreeMap;

use mot::jsonl::{FrameLine, PersonLine};
use nalgebra::{Point2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use tracker::TrackId;

use super::TruePath;

/// Errors of a tracker.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackErrors {
    /// Frame rate, Hz.
    pub rate_hz: f64,
    /// Smallest and largest standard deviation of a person's position, metres; it is told, and changes slowly.
    pub sigma_m: (f64, f64),
    /// Standard deviation of a person's velocity, metres a second.
    pub velocity_sigma_m_s: f64,
    /// Time for which an error of position or velocity lasts (exponential correlation), seconds.
    pub lasting_s: f64,
    /// Largest delay of the birth of a track, and largest advance of its death, seconds.
    pub late_s: f64,
    /// Mean time between two gaps of a track, seconds.
    pub gap_every_s: f64,
    /// Shortest and longest gap, seconds.
    pub gap_s: (f64, f64),
}

impl Default for TrackErrors {
    fn default() -> Self {
        Self {
            rate_hz: 12.0,
            sigma_m: (0.02, 0.08),
            velocity_sigma_m_s: 0.15,
            lasting_s: 0.5,
            late_s: 0.3,
            gap_every_s: 30.0,
            gap_s: (0.2, 1.5),
        }
    }
}

/// A track that is being made.
struct NoisyTrack<'a> {
    path: &'a TruePath,
    error: Vector2<f64>,
    velocity_error: Vector2<f64>,
    phase: f64,
    born_s: f64,
    dies_s: f64,
    back_s: f64,
    rng: Pcg64Mcg,
}

/// Calls `each` with every line of `tracks.jsonl` until `until_s`: a day need not fit into memory.
pub fn lines(
    paths: &[TruePath],
    errors: &TrackErrors,
    until_s: f64,
    seed: u64,
    mut each: impl FnMut(&FrameLine),
) {
    let mut tracks: Vec<NoisyTrack<'_>> =
        paths.iter().map(|path| NoisyTrack::new(path, errors, seed)).collect();
    tracks.sort_by(|a, b| a.born_s.total_cmp(&b.born_s));
    let mut alive: Vec<NoisyTrack<'_>> = Vec::new();
    let mut coming = tracks.into_iter().peekable();
    let frames = (until_s * errors.rate_hz) as u32;
    for frame in 1..=frames {
        let time = f64::from(frame - 1) / errors.rate_hz;
        while let Some(track) = coming.next_if(|track| track.born_s <= time) {
            alive.push(track);
        }
        alive.retain(|track| track.dies_s >= time);
        let mut people: Vec<PersonLine> =
            alive.iter_mut().filter_map(|track| track.step(time, errors)).collect();
        people.sort_by_key(|person| person.id);
        let (count, set_aside, states, clock) = (Vec::new(), Vec::new(), Vec::new(), None);
        each(&FrameLine { frame, time: (time * 1e6).round() / 1e6, people, count, set_aside, states, clock });
    }
}

impl<'a> NoisyTrack<'a> {
    fn new(path: &'a TruePath, errors: &TrackErrors, seed: u64) -> Self {
        // Each person has their own randomness: one more person does not change the others.
        let mut rng = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(u64::from(path.id)));
        let (first_s, last_s) = path.span_s();
        let late = |rng: &mut Pcg64Mcg| errors.late_s * rng.random::<f64>();
        Self {
            born_s: first_s + late(&mut rng),
            dies_s: last_s - late(&mut rng),
            error: Vector2::new(StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng)),
            velocity_error: Vector2::new(StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng)),
            phase: rng.random_range(0.0..std::f64::consts::TAU),
            back_s: f64::NEG_INFINITY,
            path,
            rng,
        }
    }

    fn step(&mut self, time_s: f64, errors: &TrackErrors) -> Option<PersonLine> {
        let step_s = 1.0 / errors.rate_hz;
        let kept = (-step_s / errors.lasting_s).exp();
        let fresh = Vector2::new(StandardNormal.sample(&mut self.rng), StandardNormal.sample(&mut self.rng));
        self.error = self.error * kept + fresh * (1.0 - kept * kept).sqrt();
        let fresh = Vector2::new(StandardNormal.sample(&mut self.rng), StandardNormal.sample(&mut self.rng));
        self.velocity_error = self.velocity_error * kept + fresh * (1.0 - kept * kept).sqrt();
        if self.rng.random_bool((step_s / errors.gap_every_s).clamp(0.0, 1.0)) {
            self.back_s = time_s + self.rng.random_range(errors.gap_s.0..=errors.gap_s.1);
        }
        if time_s < self.back_s {
            return None;
        }
        let place: Point2<f64> = self.path.at(time_s)?;
        let (least, most) = errors.sigma_m;
        let sigma_m = least + (most - least) * (0.5 + 0.5 * (self.phase + 0.7 * time_s).sin());
        let found = place + self.error * sigma_m;
        let before = self.path.at(time_s - step_s).unwrap_or(place);
        let velocity = (place - before) / step_s + self.velocity_error * errors.velocity_sigma_m_s;
        let rounded = |value: f64| (value * 1e4).round() / 1e4;
        Some(PersonLine {
            id: TrackId(self.path.id),
            x: rounded(found.x),
            y: rounded(found.y),
            radius: 0.25,
            height: 1.7,
            vx: rounded(velocity.x),
            vy: rounded(velocity.y),
            sigma: [rounded(sigma_m); 2],
            confidence: 0.95,
            visible: BTreeMap::new(),
        })
    }
}
