//! Exports read back by the crate `mcap` and by the descriptors in the file, as other programs read them.

use std::collections::BTreeMap;
use std::path::Path;

use calib::{Camera, Intrinsics};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use prost_reflect::{DescriptorPool, DynamicMessage, ReflectMessage, Value};
use scenes::polygon::Polygon;
use scenes::room::{Line, Region, Room, RoomCamera};

use super::*;

fn room() -> Room {
    let pose =
        Isometry3::face_towards(&Point3::new(1.0, 2.0, 2.5), &Point3::new(3.0, 2.0, 0.5), &-Vector3::z());
    let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 70.0);
    intrinsics.distortion = [-0.2, 0.1, 1e-4, -2e-3, 0.01].into();
    let rectangle = Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(1.0, 2.0));
    Room {
        cameras: vec![RoomCamera {
            name: "left".into(),
            camera: Camera { intrinsics, camera_from_world: pose.inverse() },
            reference: None,
        }],
        regions: vec![Region { name: "counter".into(), polygon: rectangle, dwell_s: None }],
        lines: vec![Line { name: "gate".into(), points: vec![Point2::origin(), Point2::new(0.0, 3.0)] }],
        ..Room::default()
    }
}

/// Writes a run of three frames: person 3 is alone, then with person 4, then gone.
fn write_run(out: &Path, clock: bool) {
    let person = |id: u32, x: f64| {
        format!(
            r#"{{"id":{id},"x":{x},"y":0.5,"radius":0.25,"height":1.7,"vx":0.0,"vy":1.0,"sigma":[0.1,0.2],"confidence":0.9}}"#
        )
    };
    let line = |frame: u32, time: f64, people: &[String]| {
        let clock =
            if clock { format!(r#","clock":"2026-11-26T09:00:0{frame}.000+01:00""#) } else { String::new() };
        format!(r#"{{"frame":{frame},"time":{time},"people":[{}]{clock}}}"#, people.join(",")) + "\n"
    };
    let text = line(1, 0.5, &[person(3, 1.25)])
        + &line(2, 1.5, &[person(3, 1.5), person(4, 2.0)])
        + &line(3, 2.500_001, &[person(4, 2.5)]);
    std::fs::write(out.join("tracks.jsonl"), text).unwrap();
    let events = r#"{"time":1.0,"frame":1,"kind":"enter","where":"counter","id":3,"x":1.2,"y":0.4}"#;
    std::fs::write(out.join("events.jsonl"), format!("{events}\n")).unwrap();
    std::fs::write(out.join("plan.png"), b"not looked at").unwrap();
}

/// Messages by topic: time in nanoseconds, and content decoded by the descriptors in the file.
type Messages = BTreeMap<String, Vec<(u64, DynamicMessage)>>;

fn read(file: &Path) -> Messages {
    let bytes = std::fs::read(file).unwrap();
    let mut found = Messages::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.clone().unwrap();
        assert_eq!(
            (schema.encoding.as_str(), message.channel.message_encoding.as_str()),
            ("protobuf", "protobuf")
        );
        let pool = DescriptorPool::decode(schema.data.as_ref()).unwrap();
        let descriptor = pool.get_message_by_name(&schema.name).unwrap();
        let decoded = DynamicMessage::decode(descriptor, message.data.as_ref()).unwrap();
        assert_eq!(decoded.unknown_fields().count(), 0, "{}", message.channel.topic);
        found.entry(message.channel.topic.clone()).or_default().push((message.log_time, decoded));
    }
    found
}

/// A field by the path of names, numbers index lists: `entities.0.id`.
fn at(message: &DynamicMessage, path: &str) -> Value {
    path.split('.').fold(Value::Message(message.clone()), |value, step| match value {
        Value::Message(message) => message.get_field_by_name(step).unwrap().into_owned(),
        Value::List(list) => list[step.parse::<usize>().unwrap()].clone(),
        other => panic!("{step} of {other:?}"),
    })
}

fn number(message: &DynamicMessage, path: &str) -> f64 {
    at(message, path).as_f64().unwrap()
}

fn length(message: &DynamicMessage, path: &str) -> usize {
    at(message, path).as_list().unwrap().len()
}

#[test]
fn a_run_reads_back_with_its_channels_times_and_people() {
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), false);
    let file = folder.path().join("run.mcap");
    let report = write(folder.path(), &room(), &file, McapOptions::default()).unwrap();
    let found = read(&file);
    let channels: Vec<(&str, usize, String)> = found
        .iter()
        .map(|(topic, messages)| {
            (topic.as_str(), messages.len(), messages[0].1.descriptor().name().to_owned())
        })
        .collect();
    let expected = [
        ("/cameras/left/calibration", 1, "CameraCalibration"),
        ("/cameras/left/transform", 1, "FrameTransform"),
        ("/events", 1, "Log"),
        ("/people", 3, "SceneUpdate"),
        ("/plan", 1, "CompressedImage"),
        ("/poses", 3, "PosesInFrame"),
        ("/room", 1, "SceneUpdate"),
    ];
    assert_eq!(channels, expected.map(|(topic, count, schema)| (topic, count, schema.to_owned())));
    assert_eq!(report, McapReport { frames: 3, messages: 11, pictures: 0 });

    let people = &found["/people"];
    let times: Vec<u64> = people.iter().map(|(time, _)| *time).collect();
    assert_eq!(times, [500_000_000, 1_500_000_000, 2_500_001_000]);
    let last = &people[2].1;
    assert_eq!((length(last, "entities"), length(last, "deletions")), (1, 1));
    assert_eq!(at(last, "deletions.0.id"), Value::String("3".into()));
    assert_eq!(at(last, "entities.0.id"), Value::String("4".into()));
    assert_eq!(at(last, "entities.0.timestamp.nanos"), Value::I32(500_001_000));
    let body = "entities.0.cylinders.0";
    assert_eq!(at(last, "entities.0.frame_id"), Value::String("room".into()));
    for (path, expected) in
        [("pose.position.x", 2.5), ("pose.position.z", 0.85), ("size.x", 0.5), ("size.z", 1.7)]
    {
        assert!((number(last, &format!("{body}.{path}")) - expected).abs() < 1e-12, "{path}");
    }
    let poses = &found["/poses"][1].1;
    assert_eq!(length(poses, "poses"), 2);
    // Walking along y is a quarter turn about z.
    assert!((number(poses, "poses.0.orientation.z") - 0.5_f64.sqrt()).abs() < 1e-12);
    let (event_time, event) = &found["/events"][0];
    assert_eq!(*event_time, 1_000_000_000);
    assert!(matches!(at(event, "message"), Value::String(line) if line.contains("\"kind\":\"enter\"")));
}

