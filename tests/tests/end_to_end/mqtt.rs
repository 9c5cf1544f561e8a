//! MQTT against a real broker: nothing lost while it is away, the last will, TLS, users, an absent broker.

use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use calib::{Camera, Intrinsics};
use mot::jsonl::FrameLine;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};
use scenes::polygon::Polygon;
use scenes::room::{Line, Region, Room, RoomCamera};
use serde_json::Value;
use tests::broker::{Broker, BrokerCertificates, BrokerOptions, Subscriber};
use tests::data::{office, program};
use tests::live::run::{LiveRun, free_address};
use tracker::events::{EventOptions, Events, Tally};
use tracker::prepared_room::{PreparationOptions, PreparedRoom};
use tracker::publish::mqtt::{BrokerTls, Credentials, MqttOptions, MqttOutput, PublishOptions};
use tracker::tracks::person_line;
use tracker::{PersonEstimate, TrackId};

const PATIENCE: Duration = Duration::from_secs(30);
/// Step of the people's time, seconds.
const STEP_S: f64 = 0.1;

fn room() -> Room {
    let pose = Isometry3::face_towards(&Point3::new(-4.0, 0.0, 2.5), &Point3::origin(), &-Vector3::z());
    let intrinsics = Intrinsics::from_horizontal_fov(320, 240, 80.0);
    let camera = Camera { intrinsics, camera_from_world: pose.inverse() };
    Room {
        cameras: vec![RoomCamera { name: "cam".into(), camera, reference: None }],
        regions: vec![Region {
            name: "a/b".into(),
            polygon: Polygon::rectangle(Point2::new(0.5, -2.0), Point2::new(2.0, 2.0)),
            dwell_s: None,
        }],
        lines: vec![Line {
            name: "gate".into(),
            points: vec![Point2::new(0.0, 2.0), Point2::new(0.0, -2.0)],
        }],
        ..Room::default()
    }
}

/// Ten people who walk to and fro through the region and over the line, at the frame of this number.
fn people(frame: u32) -> Vec<PersonEstimate> {
    let person = |i: u32| PersonEstimate {
        id: TrackId(i),
        x_m: 1.6 * (f64::from(frame) * STEP_S * 1.5 + f64::from(i)).sin(),
        y_m: 0.1 * f64::from(i),
        z_m: 0.0,
        radius_m: 0.25,
        height_m: 1.7,
        vx: 0.0,
        vy: 0.0,
        sigma_m: [0.02, 0.02],
        confidence: 0.99,
        visible: vec![1.0],
    };
    (0..10).map(person).collect()
}

fn prepared(room: &Room) -> PreparedRoom {
    PreparedRoom::prepare(room, Path::new("."), &PreparationOptions::default()).unwrap()
}

/// Address of the broker with TLS or without.
fn options(broker: &Broker, protocol: &str) -> MqttOptions {
    MqttOptions::new(format!("{protocol}://localhost:{}/site", broker.address().port()).parse().unwrap())
}

/// Lines of the events and final counts of so many frames, from a detector of the test's own.
fn expected(room: &Room, frames: u32) -> (Vec<String>, Tally) {
    let (mut detector, mut tally) = (Events::new(room, EventOptions::default()), Tally::new(room));
    let mut events = Vec::new();
    for frame in 1..=frames {
        let time = (f64::from(frame) * STEP_S * 1e6).round() / 1e6;
        let people = people(frame).iter().map(|p| person_line(p, &["cam".into()])).collect();
        let line =
            FrameLine { frame, time, people, count: vec![], set_aside: vec![], states: vec![], clock: None };
        events.extend(detector.step(&line));
    }
    events.extend(detector.finish());
    for event in &events {
        tally.add(event);
    }
    (events.iter().map(|event| event.text(Path::new("")).unwrap().trim_end().to_owned()).collect(), tally)
}

