//! Moments of live cameras. No camera is waited for longer than the latency.
//!
//! The fastest present camera leads; its frames are the moments. Of several equally fast cameras the one leads whose
//! frames arrive last, as measured by the aligned clocks: then no frame of another camera is late. A moment is complete
//! when no other camera is expected to deliver a nearer frame than its latest, that is, when the moment is less than
//! half way from that frame to the next. Otherwise the next frame is waited for until it is due, but no longer than the
//! latency after the leading frame.

use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant, SystemTime};

use super::camera::{GatheredCamera, StreamEnd};
use super::{Gathered, LeftOut, MomentPart, NEAR_S, NextMoment, WAIT, nearest_part};
use crate::foreground::Verdict;
use crate::silhouette::Body;
use crate::source::utc_s;
use crate::station::Event;
use crate::{Error, Result};

/// Silence after which a camera counts as absent, seconds; for a slow camera three of its intervals.
const PATIENCE_S: f64 = 0.5;
/// Factor by which a camera has to be faster to take the lead from a present camera.
const FASTER: f64 = 1.2;
/// Largest delay, relative to the other cameras, of a camera that may lead, seconds: the range that `--offset auto`
/// corrects. A camera that is later still does not delay the others.
const LATEST_LEAD_S: f64 = 0.5;
/// Earliest arrival of the next frame after the last, intervals.
const NOT_BEFORE: f64 = 0.8;
/// Tolerance added to a camera's usual delay before it is given up, seconds.
const SLACK_S: f64 = 0.02;
/// Age beyond the latency at which a moment is skipped for a newer one, seconds.
const BEHIND_S: f64 = 0.2;

#[derive(Debug)]
pub(super) struct LiveGathering {
    latency_s: f64,
    lead: Option<usize>,
    /// Capture time of the first moment, which is the run's zero, seconds since 1970.
    start_s: Option<f64>,
    latest_s: f64,
    frame: u32,
    left_out: LeftOut,
}

impl LiveGathering {
    pub(super) fn new(latency_s: f64) -> Self {
        let latest_s = f64::NEG_INFINITY;
        Self { latency_s, lead: None, start_s: None, latest_s, frame: 0, left_out: LeftOut::default() }
    }

    pub(super) fn left_out(&self) -> LeftOut {
        self.left_out
    }

