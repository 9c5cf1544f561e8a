//! Decoding and foreground ahead of the tracker, on worker threads, without changing what it sees.
//!
//! Every camera belongs to one worker, every worker goes through its cameras in the same order frame after frame, and
//! the moments are put together in the order of the cameras: the number of threads changes the time, not the result.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::Scope;

use super::feed::{CameraFeed, Fed};
use crate::Result;
use crate::moment::CameraFrame;
use crate::source::Schedule;

/// How many frames a camera may be ahead of the tracker.
const FRAMES_AHEAD: usize = 4;

/// All cameras, frame by frame.
pub(super) enum Feeds<'t> {
    /// On the caller's thread.
    Here { feeds: Vec<CameraFeed>, schedule: &'t Schedule, spares: Vec<Option<CameraFrame>> },
    /// On workers; one pair of channels a camera.
    Ahead(Vec<Line>),
}

/// One camera's channels.
pub(super) struct Line {
    name: String,
    fed: Receiver<Result<Fed>>,
    spares: Sender<CameraFrame>,
}

/// The frame of all cameras, or the camera that ended first.
pub(super) enum Next {
    Moment(Vec<Fed>),
    Ended(String),
}

/// One camera on its worker.
struct Job {
    camera: usize,
    feed: CameraFeed,
    fed: SyncSender<Result<Fed>>,
    spares: Receiver<CameraFrame>,
}

impl<'t> Feeds<'t> {
    /// With one thread everything happens on the caller's; with more, up to that many workers share the cameras.
    pub(super) fn start<'scope>(
        scope: &'scope Scope<'scope, 't>,
        feeds: Vec<CameraFeed>,
        schedule: &'t Schedule,
        threads: usize,
    ) -> Self {
        if threads <= 1 {
            let spares = feeds.iter().map(|_| None).collect();
            return Self::Here { feeds, schedule, spares };
        }
        let workers = threads.min(feeds.len());
        let mut jobs: Vec<Vec<Job>> = (0..workers).map(|_| Vec::new()).collect();
        let mut lines = Vec::new();
        for (i, feed) in feeds.into_iter().enumerate() {
            let (send_fed, fed) = sync_channel(FRAMES_AHEAD);
            let (spares, receive_spares) = channel();
            lines.push(Line { name: feed.name().to_owned(), fed, spares });
            jobs[i % workers].push(Job { camera: i, feed, fed: send_fed, spares: receive_spares });
        }
        for jobs in jobs {
            scope.spawn(move || work(jobs, schedule));
        }
        Self::Ahead(lines)
    }

    /// The next moment. The shortest source ends the run, even where another has an error at that frame.
    pub(super) fn next(&mut self) -> Result<Next> {
        let mut parts = Vec::new();
        match self {
            Self::Here { feeds, schedule, spares } => {
                for (camera, (feed, spare)) in feeds.iter_mut().zip(spares).enumerate() {
                    let part = feed.next(schedule, camera, spare.take()).transpose();
                    let Some(part) = part else { return Ok(Next::Ended(feed.name().to_owned())) };
                    parts.push(part);
                }
            }
            Self::Ahead(lines) => {
                for line in lines {
                    // A worker that is done with a camera hangs up.
                    let Ok(part) = line.fed.recv() else { return Ok(Next::Ended(line.name.clone())) };
                    parts.push(part);
                }
            }
        }
        parts.into_iter().collect::<Result<_>>().map(Next::Moment)
    }

    /// Gives a moment's pictures back, to be written into again.
    pub(super) fn recycle(&mut self, frames: Vec<CameraFrame>) {
        match self {
            Self::Here { spares, .. } => *spares = frames.into_iter().map(Some).collect(),
            Self::Ahead(lines) => {
                for (line, frame) in lines.iter().zip(frames) {
                    // A worker that has ended needs no more pictures.
                    let _ = line.spares.send(frame);
                }
            }
        }
    }
}

/// Feeds the cameras of one worker in turn, until they have ended or nobody listens.
fn work(mut jobs: Vec<Job>, schedule: &Schedule) {
    while !jobs.is_empty() {
        jobs.retain_mut(|job| {
            match job.feed.next(schedule, job.camera, job.spares.try_recv().ok()).transpose() {
                Some(part) => {
                    let failed = part.is_err();
                    job.fed.send(part).is_ok() && !failed
                }
                None => false,
            }
        });
    }
}
