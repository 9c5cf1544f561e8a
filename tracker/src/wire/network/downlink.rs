//! A gatherer's end of the network.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::super::encoding::Limits;
use super::super::keys::{self, Token};
use super::super::roster::{Roster, RosterAction};
use super::super::{Endpoints, ExpectedStations, Fingerprint};
use super::session::{Arrival, Member, Subscriptions};
use crate::observation::Feedback;
use crate::station::{Inbox, Port};
use crate::{Error, Result};

/// Interval of the roster's clock.
const TICK: Duration = Duration::from_millis(50);
/// Time to wait for further stations if all present ones are live; they may come at any time.
const LIVE_GRACE: Duration = Duration::from_secs(1);
/// Time after which a wait is logged.
const QUIET: Duration = Duration::from_secs(1);

/// A gatherer's end of the network. Dropping it leaves the network, within 2 s.
pub struct Downlink {
    stop: Sender<DownlinkInput>,
    driver: Option<JoinHandle<()>>,
    garbage: Arc<AtomicU64>,
}

enum DownlinkInput {
    Arrival(Arrival),
    Feedback(usize, Feedback),
    Stop,
}

/// Thread that runs the roster: handles all inputs, one after the other.
struct Driver {
    member: Member,
    id: String,
    room: Fingerprint,
    roster: Roster,
    inputs: Receiver<DownlinkInput>,
    inbox: Inbox,
    garbage: Arc<AtomicU64>,
    ticked: Instant,
}

impl Downlink {
    /// Joins the network as the gatherer of a room, waits for the stations of all cameras, and starts them together.
    /// From then on their events come into the inbox, and their ports take feedback: one a camera, in the order of
    /// `expected`.
    ///
    /// If all present stations are live, further ones are waited for only a second: live stations may come late, leave
    /// and come back. A live station that leaves gives one observation of
    /// [`Verdict::Lost`](crate::foreground::Verdict::Lost); sequence numbers go on growing when it is back. A
    /// recording's station that leaves before its end gives an [`Event::Failed`](crate::station::Event::Failed).
    ///
    /// # Errors
    /// An unusable endpoint or certificate, missing stations after `bound`, or a set `is_interrupted`.
    pub fn open(
        expected: ExpectedStations,
        endpoints: &Endpoints,
        bound: Duration,
        is_interrupted: &AtomicBool,
        inbox: Inbox,
    ) -> Result<(Vec<Port>, Self)> {
        let (arrivals, inputs) = mpsc::channel();
        let room = expected.room;
        let longest =
            expected.cameras.iter().map(|c| Limits { width: c.width, height: c.height }.longest_message());
        let subscriptions = |id: &str| Subscriptions {
            token: Some(Token::new(room, None, id).key()),
            tokens: keys::STATIONS,
            messages: vec![keys::messages_to_gatherer(room, id)],
        };
        let arrived = {
            let arrivals = arrivals.clone();
            move |arrival| drop(arrivals.send(DownlinkInput::Arrival(arrival)))
        };
        let member = Member::join(endpoints, longest.max().unwrap_or(0), subscriptions, arrived)?;
        let garbage = Arc::new(AtomicU64::new(0));
        let names: Vec<String> = expected.cameras.iter().map(|camera| camera.name.clone()).collect();
        let mut driver = Driver {
            id: member.id(),
            member,
            room,
            roster: Roster::new(expected),
            inputs,
            inbox,
            garbage: Arc::clone(&garbage),
            ticked: Instant::now(),
        };
        driver.wait_for_stations(bound, is_interrupted)?;
        let ports = driver.roster.hellos().zip(names).enumerate().map(|(camera, (hello, name))| {
            let feedback = arrivals.clone();
            Port {
                name,
                is_live: hello.is_none_or(|hello| hello.is_live),
                rate_hz: hello.and_then(|hello| hello.rate_hz),
                has_boxes_alone: hello.is_some_and(|hello| hello.has_boxes_alone),
                feedback: Box::new(move |message| {
                    drop(feedback.send(DownlinkInput::Feedback(camera, message)));
                }),
            }
        });
        let ports = ports.collect();
        let actions = driver.roster.start(Instant::now());
        driver.act(actions);
        let driver = thread::Builder::new().name("downlink".to_owned()).spawn(move || while driver.step() {});
        let driver =
            driver.map_err(|e| Error::option("stations", format!("no thread can be started: {e}")))?;
        Ok((ports, Self { stop: arrivals, driver: Some(driver), garbage }))
    }

