//! A station's end of the network.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::super::encoding::{Limits, Message};
use super::super::enrolment::{Enrolment, EnrolmentAction};
use super::super::keys::{self, Token};
use super::super::{Endpoints, Fingerprint, Hello};
use super::session::{Arrival, Member, Subscriptions};
use crate::observation::Feedback;
use crate::station::Event;
use crate::{Error, Result};

/// Capacity for feedback that waits for the station; more than can ever wait in a recording.
const FEEDBACK_QUEUE: usize = 4 * Feedback::WINDOW as usize;
/// Time within which the gatherer must confirm that a recording's end has arrived.
const END_BOUND: Duration = Duration::from_secs(5);
/// Interval at which a wait checks whether it is over.
const LOOK: Duration = Duration::from_millis(50);
/// Time after which a wait is logged.
const QUIET: Duration = Duration::from_secs(1);
/// Interval at which an end is repeated until it is confirmed.
const REPEAT: Duration = Duration::from_millis(500);

/// A station's end of the network. Dropping it leaves the network, within 2 s.
pub struct Uplink {
    shared: Arc<UplinkState>,
    stop: Sender<UplinkInput>,
    driver: Option<JoinHandle<()>>,
}

struct UplinkState {
    member: Member,
    id: String,
    room: Fingerprint,
    camera: String,
    is_live: bool,
    enrolment: Mutex<Enrolment>,
    changed: Condvar,
}

enum UplinkInput {
    Arrival(Arrival),
    Stop,
}

impl Uplink {
    /// Joins the network as the station of one camera. Feedback comes through the receiver, which ends when a
    /// recording's station cannot go on; [`Self::send`] then returns the reason. Live stations that do not take
    /// feedback in time miss some.
    ///
    /// # Errors
    /// An unusable endpoint or certificate.
    pub fn open(hello: Hello, endpoints: &Endpoints) -> Result<(Self, Receiver<Feedback>)> {
        // A hello that cannot be encoded is reported now, before the gatherer waits for it.
        Message::Hello(hello.clone()).encode().map_err(|malformed| {
            Error::option(format!("station `{}`", hello.camera), malformed.to_string())
        })?;
        let (arrivals, inputs) = mpsc::channel();
        let (feedback_in, feedback) = mpsc::sync_channel(FEEDBACK_QUEUE);
        let (room, camera, is_live) = (hello.room, hello.camera.clone(), hello.is_live);
        let subscriptions = |id: &str| Subscriptions {
            token: Some(Token::new(room, Some(&camera), id).key()),
            tokens: keys::GATHERERS,
            messages: vec![keys::messages_to_station(room, &camera, id)],
        };
        let arrived = {
            let arrivals = arrivals.clone();
            move |arrival| drop(arrivals.send(UplinkInput::Arrival(arrival)))
        };
        let member = Member::join(endpoints, Limits::NO_MASK.longest_message(), subscriptions, arrived)?;
        let shared = Arc::new(UplinkState {
            id: member.id(),
            member,
            room,
            camera,
            is_live,
            enrolment: Mutex::new(Enrolment::new(hello, feedback_in)),
            changed: Condvar::new(),
        });
        let driver = {
            let shared = Arc::clone(&shared);
            thread::Builder::new().name("uplink".to_owned()).spawn(move || shared.drive(&inputs))
        };
        let driver =
            driver.map_err(|e| Error::option("stations", format!("no thread can be started: {e}")))?;
        Ok((Self { shared, stop: arrivals, driver: Some(driver) }, feedback))
    }

    /// Waits until the gatherer wants observations; a recording's first frame must not be sent before. Without a bound
    /// the wait is unlimited.
    ///
    /// # Errors
    /// A refusal by the gatherer, no gatherer within the bound, or a set `is_interrupted`.
    pub fn wait_for_start(&self, bound: Option<Duration>, is_interrupted: &AtomicBool) -> Result<()> {
        let begun = Instant::now();
        let mut is_logged = false;
        let mut enrolment = self.shared.lock();
        loop {
            if let Some(failure) = enrolment.failure() {
                return Err(self.shared.error(failure));
            }
            if enrolment.started_by().is_some() {
                return Ok(());
            }
            if is_interrupted.load(Ordering::Relaxed) {
                return Err(self.shared.error("interrupted while it waited for the gatherer"));
            }
            if let Some(bound) = bound.filter(|bound| begun.elapsed() >= *bound) {
                let hint = enrolment
                    .hint()
                    .unwrap_or("start `tracker run` with --stations, and check the endpoints");
                return Err(self
                    .shared
                    .error(&format!("no gatherer within {} s: {hint}", bound.as_secs_f64())));
            }
            if begun.elapsed() >= QUIET && !std::mem::replace(&mut is_logged, true) {
                tracing::info!("station `{}` waits for its gatherer", self.shared.camera);
            }
            enrolment = self.shared.wait(enrolment);
        }
    }

