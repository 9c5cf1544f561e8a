//! Tests of recordings: everything arrives, in order, and within the window; a side that leaves is reported.

use std::time::Instant;

use super::*;

/// A station like the product's: it is at most a window of observations ahead of its feedback. Returns the feedback
/// that it got.
fn play(camera: &'static str, endpoints: Endpoints, frames: u64) -> JoinHandle<Vec<Feedback>> {
    thread::spawn(move || {
        let (mut uplink, feedback) = Uplink::open(hello(camera, false), &endpoints).unwrap();
        uplink.wait_for_start(Some(BOUND), &GO_ON).unwrap();
        let mut got = Vec::new();
        for sequence in 1..=frames {
            if sequence > Feedback::WINDOW {
                got.push(feedback.recv_timeout(BOUND).unwrap());
            }
            uplink.send(event(camera, sequence)).unwrap();
        }
        uplink.send(Event::Ended).unwrap();
        got.extend(feedback.try_iter());
        got
    })
}

fn gather_all(gatherer: &mut Gatherer, cameras: &[&str], frames: u64) {
    let mut next = vec![1; cameras.len()];
    let mut ended = 0;
    while ended < cameras.len() {
        match gatherer.next() {
            (camera, Event::Seen(got)) => {
                let truth = seen(cameras[camera], next[camera]);
                assert_eq!(got.observation, truth.observation);
                assert_eq!((got.decode, got.foreground), (truth.decode, truth.foreground));
                (gatherer.ports[camera].feedback)(feedback(next[camera]));
                next[camera] += 1;
            }
            (_, Event::Ended) => ended += 1,
            (_, Event::Failed(error)) => panic!("{error}"),
        }
    }
    assert_eq!(next, vec![frames + 1; cameras.len()]);
}

fn check_feedback(got: &[Feedback], frames: u64) {
    assert!(got.len() as u64 >= frames - Feedback::WINDOW);
    for (got, sequence) in got.iter().zip(1..) {
        assert_eq!(*got, feedback(sequence));
    }
}

#[test]
fn two_stations_of_recordings_lose_nothing() {
    let (address, frames, cameras) = (free_address(), 150, ["cam0", "cam 1/ä"]);
    let stations: Vec<_> = cameras.map(|camera| play(camera, connecting(&address), frames)).into();
    let mut gatherer = gather(&cameras, listening(&address), BOUND).join().unwrap().unwrap();
    let known: Vec<_> = gatherer.ports.iter().map(|p| (p.name.as_str(), p.is_live, p.rate_hz)).collect();
    assert_eq!(known, [("cam0", false, Some(12.5)), ("cam 1/ä", false, None)]);
    gather_all(&mut gatherer, &cameras, frames);
    for station in stations {
        check_feedback(&station.join().unwrap(), frames);
    }
    assert_eq!(gatherer.downlink.garbage(), 0);
}

#[test]
fn stations_may_listen_and_the_gatherer_connect() {
    let (addresses, frames) = ([free_address(), free_address()], 20);
    let cameras = ["cam0", "cam1"];
    let endpoints = Endpoints {
        connect: addresses.iter().map(|address| address.parse().unwrap()).collect(),
        ..Endpoints::default()
    };
    let gatherer = gather(&cameras, endpoints, BOUND);
    let stations: Vec<_> = cameras
        .iter()
        .zip(&addresses)
        .map(|(camera, address)| play(camera, listening(address), frames))
        .collect();
    gather_all(&mut gatherer.join().unwrap().unwrap(), &cameras, frames);
    for station in stations {
        check_feedback(&station.join().unwrap(), frames);
    }
}

