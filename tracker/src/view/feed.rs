//! Data of a run for the page, frame by frame: people, counts, events, health of the cameras.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mot::jsonl::PersonLine;
use scenes::room::Room;
use serde::Serialize;
use tokio::sync::mpsc::Sender;

use crate::PersonEstimate;
use crate::events::{CameraState, Clock, Event, EventOptions, Events, Tally};
use crate::foreground::Verdict;
use crate::tracks::frame_line;

/// Number of frames that wait for the page's thread before further ones are dropped.
pub(super) const WAITING_FRAMES: usize = 1024;
/// Number of undelivered events that are kept while frames are dropped.
const MOST_UNDELIVERED: usize = 1000;
/// Time over which the rate of frames is measured.
const RATE_WINDOW: Duration = Duration::from_secs(2);

/// Sender of a run's frames to its page. Never waits: frames are dropped when the page's thread is behind.
#[derive(Debug)]
pub struct LiveFeed {
    events: Events,
    tally: Tally,
    cameras: Vec<String>,
    clock: Option<Clock>,
    page: Sender<FeedFrame>,
    /// Events whose frames were dropped.
    undelivered: Vec<Event>,
    /// Times at which the latest frames were processed.
    processed: VecDeque<Instant>,
}

/// A frame on its way to the page.
#[derive(Debug, Serialize)]
pub(super) struct FeedFrame {
    frame: u32,
    time: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    clock: Option<String>,
    people: Vec<PersonLine>,
    /// State of each camera, in the order of the run; `None` for one that works.
    health: Vec<Option<&'static str>>,
    /// People inside, in and out of each place: the room, zones, regions, lines.
    counts: Vec<[i64; 3]>,
    /// Rate of processing, frames a second.
    rate: f64,
    /// Time from capture to result, seconds, where the cameras are live.
    #[serde(skip_serializing_if = "Option::is_none")]
    latency: Option<f64>,
    /// Number of frames and moments that a live run has left out.
    left_out: u64,
    #[serde(skip)]
    pub(super) events: Vec<Event>,
}

/// A processed frame, as the run knows it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FeedInput<'a> {
    pub(crate) frame: u32,
    pub(crate) time_s: f64,
    pub(crate) people: &'a [PersonEstimate],
    pub(crate) verdicts: &'a [Verdict],
    /// Capture time, seconds since 1970, where the cameras are live.
    pub(crate) utc_s: Option<f64>,
    /// Number of frames and moments that were left out until now.
    pub(crate) left_out: u64,
}

impl LiveFeed {
    pub(super) fn new(
        page: Sender<FeedFrame>,
        room: &Room,
        cameras: Vec<String>,
        clock: Option<Clock>,
    ) -> Self {
        Self {
            events: Events::new(room, EventOptions::default()),
            tally: Tally::new(room),
            cameras,
            clock,
            page,
            undelivered: Vec::new(),
            processed: VecDeque::new(),
        }
    }

    /// Takes the next frame.
    pub(crate) fn put(&mut self, input: FeedInput<'_>) {
        let FeedInput { frame, time_s, people, verdicts, utc_s, left_out } = input;
        let faulty = verdicts.iter().copied().enumerate().filter(|(_, verdict)| verdict.is_set_aside());
        let set_aside: Vec<(usize, Verdict)> = faulty.collect();
        let line = frame_line(frame, time_s, people, &self.cameras, &set_aside, self.clock.as_ref());
        let events = self.events.step(&line);
        for event in &events {
            self.tally.add(event);
        }
        self.undelivered.extend(events);
        let excess = self.undelivered.len().saturating_sub(MOST_UNDELIVERED);
        self.undelivered.drain(..excess);
        let counts = self.tally.places().map(|(_, count)| [count.inside(), count.entered, count.left]);
        let frame = FeedFrame {
            frame,
            time: line.time,
            clock: line.clock,
            people: line.people,
            health: verdicts.iter().map(|verdict| health(*verdict)).collect(),
            counts: counts.collect(),
            rate: self.rate(Instant::now()),
            latency: utc_s.map(latency_s),
            left_out,
            events: Vec::new(),
        };
        // A page that has ended or is behind takes none.
        if let Ok(place) = self.page.try_reserve() {
            place.send(FeedFrame { events: std::mem::take(&mut self.undelivered), ..frame });
        }
    }