    /// Number of messages that were refused: of unknown senders, malformed, out of order.
    pub fn garbage(&self) -> u64 {
        self.garbage.load(Ordering::Relaxed)
    }
}

impl Driver {
    fn wait_for_stations(&mut self, bound: Duration, is_interrupted: &AtomicBool) -> Result<()> {
        let begun = Instant::now();
        let mut first: Option<Instant> = None;
        let mut is_logged = false;
        loop {
            self.step();
            let missing = self.roster.missing();
            if missing.is_empty() {
                return Ok(());
            }
            let there: Vec<_> = self.roster.hellos().flatten().collect();
            let are_live = !there.is_empty() && there.iter().all(|hello| hello.is_live);
            if are_live && first.get_or_insert_with(Instant::now).elapsed() >= LIVE_GRACE {
                tracing::warn!("begins without the stations of {}; they may come later", listed(&missing));
                return Ok(());
            }
            if is_interrupted.load(Ordering::Relaxed) {
                return Err(Error::option("expected", "interrupted while waiting for stations"));
            }
            if begun.elapsed() >= bound {
                let problem = format!(
                    "no station of {} within {} s; start `tracker station … --camera NAME`, and check its endpoints and \
                     messages",
                    listed(&missing),
                    bound.as_secs_f64()
                );
                return Err(Error::option("expected", problem));
            }
            if begun.elapsed() >= QUIET && !is_logged {
                tracing::info!("waits for the stations of {}", listed(&missing));
                is_logged = true;
            }
        }
    }

    /// Handles one input, or lets a tick pass; `false` at the end.
    fn step(&mut self) -> bool {
        let input = self.inputs.recv_timeout(TICK);
        let now = Instant::now();
        let actions = match input {
            Ok(DownlinkInput::Arrival(arrival)) => self.arrived(arrival, now),
            Ok(DownlinkInput::Feedback(camera, feedback)) => self.roster.feedback(camera, feedback, now),
            Err(mpsc::RecvTimeoutError::Timeout) => Vec::new(),
            Ok(DownlinkInput::Stop) | Err(mpsc::RecvTimeoutError::Disconnected) => return false,
        };
        self.act(actions);
        if now - self.ticked >= TICK {
            self.ticked = now;
            let actions = self.roster.tick(now);
            self.act(actions);
        }
        self.garbage.store(self.roster.garbage(), Ordering::Relaxed);
        true
    }

    /// Handles an arrival; unknown keys are ignored.
    fn arrived(&mut self, arrival: Arrival, now: Instant) -> Vec<RosterAction> {
        let actions = match arrival {
            Arrival::Appeared(key) => Token::of(&key).map(|token| self.roster.token_appeared(&token, now)),
            Arrival::Vanished(key) => Token::of(&key).map(|token| self.roster.token_vanished(&token.id, now)),
            Arrival::Message { key, bytes } => keys::parties(&key)
                .map(|(camera, station, _)| self.roster.message(&camera, &station, &bytes, now)),
        };
        actions.unwrap_or_default()
    }

    fn act(&self, actions: Vec<RosterAction>) {
        for action in actions {
            match action {
                RosterAction::Log(line) => tracing::warn!("{line}"),
                // A gathering that has ended takes no more events.
                RosterAction::Deliver(camera, event) => drop(self.inbox.send((camera, event))),
                RosterAction::Send { camera, station, message, may_drop } => match message.encode() {
                    Ok(bytes) => {
                        let key = keys::messages(self.room, "down", &camera, &station, &self.id);
                        self.member.send(&key, bytes, may_drop);
                    }
                    Err(malformed) => tracing::warn!("nothing is sent to station `{camera}`: {malformed}"),
                },
            }
        }
    }
}

fn listed(cameras: &[&str]) -> String {
    cameras.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

impl Drop for Downlink {
    fn drop(&mut self) {
        let _ = self.stop.send(DownlinkInput::Stop);
        if let Some(driver) = self.driver.take() {
            let _ = driver.join();
        }
    }
}

impl std::fmt::Debug for Downlink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Downlink").field("garbage", &self.garbage()).finish_non_exhaustive()
    }
}
