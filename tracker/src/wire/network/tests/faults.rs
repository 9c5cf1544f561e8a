//! Tests of live stations that come, leave and come back, and of peers that must not take part.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Instant;

use zenoh::Wait;

use super::*;
use crate::wire::test_loopback::stranger;

/// Thread of a live station that observes all the time; its result is the error that ended it.
fn observe_live(camera: &'static str, address: &str, stop: &'static AtomicBool) -> JoinHandle<Result<()>> {
    let endpoints = connecting(address);
    thread::spawn(move || {
        let (mut uplink, _feedback) = Uplink::open(hello(camera, true), &endpoints)?;
        let mut sequence = 0;
        while !stop.load(std::sync::atomic::Ordering::Relaxed) {
            sequence += 1;
            uplink.send(event(camera, sequence))?;
            thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    })
}

/// A flag for one test's stations.
macro_rules! flag {
    () => {{
        static FLAG: AtomicBool = AtomicBool::new(false);
        &FLAG
    }};
}

fn set(flag: &AtomicBool) {
    flag.store(true, std::sync::atomic::Ordering::Relaxed);
}

/// Takes events until one of this camera and health comes; all sequence numbers must grow.
fn until(gatherer: &Gatherer, camera: usize, health: Verdict, latest: &mut [u64]) {
    let begun = Instant::now();
    loop {
        assert!(begun.elapsed() < BOUND, "no {health:?} of camera {camera}");
        match gatherer.next() {
            (from, Event::Seen(seen)) => {
                let observation = &seen.observation;
                assert!(observation.sequence > latest[from]);
                latest[from] = observation.sequence;
                if from == camera && observation.health == health {
                    return;
                }
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn live_stations_come_late_go_and_come_back() {
    let (address, first, second, third) = (free_address(), flag!(), flag!(), flag!());
    let gatherer = gather(&["cam0", "cam1"], listening(&address), BOUND);
    let station = observe_live("cam0", &address, first);
    let gatherer = gatherer.join().unwrap().unwrap();
    assert!(gatherer.ports.iter().all(|port| port.is_live));
    let mut latest = [0; 2];
    until(&gatherer, 0, Verdict::Usable, &mut latest);
    let late = observe_live("cam1", &address, second);
    until(&gatherer, 1, Verdict::Usable, &mut latest);
    set(first);
    station.join().unwrap().unwrap();
    until(&gatherer, 0, Verdict::Lost, &mut latest);
    let lost_at = latest[0];
    until(&gatherer, 1, Verdict::Usable, &mut latest);
    assert_eq!(latest[0], lost_at, "a loss is reported once");
    let restarted = Instant::now();
    let back = observe_live("cam0", &address, third);
    until(&gatherer, 0, Verdict::Usable, &mut latest);
    println!("a restarted station is heard after {:.0?}", restarted.elapsed());
    set(second);
    set(third);
    for station in [late, back] {
        station.join().unwrap().unwrap();
    }
}

#[test]
fn a_live_station_finds_a_restarted_gatherer() {
    let (address, stop) = (free_address(), flag!());
    let station = observe_live("cam0", &address, stop);
    for _ in 0..2 {
        let gatherer = gather(&["cam0"], listening(&address), BOUND).join().unwrap().unwrap();
        until(&gatherer, 0, Verdict::Usable, &mut [0]);
        drop(gatherer);
    }
    set(stop);
    station.join().unwrap().unwrap();
}

#[test]
fn a_second_station_of_a_camera_is_refused_and_the_first_goes_on() {
    let (address, stop) = (free_address(), flag!());
    let gatherer = gather(&["cam0"], listening(&address), BOUND);
    let first = observe_live("cam0", &address, stop);
    let gatherer = gatherer.join().unwrap().unwrap();
    until(&gatherer, 0, Verdict::Usable, &mut [0]);
    let line = observe_live("cam0", &address, flag!()).join().unwrap().unwrap_err().to_string();
    assert!(
        line.starts_with("station `cam0`: the gatherer refuses it: another station has camera `cam0`"),
        "{line}"
    );
    until(&gatherer, 0, Verdict::Usable, &mut [0]);
    set(stop);
    first.join().unwrap().unwrap();
}

#[test]
fn stations_of_another_room_and_missing_ones_are_told_in_one_line() {
    let (address, bound) = (free_address(), Duration::from_secs(2));
    let gatherer = gather(&["cam0", "cam1"], listening(&address), bound);
    let foreign = Hello { room: Fingerprint([6; 16]), ..hello("cam0", false) };
    let (foreign, _feedback) = Uplink::open(foreign, &connecting(&address)).unwrap();
    let (own, _kept) = Uplink::open(hello("cam1", false), &connecting(&address)).unwrap();
    let line = foreign.wait_for_start(Some(bound / 2), &GO_ON).unwrap_err().to_string();
    assert!(
        line.starts_with("station `cam0`: no gatherer within 1 s: a gatherer is of another room"),
        "{line}"
    );
    let line = gatherer.join().unwrap().err().unwrap().to_string();
    assert!(line.starts_with("expected: no station of `cam0` within 2 s"), "{line}");
    let interrupted = AtomicBool::new(true);
    let line = own.wait_for_start(None, &interrupted).unwrap_err().to_string();
    assert_eq!(line, "station `cam1`: interrupted while it waited for the gatherer");
}

#[test]
fn garbage_on_keys_and_port_is_counted_and_the_rest_goes_on() {
    let (address, stop) = (free_address(), flag!());
    let gatherer = gather(&["cam0"], listening(&address), BOUND);
    let station = observe_live("cam0", &address, stop);
    let mut gatherer = gatherer.join().unwrap().unwrap();
    let mut latest = [0];
    until(&gatherer, 0, Verdict::Usable, &mut latest);

    // Bytes on the port: nonsense, an endless length, silence.
    let mut open = Vec::new();
    for bytes in [&b"GET / HTTP/1.1\r\n\r\n"[..], &[0xff; 4096], &[0; 7], &[]] {
        let mut stream = TcpStream::connect(&address).unwrap();
        let _ = stream.write_all(bytes);
        stream.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        let _ = stream.read(&mut [0; 64]);
        open.push(stream);
    }
    until(&gatherer, 0, Verdict::Usable, &mut latest);

    // Nonsense under the keys: unknown stations, those of the station itself, tokens.
    let stranger = stranger(&address);
    let overheard = stranger.declare_subscriber("roomtrack/**").wait().unwrap();
    let begun = Instant::now();
    let key = loop {
        (gatherer.ports[0].feedback)(feedback(latest[0]));
        if let Ok(Some(sample)) = overheard.recv_timeout(Duration::from_millis(50)) {
            break sample.key_expr().to_string();
        }
        assert!(begun.elapsed() < BOUND);
    };
    let (_, station_id, gatherer_id) = crate::wire::keys::parties(&key).unwrap();
    let _tokens = ["1/00/cam0/ff", "9/x/cam0/ff", "1/x/%zz/1"]
        .map(|rest| stranger.liveliness().declare_token(format!("roomtrack/station/{rest}")).wait().unwrap());
    for (camera, id) in [("cam0", "dead"), ("cam0", station_id.as_str()), ("cam9", station_id.as_str())] {
        let key = crate::wire::keys::messages(ROOM, "up", camera, id, &gatherer_id);
        for bytes in [
            Vec::new(),
            vec![1, 2],
            vec![0xff; 5000],
            b"\x01\x02\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01".to_vec(),
        ] {
            stranger.put(key.as_str(), bytes).wait().unwrap();
        }
    }
    let begun = Instant::now();
    while gatherer.downlink.garbage() < 12 {
        assert!(begun.elapsed() < BOUND, "{}", gatherer.downlink.garbage());
        until(&gatherer, 0, Verdict::Usable, &mut latest);
    }
    assert_eq!(gatherer.downlink.garbage(), 12);

    // A message larger than the limit does not reach the roster.
    let key = crate::wire::keys::messages(ROOM, "up", "cam0", "dead", &gatherer_id);
    stranger.put(key.as_str(), vec![7; 16 << 20]).wait().unwrap();
    let deadline = Instant::now() + Duration::from_secs(1);
    while Instant::now() < deadline {
        until(&gatherer, 0, Verdict::Usable, &mut latest);
    }
    assert_eq!(gatherer.downlink.garbage(), 12);
    set(stop);
    station.join().unwrap().unwrap();
}

#[test]
fn an_address_that_is_taken_is_told_in_one_line() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let line = gather(&["cam0"], listening(&address), BOUND).join().unwrap().err().unwrap().to_string();
    assert!(line.starts_with(&format!("listen: tcp/{address}: ")) && !line.contains('\n'), "{line}");
}

#[test]
fn a_live_station_without_a_gatherer_never_waits() {
    let (mut uplink, _feedback) = Uplink::open(hello("cam0", true), &connecting(&free_address())).unwrap();
    let begun = Instant::now();
    for sequence in 1..=100 {
        uplink.send(event("cam0", sequence)).unwrap();
    }
    uplink.send(Event::Ended).unwrap();
    assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
}