#[test]
fn no_event_is_lost_while_the_broker_is_dead() {
    let room = room();
    let mut broker = Broker::start(&BrokerOptions::default()).unwrap();
    let subscriber = Subscriber::start(&broker).unwrap();
    let publishing = PublishOptions { discovery: true, ..PublishOptions::new("hall") };
    let mut output =
        MqttOutput::start(&options(&broker, "mqtt"), publishing, &room, &prepared(&room)).unwrap();
    let (frames, begun) = (400, Instant::now());
    let mut slowest = Duration::ZERO;
    for frame in 1..=frames {
        match frame {
            100 => broker.kill(),
            300 => broker.restart().unwrap(),
            _ => {}
        }
        let published = Instant::now();
        output.publish(frame, f64::from(frame) * STEP_S, &people(frame), &[]).unwrap();
        if frame != 100 && frame != 300 {
            slowest = slowest.max(published.elapsed());
        }
        thread::sleep(Duration::from_millis(20));
    }
    let elapsed = begun.elapsed();
    let gauge = output.gauge();
    output.finish().unwrap();
    let (events, tally) = expected(&room, frames);
    assert!(events.len() > 200, "{}", events.len());
    let counts = gauge();
    let (delivered, dropped) = (counts.delivery.acknowledged, counts.delivery.dropped);
    assert_eq!((delivered as usize, dropped, counts.delivery.waiting), (events.len(), 0, 0));
    assert!(slowest < Duration::from_millis(500), "the tracker waited for the network: {slowest:?}");

    subscriber.wait_for(PATIENCE, |all| all.last().is_some_and(|m| m.payload == "offline")).unwrap();
    let mut first_arrivals: Vec<String> = Vec::new();
    for event in subscriber.topic("site/hall/event") {
        if !first_arrivals.contains(&event) {
            first_arrivals.push(event);
        }
    }
    assert_eq!(first_arrivals, events, "each event at least once, first in its order");
    let status = subscriber.topic("site/hall/status");
    assert_eq!((status.first().unwrap().as_str(), status.last().unwrap().as_str()), ("online", "offline"));
    let messages = subscriber.topic("site/hall/people");
    assert!(messages.len() as f64 <= 5.0 * elapsed.as_secs_f64() + 2.0, "{} in {elapsed:?}", messages.len());
    let line: FrameLine = serde_json::from_str(messages.last().unwrap()).unwrap();
    assert_eq!(line.people.len(), 10);
    for (name, topic) in [("room", "room"), ("a/b", "a%2Fb"), ("gate", "gate")] {
        let (_, count) = tally.places().find(|(place, _)| *place == name).unwrap();
        let last = subscriber.topic(&format!("site/hall/count/{topic}")).pop().unwrap();
        let last: Value = serde_json::from_str(&last).unwrap();
        let found = ["inside", "in", "out"].map(|key| last[key].as_i64().unwrap());
        assert_eq!(found, [count.inside(), count.entered, count.left], "{name}");
    }
    // Counts and the announcement are kept for later subscribers.
    drop(subscriber);
    let late = Subscriber::start(&broker).unwrap();
    late.wait_for(PATIENCE, |all| all.iter().any(|m| m.topic == "site/hall/count/gate" && m.is_retained))
        .unwrap();
    let config = late.received().into_iter().find(|m| m.topic.ends_with("/gate_in/config")).unwrap();
    let config: Value = serde_json::from_str(&config.payload).unwrap();
    assert_eq!(config["state_topic"], "site/hall/count/gate");
}

#[test]
fn a_killed_tracker_is_offline_by_its_last_will() {
    let broker = Broker::start(&BrokerOptions::default()).unwrap();
    let subscriber = Subscriber::start(&broker).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut given: Vec<String> = ["cam0", "cam1"]
        .iter()
        .flat_map(|name| {
            let video = office().join(format!("video/{name}.mp4"));
            ["--video".to_owned(), format!("{name}={}", video.display())]
        })
        .collect();
    let url = format!("mqtt://127.0.0.1:{}", broker.address().port());
    given.extend(
        ["--no-film", "--mqtt", &url, "--mqtt-room", "office", "--mqtt-form", "scenescape"]
            .map(str::to_owned),
    );
    let run = LiveRun::start(&office().join("room"), &folder.path().join("out"), &given).unwrap();
    let is_tracking = |all: &[tests::broker::Received]| {
        all.iter().any(|m| m.topic == "roomtrack/office/people" && m.payload.contains("\"translation\":["))
    };
    subscriber.wait_for(2 * PATIENCE, is_tracking).unwrap();
    assert_eq!(subscriber.topic("roomtrack/office/status"), ["online"]);
    run.signal("KILL").unwrap();
    subscriber.wait_for(PATIENCE, |all| all.iter().any(|m| m.payload == "offline")).unwrap();
    assert_eq!(subscriber.topic("roomtrack/office/status"), ["online", "offline"]);
    // The same message stands where SceneScape's consumers look for it.
    let scene = subscriber.topic("roomtrack/office/people").pop().unwrap();
    let id = serde_json::from_str::<Value>(&scene).unwrap()["id"].as_str().unwrap().to_owned();
    assert!(!subscriber.topic(&format!("roomtrack/regulated/scene/{id}")).is_empty());
}

