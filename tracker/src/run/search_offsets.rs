//! Estimates the offsets between recordings in a pass before the run. A live run cannot look ahead: it corrects them
//! step by step.

use std::sync::mpsc::Receiver;

use super::clock_offsets::alignments;
use crate::gathering::ClockAlignment;
use crate::observation::Feedback;
use crate::offsets::{OffsetEstimator, OffsetOptions, Offsets};
use crate::prepared_room::PreparedRoom;
use crate::station::{Event, ObservedFrame, Port};
use crate::{Error, Result};

/// Length of the recordings that is searched, seconds; offsets do not change.
const LOOK_S: f64 = 300.0;

/// Offsets between the clocks of these stations' recordings, on top of the alignments `given`.
///
/// # Errors
/// An error of a station before its first observation, or a mask whose size is not that of its camera.
pub fn offsets_of_recordings(
    room: &PreparedRoom,
    mut ports: Vec<Port>,
    events: &Receiver<(usize, Event)>,
    given: &[ClockAlignment],
) -> Result<Offsets> {
    let options = OffsetOptions { keep_s: LOOK_S, ..OffsetOptions::recording() };
    let mut estimator = OffsetEstimator::new(room, options)?;
    let mut cameras: Vec<ScannedRecording> = ports.iter().map(|_| ScannedRecording::default()).collect();
    // The camera whose next observation is the earliest comes first, so that observations arrive in the order of their
    // times.
    while let Some(camera) = next(&mut cameras, events)? {
        let Some(seen) = cameras[camera].pending.pop_front() else { break };
        let time_s = given[camera].apply(seen.observation.time_s);
        let start_s = *cameras[camera].start_s.get_or_insert(time_s);
        (ports[camera].feedback)(Feedback { sequence: seen.observation.sequence, people: Vec::new() });
        if time_s - start_s > LOOK_S {
            cameras[camera].is_over = true;
            cameras[camera].pending.clear();
            continue;
        }
        if let Some(mask) = &seen.observation.mask {
            estimator.observe(camera, time_s, mask)?;
        }
    }
    Ok(estimator.estimate())
}

/// Estimates the offsets between the clocks of these stations' recordings, and reports them in the log; the alignments
/// `given` with the offsets added.
///
/// # Errors
/// As [`offsets_of_recordings`].
pub fn search_offsets(
    room: &PreparedRoom,
    ports: Vec<Port>,
    events: &Receiver<(usize, Event)>,
    given: &[ClockAlignment],
) -> Result<Vec<ClockAlignment>> {
    let found = offsets_of_recordings(room, ports, events, given)?;
    for (camera, offset) in found.cameras.iter().enumerate() {
        let name = &room.cameras[camera].name;
        let reference = &room.cameras[offset.reference].name;
        if !offset.is_known {
            tracing::warn!(
                "--offset auto: the people seen by `{name}` and others do not tell its offset; taking {:.2} s",
                given[camera].offset_s
            );
        } else if offset.reference != camera {
            tracing::info!(
                "camera `{name}`: its first frame was taken {:+.3} ± {:.3} s after that of `{reference}`, by the people seen",
                given[camera].offset_s + offset.offset_s,
                offset.sigma_s
            );
        }
    }
    Ok(alignments(given, &found))
}

/// State of one recording.
#[derive(Default)]
struct ScannedRecording {
    pending: std::collections::VecDeque<ObservedFrame>,
    start_s: Option<f64>,
    is_over: bool,
}

/// Camera whose observation comes next in time; `None` when all recordings are over.
fn next(cameras: &mut [ScannedRecording], events: &Receiver<(usize, Event)>) -> Result<Option<usize>> {
    while cameras.iter().any(|camera| camera.pending.is_empty() && !camera.is_over) {
        match events.recv() {
            Ok((camera, Event::Seen(seen))) if !cameras[camera].is_over => {
                cameras[camera].pending.push_back(*seen);
            }
            Ok((_, Event::Seen(_))) => {}
            Ok((camera, Event::Ended)) => cameras[camera].is_over = true,
            Ok((camera, Event::Failed(error))) => fail(&mut cameras[camera], error)?,
            Err(_) => cameras.iter_mut().for_each(|camera| camera.is_over = true),
        }
    }
    let time_s =
        |camera: &usize| cameras[*camera].pending.front().map_or(f64::INFINITY, |s| s.observation.time_s);
    let earliest = (0..cameras.len()).min_by(|a, b| time_s(a).total_cmp(&time_s(b)));
    Ok(earliest.filter(|camera| time_s(camera).is_finite()))
}

/// Ends a recording. One that fails after its first observation still counts with what it showed.
fn fail(camera: &mut ScannedRecording, error: Error) -> Result<()> {
    camera.is_over = true;
    if camera.start_s.is_none() && camera.pending.is_empty() { Err(error) } else { Ok(()) }
}
