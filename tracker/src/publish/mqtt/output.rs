//! The output of a run that publishes its people, events and counts.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use mot::jsonl::FrameLine;
use scenes::room::Room;
use serde::Serialize;
use shell::options::check_numbers;
use shell::ranges::RATE_HZ;

use super::MqttOptions;
use super::connection::{Connection, ConnectionCounts};
use super::discovery::{self, CountedPlace};
use super::scenescape::Scene;
use super::topics::Topics;
use crate::events::{Clock, Event, EventOptions, Events, PlaceCount, Tally};
use crate::foreground::Verdict;
use crate::prepared_room::PreparedRoom;
use crate::tracks::frame_line;
use crate::{Error, PersonEstimate, Result};

/// Longest wait for the first attempt to connect, while the run begins.
const FIRST_ATTEMPT: Duration = Duration::from_secs(3);

/// Place of a message in errors.
const PLACE: &str = "MQTT message";

/// Form of the messages of people.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PeopleForm {
    /// The line of `tracks.jsonl`.
    #[default]
    Line,
    /// `SceneScape`'s regulated scene message, also at the topic at which its consumers look.
    SceneScape,
}

/// Options of what is published.
#[derive(Debug, Clone, PartialEq)]
pub struct PublishOptions {
    /// Name of the room in topics.
    pub room: String,
    /// Largest number of messages of people a second. Default 5.
    pub rate_hz: f64,
    /// Form of these messages.
    pub form: PeopleForm,
    /// Whether the counts are announced to Home Assistant.
    pub discovery: bool,
    /// Time of day of the run, if it is known.
    pub clock: Option<Clock>,
}

impl PublishOptions {
    /// Default options for a room of this name.
    pub fn new(room: impl Into<String>) -> Self {
        Self { room: room.into(), rate_hz: 5.0, form: PeopleForm::default(), discovery: false, clock: None }
    }
}

/// Publisher of a run. It has an event detector of its own, so that it needs no other output; the same frames give the
/// same events.
#[derive(Debug)]
pub struct MqttOutput {
    connection: Connection,
    topics: Topics,
    options: PublishOptions,
    cameras: Vec<String>,
    events: Events,
    tally: Tally,
    /// Counts that were published last.
    counts: BTreeMap<String, PlaceCount>,
    scene: Option<Scene>,
    pace: Pace,
    /// Clock of `SceneScape`'s messages in a run whose time of day is not known: the first frame is taken as captured when
    /// it arrived here.
    assumed_clock: Option<Clock>,
}

/// Message of a place's counts.
#[derive(Debug, Serialize)]
struct CountMessage {
    time: f64,
    inside: i64,
    r#in: i64,
    out: i64,
}

impl MqttOutput {
    /// Connects to the broker for a run in this room.
    ///
    /// # Errors
    /// Invalid options, or a broker that refuses this machine; one that cannot be reached is tried again.
    pub fn start(
        broker: &MqttOptions,
        options: PublishOptions,
        room: &Room,
        prepared: &PreparedRoom,
    ) -> Result<Self> {
        let is_rate = |rate: f64| rate > 0.0 && RATE_HZ.contains(rate);
        check_numbers([("mqtt_rate", options.rate_hz)], is_rate, "messages a second, above 0")?;
        let topics = Topics::new(&broker.address.prefix, &options.room);
        let connection = Connection::start(broker, topics.status())?;
        connection.check(FIRST_ATTEMPT)?;
        let cameras: Vec<String> = prepared.cameras.iter().map(|camera| camera.name.clone()).collect();
        let scene = (options.form == PeopleForm::SceneScape).then(|| {
            let filmed = prepared.cameras.iter().map(|c| (c.name.clone(), c.filmed.clone())).collect();
            Scene::new(&options.room, &broker.client_id, filmed)
        });
        let mut output = Self {
            connection,
            topics,
            cameras,
            events: Events::new(room, EventOptions::default()),
            tally: Tally::new(room),
            counts: BTreeMap::new(),
            scene,
            pace: Pace::new(options.rate_hz),
            assumed_clock: None,
            options,
        };
        if output.options.discovery {
            output.announce(room);
        }
        output.publish_counts(0.0)?;
        Ok(output)
    }

