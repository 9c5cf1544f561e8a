//! Tests of stations and gatherers as sessions of their own on the loopback. Each test has a port of its own and ends
//! in bounded time.

mod faults;
mod recordings;
mod tls;

use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{self, Receiver};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::{Downlink, Uplink};
use crate::Result;
use crate::foreground::Verdict;
use crate::observation::{Colours, Feedback, Mask, Observation};
use crate::silhouette::Body;
use crate::station::Port;
use crate::station::{Event, ObservedFrame, Pictures};
use crate::wire::test_loopback::free_address;
use crate::wire::{Endpoints, ExpectedCamera, ExpectedStations, Fingerprint, Hello};

/// Bound of every wait in these tests.
const BOUND: Duration = Duration::from_secs(20);
const ROOM: Fingerprint = Fingerprint([5; Fingerprint::BYTES]);
const SIZE: (u32, u32) = (96, 72);
/// Interrupt flag that is never set.
static GO_ON: AtomicBool = AtomicBool::new(false);

fn listening(address: &str) -> Endpoints {
    Endpoints { listen: vec![address.parse().unwrap()], ..Endpoints::default() }
}

fn connecting(address: &str) -> Endpoints {
    Endpoints { connect: vec![address.parse().unwrap()], ..Endpoints::default() }
}

fn hello(camera: &str, is_live: bool) -> Hello {
    let rate_hz = (camera == "cam0").then_some(12.5);
    Hello {
        room: ROOM,
        camera: camera.into(),
        width: SIZE.0,
        height: SIZE.1,
        is_live,
        rate_hz,
        has_boxes_alone: false,
    }
}

fn expected(cameras: &[&str]) -> ExpectedStations {
    let camera = |name: &&str| ExpectedCamera { name: (*name).into(), width: SIZE.0, height: SIZE.1 };
    ExpectedStations { room: ROOM, cameras: cameras.iter().map(camera).collect() }
}

/// Gatherer with all its stations.
struct Gatherer {
    ports: Vec<Port>,
    downlink: Downlink,
    events: Receiver<(usize, Event)>,
}

fn gather(cameras: &[&str], endpoints: Endpoints, bound: Duration) -> JoinHandle<Result<Gatherer>> {
    let expected = expected(cameras);
    thread::spawn(move || {
        let (inbox, events) = mpsc::channel();
        let (ports, downlink) = Downlink::open(expected, &endpoints, bound, &GO_ON, inbox)?;
        Ok(Gatherer { ports, downlink, events })
    })
}

impl Gatherer {
    /// The next event.
    fn next(&self) -> (usize, Event) {
        self.events.recv_timeout(BOUND).unwrap()
    }

    /// The next observation of a camera.
    fn next_seen(&self, camera: usize) -> ObservedFrame {
        match self.next() {
            (from, Event::Seen(seen)) if from == camera => *seen,
            other => panic!("{other:?}"),
        }
    }
}

/// Observation of a camera's `sequence`th frame.
fn seen(camera: &str, sequence: u64) -> ObservedFrame {
    let grain = 3 + camera.len() as u32;
    let shift = sequence as u32;
    let mask =
        Mask::from_fn(SIZE.0, SIZE.1, |x, y| ((x + shift) / grain * 7 + y / grain * 5).is_multiple_of(3));
    let colours = Colours::sample(&mask, 4, |x, y| image::Rgb([x as u8, y as u8, shift as u8]));
    let observation = Observation {
        sequence,
        time_s: sequence as f64 / 12.5,
        health: Verdict::Usable,
        mask: Some(mask),
        colours: Some(colours),
        boxes: None,
    };
    ObservedFrame {
        observation,
        pictures: Pictures::default(),
        decode: Duration::from_nanos(sequence),
        foreground: Duration::from_micros(sequence),
    }
}

fn event(camera: &str, sequence: u64) -> Event {
    Event::Seen(Box::new(seen(camera, sequence)))
}

fn feedback(sequence: u64) -> Feedback {
    let body = Body { x_m: 0.1 * sequence as f64, y_m: 1.0 / 3.0, radius_m: 0.25, height_m: 1.7 };
    Feedback { sequence, people: vec![body; (sequence % 4) as usize] }
}
