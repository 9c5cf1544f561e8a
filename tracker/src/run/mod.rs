//! The pipeline behind the stations: moments → method → estimates → outputs, and feedback to the stations.

mod agency_log;
mod camera_log;
mod clock_offsets;
mod event_log;
mod lag_buffer;
mod output;
mod search_offsets;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

pub use agency_log::AgencyLog;
use camera_log::CameraLog;
pub use clock_offsets::{ClockOffsets, ClockReport};
pub use event_log::{EventListener, EventLog, NoEvents};
use lag_buffer::{HeldMoment, LagBuffer};
pub use output::{Output, ProcessedMoment};
use scenes::room::Room;
pub use search_offsets::{offsets_of_recordings, search_offsets};

use crate::foreground::Verdict;
use crate::gathering::{Gathered, Gathering, LeftOut, MomentPart, NextMoment};
use crate::method::Method;
use crate::observation::Observation;
use crate::prepared_room::PreparedRoom;
use crate::silhouette::Body;
use crate::station::{ObservedFrame, Pictures};
use crate::tracks::{Stopwatch, Timings};
use crate::{CameraFrame, Error, Moment, Result};

/// Most memory for the pictures of held moments, bytes.
const MOST_HELD_BYTES: usize = 1 << 30;

/// Reason why a run ended.
#[derive(Debug)]
pub enum RunEnd {
    /// A camera's source ended, the first of all: the name of the camera.
    Source(String),
    /// The caller's `advance` asked to stop.
    Stopped,
    /// A frame could not be decoded or has no time, or an output could not be written.
    Failed(Error),
}

/// Report of a run.
#[derive(Debug)]
pub struct RunReport {
    /// Number of moments processed.
    pub frames: u32,
    /// Time from the decoding of the first frame to the last output, seconds.
    pub wall_s: f64,
    /// Reason why the run ended.
    pub ended: RunEnd,
    /// For each camera that was set aside: the number of frames, and the first reason.
    pub set_aside: BTreeMap<String, (u32, Verdict)>,
    /// Counts of observations and moments that a live run left out.
    pub left_out: LeftOut,
    /// Time of each stage: `decode`, `foreground`, `inference`, `output`.
    pub timings: Timings,
}

impl RunReport {
    /// The report of a run that did not fail.
    ///
    /// The error that ended the run.
    /// The error that ended the run.
    pub fn unless_failed(self) -> Result<Self> {
        match self.ended {
            RunEnd::Failed(error) => Err(error),
            RunEnd::Source(_) | RunEnd::Stopped => Ok(self),
        }
    }
}

/// Tracks everybody through all gathered moments; the cameras are those of the method's room, in its order. `advance`
/// is called after each moment, and while there is none, and decides how to go on. `clocks` estimates the offsets
/// of the cameras' clocks, and may correct them.
///
/// A run that fails later finishes its outputs; they hold the moments before the failure.
///
/// # Errors
/// A failure before the first moment was processed.
pub fn run(
    mut gathering: Gathering,
    method: &mut dyn Method,
    mut outputs: Vec<Box<dyn Output + '_>>,
    clocks: Option<ClockOffsets>,
    threads: usize,
    mut advance: impl FnMut(RunProgress) -> RunDirective,
) -> Result<RunReport> {
    let started = Instant::now();
    let mut pipeline = Pipeline {
        log: CameraLog::new(gathering.names().map(str::to_owned).collect()),
        stopwatch: Stopwatch::default(),
        held: LagBuffer::new(method.lag_s(), MOST_HELD_BYTES),
        clocks,
        frames: 0,
    };
    let ended = loop {
        let step = match gathering.next_moment() {
            Ok(NextMoment::Moment(gathered)) => {
                let time_s = gathered.time_s;
                let believed = pipeline.follow(gathered, gathering.left_out(), method, &mut outputs);
                if let Some(alignments) = pipeline.clocks.as_mut().and_then(|clocks| clocks.changed(time_s)) {
                    gathering.align(&alignments);
                }
                believed.map(|believed| gathering.believe(believed)).map(|()| RunProgress::Moment)
            }
            Ok(NextMoment::Idle) => Ok(RunProgress::Idle),
            Ok(NextMoment::Ended(camera)) => break Ok(RunEnd::Source(camera)),
            Err(error) => Err(error),
        };
        match step {
            Ok(progress) => match advance(progress) {
                RunDirective::GoOn => {}
                RunDirective::Stop => break Ok(RunEnd::Stopped),
                RunDirective::Replace(changed) => {
                    if !method.replace_zones(&changed.prepared) {
                        break Ok(RunEnd::Stopped);
                    }
                    let replaced =
                        outputs.iter_mut().try_for_each(|output| output.replace_room(&changed.room));
                    if let Err(error) = replaced {
                        break Err(error);
                    }
                }
            },
            Err(error) => break Err(error),
        }
    };
    let ended = match ended {
        Err(error) if pipeline.frames == 0 => return Err(error),
        ended => ended,
    };
    let left_out = gathering.left_out();
    // Dropping the gathering ends the stations.
    drop(gathering);
    // Held moments are emitted even after a decoding error: they were processed before it.
    let Pipeline { log, mut stopwatch, mut held, clocks, frames } = pipeline;
    let emitted = std::iter::from_fn(|| held.pop())
        .try_for_each(|last| stopwatch.time("output", || last.emit(method, &mut outputs)));
    let finishing = Instant::now();
    // Every output is finished, even where another one fails.
    let mut finished = Ok(());
    for output in outputs {
        finished = finished.and(output.finish());
    }
    tracing::debug!("outputs finished in {:.1} ms", finishing.elapsed().as_secs_f64() * 1e3);
    // The first error is the one to mend.
    let ended = ended.and_then(|ended| emitted.and(finished).map(|()| ended)).unwrap_or_else(RunEnd::Failed);
    Ok(RunReport {
        frames,
        wall_s: started.elapsed().as_secs_f64(),
        ended,
        set_aside: log.into_set_aside(),
        left_out,
        timings: Timings {
            offsets: clocks.map(ClockOffsets::finish).unwrap_or_default(),
            ..stopwatch.timings(threads, frames as usize)
        },
    })
}

