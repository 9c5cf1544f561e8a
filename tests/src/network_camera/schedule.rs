//! Schedule of a camera: times at which each picture is captured and sent, and the fault in force.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::chain::StepResult;

/// Options of a camera: its clock, its network, its faults.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraOptions {
    /// Pictures a second of the camera's own clock.
    pub rate_hz: f64,
    /// Delay of every picture, seconds, 0 or more.
    pub delay_s: f64,
    /// Error of the camera's clock: its pictures come at `rate_hz · (1 + drift_ppm · 10⁻⁶)`.
    pub drift_ppm: f64,
    /// Largest delay of a picture by the network, seconds, uniform from 0; the order of pictures is kept.
    pub jitter_s: f64,
    /// Share of the pictures that are lost, from 0 to below 1.
    pub loss: f64,
    /// Seed of jitter and losses.
    pub seed: u64,
    /// Behaviour after the film's last picture.
    pub at_end: AtEnd,
    /// Scripted faults. Where several overlap, the first of the list is in force.
    pub faults: Vec<Outage>,
}

impl Default for CameraOptions {
    fn default() -> Self {
        Self {
            rate_hz: 12.0,
            delay_s: 0.0,
            drift_ppm: 0.0,
            jitter_s: 0.0,
            loss: 0.0,
            seed: 1,
            at_end: AtEnd::Repeat,
            faults: Vec::new(),
        }
    }
}

/// Behaviour after the film's last picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AtEnd {
    /// The film starts again.
    Repeat,
    /// Black pictures are sent.
    Black,
    /// Connections are closed, and refused from then on.
    Close,
}

/// Fault of a camera that replaces its regular pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Connections stay open, and nothing is sent.
    Silent,
    /// Connections are broken off and refused.
    Refused,
    /// Only the first half of each JPEG is sent.
    Torn,
    /// The pictures have another size.
    Resized {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// Connections are accepted, and no request is answered. Clients that are connected already get no pictures.
    Unanswered,
}

/// Fault, and the time during which it is in force, seconds from the epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outage {
    /// Beginning.
    pub from_s: f64,
    /// End; infinity for a fault that stays.
    pub until_s: f64,
    /// Kind of the fault.
    pub fault: Fault,
}

impl Outage {
    /// Size of the pictures, pixels, while the fault changes it; `None` for other faults.
    pub(super) fn size(&self) -> Option<(u32, u32)> {
        match self.fault {
            Fault::Resized { width, height } => Some((width, height)),
            _ => None,
        }
    }
}

impl CameraOptions {
    /// Checks the ranges.
    pub(super) fn validate(&self) -> StepResult<()> {
        let in_range = [
            ("rate_hz", self.rate_hz > 0.0 && self.rate_hz.is_finite()),
            ("delay_s", self.delay_s >= 0.0 && self.delay_s.is_finite()),
            ("drift_ppm", self.drift_ppm.abs() < 1e6),
            ("jitter_s", self.jitter_s >= 0.0 && self.jitter_s.is_finite()),
            ("loss", (0.0..1.0).contains(&self.loss)),
            ("faults", self.faults.iter().all(|outage| outage.from_s < outage.until_s)),
        ];
        match in_range.iter().find(|(_, is_in_range)| !is_in_range) {
            Some((option, _)) => Err(format!("camera option {option}: out of range")),
            None => Ok(()),
        }
    }

    /// Pictures a second of true time.
    fn true_rate_hz(&self) -> f64 {
        self.rate_hz * (1.0 + 1e-6 * self.drift_ppm)
    }

    /// Time from the epoch at which the picture of this number is captured, before the camera's delay, seconds.
    pub(super) fn captured_at_s(&self, number: u64) -> f64 {
        number as f64 / self.true_rate_hz()
    }

    /// Time from the epoch at which the picture of this number leaves the camera, before the network's jitter,
    /// seconds.
    fn shown_at_s(&self, number: u64) -> f64 {
        self.captured_at_s(number) + self.delay_s
    }

    /// The fault in force at a time from the epoch.
    pub(super) fn fault_at(&self, time_s: f64) -> Option<Fault> {
        let now = self.faults.iter().find(|outage| (outage.from_s..outage.until_s).contains(&time_s));
        now.map(|outage| outage.fault)
    }

    /// Whether connections are refused at any time between these two.
    pub(super) fn is_refusing_within(&self, from_s: f64, until_s: f64) -> bool {
        let overlaps = |outage: &Outage| outage.from_s <= until_s && outage.until_s > from_s;
        self.faults.iter().any(|outage| outage.fault == Fault::Refused && overlaps(outage))
    }

    /// Whether a film of `pictures` pictures is over at `time_s`, and the camera has closed with it.
    pub(super) fn is_closed_at(&self, time_s: f64, pictures: usize) -> bool {
        self.at_end == AtEnd::Close && time_s > self.shown_at_s(pictures as u64) + self.jitter_s
    }

    /// Jitter in seconds of the picture of this number; `None` if it is lost.
    fn jitter_s(&self, number: u64) -> Option<f64> {
        // Neighbouring seeds give unrelated streams only after mixing.
        let mixed = (self.seed << 40 ^ number).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut rng = Pcg64Mcg::seed_from_u64(mixed);
        let is_lost = rng.random::<f64>() < self.loss;
        let jitter_s = self.jitter_s * rng.random::<f64>();
        (!is_lost).then_some(jitter_s)
    }
}

/// Sequence of pictures for one client.
#[derive(Debug)]
pub(super) struct Playback<'a> {
    options: &'a CameraOptions,
    pictures: u64,
    next: u64,
    /// Time at which the latest picture was due, seconds from the epoch.
    latest_s: f64,
}

/// Turn of one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlaybackStep {
    /// Place of the picture in the film; `None` for black.
    pub(super) shown: Option<usize>,
    /// Time at which it is to be sent, seconds from the epoch.
    pub(super) due_s: f64,
}

impl<'a> Playback<'a> {
    /// Starts with the first picture that the camera has not shown yet at `now_s`.
    pub(super) fn new(options: &'a CameraOptions, pictures: usize, now_s: f64) -> Self {
        let mut playback = Self { options, pictures: pictures as u64, next: 0, latest_s: f64::NEG_INFINITY };
        playback.catch_up(now_s);
        playback
    }

    /// Skips the pictures that were shown before `now_s`.
    pub(super) fn catch_up(&mut self, now_s: f64) {
        let shown = ((now_s - self.options.delay_s) * self.options.true_rate_hz()).ceil();
        self.next = self.next.max(shown.max(0.0) as u64);
    }

    /// The next picture that is not lost.
    pub(super) fn next(&mut self) -> PlaybackStep {
        loop {
            let number = self.next;
            self.next += 1;
            let Some(jitter_s) = self.options.jitter_s(number) else { continue };
            let place = match self.options.at_end {
                AtEnd::Repeat => Some(number % self.pictures),
                AtEnd::Black | AtEnd::Close => Some(number).filter(|n| *n < self.pictures),
            };
            let due_s = (self.options.shown_at_s(number) + jitter_s).max(self.latest_s);
            self.latest_s = due_s;
            return PlaybackStep { shown: place.map(|place| place as usize), due_s };
        }
    }
}
