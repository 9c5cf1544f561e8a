//! The pipeline: sources → foreground → method → outputs, one moment after the other, each stage timed.

mod ahead;
mod feed;
mod output;
mod waiting;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::thread;
use std::time::{Duration, Instant};

use ahead::{Feeds, Next};
pub use feed::{CameraFeed, Fed};
pub use output::{Followed, Output};
use waiting::{Waiting, WaitingRoom};

use crate::foreground::Verdict;
use crate::method::Method;
use crate::source::Schedule;
use crate::tracks::{Stopwatch, Timings};
use crate::{Error, Moment, Result};

/// When no camera's stream has been there for so long, the run ends.
const ALL_LOST_FOR: Duration = Duration::from_mins(1);
/// What the pictures of the moments that wait to be told may take of memory, bytes.
const MOST_WAITING_BYTES: usize = 1 << 30;

/// How to run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOptions {
    /// When the moments are, and which frames belong to them; a clock for each feed.
    pub schedule: Schedule,
    /// Worker threads; the result is the same for any number.
    pub threads: usize,
}

/// What ended a run.
#[derive(Debug)]
pub enum Ended {
    /// The camera whose source ended first, when the others go on or end with it; the first of all cameras when all streams
    /// have been lost for a minute.
    Source(String),
    /// Whoever watches its progress.
    Asked,
    /// A frame that cannot be decoded, has no time or the wrong size; an output that cannot be written.
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

/// Follows everybody through all moments of the feeds. `feeds` are in the order of the stage's cameras. `advance` is
/// called after each moment, and says whether to go on.
///
/// A run that fails on its way has followed the moments before: the outputs have them, and are finished.
///
/// # Errors
/// A failure before the first moment was followed.
pub fn run(
    feeds: Vec<CameraFeed>,
    method: &mut dyn Method,
    mut outputs: Vec<Box<dyn Output + '_>>,
    options: &RunOptions,
    mut advance: impl FnMut() -> ControlFlow<()>,
) -> Result<RunReport> {
    if feeds.is_empty() {
        return Err(Error::option("--video", "no camera has a source"));
    }
    let names: Vec<String> = feeds.iter().map(|f| f.name().to_owned()).collect();
    let started = Instant::now();
    let mut log = CameraLog::new(names);
    let mut stopwatch = Stopwatch::default();
    let mut frame = options.schedule.first() - 1;
    let mut all_lost_since: Option<Instant> = None;
    let mut waiting = WaitingRoom::new(method.lag_s(), MOST_WAITING_BYTES);
    let ended = thread::scope(|scope| {
        let mut feeds = Feeds::start(scope, feeds, &options.schedule, options.threads);
        loop {
            let parts = match feeds.next()? {
                Next::Moment(parts) => parts,
                Next::Ended(camera) => return Ok::<_, Error>(Ended::Source(camera)),
            };
            if parts.iter().any(|p| p.verdict != Verdict::Lost) {
                all_lost_since = None;
            } else if all_lost_since.get_or_insert_with(Instant::now).elapsed() > ALL_LOST_FOR {
                return Ok(Ended::Source(log.names[0].clone()));
            }
            log.note(frame + 1, &parts);
            stopwatch.record("decode", parts.iter().map(|p| p.decode).sum::<Duration>());
            stopwatch.record("foreground", parts.iter().map(|p| p.foreground).sum::<Duration>());
            let verdicts: Vec<Verdict> = parts.iter().map(|p| p.verdict).collect();
            let (cameras, real): (Vec<_>, Vec<_>) = parts.into_iter().map(|p| (p.frame, p.real)).unzip();
            let time_s = options.schedule.time_s(frame + 1)?;
            let moment = Moment { frame: frame + 1, time_s, cameras: &cameras };
            let people = stopwatch.time("inference", || method.step(&moment))?;
            frame += 1;
            waiting.enter(Waiting { frame, time_s, cameras, real, verdicts, people });
            while let Some(first) = waiting.due(time_s) {
                stopwatch.time("output", || first.tell(method, &mut outputs))?;
                feeds.recycle(first.cameras);
            }
            if advance().is_break() {
                return Ok(Ended::Asked);
            }
        }
    });
    let frames = frame + 1 - options.schedule.first();
    let ended = match ended {
        Err(error) if frames == 0 => return Err(error),
        ended => ended,
    };
    // Also where a frame cannot be decoded: what came before it has been followed.
    let told = std::iter::from_fn(|| waiting.leave())
        .try_for_each(|last| stopwatch.time("output", || last.tell(method, &mut outputs)));
    let finishing = Instant::now();
    // Each of them, also where another cannot be written.
    let mut finished = Ok(());
    for output in outputs {
        finished = finished.and(output.finish());
    }
    tracing::debug!("outputs finished in {:.1} ms", finishing.elapsed().as_secs_f64() * 1e3);
    // What went wrong first is what to mend.
    let ended = ended.and_then(|ended| told.and(finished).map(|()| ended)).unwrap_or_else(Ended::Failed);
    Ok(RunReport {
        frames,
        wall_s: started.elapsed().as_secs_f64(),
        ended,
        set_aside: log.set_aside,
        timings: stopwatch.timings(options.threads, frames as usize),
    })
}

/// Says when a camera is set aside and taken back.
struct CameraLog {
    names: Vec<String>,
    latest: Vec<Verdict>,
    set_aside: BTreeMap<String, (u32, Verdict)>,
}

impl CameraLog {
    fn new(names: Vec<String>) -> Self {
        Self { latest: vec![Verdict::Usable; names.len()], names, set_aside: BTreeMap::new() }
    }

    fn note(&mut self, frame: u32, parts: &[Fed]) {
        for ((name, latest), part) in self.names.iter().zip(&mut self.latest).zip(parts) {
            if part.verdict == Verdict::Between {
                continue;
            }
            if part.verdict.is_set_aside() {
                self.set_aside.entry(name.clone()).or_insert((0, part.verdict)).0 += 1;
            }
            if part.verdict != *latest {
                match part.verdict {
                    Verdict::Usable => tracing::info!("camera `{name}`: taken back at frame {frame}"),
                    why => tracing::warn!("camera `{name}`: set aside from frame {frame}: {why}"),
                }
                *latest = part.verdict;
            }
        }
    }
}

#[cfg(test)]
mod tests;