    pub(super) fn next(
        &mut self,
        cameras: &mut [GatheredCamera],
        events: &Receiver<(usize, Event)>,
        believed: &[Body],
    ) -> Result<NextMoment> {
        loop {
            let is_open = drain(cameras, events);
            if let Some(ended) = ended(cameras, self.latest_s)? {
                return Ok(ended);
            }
            self.drop_late(cameras, believed);
            let now = Instant::now();
            let wait = match self.candidate(cameras, now) {
                None => WAIT,
                Some((lead, time_s, arrived)) => {
                    match self.complete_in(cameras, lead, time_s, arrived, now) {
                        Some(wait) => wait,
                        None if self.is_behind(&cameras[lead], time_s) => {
                            self.left_out.skipped += 1;
                            self.latest_s = time_s;
                            continue;
                        }
                        None => {
                            return Ok(NextMoment::Moment(self.moment(cameras, lead, time_s, now, believed)));
                        }
                    }
                }
            };
            if !is_open {
                return Err(Error::option("ports", "all stations have gone"));
            }
            match events.recv_timeout(wait.min(WAIT)) {
                Ok((camera, event)) => take(cameras, camera, event),
                // Nothing to wait for: the caller decides whether the run goes on.
                Err(RecvTimeoutError::Timeout) if wait >= WAIT => return Ok(NextMoment::Idle),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
        }
    }

    /// Drops observations that cannot belong to a later moment.
    fn drop_late(&mut self, cameras: &mut [GatheredCamera], believed: &[Body]) {
        for camera in cameras.iter_mut() {
            let over_s = self.latest_s - (0.5 * camera.interval_s).max(NEAR_S);
            while camera.pending.front().is_some_and(|first| first.time_s < over_s) {
                // An observation that was used, or that a nearer one replaced, is not late; one that arrived after its
                // moment is.
                if !camera.has_been_used() {
                    self.left_out.late += 1;
                }
                camera.drop_oldest(believed);
            }
        }
    }

    /// Leading camera, and time and arrival of its first frame after the latest moment.
    fn candidate(&mut self, cameras: &[GatheredCamera], now: Instant) -> Option<(usize, f64, Instant)> {
        let lead = self.choose_lead(cameras, now)?;
        self.lead = Some(lead);
        // A new leader's frames may have been used in the moments before.
        let from_s = self.latest_s + 0.4 * cameras[lead].interval_s;
        cameras[lead].first_after(from_s).map(|first| (lead, first.time_s, first.arrived))
    }

    /// Camera that leads: the present leader where the rules allow it.
    fn choose_lead(&self, cameras: &[GatheredCamera], now: Instant) -> Option<usize> {
        let present = || (0..cameras.len()).filter(|camera| cameras[*camera].is_present(now, PATIENCE_S));
        let least = |value: fn(&GatheredCamera) -> f64| {
            present().map(|i| value(&cameras[i])).fold(f64::INFINITY, f64::min)
        };
        let (interval_s, delay_s) = (least(|camera| camera.interval_s), least(|camera| camera.delay_s));
        let may_lead = || {
            present().filter(|i| {
                cameras[*i].interval_s <= FASTER * interval_s
                    && cameras[*i].delay_s <= delay_s + LATEST_LEAD_S
            })
        };
        let latest_s = may_lead().map(|i| cameras[i].delay_s).fold(f64::NEG_INFINITY, f64::max);
        // Differences below half an interval are ignored; otherwise the lead would alternate between cameras.
        let comes_last = |i: &usize| cameras[*i].delay_s + 0.5 * cameras[*i].interval_s >= latest_s;
        let fastest_first = |a: &usize, b: &usize| cameras[*a].interval_s.total_cmp(&cameras[*b].interval_s);
        self.lead
            .filter(|lead| may_lead().filter(comes_last).any(|i| i == *lead))
            .or_else(|| may_lead().filter(comes_last).min_by(fastest_first))
            .or_else(|| present().min_by(fastest_first))
    }

    /// Remaining wait for the other cameras; `None` when no nearer observation is expected.
    fn complete_in(
        &self,
        cameras: &[GatheredCamera],
        lead: usize,
        time_s: f64,
        arrived: Instant,
        now: Instant,
    ) -> Option<Duration> {
        let waited_s = now.saturating_duration_since(arrived).as_secs_f64();
        let others =
            cameras.iter().enumerate().filter(|(i, camera)| *i != lead && camera.is_present(now, PATIENCE_S));
        let wait_s = others
            .filter_map(|(_, camera)| {
                let newest_s = camera.newest_s?;
                let behind_s = time_s - newest_s;
                if behind_s <= 0.0 || NOT_BEFORE * camera.interval_s - behind_s >= behind_s {
                    return None;
                }
                // Due time of its next frame, seconds after the leading frame.
                let due_s = (camera.interval_s - behind_s)
                    + (camera.delay_s - cameras[lead].delay_s).max(0.0)
                    + SLACK_S;
                Some(due_s.clamp(0.0, self.latency_s) - waited_s)
            })
            .fold(0.0, f64::max);
        (wait_s > 0.0).then(|| Duration::from_secs_f64(wait_s))
    }

    /// Whether the tracker is so far behind that this moment is skipped for the next one.
    fn is_behind(&self, lead: &GatheredCamera, time_s: f64) -> bool {
        let age_s = utc_s(SystemTime::now()) - time_s - lead.least_delay_s;
        age_s > self.latency_s + BEHIND_S && lead.first_after(time_s).is_some()
    }

    fn moment(
        &mut self,
        cameras: &mut [GatheredCamera],
        lead: usize,
        time_s: f64,
        now: Instant,
        believed: &[Body],
    ) -> Gathered {
        let near_s = (0.5 * cameras[lead].interval_s).max(NEAR_S);
        let parts = cameras.iter_mut().map(|camera| {
            camera.keep_nearest(time_s, believed);
            nearest_part(camera, time_s, near_s).unwrap_or_else(|| MomentPart::Nothing(reason(camera, now)))
        });
        let parts = parts.collect();
        self.latest_s = time_s;
        self.frame = self.frame.saturating_add(1);
        let start_s = *self.start_s.get_or_insert(time_s);
        Gathered { frame: self.frame, time_s: time_s - start_s, utc_s: Some(time_s), parts }
    }
}

/// Reason why a camera has no observation at a moment.
fn reason(camera: &GatheredCamera, now: Instant) -> Verdict {
    match camera.health {
        health @ (Verdict::Lost | Verdict::OtherShape) => health,
        _ if camera.latest_arrival.is_none() => Verdict::Lost,
        _ if !camera.is_present(now, PATIENCE_S) => Verdict::Silent,
        _ => Verdict::Between,
    }
}

/// Processes all events that have arrived. Returns whether more can come.
fn drain(cameras: &mut [GatheredCamera], events: &Receiver<(usize, Event)>) -> bool {
    loop {
        match events.try_recv() {
            Ok((camera, event)) => take(cameras, camera, event),
            Err(TryRecvError::Empty) => return true,
            Err(TryRecvError::Disconnected) => return false,
        }
    }
}

fn take(cameras: &mut [GatheredCamera], camera: usize, event: Event) {
    if let Some(camera) = cameras.get_mut(camera) {
        camera.take(event, Some(utc_s(SystemTime::now())));
    }
}

/// The end of the run, where a recording beside live cameras has ended.
fn ended(cameras: &mut [GatheredCamera], latest_s: f64) -> Result<Option<NextMoment>> {
    for camera in cameras {
        match camera.end.take() {
            None => {}
            Some(StreamEnd::Failed(error)) => return Err(error),
            Some(StreamEnd::Ended) => {
                // Observations that have already arrived still belong to moments.
                if camera.newest_s.is_none_or(|newest| newest <= latest_s + 0.5 * camera.interval_s) {
                    return Ok(Some(NextMoment::Ended(camera.port.name.clone())));
                }
                camera.end = Some(StreamEnd::Ended);
            }
        }
    }
    Ok(None)
}