/// The latest step of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunProgress {
    /// A moment was processed.
    Moment,
    /// No moment was ready.
    Idle,
}

/// Decision of the caller of a run after a step.
#[derive(Debug)]
pub enum RunDirective {
    /// Go on.
    GoOn,
    /// End here.
    Stop,
    /// Go on with changed zones, regions and lines, without losing people. A run whose method cannot do that ends.
    Replace(Box<ChangedRoom>),
}

/// A room whose zones, regions and lines were changed; cameras and geometry are those of before.
#[derive(Debug)]
pub struct ChangedRoom {
    /// The room as it was read.
    pub room: Room,
    /// The same room, prepared.
    pub prepared: PreparedRoom,
}

struct Pipeline {
    log: CameraLog,
    stopwatch: Stopwatch,
    held: LagBuffer,
    clocks: Option<ClockOffsets>,
    frames: u32,
}

impl Pipeline {
    /// Processes one moment. Returns the bodies of the estimated people.
    fn follow(
        &mut self,
        gathered: Gathered,
        left_out: LeftOut,
        method: &mut dyn Method,
        outputs: &mut [Box<dyn Output + '_>],
    ) -> Result<Vec<Body>> {
        let Gathered { frame, time_s, utc_s, parts } = gathered;
        let count = parts.len();
        let (mut cameras, mut pictures, mut health) =
            (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        let (mut decode, mut foreground) = (Duration::ZERO, Duration::ZERO);
        for (camera, part) in parts.into_iter().enumerate() {
            if let (Some(clocks), MomentPart::Seen(seen)) = (&mut self.clocks, &part) {
                clocks.observe(camera, &seen.observation)?;
            }
            let (camera, shown, verdict) = match part {
                MomentPart::Seen(seen) => {
                    let ObservedFrame { observation, pictures, decode: decoding, foreground: observing } =
                        *seen;
                    decode += decoding;
                    foreground += observing;
                    let image = pictures.pinhole.clone();
                    let Observation { mask, colours, boxes, health, .. } = observation;
                    let camera = CameraFrame { mask, colours, boxes, image };
                    (camera, pictures, health)
                }
                MomentPart::Nothing(why) => (CameraFrame::default(), Pictures::default(), why),
            };
            cameras.push(camera);
            pictures.push(shown);
            health.push(verdict);
        }
        self.log.note(frame, &health);
        self.stopwatch.record("decode", decode);
        self.stopwatch.record("foreground", foreground);
        let moment = Moment { frame, time_s, cameras: &cameras };
        let people = self.stopwatch.time("inference", || method.step(&moment))?;
        self.frames += 1;
        let believed = people.iter().map(Body::from).collect();
        self.held.push(HeldMoment { frame, time_s, utc_s, left_out, cameras, pictures, health, people });
        while let Some(first) = self.held.pop_due(time_s) {
            self.stopwatch.time("output", || first.emit(method, outputs))?;
        }
        Ok(believed)
    }
}

#[cfg(test)]
mod tests;
