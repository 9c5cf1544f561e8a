//! Moments of recordings. Every camera is waited for, so the moments do not depend on the speed of any station.

use std::sync::mpsc::{Receiver, RecvTimeoutError};

use super::camera::{GatheredCamera, StreamEnd};
use super::{Gathered, MomentPart, NEAR_S, NextMoment, WAIT, nearest_part};
use crate::foreground::Verdict;
use crate::silhouette::Body;
use crate::station::Event;
use crate::{Error, Result};

/// Gap in the leading camera's frames, in its intervals, beyond which another camera's frames become the moments.
const GAP: f64 = 1.5;

#[derive(Debug)]
pub(super) struct RecordedGathering {
    /// Indices of the cameras, the fastest first; of equally fast ones, in their own order.
    order: Vec<usize>,
    near_s: f64,
    /// Number and time of the latest moment.
    latest: Option<(u32, f64)>,
}

impl RecordedGathering {
    pub(super) fn new(cameras: &[GatheredCamera]) -> Self {
        let mut order: Vec<usize> = (0..cameras.len()).collect();
        order.sort_by(|a, b| cameras[*a].interval_s.total_cmp(&cameras[*b].interval_s));
        let near_s = order.first().map_or(NEAR_S, |lead| (0.5 * cameras[*lead].interval_s).max(NEAR_S));
        Self { order, near_s, latest: None }
    }

    pub(super) fn next(
        &mut self,
        cameras: &mut [GatheredCamera],
        events: &Receiver<(usize, Event)>,
        believed: &[Body],
    ) -> Result<NextMoment> {
        if self.latest.is_none() {
            match start_s(cameras, events, believed)? {
                CommonStart::At(start_s) => self.skip_to(start_s, cameras, believed),
                CommonStart::Waiting => return Ok(NextMoment::Idle),
                CommonStart::Never(next) => return Ok(next),
            }
        }
        let after_s = self.latest.map_or(f64::NEG_INFINITY, |(_, time_s)| time_s);
        let Some((lead, time_s)) = self.next_time(after_s, cameras, events) else {
            return self.waiting_or_ended(cameras, events, after_s);
        };
        for camera in 0..cameras.len() {
            if !reach(cameras, events, camera, time_s) {
                return Ok(NextMoment::Idle);
            }
        }
        if let Some(ended) = ended_before(cameras, time_s)? {
            return Ok(ended);
        }
        let mut parts = Vec::with_capacity(cameras.len());
        for camera in cameras.iter_mut() {
            camera.keep_nearest(time_s, believed);
            let part = nearest_part(camera, time_s, self.near_s);
            parts.push(part.unwrap_or(MomentPart::Nothing(Verdict::Between)));
        }
        let own = cameras[lead].pending.front().map_or(0, |p| p.seen.observation.sequence);
        let following = self.latest.map_or(1, |(frame, _)| frame.saturating_add(1));
        // Only the leading camera's frames have the moments' numbers.
        let own = if lead == self.order[0] { u32::try_from(own).unwrap_or(u32::MAX) } else { 0 };
        let frame = own.max(following);
        self.latest = Some((frame, time_s));
        Ok(NextMoment::Moment(Gathered { frame, time_s, utc_s: None, parts }))
    }

    /// Drops the leading camera's frames from before all cameras have begun.
    fn skip_to(&mut self, start_s: f64, cameras: &mut [GatheredCamera], believed: &[Body]) {
        let lead = &mut cameras[self.order[0]];
        let first_s = start_s - 0.5 * lead.interval_s - 1e-9;
        while lead.pending.front().is_some_and(|first| first.time_s < first_s) {
            lead.drop_oldest(believed);
        }
    }

    /// Camera whose next frame is the next moment, and its time; `None` when that is unknown, or there is none.
    fn next_time(
        &self,
        after_s: f64,
        cameras: &mut [GatheredCamera],
        events: &Receiver<(usize, Event)>,
    ) -> Option<(usize, f64)> {
        let mut earliest: Option<(usize, f64)> = None;
        for &camera in &self.order {
            // Frames that have been used belong to moments up to half an interval later.
            let from_s =
                if earliest.is_none() { after_s + 1e-9 } else { after_s + 0.5 * cameras[camera].interval_s };
            let found = loop {
                if let Some(next) = cameras[camera].first_after(from_s) {
                    break Some(next.time_s);
                }
                if cameras[camera].end.is_some() {
                    break None;
                }
                if !receive(cameras, events) {
                    return None;
                }
            };
            let Some(time_s) = found else {
                // The run ends with the leading camera.
                if camera == self.order[0] {
                    return None;
                }
                continue;
            };
            let is_there = after_s.is_infinite() || time_s - after_s <= GAP * cameras[camera].interval_s;
            if earliest.is_none_or(|(_, earliest_s)| time_s < earliest_s) {
                earliest = Some((camera, time_s));
            }
            if is_there {
                return earliest;
            }
        }
        earliest
    }

