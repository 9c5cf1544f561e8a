//! Observations of all stations → moments.
//!
//! A moment has the time of a frame of the leading (fastest) camera, and of every other camera the observation nearest
//! in time, or none: an observation that is too far away shows where people were, not where they are.
//!
//! * [`recorded`] waits for every camera: the same moments in every run.
//! * [`live`] waits for no camera longer than the latency: a silent or slow camera neither delays nor shifts another,
//!   and moments that the tracker cannot keep up with are skipped.
//!
//! Feedback goes the other way: when an observation is dropped, its station gets the present estimates of the people
//! ([`Gathering::believe`]).

mod camera;
mod live;
mod recorded;
#[cfg(test)]
mod tests;

use std::sync::mpsc::Receiver;
use std::time::Duration;

use shell::ranges::SECONDS;

pub use camera::ClockAlignment;
use camera::GatheredCamera;
use live::LiveGathering;
use recorded::RecordedGathering;

use crate::foreground::Verdict;
use crate::silhouette::Body;
use crate::station::{Event, ObservedFrame, Port};
use crate::{Error, Result};
use shell::options::check_ranges;

/// Time difference within which a frame always belongs to a moment, even where the moments are closer together,
/// seconds: a walking person moves 5 cm.
const NEAR_S: f64 = 0.04;

/// One camera's part of a moment.
#[derive(Debug, Clone)]
pub enum MomentPart {
    /// The observation nearest in time.
    Seen(Box<ObservedFrame>),
    /// No observation is near, for this reason.
    Nothing(Verdict),
}

/// Observations of one moment.
#[derive(Debug, Clone)]
pub struct Gathered {
    /// Number of the moment, from 1; that of the leading camera's frame in a recording.
    pub frame: u32,
    /// Time on the run's clock, seconds.
    pub time_s: f64,
    /// Capture time, seconds since 1970, where the cameras are live.
    pub utc_s: Option<f64>,
    /// Part of each camera, in the order of the ports.
    pub parts: Vec<MomentPart>,
}

/// Result of [`Gathering::next_moment`].
#[derive(Debug)]
pub enum NextMoment {
    /// A moment.
    Moment(Gathered),
    /// No moment is ready; ask again.
    Idle,
    /// The camera of this name ended first.
    Ended(String),
}

/// Options of the gathering.
#[derive(Debug, Clone, PartialEq)]
pub struct GatheringOptions {
    /// Correction of each camera's clock, in the order of the ports.
    pub alignments: Vec<ClockAlignment>,
    /// Longest wait of live input for late cameras, seconds. Default 0.3.
    pub latency_s: f64,
}

/// Counts of observations and moments that a live run left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// Frames that a busy station or network passed over.
    pub passed_over: u64,
    /// Observations that arrived after their moment.
    pub late: u64,
    /// Moments that were skipped because the tracker was behind.
    pub skipped: u64,
}

/// Combines observations to moments.
#[derive(Debug)]
pub struct Gathering {
    cameras: Vec<GatheredCamera>,
    events: Receiver<(usize, Event)>,
    believed: Vec<Body>,
    mode: Mode,
}

#[derive(Debug)]
enum Mode {
    Recorded(RecordedGathering),
    Live(LiveGathering),
}

impl Gathering {
    /// Gathers from these stations, whose events arrive by `events`. Live when one of them is.
    ///
    /// # Errors
    /// No stations, a wrong number of alignments, or an invalid offset or latency.
    pub fn new(
        ports: Vec<Port>,
        events: Receiver<(usize, Event)>,
        options: &GatheringOptions,
    ) -> Result<Self> {
        if ports.is_empty() {
            return Err(Error::option("ports", "no camera has a source"));
        }
        if options.alignments.len() != ports.len() {
            let problem = format!("{} clocks for {} cameras", options.alignments.len(), ports.len());
            return Err(Error::option("alignments", problem));
        }
        if let Some(odd) =
            options.alignments.iter().find(|a| !(a.offset_s.is_finite() && a.drift.is_finite()))
        {
            return Err(Error::option("alignments", format!("{} is no time; give seconds", odd.offset_s)));
        }
        check_ranges([("latency_s", options.latency_s, SECONDS)])?;
        let is_live = ports.iter().any(|port| port.is_live);
        let cameras: Vec<GatheredCamera> = ports
            .into_iter()
            .zip(&options.alignments)
            .map(|(port, a)| GatheredCamera::new(port, *a))
            .collect();
        let mode = if is_live {
            Mode::Live(LiveGathering::new(options.latency_s))
        } else {
            Mode::Recorded(RecordedGathering::new(&cameras))
        };
        Ok(Self { cameras, events, believed: Vec::new(), mode })
    }

    /// Names of the cameras, in the order of the ports.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.cameras.iter().map(|camera| camera.port.name.as_str())
    }

    /// Whether the run is live.
    pub fn is_live(&self) -> bool {
        matches!(self.mode, Mode::Live(_))
    }

    /// Next moment. Waits for at most 100 ms.
    ///
    /// # Errors
    /// The error of a camera, after the moments before it.
    pub fn next_moment(&mut self) -> Result<NextMoment> {
        match &mut self.mode {
            Mode::Recorded(recorded) => recorded.next(&mut self.cameras, &self.events, &self.believed),
            Mode::Live(live) => live.next(&mut self.cameras, &self.events, &self.believed),
        }
    }

    /// Sends the present estimates of the people to the stations.
    pub fn believe(&mut self, people: Vec<Body>) {
        self.believed = people;
        if self.is_live() {
            for camera in &mut self.cameras {
                camera.acknowledge(0, &self.believed);
            }
        }
    }

    /// Replaces the alignments of the cameras' clocks from the next observation on.
    pub fn align(&mut self, alignments: &[ClockAlignment]) {
        for (camera, alignment) in self.cameras.iter_mut().zip(alignments) {
            camera.align(*alignment);
        }
    }

    /// Present alignments of the cameras' clocks.
    pub fn alignments(&self) -> Vec<ClockAlignment> {
        self.cameras.iter().map(|camera| camera.alignment).collect()
    }

    /// Counts of what was left out so far.
    pub fn left_out(&self) -> LeftOut {
        match &self.mode {
            Mode::Recorded(_) => LeftOut::default(),
            Mode::Live(live) => {
                let passed_over = self.cameras.iter().map(|camera| camera.passed_over).sum();
                LeftOut { passed_over, ..live.left_out() }
            }
        }
    }
}

/// Longest wait before the caller decides whether to go on.
const WAIT: Duration = Duration::from_millis(100);

/// Part of a camera whose nearest observation is its oldest; `None` where that is not near.
fn nearest_part(camera: &mut GatheredCamera, time_s: f64, near_s: f64) -> Option<MomentPart> {
    let was_used = camera.has_been_used();
    let nearest =
        camera.pending.front().filter(|pending| (pending.time_s - time_s).abs() <= near_s + 1e-9)?;
    let mut seen = nearest.seen.clone();
    if was_used {
        // A frame that belongs to several moments was decoded once.
        (seen.decode, seen.foreground) = (Duration::ZERO, Duration::ZERO);
    }
    camera.mark_used();
    Some(MomentPart::Seen(Box::new(seen)))
}