#[test]
fn a_wrong_password_is_refused_in_one_line() {
    let user = Some(("shop".to_owned(), "right".to_owned()));
    let broker = Broker::start(&BrokerOptions { user, tls: None }).unwrap();
    let room = room();
    let start = |password: &str| {
        let credentials = Some(Credentials { user: "shop".into(), password: password.into() });
        let broker = MqttOptions { credentials, ..options(&broker, "mqtt") };
        MqttOutput::start(&broker, PublishOptions::new("hall"), &room, &prepared(&room))
    };
    let output = start("right").unwrap();
    assert!(output.gauge()().is_connected);
    output.finish().unwrap();
    let line = start("wrong").unwrap_err().to_string();
    assert!(line.contains("refuses the user or the password") && !line.contains('\n'), "{line}");
    assert!(!line.contains("wrong"), "the password is not repeated: {line}");

    let folder = tempfile::tempdir().unwrap();
    let url = format!("mqtt://127.0.0.1:{}", broker.address().port());
    let mut command = program("tracker");
    command.arg("run").arg(office().join("room")).arg("--out").arg(folder.path().join("out"));
    command.arg("--video").arg(format!("cam0={}", office().join("video/cam0.mp4").display()));
    command.args(["--no-film", "--mqtt", &url]).env("ROOMTRACK_MQTT_USER", "shop");
    let ended = command.env("ROOMTRACK_MQTT_PASSWORD", "wrong").output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(2), "{said}");
    let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(errors.len() == 1 && errors[0].contains("--mqtt: ") && errors[0].contains("password"), "{said}");
    assert_eq!(said.matches("refuses the user or the password").count(), 1, "told once: {said}");
    assert!(!folder.path().join("out").exists(), "nothing is written");
}

/// Files of an authority, and of a certificate for `localhost` that it has signed.
fn certificates(folder: &Path, name: &str) -> BrokerCertificates {
    let file = |what: &str, text: String| -> PathBuf {
        let path = folder.join(format!("{name}.{what}.pem"));
        std::fs::write(&path, text).unwrap();
        path
    };
    let mut params = CertificateParams::new(Vec::new()).unwrap();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    params.distinguished_name.push(DnType::CommonName, name);
    let key = KeyPair::generate().unwrap();
    let authority = file("authority", params.self_signed(&key).unwrap().pem());
    let issuer = Issuer::new(params, key);
    let own_key = KeyPair::generate().unwrap();
    let own = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
    let certificate = file("certificate", own.signed_by(&own_key, &issuer).unwrap().pem());
    BrokerCertificates { authority, certificate, key: file("key", own_key.serialize_pem()) }
}

#[test]
fn tls_takes_the_right_authority_and_certificate_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (own, foreign) = (certificates(folder.path(), "own"), certificates(folder.path(), "foreign"));
    let broker = Broker::start(&BrokerOptions { user: None, tls: Some(own.clone()) }).unwrap();
    let room = room();
    let start = |authority: &BrokerCertificates, client: Option<&BrokerCertificates>| {
        let client = client.map(|files| (files.certificate.clone(), files.key.clone()));
        let tls = BrokerTls { authority: Some(authority.authority.clone()), client };
        let broker = MqttOptions { tls, ..options(&broker, "mqtts") };
        MqttOutput::start(&broker, PublishOptions::new("hall"), &room, &prepared(&room))
    };
    let mut output = start(&own, Some(&own)).unwrap();
    for frame in 1..=60 {
        output.publish(frame, f64::from(frame) * STEP_S, &people(frame), &[]).unwrap();
    }
    let gauge = output.gauge();
    output.finish().unwrap();
    assert!(gauge().delivery.acknowledged > 10 && gauge().delivery.waiting == 0, "{:?}", gauge());

    for (refused, words) in [
        (start(&foreign, Some(&own)), "certificate is not trusted"),
        (start(&own, Some(&foreign)), "refuses TLS with this machine"),
        (start(&own, None), "refuses TLS with this machine"),
    ] {
        let line = refused.unwrap_err().to_string();
        assert!(line.contains(words) && !line.contains('\n'), "{line}");
    }
}

#[test]
fn an_absent_broker_is_told_once_and_the_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let url = format!("mqtt://{}", free_address().unwrap());
    let mut command = program("tracker");
    command.arg("run").arg(office().join("room")).arg("--out").arg(&out).args(["--no-film", "--mqtt", &url]);
    for name in ["cam0", "cam1"] {
        command
            .arg("--video")
            .arg(format!("{name}={}", office().join(format!("video/{name}.mp4")).display()));
    }
    let ended = command.output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(0), "{said}");
    let about: Vec<&str> = said.lines().filter(|line| line.contains(&url)).collect();
    assert_eq!(about.len(), 2, "{said}");
    assert!(about[0].contains("nobody listens there"), "{said}");
    assert!(about[1].contains("events were not acknowledged"), "{said}");
    assert_eq!(std::fs::read_to_string(out.join("tracks.jsonl")).unwrap().lines().count(), 300);
}