    /// Result of a call where no next moment is known.
    fn waiting_or_ended(
        &self,
        cameras: &mut [GatheredCamera],
        events: &Receiver<(usize, Event)>,
        after_s: f64,
    ) -> Result<NextMoment> {
        let lead = self.order[0];
        if cameras[lead].end.is_none() {
            return Ok(NextMoment::Idle);
        }
        // Another camera may have ended before the leading one while the message of its station is still under way.
        let missed_s = after_s + cameras[lead].interval_s;
        for camera in 0..cameras.len() {
            if !reach(cameras, events, camera, missed_s) {
                return Ok(NextMoment::Idle);
            }
        }
        if let Some(ended) = ended_before(cameras, missed_s)? {
            return Ok(ended);
        }
        take_end(&mut cameras[lead])
    }
}

/// Time at which all cameras have begun, as far as it is known.
enum CommonStart {
    At(f64),
    Waiting,
    /// A camera has no frame.
    Never(NextMoment),
}

/// Time at which all cameras have begun: the latest of their first frames.
///
/// # Errors
/// A camera that ends before another begins.
fn start_s(
    cameras: &mut [GatheredCamera],
    events: &Receiver<(usize, Event)>,
    believed: &[Body],
) -> Result<CommonStart> {
    for camera in 0..cameras.len() {
        while cameras[camera].pending.is_empty() {
            if cameras[camera].end.is_some() {
                return take_end(&mut cameras[camera]).map(CommonStart::Never);
            }
            if !receive(cameras, events) {
                return Ok(CommonStart::Waiting);
            }
        }
    }
    let start_s =
        cameras.iter().filter_map(|c| Some(c.pending.front()?.time_s)).fold(f64::NEG_INFINITY, f64::max);
    for camera in 0..cameras.len() {
        // All frames before the start but the last are dropped; meanwhile the stations go on.
        loop {
            while cameras[camera].pending.len() > 1 && cameras[camera].pending[1].time_s < start_s {
                cameras[camera].drop_oldest(believed);
            }
            if cameras[camera].reaches(start_s) || cameras[camera].end.is_some() {
                break;
            }
            if !receive(cameras, events) {
                return Ok(CommonStart::Waiting);
            }
        }
    }
    if let Some(NextMoment::Ended(name)) = ended_before(cameras, start_s)? {
        let problem = format!(
            "there is no moment at which all cameras film: `{name}` ends before another begins; leave one out, or mend its \
             offset"
        );
        return Err(Error::option("alignments", problem));
    }
    Ok(CommonStart::At(start_s))
}

/// Waits until a camera has an observation of this time or later, or has ended. `false` after [`WAIT`] without either.
fn reach(
    cameras: &mut [GatheredCamera],
    events: &Receiver<(usize, Event)>,
    camera: usize,
    time_s: f64,
) -> bool {
    while !cameras[camera].reaches(time_s) && cameras[camera].end.is_none() {
        if !receive(cameras, events) {
            return false;
        }
    }
    true
}

/// First camera that has ended for good before a time; the error of one that has failed.
fn ended_before(cameras: &mut [GatheredCamera], time_s: f64) -> Result<Option<NextMoment>> {
    let is_over = |camera: &GatheredCamera| {
        let last_s = camera.newest_s.unwrap_or(f64::NEG_INFINITY);
        camera.end.is_some() && time_s > last_s + 0.5 * camera.interval_s
    };
    // The shortest source ends the run, even where another has an error there.
    let over = |camera: &&mut GatheredCamera| is_over(camera) && matches!(camera.end, Some(StreamEnd::Ended));
    if let Some(camera) = cameras.iter_mut().find(over) {
        return Ok(Some(NextMoment::Ended(camera.port.name.clone())));
    }
    cameras.iter_mut().find(|camera| is_over(camera)).map(take_end).transpose()
}

fn take_end(camera: &mut GatheredCamera) -> Result<NextMoment> {
    match camera.end.replace(StreamEnd::Ended) {
        Some(StreamEnd::Failed(error)) => Err(error),
        _ => Ok(NextMoment::Ended(camera.port.name.clone())),
    }
}

/// Processes one event; `false` after [`WAIT`] without any.
fn receive(cameras: &mut [GatheredCamera], events: &Receiver<(usize, Event)>) -> bool {
    match events.recv_timeout(WAIT) {
        Ok((camera, event)) => {
            if let Some(camera) = cameras.get_mut(camera) {
                camera.take(event, None);
            }
            true
        }
        Err(RecvTimeoutError::Timeout) => false,
        Err(RecvTimeoutError::Disconnected) => {
            // All stations are gone; one that did not report its end has failed.
            for camera in cameras.iter_mut().filter(|camera| camera.end.is_none()) {
                let problem = "its station has gone without a word; is its machine still there?";
                let name = format!("camera `{}`", camera.port.name);
                camera.end = Some(StreamEnd::Failed(Error::option(name, problem)));
            }
            true
        }
    }
}