    /// Rate of processing over the last seconds, frames a second, to one decimal; 0 at the first frame.
    fn rate(&mut self, now: Instant) -> f64 {
        self.processed.push_back(now);
        while self.processed.len() > 2 && now - self.processed[0] > RATE_WINDOW {
            self.processed.pop_front();
        }
        let span_s = (now - self.processed[0]).as_secs_f64();
        let rate = (self.processed.len() - 1) as f64 / span_s.max(1e-3);
        (rate * 10.0).round() / 10.0
    }
}

/// Time since the capture, seconds, to the millisecond.
fn latency_s(utc_s: f64) -> f64 {
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
    ((now_s - utc_s).max(0.0) * 1e3).round() / 1e3
}

/// Word for a camera's fault; `None` for a camera that works.
fn health(verdict: Verdict) -> Option<&'static str> {
    match verdict.camera_state() {
        Some(CameraState::Back) => None,
        Some(CameraState::Lost) => Some("lost"),
        Some(CameraState::Frozen) => Some("frozen"),
        Some(CameraState::Dark) => Some("dark"),
        Some(CameraState::Moved) => Some("moved"),
        None => Some("learning"),
    }
}

/// The newest frames and events, as the page gets them.
#[derive(Debug, Default)]
pub(super) struct FrameRing {
    /// Number of frames so far.
    pub(super) number: u64,
    /// Whether there will be no further frames.
    pub(super) has_ended: bool,
    /// JSON of each frame, the last one with the present number.
    frames: VecDeque<Arc<str>>,
    /// Bytes of all these frames.
    bytes: usize,
    /// JSON of each event, with the number of the frame that brought it.
    events: VecDeque<(u64, Arc<str>)>,
}

impl FrameRing {
    /// Largest number of frames.
    const MOST_FRAMES: usize = 600;
    /// Largest number of bytes of all frames: pages have to be there within a second.
    const MOST_BYTES: usize = 500_000;
    /// Largest number of events.
    const MOST_EVENTS: usize = 200;

    /// Adds a frame, and forgets the oldest ones.
    pub(super) fn push(&mut self, frame: &FeedFrame) {
        // Numbers that no JSON can hold are written as null.
        let Ok(json) = serde_json::to_string(frame) else { return };
        self.number += 1;
        self.bytes += json.len();
        self.frames.push_back(json.into());
        while self.frames.len() > Self::MOST_FRAMES
            || (self.bytes > Self::MOST_BYTES && self.frames.len() > 1)
        {
            self.bytes -= self.frames.pop_front().map_or(0, |oldest| oldest.len());
        }
        let events = frame.events.iter().filter_map(|event| serde_json::to_string(event).ok());
        self.events.extend(events.map(|json| (self.number, json.into())));
        let excess = self.events.len().saturating_sub(Self::MOST_EVENTS);
        self.events.drain(..excess);
    }