    /// Sends an event of the station. A recording's observation waits for the network and is never lost; a live one is
    /// dropped where the network is slower than the camera or there is no gatherer. An end or a failure is repeated
    /// until it has arrived, at most for 5 s.
    ///
    /// # Errors
    /// A refusal by the gatherer, or the loss of a recording's gatherer.
    pub fn send(&mut self, event: Event) -> Result<()> {
        let message = match event {
            Event::Seen(seen) => Message::Seen(seen),
            Event::Ended => Message::End,
            Event::Failed(error) => Message::Failure(error.to_string()),
        };
        let gatherer = {
            let enrolment = self.shared.lock();
            if let Some(failure) = enrolment.failure() {
                return Err(self.shared.error(failure));
            }
            match enrolment.started_by() {
                Some(gatherer) => gatherer.to_owned(),
                None if self.shared.is_live => return Ok(()),
                None => {
                    return Err(self.shared.error("its observations are not wanted yet; wait for the start"));
                }
            }
        };
        let bytes = message.encode().map_err(|malformed| self.shared.error(&malformed.to_string()))?;
        if matches!(message, Message::Seen(_)) {
            self.shared.send(&gatherer, bytes, self.shared.is_live);
            return Ok(());
        }
        self.send_last(&gatherer, &bytes);
        Ok(())
    }

    fn send_last(&self, gatherer: &str, bytes: &[u8]) {
        let begun = Instant::now();
        let mut sent: Option<Instant> = None;
        loop {
            if sent.is_none_or(|sent| sent.elapsed() >= REPEAT) {
                self.shared.send(gatherer, bytes.to_vec(), false);
                sent = Some(Instant::now());
            }
            let enrolment = self.shared.lock();
            let is_alone = enrolment.started_by() != Some(gatherer);
            if enrolment.is_done() || is_alone || begun.elapsed() >= END_BOUND {
                return;
            }
            drop(self.shared.wait(enrolment));
        }
    }
}

impl UplinkState {
    fn lock(&self) -> MutexGuard<'_, Enrolment> {
        self.enrolment.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a change, at most `LOOK`.
    fn wait<'a>(&self, enrolment: MutexGuard<'a, Enrolment>) -> MutexGuard<'a, Enrolment> {
        self.changed.wait_timeout(enrolment, LOOK).unwrap_or_else(PoisonError::into_inner).0
    }

    fn send(&self, gatherer: &str, bytes: Vec<u8>, may_drop: bool) {
        self.member.send(&keys::messages(self.room, "up", &self.camera, &self.id, gatherer), bytes, may_drop);
    }

    fn error(&self, problem: &str) -> Error {
        Error::option(format!("station `{}`", self.camera), problem)
    }

    fn drive(&self, inputs: &Receiver<UplinkInput>) {
        while let Ok(UplinkInput::Arrival(arrival)) = inputs.recv() {
            let actions = {
                let mut enrolment = self.lock();
                match arrival {
                    Arrival::Appeared(key) => {
                        Token::of(&key).map_or_else(Vec::new, |token| enrolment.token_appeared(&token))
                    }
                    Arrival::Vanished(key) => {
                        Token::of(&key).map_or_else(Vec::new, |token| enrolment.token_vanished(&token.id))
                    }
                    Arrival::Message { key, bytes } => keys::parties(&key)
                        .map_or_else(Vec::new, |(_, _, gatherer)| enrolment.message(&gatherer, &bytes)),
                }
            };
            self.changed.notify_all();
            for action in actions {
                match action {
                    EnrolmentAction::Log(line) => tracing::warn!("station `{}`: {line}", self.camera),
                    EnrolmentAction::Send(gatherer, message) => {
                        if let Ok(bytes) = message.encode() {
                            self.send(&gatherer, bytes, false);
                        }
                    }
                }
            }
        }
    }
}

impl Drop for Uplink {
    fn drop(&mut self) {
        let _ = self.stop.send(UplinkInput::Stop);
        if let Some(driver) = self.driver.take() {
            let _ = driver.join();
        }
    }
}

impl std::fmt::Debug for Uplink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Uplink").field("camera", &self.shared.camera).finish_non_exhaustive()
    }
}
