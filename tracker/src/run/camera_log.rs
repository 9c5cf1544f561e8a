//! Reports when a camera is set aside and when it is used again.

use std::collections::BTreeMap;

use crate::foreground::Verdict;

pub(super) struct CameraLog {
    names: Vec<String>,
    latest: Vec<Verdict>,
    set_aside: BTreeMap<String, (u32, Verdict)>,
}

impl CameraLog {
    pub(super) fn new(names: Vec<String>) -> Self {
        Self { latest: vec![Verdict::Usable; names.len()], names, set_aside: BTreeMap::new() }
    }

    /// Records the health of all cameras at one moment.
    pub(super) fn note(&mut self, frame: u32, health: &[Verdict]) {
        for ((name, latest), health) in self.names.iter().zip(&mut self.latest).zip(health) {
            if *health == Verdict::Between {
                continue;
            }
            if health.is_set_aside() {
                self.set_aside.entry(name.clone()).or_insert((0, *health)).0 += 1;
            }
            if health != latest {
                match health {
                    Verdict::Usable => tracing::info!("camera `{name}`: taken back at frame {frame}"),
                    why => tracing::warn!("camera `{name}`: set aside from frame {frame}: {why}"),
                }
                *latest = *health;
            }
        }
    }

    /// For each camera that was set aside: the number of frames, and the first reason.
    pub(super) fn into_set_aside(self) -> BTreeMap<String, (u32, Verdict)> {
        self.set_aside
    }
}
