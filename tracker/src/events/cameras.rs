//! Changes of the cameras' states.

use std::collections::BTreeMap;

use mot::jsonl::FrameLine;

use super::CameraState;

/// States of all cameras that ever had a fault.
#[derive(Debug, Clone, Default)]
pub(super) struct Cameras(BTreeMap<String, CameraWatch>);

/// State of a camera; [`CameraState::Back`] while it is usable.
#[derive(Debug, Clone)]
struct CameraWatch {
    reported: CameraState,
    latest: CameraState,
    since: (u32, f64),
}

/// A state that a camera has had for long enough, and its beginning.
pub(super) struct Changed {
    pub camera: String,
    pub state: CameraState,
    pub frame: u32,
    pub time_s: f64,
}

impl Cameras {
    /// Takes the next line; changes that have lasted for `lasting_s`.
    pub(super) fn step(&mut self, line: &FrameLine, lasting_s: f64) -> Vec<Changed> {
        for name in &line.set_aside {
            if !self.0.contains_key(name) {
                let since = (line.frame, line.time);
                let usable = CameraWatch { reported: CameraState::Back, latest: CameraState::Back, since };
                self.0.insert(name.clone(), usable);
            }
        }
        let mut changed = Vec::new();
        for (name, watch) in &mut self.0 {
            let now = line.set_aside.iter().position(|other| other == name).map_or(
                Some(CameraState::Back),
                // Files of older versions have no states.
                |i| line.states.get(i).copied().unwrap_or(Some(CameraState::Lost)),
            );
            // A camera that learns its background has no fault.
            let now = now.unwrap_or(CameraState::Back);
            if now != watch.latest {
                (watch.latest, watch.since) = (now, (line.frame, line.time));
            }
            let (frame, time_s) = watch.since;
            if watch.latest != watch.reported && line.time - time_s >= lasting_s {
                watch.reported = watch.latest;
                changed.push(Changed { camera: name.clone(), state: watch.latest, frame, time_s });
            }
        }
        changed
    }
}
