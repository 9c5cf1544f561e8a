//! The pipeline behind the stations: moments → method → estimates → outputs, and feedback to the stations.

mod agency_log;
mod camera_log;
mod clock_offsets;
mod lag;
mod output;
mod search_offsets;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

pub use agency_log::AgencyLog;
use camera_log::CameraLog;
pub use clock_offsets::{ClockOffsets, ClockReport};
use lag::{Held, LagBuffer};
pub use output::{Followed, Output};
pub use search_offsets::search_offsets;

use crate::foreground::Verdict;
use crate::gathering::{Gathered, Gathering, LeftOut, Next, Part};
use crate::method::Method;
use crate::observation::Observation;
use crate::silhouette::Body;
use crate::station::{Pictures, Seen};
use crate::tracks::{Stopwatch, Timings};
use crate::{CameraFrame, Error, Moment, Result};

/// Memory that the pictures of held moments may take, bytes.
const MOST_HELD_BYTES: usize = 1 << 30;

/// What ended a run.
#[derive(Debug)]
pub enum Ended {
    /// The camera whose source ended first, when the others go on or end with it.
    Source(String),
    /// Whoever watches its progress.
    Asked,
    /// A frame that cannot be decoded or has no time; an output that cannot be written.
    Failed(Error),
}

/// What a run did.
#[derive(Debug)]
pub struct RunReport {
    /// Moments followed.
    pub frames: u32,
    /// From the first frame's decoding to the last output, seconds.
    pub wall_s: f64,
    /// Why there are no more.
    pub ended: Ended,
    /// For each camera that was set aside at times, in how many frames, and why the first time.
    pub set_aside: BTreeMap<String, (u32, Verdict)>,
    /// Observations and moments that a live run left out.
    pub left_out: LeftOut,
    /// Time of each stage: `decode`, `foreground`, `inference`, `output`.
    pub timings: Timings,
}

impl RunReport {
    /// The report of a run that did not fail.
    ///
    /// # Errors
    /// What the run failed of.
    pub fn unless_failed(self) -> Result<Self> {
        match self.ended {
            Ended::Failed(error) => Err(error),
            Ended::Source(_) | Ended::Asked => Ok(self),
        }
    }
}

/// Follows everybody through all moments that are gathered; the cameras are those of the method's stage, in its order.
/// `advance` is called after each moment, and while there is none, and says whether to go on. `clocks` watches the cameras'
/// clocks, and may correct them.
///
/// A run that fails on its way has followed the moments before: the outputs have them, and are finished.
///
/// # Errors
/// A failure before the first moment was followed.
pub fn run(
    mut gathering: Gathering,
    method: &mut dyn Method,
    mut outputs: Vec<Box<dyn Output + '_>>,
    clocks: Option<ClockOffsets>,
    threads: usize,
    mut advance: impl FnMut(Progress) -> ControlFlow<()>,
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
            Ok(Next::Moment(gathered)) => {
                let time_s = gathered.time_s;
                let believed = pipeline.follow(gathered, method, &mut outputs);
                if let Some(alignments) = pipeline.clocks.as_mut().and_then(|clocks| clocks.changed(time_s)) {
                    gathering.align(&alignments);
                }
                believed.map(|believed| gathering.believe(believed)).map(|()| Progress::Moment)
            }
            Ok(Next::Idle) => Ok(Progress::Idle),
            Ok(Next::Ended(camera)) => break Ok(Ended::Source(camera)),
            Err(error) => Err(error),
        };
        match step {
            Ok(progress) if advance(progress).is_break() => break Ok(Ended::Asked),
            Ok(_) => {}
            Err(error) => break Err(error),
        }
    };
    let ended = match ended {
        Err(error) if pipeline.frames == 0 => return Err(error),
        ended => ended,
    };
    let left_out = gathering.left_out();
    // The stations end with it.
    drop(gathering);
    // Also where a frame cannot be decoded: what came before it has been followed.
    let Pipeline { log, mut stopwatch, mut held, clocks, frames } = pipeline;
    let emitted = std::iter::from_fn(|| held.pop())
        .try_for_each(|last| stopwatch.time("output", || last.emit(method, &mut outputs)));
    let finishing = Instant::now();
    // Each of them, also where another cannot be written.
    let mut finished = Ok(());
    for output in outputs {
        finished = finished.and(output.finish());
    }
    tracing::debug!("outputs finished in {:.1} ms", finishing.elapsed().as_secs_f64() * 1e3);
    // What went wrong first is what to mend.
    let ended = ended.and_then(|ended| emitted.and(finished).map(|()| ended)).unwrap_or_else(Ended::Failed);
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

/// Latest step of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Followed a moment.
    Moment,
    /// Waited for one.
    Idle,
}

struct Pipeline {
    log: CameraLog,
    stopwatch: Stopwatch,
    held: LagBuffer,
    clocks: Option<ClockOffsets>,
    frames: u32,
}

impl Pipeline {
    /// Follows everybody through one moment; the bodies of those who are believed in.
    fn follow(
        &mut self,
        gathered: Gathered,
        method: &mut dyn Method,
        outputs: &mut [Box<dyn Output + '_>],
    ) -> Result<Vec<Body>> {
        let Gathered { frame, time_s, parts } = gathered;
        let count = parts.len();
        let (mut cameras, mut pictures, mut health) =
            (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        let (mut decode, mut foreground) = (Duration::ZERO, Duration::ZERO);
        for (camera, part) in parts.into_iter().enumerate() {
            if let (Some(clocks), Part::Seen(seen)) = (&mut self.clocks, &part) {
                clocks.observe(camera, &seen.observation)?;
            }
            let (camera, shown, verdict) = match part {
                Part::Seen(seen) => {
                    let Seen { observation, pictures, decode: decoding, foreground: observing } = *seen;
                    decode += decoding;
                    foreground += observing;
                    let image = pictures.pinhole.clone();
                    let Observation { mask, colours, boxes, health, .. } = observation;
                    let camera = CameraFrame { mask, colours, boxes, image };
                    (camera, pictures, health)
                }
                Part::Nothing(why) => (CameraFrame::default(), Pictures::default(), why),
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
        self.held.push(Held { frame, time_s, cameras, pictures, health, people });
        while let Some(first) = self.held.pop_due(time_s) {
            self.stopwatch.time("output", || first.emit(method, outputs))?;
        }
        Ok(believed)
    }
}

#[cfg(test)]
mod tests;