    /// JSON of the frames and events after the frame of a number; of all that are kept for a number of another run.
    pub(super) fn since(&self, after: u64) -> String {
        let after = if after > self.number { 0 } else { after };
        let fresh = usize::try_from(self.number - after).unwrap_or(usize::MAX).min(self.frames.len());
        let frames: Vec<&str> =
            self.frames.iter().skip(self.frames.len() - fresh).map(|json| &**json).collect();
        let is_fresh = |(number, json): &'_ (u64, Arc<str>)| (*number > after).then(|| json.to_string());
        let events: Vec<String> = self.events.iter().filter_map(is_fresh).collect();
        format!(
            r#"{{"number":{},"has_ended":{},"frames":[{}],"events":[{}]}}"#,
            self.number,
            self.has_ended,
            frames.join(","),
            events.join(",")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::polygon::Polygon;
    use scenes::room::{Zone, ZoneKind};
    use serde_json::Value;

    fn room() -> Room {
        let square = |x: f64| Polygon::rectangle([x, -1.0].into(), [x + 2.0, 1.0].into());
        let zone = Zone { name: "door".into(), polygon: square(0.0), kind: ZoneKind::Both };
        Room { zones: vec![zone], ..Room::default() }
    }

    fn input<'a>(frame: u32, people: &'a [PersonEstimate], verdicts: &'a [Verdict]) -> FeedInput<'a> {
        FeedInput { frame, time_s: f64::from(frame) / 10.0, people, verdicts, utc_s: None, left_out: 3 }
    }

    #[test]
    fn frames_carry_people_counts_events_and_health() {
        let (sender, mut received) = tokio::sync::mpsc::channel(WAITING_FRAMES);
        let mut feed = LiveFeed::new(sender, &room(), vec!["a".into(), "b".into()], None);
        let mut ring = FrameRing::default();
        for frame in 1..=30 {
            let somebody = [PersonEstimate::standing(4, 1.0, 0.0)];
            feed.put(input(frame, &somebody, &[Verdict::Usable, Verdict::Frozen]));
            ring.push(&received.try_recv().unwrap());
        }
        let all: Value = serde_json::from_str(&ring.since(0)).unwrap();
        assert_eq!((all["frames"].as_array().unwrap().len(), &all["number"]), (30, &30.into()));
        let last = &all["frames"][29];
        assert_eq!((&last["people"][0]["id"], &last["people"][0]["x"]), (&4.into(), &1.0.into()));
        assert_eq!(last["health"], serde_json::json!([null, "frozen"]));
        assert_eq!((&last["counts"][0], &last["left_out"]), (&serde_json::json!([1, 1, 0]), &3.into()));
        let kinds: Vec<&str> =
            all["events"].as_array().unwrap().iter().map(|event| event["kind"].as_str().unwrap()).collect();
        assert!(kinds.contains(&"appear") && kinds.contains(&"camera"), "{kinds:?}");
        // Only what is new; and everything for a page of another run.
        let news: Value = serde_json::from_str(&ring.since(28)).unwrap();
        assert_eq!((news["frames"].as_array().unwrap().len(), &news["frames"][0]["frame"]), (2, &29.into()));
        assert_eq!(news["events"], serde_json::json!([]));
        assert_eq!(ring.since(99), ring.since(0));
    }

    #[test]
    fn a_page_that_takes_nothing_loses_frames_but_no_events() {
        let (sender, mut received) = tokio::sync::mpsc::channel(1);
        let mut feed = LiveFeed::new(sender, &room(), vec!["a".into()], None);
        let somebody = [PersonEstimate::standing(4, 1.0, 0.0)];
        for frame in 1..=30 {
            feed.put(input(frame, &somebody, &[Verdict::Usable]));
        }
        assert_eq!(received.try_recv().unwrap().frame, 1);
        feed.put(input(31, &somebody, &[Verdict::Usable]));
        let next = received.try_recv().unwrap();
        assert_eq!(next.frame, 31);
        assert!(next.events.iter().any(|event| event.kind == crate::events::EventKind::Appear));
    }

    #[test]
    fn the_ring_is_bounded() {
        let mut ring = FrameRing::default();
        let people: Vec<PersonEstimate> = (1..=40).map(|id| PersonEstimate::standing(id, 1.0, 0.0)).collect();
        let (sender, mut received) = tokio::sync::mpsc::channel(1);
        let mut feed = LiveFeed::new(sender, &Room::default(), Vec::new(), None);
        for frame in 1..=700 {
            feed.put(input(frame, &people, &[]));
            ring.push(&received.try_recv().unwrap());
        }
        let text = ring.since(0);
        assert!(text.len() < FrameRing::MOST_BYTES + 100_000 && text.ends_with("]}"), "{}", text.len());
        assert_eq!(ring.number, 700);
    }
}