    /// Counts of the connection, for metrics; they stay available after the end.
    pub fn gauge(&self) -> impl Fn() -> ConnectionCounts + Send + Sync + 'static {
        self.connection.gauge()
    }

    /// Publishes a frame: its events and the counts that they change at once, its people if a message is due. `set_aside`
    /// are the indices of the cameras without usable pictures, with the reason.
    ///
    /// # Errors
    /// A number that cannot be written. Nothing of the network is an error.
    pub fn publish(
        &mut self,
        frame: u32,
        time_s: f64,
        people: &[PersonEstimate],
        set_aside: &[(usize, Verdict)],
    ) -> Result<()> {
        let clock = self.options.clock.as_ref();
        let line = frame_line(frame, time_s, people, &self.cameras, set_aside, clock);
        let events = self.events.step(&line);
        self.publish_events(&events)?;
        if let Some(scene) = &mut self.scene {
            scene.observe(time_s, people);
        }
        if self.pace.is_due(Instant::now()) {
            self.publish_people(&line, people)?;
        }
        Ok(())
    }

    /// Goes on with the zones, regions and lines of a changed room.
    ///
    /// # Errors
    /// A number that cannot be written.
    pub fn replace_room(&mut self, room: &Room) -> Result<()> {
        let events = self.events.replace_room(room);
        self.publish_events(&events)?;
        self.tally = self.tally.of_places(room);
        if self.options.discovery {
            self.announce(room);
        }
        self.publish_counts(events.last().map_or(0.0, |last| last.time))
    }

    /// Publishes what is decided by the end of the run, and disconnects once the broker has acknowledged it.
    ///
    /// # Errors
    /// A number that cannot be written.
    pub fn finish(mut self) -> Result<()> {
        let events = self.events.finish();
        self.publish_events(&events)?;
        self.connection.finish();
        Ok(())
    }

    fn announce(&self, room: &Room) {
        let is_line = |name: &str| room.lines.iter().any(|line| line.name == name);
        let places: Vec<CountedPlace<'_>> = self
            .tally
            .places()
            .map(|(name, _)| if is_line(name) { CountedPlace::Line(name) } else { CountedPlace::Area(name) })
            .collect();
        for (topic, config) in discovery::announcement(&self.options.room, &self.topics, &places) {
            self.connection.retain(topic, config.to_string().into_bytes());
        }
    }

    fn publish_events(&mut self, events: &[Event]) -> Result<()> {
        for event in events {
            let line = event.text(Path::new(PLACE))?;
            self.connection.publish_event(self.topics.event(), line.trim_end().into());
            self.tally.add(event);
            if let Some(scene) = &mut self.scene {
                scene.note(event);
            }
        }
        match events.last() {
            Some(last) => self.publish_counts(last.time),
            None => Ok(()),
        }
    }

    /// Publishes the counts that have changed.
    fn publish_counts(&mut self, time_s: f64) -> Result<()> {
        for (name, count) in self.tally.places() {
            if self.counts.get(name) == Some(&count) {
                continue;
            }
            self.counts.insert(name.to_owned(), count);
            let PlaceCount { entered, left } = count;
            let message = CountMessage { time: time_s, inside: count.inside(), r#in: entered, out: left };
            self.connection.retain(self.topics.count(name), json(&message)?);
        }
        Ok(())
    }

    fn publish_people(&mut self, line: &FrameLine, people: &[PersonEstimate]) -> Result<()> {
        let Some(scene) = &self.scene else {
            let text = line.text(Path::new(PLACE))?;
            self.connection.publish_latest(self.topics.people(), text.trim_end().into());
            return Ok(());
        };
        let assumed = self.assumed_clock.get_or_insert_with(|| {
            let since = Duration::try_from_secs_f64(line.time).unwrap_or_default();
            let now = SystemTime::now();
            Clock::of_system(now.checked_sub(since).unwrap_or(now))
        });
        let clock = self.options.clock.as_ref().unwrap_or(assumed);
        let text = json(&scene.message(line.time, clock, people))?;
        self.connection.publish_latest(self.topics.regulated_scene(scene.id()), text.clone());
        self.connection.publish_latest(self.topics.people(), text);
        Ok(())
    }
}

fn json(message: &impl Serialize) -> Result<Vec<u8>> {
    serde_json::to_vec(message)
        .map_err(|e| Error::option("mqtt", format!("a message cannot be written ({e})")))
}

/// Clock that allows so many messages a second on average, however long ago the last one was.
#[derive(Debug)]
struct Pace {
    interval: Duration,
    due: Option<Instant>,
}

impl Pace {
    fn new(rate_hz: f64) -> Self {
        Self { interval: Duration::try_from_secs_f64(rate_hz.recip()).unwrap_or(Duration::MAX), due: None }
    }

    /// Whether a message may be sent now, which then counts as sent.
    fn is_due(&mut self, now: Instant) -> bool {
        match self.due {
            Some(due) if now < due => false,
            // A frame that comes a little late does not delay the next; a pause is not made up for.
            Some(due) if now < due + self.interval => {
                self.due = due.checked_add(self.interval);
                true
            }
            _ => {
                self.due = now.checked_add(self.interval);
                true
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_at_most_at_their_rate() {
        let begun = Instant::now();
        let at = |ms: u64| begun + Duration::from_millis(ms);
        let sent = |rate_hz: f64, frames_ms: &mut dyn Iterator<Item = u64>| {
            let mut pace = Pace::new(rate_hz);
            frames_ms.filter(|ms| pace.is_due(at(*ms))).count()
        };
        // Ten seconds at 12 and at 30 frames a second, and at one a second.
        assert_eq!(sent(5.0, &mut (0..120).map(|i| i * 1000 / 12)), 50);
        assert_eq!(sent(5.0, &mut (0..300).map(|i| i * 1000 / 30)), 50);
        assert_eq!(sent(5.0, &mut (0..10).map(|i| i * 1000)), 10);
        assert_eq!(sent(0.5, &mut (0..120).map(|i| i * 1000 / 12)), 5);
        // Nothing is made up for after a pause.
        assert_eq!(sent(5.0, &mut [0, 5000, 5010, 5020, 5030].into_iter()), 2);
    }
}