#[test]
fn a_router_may_stand_between() {
    use zenoh::Wait;
    let (address, frames) = (free_address(), 20);
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"router\"".to_owned()),
        ("listen/endpoints", format!("[\"tcp/{address}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    let router = zenoh::open(config).wait().unwrap();
    let through = || Endpoints { via_router: true, ..connecting(&address) };
    let station = play("cam0", through(), frames);
    let mut gatherer = gather(&["cam0"], through(), BOUND).join().unwrap().unwrap();
    gather_all(&mut gatherer, &["cam0"], frames);
    check_feedback(&station.join().unwrap(), frames);
    drop(gatherer);
    router.close().wait().unwrap();
    let line = Uplink::open(hello("cam0", true), &through()).unwrap_err().to_string();
    assert!(line.contains(&address) && !line.contains('\n'), "{line}");
}

#[test]
fn round_trips_on_the_loopback_are_short() {
    let address = free_address();
    let gatherer = gather(&["cam0"], listening(&address), BOUND);
    let (mut uplink, feedback) = Uplink::open(hello("cam0", false), &connecting(&address)).unwrap();
    uplink.wait_for_start(Some(BOUND), &GO_ON).unwrap();
    let mut gatherer = gatherer.join().unwrap().unwrap();
    let echo = thread::spawn(move || {
        while let (camera, Event::Seen(seen)) = gatherer.next() {
            (gatherer.ports[camera].feedback)(super::feedback(seen.observation.sequence));
        }
        gatherer
    });
    let mut times: Vec<Duration> = (1..=1000)
        .map(|sequence| {
            let event = event("cam0", sequence);
            let begun = Instant::now();
            uplink.send(event).unwrap();
            feedback.recv_timeout(BOUND).unwrap();
            begun.elapsed()
        })
        .collect();
    times.sort_unstable();
    println!("observation there, feedback back: p50 {:.0?}, p99 {:.0?}", times[500], times[990]);
    // A machine that is busy otherwise is slow at the tail, not in the middle.
    assert!(times[500] < Duration::from_millis(20), "{:?}", times[500]);
    uplink.send(Event::Ended).unwrap();
    echo.join().unwrap();
}

#[test]
fn a_recording_whose_gatherer_goes_fails_with_one_line() {
    let address = free_address();
    let gatherer = gather(&["cam0"], listening(&address), BOUND);
    let (mut uplink, feedback) = Uplink::open(hello("cam0", false), &connecting(&address)).unwrap();
    uplink.wait_for_start(Some(BOUND), &GO_ON).unwrap();
    uplink.send(event("cam0", 1)).unwrap();
    drop(gatherer.join().unwrap().unwrap());
    while feedback.recv_timeout(BOUND).is_ok() {}
    let line = uplink.send(event("cam0", 2)).unwrap_err().to_string();
    assert!(line.starts_with("station `cam0`: the gatherer has gone before"), "{line}");
}

#[test]
fn a_recording_whose_station_goes_fails_and_a_failure_is_told() {
    let (address, other) = (free_address(), Duration::from_millis(300));
    let gatherer = gather(&["cam0", "cam1"], listening(&address), BOUND);
    let [(mut first, _kept), (mut second, _kept_too)] =
        ["cam0", "cam1"].map(|camera| Uplink::open(hello(camera, false), &connecting(&address)).unwrap());
    for uplink in [&first, &second] {
        uplink.wait_for_start(Some(BOUND), &GO_ON).unwrap();
    }
    let gatherer = gatherer.join().unwrap().unwrap();
    first.send(event("cam0", 1)).unwrap();
    assert_eq!(gatherer.next_seen(0).observation.sequence, 1);
    drop(first);
    match gatherer.next() {
        (0, Event::Failed(error)) => assert!(error.to_string().contains("gone before its recording's end")),
        got => panic!("{got:?}"),
    }
    second.send(Event::Failed(crate::Error::option("videos", "b.mp4: no such file"))).unwrap();
    match gatherer.next() {
        (1, Event::Failed(error)) => {
            assert_eq!(error.to_string(), "station `cam1`: videos: b.mp4: no such file");
        }
        got => panic!("{got:?}"),
    }
    assert!(gatherer.events.recv_timeout(other).is_err());
}
