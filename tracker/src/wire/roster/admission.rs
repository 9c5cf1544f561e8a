//! Admission of stations: which one holds a camera, and which are refused.

use std::time::{Duration, Instant};

use super::{Hello, Latest, Roster, RosterAction, SILENCE};
use crate::Error;
use crate::foreground::Verdict;
use crate::observation::Observation;
use crate::station::{Event, ObservedFrame, Pictures};
use crate::wire::encoding::Message;

impl Roster {
    pub(super) fn decide_rivals(&mut self, now: Instant) -> Vec<RosterAction> {
        let rivals = self.stations.iter().filter_map(|(id, s)| Some((id.clone(), s.camera, s.rival_since?)));
        let rivals: Vec<_> = rivals.collect();
        let mut actions = Vec::new();
        for (rival, camera, since) in rivals {
            let holder = self.slots[camera].holder.clone();
            match holder.and_then(|id| self.stations.get(&id)) {
                None => actions.extend(self.admit(&rival, now)),
                Some(holder) if holder.heard > since => {
                    let line = format!(
                        "another station has camera `{}`: this one is refused; stop one of the two",
                        self.expected.cameras[camera].name
                    );
                    actions.extend(self.refuse(&rival, &line, now));
                }
                Some(_) if now - since >= SILENCE => {
                    actions.extend(self.release(camera, now));
                    actions.extend(self.admit(&rival, now));
                }
                Some(_) => {}
            }
        }
        actions
    }

    pub(super) fn hello(&mut self, id: &str, hello: Hello, now: Instant) -> Vec<RosterAction> {
        let Some(station) = self.stations.get_mut(id) else { return Vec::new() };
        let camera = &self.expected.cameras[station.camera];
        let slot = &self.slots[station.camera];
        if station.hello.is_some() {
            return Vec::new();
        }
        let problem = if hello.room != self.expected.room || hello.camera != camera.name {
            Some("its hello and its key disagree".to_owned())
        } else if (hello.width, hello.height) != (camera.width, camera.height) {
            Some(format!(
                "its masks are {} × {} pixels, here {} × {}; give both the same --mask-width",
                hello.width, hello.height, camera.width, camera.height
            ))
        } else if slot.is_over {
            Some(format!("the recording of camera `{}` is over", camera.name))
        } else if self.is_running && !hello.is_live {
            Some("the run has begun, and recordings begin together; start it before the run".to_owned())
        } else {
            None
        };
        station.hello = Some(hello);
        if let Some(problem) = problem {
            return self.refuse(id, &problem, now);
        }
        if slot.holder.is_some() {
            station.rival_since = Some(now);
            return self.decide_rivals(now);
        }
        self.admit(id, now)
    }

    /// Makes a station its camera's holder.
    pub(super) fn admit(&mut self, id: &str, now: Instant) -> Vec<RosterAction> {
        let Some(station) = self.stations.get_mut(id) else { return Vec::new() };
        station.rival_since = None;
        let slot = &mut self.slots[station.camera];
        let is_back = slot.hello.is_some();
        slot.hello.clone_from(&station.hello);
        slot.holder = Some(id.to_owned());
        slot.offset = slot.latest.as_ref().map_or(0, |latest| latest.sequence);
        let name = &self.expected.cameras[station.camera].name;
        let line = format!("station `{name}` is {}", if is_back { "back" } else { "there" });
        let mut actions = vec![RosterAction::Log(line)];
        if self.is_running {
            actions.extend(self.send(id, Message::Start, now));
        }
        actions
    }

    /// Takes a camera from its holder, which has left.
    pub(super) fn release(&mut self, camera: usize, now: Instant) -> Vec<RosterAction> {
        let slot = &mut self.slots[camera];
        let name = &self.expected.cameras[camera].name;
        slot.holder = None;
        if slot.is_over {
            return Vec::new();
        }
        let is_recording = slot.hello.as_ref().is_some_and(|hello| !hello.is_live);
        if is_recording && self.is_running {
            slot.is_over = true;
            let problem = "it has gone before its recording's end; see its own messages, and run again";
            return vec![RosterAction::Deliver(
                camera,
                Event::Failed(Error::option(format!("station `{name}`"), problem)),
            )];
        }
        let mut actions = vec![RosterAction::Log(format!("station `{name}` has gone"))];
        if let Some(latest) = slot.latest.as_mut().filter(|latest| !latest.is_loss) {
            let time_s = latest.time_s + (now - latest.at).as_secs_f64();
            *latest = Latest { sequence: latest.sequence + 1, time_s, at: now, is_loss: true };
            let lost = Observation::unusable(latest.sequence, time_s, Verdict::Lost);
            let seen = ObservedFrame {
                observation: lost,
                pictures: Pictures::default(),
                decode: Duration::ZERO,
                foreground: Duration::ZERO,
            };
            actions.push(RosterAction::Deliver(camera, Event::Seen(Box::new(seen))));
        }
        actions
    }

    pub(super) fn refuse(&mut self, id: &str, problem: &str, now: Instant) -> Vec<RosterAction> {
        let Some(station) = self.stations.get_mut(id) else { return Vec::new() };
        station.rival_since = None;
        station.refusal = Some(problem.to_owned());
        let name = &self.expected.cameras[station.camera].name;
        let line = format!("a station of camera `{name}` is refused: {problem}");
        [RosterAction::Log(line)]
            .into_iter()
            .chain(self.send(id, Message::Refusal(problem.to_owned()), now))
            .collect()
    }
}
