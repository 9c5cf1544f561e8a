//! Foxglove's messages of a room and its people.

use mot::jsonl::PersonLine;
use nalgebra::{Isometry3, Point2, UnitQuaternion, Vector3};
use scenes::room::{Room, RoomCamera};
use shell::canvas::Color;

use super::wire::ProtoMessage;
use crate::TrackId;

/// Frame of reference of the room's coordinates.
pub(super) const ROOM_FRAME: &str = "room";
/// Thickness of drawn lines, metres.
const LINE_M: f64 = 0.03;
/// Height of labels, metres.
const TEXT_M: f64 = 0.2;
/// Speed above which people are taken to face where they walk, m/s.
const WALKS_M_S: f64 = 0.2;
/// Kinds of `LinePrimitive`.
const LINE_STRIP: u64 = 0;
const LINE_LOOP: u64 = 1;
/// `Log.Level.INFO`.
const INFO: u64 = 2;

/// Time of a message, nanoseconds since 1970, or since the run's time 0 where its time of day is not known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Timestamp(pub(super) u64);

impl Timestamp {
    fn message(self) -> ProtoMessage {
        ProtoMessage::new().uint(1, self.0 / 1_000_000_000).uint(2, self.0 % 1_000_000_000)
    }
}

fn vector(v: &Vector3<f64>) -> ProtoMessage {
    ProtoMessage::new().double(1, v.x).double(2, v.y).double(3, v.z)
}

fn quaternion(rotation: &UnitQuaternion<f64>) -> ProtoMessage {
    ProtoMessage::new()
        .double(1, rotation.i)
        .double(2, rotation.j)
        .double(3, rotation.k)
        .double(4, rotation.w)
}

fn pose(position: &Vector3<f64>, rotation: &UnitQuaternion<f64>) -> ProtoMessage {
    ProtoMessage::new().message(1, &vector(position)).message(2, &quaternion(rotation))
}

fn color(color: Color, alpha: f64) -> ProtoMessage {
    let Color { r, g, b, .. } = color;
    let part = |value: u8| f64::from(value) / 255.0;
    ProtoMessage::new().double(1, part(r)).double(2, part(g)).double(3, part(b)).double(4, alpha)
}

/// `PosesInFrame`: where people stand, turned to where they walk.
pub(super) fn poses(time: Timestamp, people: &[PersonLine]) -> ProtoMessage {
    let person = |person: &PersonLine| {
        let heading = if person.vx.hypot(person.vy) > WALKS_M_S { person.vy.atan2(person.vx) } else { 0.0 };
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
        pose(&Vector3::new(person.x, person.y, 0.0), &rotation)
    };
    ProtoMessage::new().message(1, &time.message()).text(2, ROOM_FRAME).messages(3, people.iter().map(person))
}

/// `SceneUpdate` of the people: a cylinder and a label each; those who are gone are deleted.
pub(super) fn people(time: Timestamp, people: &[PersonLine], gone: &[TrackId]) -> ProtoMessage {
    // A deletion of type 0 concerns the entity of its id.
    let deletion = |id: &TrackId| ProtoMessage::new().message(1, &time.message()).text(3, &id.to_string());
    let update = ProtoMessage::new().messages(1, gone.iter().map(deletion));
    update.messages(2, people.iter().map(|person| person_entity(time, person)))
}

fn person_entity(time: Timestamp, person: &PersonLine) -> ProtoMessage {
    let upright = UnitQuaternion::identity();
    let at = |z: f64| pose(&Vector3::new(person.x, person.y, z), &upright);
    let paint = Color::of_id(person.id.0);
    let body = ProtoMessage::new()
        .message(1, &at(0.5 * person.height))
        .message(2, &vector(&Vector3::new(2.0 * person.radius, 2.0 * person.radius, person.height)))
        .double(3, 1.0)
        .double(4, 1.0)
        .message(5, &color(paint, 0.3 + 0.5 * person.confidence.clamp(0.0, 1.0)));
    let label = text(&at(person.height + TEXT_M), &person.id.to_string());
    let metadata =
        [("confidence", person.confidence), ("sigma_x_m", person.sigma[0]), ("sigma_y_m", person.sigma[1])];
    let pairs = metadata.map(|(key, value)| ProtoMessage::new().text(1, key).text(2, &value.to_string()));
    entity(time, &person.id.to_string()).messages(6, pairs).message(10, &body).message(13, &label)
}

