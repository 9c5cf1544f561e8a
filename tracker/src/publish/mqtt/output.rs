//! The output of a run that publishes its people.

use std::time::{Duration, Instant, SystemTime};

use super::connection::Connection;
use super::scenescape::Scene;
use super::topics::Topics;
use super::{MqttOptions, discovery};
use crate::prepared_room::PreparedRoom;
use crate::publish::mqtt::discovery::CountedPlace;
use crate::run::{Output, ProcessedMoment};
use crate::tracks::jsonl::FrameLine;
use crate::{Error, Result};

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
}

/// Publisher of a run's people.
#[derive(Debug)]
pub struct MqttOutput {
    connection: Connection,
    topics: Topics,
    options: PublishOptions,
    cameras: Vec<String>,
    scene: Option<Scene>,
    pace: Pace,
    /// Time of day at the run's time 0: that of the first frame's arrival here, less the frame's time.
    start: Option<SystemTime>,
}

impl MqttOutput {
    /// Connects to the broker for a run in this room.
    ///
    /// # Errors
    /// Invalid options, or a broker that refuses this machine; one that cannot be reached is tried again.
    pub fn start(broker: &MqttOptions, options: PublishOptions, prepared: &PreparedRoom) -> Result<Self> {
        if !(options.rate_hz > 0.0 && options.rate_hz.is_finite()) {
            let problem = format!("{} is no rate; give messages a second, above 0", options.rate_hz);
            return Err(Error::option("mqtt_rate", problem));
        }
        let topics = Topics::new(&broker.address.prefix, &options.room);
        let connection = Connection::start(broker, topics.status())?;
        connection.check(FIRST_ATTEMPT)?;
        let cameras: Vec<String> = prepared.cameras.iter().map(|camera| camera.name.clone()).collect();
        let scene = (options.form == PeopleForm::SceneScape).then(|| {
            let filmed = prepared.cameras.iter().map(|c| (c.name.clone(), c.filmed.clone())).collect();
            Scene::new(&options.room, &broker.client_id, filmed)
        });
        let pace = Pace::new(options.rate_hz);
        Ok(Self { connection, topics, options, cameras, scene, pace, start: None })
    }

    /// Connection to the broker.
    pub fn connection(&self) -> &Connection {
        &self.connection
    }

    /// Announces the places with counts to Home Assistant, if that is wanted.
    pub fn announce(&self, places: &[CountedPlace<'_>]) {
        if self.options.discovery {
            for (topic, config) in discovery::announcement(&self.options.room, &self.topics, places) {
                self.connection.retain(topic, config.to_string().into_bytes());
            }
        }
    }

    fn publish_people(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let time_s = followed.moment.time_s;
        let from_start =
            |now: SystemTime| now.checked_sub(Duration::try_from_secs_f64(time_s).unwrap_or_default());
        let start = *self.start.get_or_insert_with(|| {
            let now = SystemTime::now();
            from_start(now).unwrap_or(now)
        });
        if let Some(scene) = &mut self.scene {
            scene.observe(time_s, followed.people);
        }
        if !self.pace.is_due(Instant::now()) {
            return Ok(());
        }
        match &self.scene {
            None => {
                let line = FrameLine::of(followed, &self.cameras);
                let text = line.text(std::path::Path::new("people"))?;
                self.connection.publish_latest(self.topics.people(), text.trim_end().into());
            }
            Some(scene) => {
                let message = scene.message(time_s, start, followed.people);
                let text =
                    serde_json::to_vec(&message).map_err(|e| Error::option("mqtt_form", e.to_string()))?;
                self.connection.publish_latest(self.topics.regulated_scene(scene.id()), text.clone());
                self.connection.publish_latest(self.topics.people(), text);
            }
        }
        Ok(())
    }
}

impl Output for MqttOutput {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        self.publish_people(followed)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.connection.finish();
        Ok(())
    }
}

/// Longest wait for the first attempt to connect, while the run begins.
const FIRST_ATTEMPT: Duration = Duration::from_secs(3);

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