#[test]
fn the_room_and_its_cameras_read_back() {
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), true);
    let (file, room) = (folder.path().join("deep/run.mcap"), room());
    write(folder.path(), &room, &file, McapOptions::default()).unwrap();
    let found = read(&file);
    let (time, outlines) = &found["/room"][0];
    // 08:00:01 UTC: the first frame's time of day.
    assert_eq!(*time, 1_795_680_001_000_000_000);
    assert_eq!(length(outlines, "entities"), 2);
    assert_eq!(length(outlines, "entities.0.lines.0.points"), 4);
    assert_eq!(at(outlines, "entities.0.lines.0.type"), Value::EnumNumber(1));
    assert_eq!(at(outlines, "entities.1.lines.0.type"), Value::EnumNumber(0));
    let transform = &found["/cameras/left/transform"][0].1;
    for (axis, expected) in [("x", 1.0), ("y", 2.0), ("z", 2.5)] {
        assert!((number(transform, &format!("translation.{axis}")) - expected).abs() < 1e-12);
    }
    let calibration = &found["/cameras/left/calibration"][0].1;
    assert_eq!(at(calibration, "width"), Value::U32(640));
    assert_eq!(["D", "K", "R", "P"].map(|name| length(calibration, name)), [5, 9, 9, 12]);
    let focal_px = room.cameras[0].camera.intrinsics.matrix()[(0, 0)];
    assert!((number(calibration, "K.0") - focal_px).abs() < 1e-12);
    assert!((number(calibration, "P.5") - focal_px).abs() < 1e-9);
    assert!((number(calibration, "D.0") + 0.2).abs() < 1e-12);
}

#[test]
fn what_cannot_be_exported_is_named_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let refusal =
        |options: McapOptions| write(folder.path(), &room(), &file, options).unwrap_err().to_string();
    assert!(refusal(McapOptions::default()).contains("tracks.jsonl"));
    std::fs::write(folder.path().join("tracks.jsonl"), "").unwrap();
    assert!(refusal(McapOptions::default()).contains("no frame"));
    write_run(folder.path(), false);
    assert!(refusal(McapOptions { pictures: true }).contains("--no-film"));
    std::fs::write(folder.path().join("events.jsonl"), "{}\n").unwrap();
    assert!(refusal(McapOptions::default()).contains("events.jsonl: line 1"));
    let left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(!left.iter().any(|name| name.to_string_lossy().contains("mcap")), "{left:?}");
}