fn entity(time: Timestamp, id: &str) -> ProtoMessage {
    ProtoMessage::new().message(1, &time.message()).text(2, ROOM_FRAME).text(3, id)
}

fn text(place: &ProtoMessage, text: &str) -> ProtoMessage {
    ProtoMessage::new()
        .message(1, place)
        .uint(2, 1)
        .double(3, TEXT_M)
        .message(5, &color(Color::WHITE, 1.0))
        .text(6, text)
}

/// `SceneUpdate` of the room: outlines of zones, regions and walkable floor, and lines.
pub(super) fn room(time: Timestamp, room: &Room) -> ProtoMessage {
    let zones = room.zones.iter().map(|zone| ("zone", zone.name.clone(), LINE_LOOP, &zone.polygon.0, 2));
    let regions =
        room.regions.iter().map(|region| ("region", region.name.clone(), LINE_LOOP, &region.polygon.0, 0));
    let lines = room.lines.iter().map(|line| ("line", line.name.clone(), LINE_STRIP, &line.points, 1));
    let walkable = room.walkable.iter().flatten().enumerate();
    let floor = walkable.map(|(i, polygon)| ("floor", (i + 1).to_string(), LINE_LOOP, &polygon.0, 3));
    let entities = zones.chain(regions).chain(lines).chain(floor).map(|(kind, name, form, points, paint)| {
        outline(time, kind, &name, form, points, Color::of_id(paint))
    });
    ProtoMessage::new().messages(2, entities)
}

fn outline(
    time: Timestamp,
    kind: &str,
    name: &str,
    form: u64,
    points: &[Point2<f64>],
    paint: Color,
) -> ProtoMessage {
    let identity = pose(&Vector3::zeros(), &UnitQuaternion::identity());
    let line = ProtoMessage::new()
        .uint(1, form)
        .message(2, &identity)
        .double(3, LINE_M)
        .messages(5, points.iter().map(|p| vector(&Vector3::new(p.x, p.y, 0.0))))
        .message(6, &color(paint, 1.0));
    let middle = points.iter().map(|p| p.coords).sum::<nalgebra::Vector2<f64>>() / points.len().max(1) as f64;
    let place = pose(&Vector3::new(middle.x, middle.y, TEXT_M), &UnitQuaternion::identity());
    entity(time, &format!("{kind} {name}")).message(11, &line).message(13, &text(&place, name))
}

/// `FrameTransform` of a camera: OpenCV's axes, in the room.
pub(super) fn camera_transform(time: Timestamp, camera: &RoomCamera) -> ProtoMessage {
    let room_from_camera: Isometry3<f64> = camera.camera.camera_from_world.inverse();
    ProtoMessage::new()
        .message(1, &time.message())
        .text(2, ROOM_FRAME)
        .text(3, &camera_frame(&camera.name))
        .message(4, &vector(&room_from_camera.translation.vector))
        .message(5, &quaternion(&room_from_camera.rotation))
}

/// Frame of reference of a camera.
pub(super) fn camera_frame(name: &str) -> String {
    format!("camera/{name}")
}

/// `CameraCalibration`; Foxglove's pixels and distortion are `OpenCV`'s, too.
pub(super) fn calibration(time: Timestamp, camera: &RoomCamera) -> ProtoMessage {
    let intrinsics = &camera.camera.intrinsics;
    let matrix = intrinsics.matrix();
    let row = |i: usize| [matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)]];
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let distortion = intrinsics.distortion;
    ProtoMessage::new()
        .message(1, &time.message())
        .fixed32(2, intrinsics.width)
        .fixed32(3, intrinsics.height)
        .text(4, distortion.model().ros_name())
        .doubles(5, distortion.coefficients())
        .doubles(6, (0..3).flat_map(row))
        .doubles(7, identity)
        .doubles(8, (0..3).flat_map(|i| row(i).into_iter().chain([0.0])))
        .text(9, &camera_frame(&camera.name))
}

/// `CompressedImage`; `format` is `jpeg` or `png`.
pub(super) fn picture(time: Timestamp, frame: &str, format: &str, data: &[u8]) -> ProtoMessage {
    ProtoMessage::new().message(1, &time.message()).bytes(2, data).text(3, format).text(4, frame)
}

/// `Log` of an event: its line of `events.jsonl`.
pub(super) fn log(time: Timestamp, line: &str) -> ProtoMessage {
    ProtoMessage::new().message(1, &time.message()).uint(2, INFO).text(3, line).text(4, "events")
}
