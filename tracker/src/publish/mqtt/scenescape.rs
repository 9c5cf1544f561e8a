//! People in the form of `SceneScape`'s regulated scene messages (its `OUTPUT_FIELDS.md`, table "regulated/scene").
//!
//! `SceneScape` names scenes and objects by UUIDs. A scene's is derived from the room's name, so that it stays; a
//! person's from the scene, the run and the track, so that no two runs share one.

use std::collections::BTreeMap;

use mot::jsonl::rounded;
use mot::rows::PixelBox;
use serde::Serialize;

use crate::events::{Clock, Event, EventKind};
use crate::silhouette::{Body, contour};
use crate::{PersonEstimate, TrackId};

/// Least visible share of a silhouette for a camera that sees the person.
const SEEN: f64 = 0.05;
/// Absence after which a person is forgotten, seconds; one who is found again keeps their time.
const FORGOTTEN_S: f64 = 60.0;

/// One message.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct RegulatedScene {
    timestamp: String,
    id: String,
    name: String,
    /// Frames a second of the run.
    scene_rate: f64,
    /// Frames a second of each camera.
    rate: BTreeMap<String, f64>,
    objects: Vec<SceneObject>,
}

/// A person.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct SceneObject {
    id: String,
    #[serde(rename = "type")]
    kind: &'static str,
    category: &'static str,
    confidence: f64,
    translation: [f64; 3],
    size: [f64; 3],
    velocity: [f64; 3],
    /// Quaternion x, y, z, w.
    rotation: [f64; 4],
    visibility: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    center_of_mass: Option<ImageBox>,
    similarity: Option<f64>,
    first_seen: String,
    camera_bounds: BTreeMap<String, ImageBox>,
    regions: BTreeMap<String, Entered>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct ImageBox {
    x: f64,
    y: f64,
    width: f64,
    height: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Entered {
    entered: String,
}

impl From<PixelBox> for ImageBox {
    fn from(found: PixelBox) -> Self {
        let [x, y, width, height] = [found.left, found.top, found.width, found.height].map(rounded);
        Self { x, y, width, height }
    }
}

impl ImageBox {
    /// The middle third of the width below the uppermost quarter, as `SceneScape` has it.
    fn center_of_mass(self) -> Self {
        let (width, height) = (self.width / 3.0, self.height / 4.0);
        Self {
            x: rounded(self.x + width),
            y: rounded(self.y + height),
            width: rounded(width),
            height: rounded(height),
        }
    }
}

/// First and latest time at which a person was estimated, seconds.
#[derive(Debug, Clone, Copy)]
struct Seen {
    first_s: f64,
    last_s: f64,
}

/// Scene of a run, with what is known of its people from earlier frames.
#[derive(Debug)]
pub(super) struct Scene {
    id: String,
    name: String,
    run: [u8; 32],
    cameras: Vec<(String, calib::Camera)>,
    seen: BTreeMap<TrackId, Seen>,
    /// Zones and regions in which a person is, with the time of entering.
    inside: BTreeMap<TrackId, BTreeMap<String, f64>>,
    latest_s: Option<f64>,
    interval_s: f64,
}

impl Scene {
    /// Scene of the room of this name. `run` differs between runs.
    pub(super) fn new(name: &str, run: &str, cameras: Vec<(String, calib::Camera)>) -> Self {
        let digest = blake3::hash(format!("roomtrack scene {name}").as_bytes());
        let run = blake3::hash(format!("{digest} {run}").as_bytes());
        Self {
            id: uuid(digest.as_bytes()),
            name: name.to_owned(),
            run: *run.as_bytes(),
            cameras,
            seen: BTreeMap::new(),
            inside: BTreeMap::new(),
            latest_s: None,
            interval_s: 0.0,
        }
    }

    /// Identifier of the scene.
    pub(super) fn id(&self) -> &str {
        &self.id
    }

    /// Records in which zones and regions people are.
    pub(super) fn note(&mut self, event: &Event) {
        let (Some(person), Some(place)) = (event.id, &event.place) else { return };
        let since_s = match (event.kind, event.revoked) {
            (EventKind::Enter, _) => Some(event.time),
            (EventKind::Revoke, Some(EventKind::Leave)) => Some(event.time - event.seconds.unwrap_or(0.0)),
            (EventKind::Leave, _) | (EventKind::Revoke, Some(EventKind::Enter)) => None,
            _ => return,
        };
        let places = self.inside.entry(person).or_default();
        match since_s {
            Some(since_s) => drop(places.insert(place.clone(), since_s)),
            None => drop(places.remove(place)),
        }
        self.inside.retain(|_, places| !places.is_empty());
    }

    /// Records a frame, of which not every one becomes a message.
    pub(super) fn observe(&mut self, time_s: f64, people: &[PersonEstimate]) {
        if let Some(latest_s) = self.latest_s {
            // A mean over about 20 frames.
            let interval_s = time_s - latest_s;
            let share = if self.interval_s == 0.0 { 1.0 } else { 0.05 };
            self.interval_s += share * (interval_s - self.interval_s);
        }
        self.latest_s = Some(time_s);
        for person in people {
            let seen = self.seen.entry(person.id).or_insert(Seen { first_s: time_s, last_s: time_s });
            seen.last_s = time_s;
        }
        self.seen.retain(|_, seen| time_s - seen.last_s < FORGOTTEN_S);
    }

    /// Message of the latest frame.
    pub(super) fn message(&self, time_s: f64, clock: &Clock, people: &[PersonEstimate]) -> RegulatedScene {
        let rate = if self.interval_s > 0.0 { rounded(self.interval_s.recip()) } else { 0.0 };
        RegulatedScene {
            timestamp: clock.at(time_s),
            id: self.id.clone(),
            name: self.name.clone(),
            scene_rate: rate,
            rate: self.cameras.iter().map(|(name, _)| (name.clone(), rate)).collect(),
            objects: people.iter().map(|person| self.object(person, time_s, clock)).collect(),
        }
    }

    fn object(&self, person: &PersonEstimate, time_s: f64, clock: &Clock) -> SceneObject {
        let body = Body::from(person);
        let mut seen: Vec<(f64, &str, Option<ImageBox>)> = self
            .cameras
            .iter()
            .zip(&person.visible)
            .filter(|(_, visible)| **visible >= SEEN)
            .map(|((name, camera), visible)| {
                (*visible, name.as_str(), contour::bounding_box(&body, camera).map(ImageBox::from))
            })
            .collect();
        let visibility = seen.iter().map(|(_, name, _)| (*name).to_owned()).collect();
        let camera_bounds = seen.iter().filter_map(|(_, name, found)| Some(((*name).to_owned(), (*found)?)));
        let camera_bounds = camera_bounds.collect();
        // The camera that sees most of the person comes first.
        seen.sort_by(|a, b| b.0.total_cmp(&a.0));
        let digest = blake3::keyed_hash(&self.run, &person.id.0.to_le_bytes());
        let regions = self.inside.get(&person.id).into_iter().flatten();
        let diameter = rounded(2.0 * person.radius_m);
        SceneObject {
            id: uuid(digest.as_bytes()),
            kind: "person",
            category: "person",
            confidence: rounded(person.confidence),
            translation: [rounded(person.x_m), rounded(person.y_m), rounded(person.z_m)],
            size: [diameter, diameter, rounded(person.height_m)],
            velocity: [rounded(person.vx), rounded(person.vy), 0.0],
            rotation: [0.0, 0.0, 0.0, 1.0],
            visibility,
            center_of_mass: seen.iter().find_map(|(_, _, found)| *found).map(ImageBox::center_of_mass),
            similarity: None,
            first_seen: clock.at(self.seen.get(&person.id).map_or(time_s, |seen| seen.first_s)),
            camera_bounds,
            regions: regions
                .map(|(place, since)| (place.clone(), Entered { entered: clock.at(*since) }))
                .collect(),
        }
    }
}

/// The first 16 bytes of a digest as a UUID of version 8 (RFC 9562: own construction).
fn uuid(digest: &[u8]) -> String {
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&digest[..16]);
    bytes[6] = bytes[6] & 0x0f | 0x80;
    bytes[8] = bytes[8] & 0x3f | 0x80;
    let hex = format!("{:032x}", u128::from_be_bytes(bytes));
    [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]].join("-")
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::{Camera, Intrinsics};
    use nalgebra::{Isometry3, Point3, Vector3};
    use serde_json::Value;

    fn camera(eye: [f64; 3]) -> Camera {
        let target = Point3::new(2.0, 2.0, 0.8);
        let pose = Isometry3::face_towards(&Point3::from(eye), &target, &-Vector3::z()).inverse();
        Camera { intrinsics: Intrinsics::from_horizontal_fov(320, 240, 70.0), camera_from_world: pose }
    }

    fn person(id: u32, visible: [f64; 2]) -> PersonEstimate {
        PersonEstimate {
            id: TrackId(id),
            x_m: 2.0,
            y_m: 1.5,
            z_m: 0.0,
            radius_m: 0.25,
            height_m: 1.75,
            vx: 0.5,
            vy: -0.25,
            sigma_m: [0.03, 0.02],
            confidence: 0.97,
            visible: visible.to_vec(),
        }
    }

    fn scene(run: &str) -> Scene {
        let cameras =
            vec![("left".into(), camera([0.0, 0.0, 2.0])), ("right".into(), camera([-3.0, 2.0, 2.0]))];
        Scene::new("hall", run, cameras)
    }

    #[test]
    fn a_message_has_the_documented_fields() {
        let clock = Clock::parse("2026-03-26T20:48:42.857Z").unwrap();
        let mut scene = scene("a");
        let people = [person(3, [0.9, 0.01])];
        scene.observe(0.0, &people);
        let event = |line: &str| serde_json::from_str::<Event>(line).unwrap();
        for line in [
            r#"{"time":0.5,"frame":6,"kind":"enter","where":"counter","id":3}"#,
            r#"{"time":0.6,"frame":7,"kind":"enter","where":"shelf","id":3}"#,
            r#"{"time":2.6,"frame":31,"kind":"leave","where":"counter","id":3,"seconds":2.1}"#,
            r#"{"time":2.6,"frame":31,"kind":"revoke","revoked":"leave","where":"counter","id":3,"seconds":2.1}"#,
            r#"{"time":0.6,"frame":7,"kind":"revoke","revoked":"enter","where":"shelf","id":3}"#,
        ] {
            scene.note(&event(line));
        }
        scene.observe(0.1, &people);
        let message = serde_json::to_value(scene.message(7.292, &clock, &people)).unwrap();
        // The moments of SceneScape's own sample, regulated_scene.json.
        assert_eq!(message["timestamp"], "2026-03-26T20:48:50.149Z");
        let object = &message["objects"][0];
        assert_eq!(object["first_seen"], "2026-03-26T20:48:42.857Z");
        assert_eq!(message["name"], "hall");
        assert_eq!(message["scene_rate"], 10.0);
        assert_eq!(message["rate"]["right"], 10.0);
        assert_eq!((&object["type"], &object["category"]), (&"person".into(), &"person".into()));
        assert_eq!(object["translation"], serde_json::json!([2.0, 1.5, 0.0]));
        assert_eq!(object["size"], serde_json::json!([0.5, 0.5, 1.75]));
        assert_eq!(object["velocity"], serde_json::json!([0.5, -0.25, 0.0]));
        assert_eq!(object["visibility"], serde_json::json!(["left"]));
        assert_eq!(
            object["regions"],
            serde_json::json!({"counter": {"entered": "2026-03-26T20:48:43.357Z"}})
        );
        assert_eq!(object["similarity"], Value::Null);
        let (bounds, center) = (&object["camera_bounds"]["left"], &object["center_of_mass"]);
        let number = |value: &Value, key: &str| value[key].as_f64().unwrap();
        assert!((number(center, "width") * 3.0 - number(bounds, "width")).abs() < 1e-3);
        assert!(object["camera_bounds"].get("right").is_none());
    }

    #[test]
    fn identifiers_are_uuids_that_last_for_a_run() {
        let id = |scene: &Scene, track: u32| {
            let message = scene.message(
                0.0,
                &Clock::parse("2026-01-01T00:00:00Z").unwrap(),
                &[person(track, [1.0, 1.0])],
            );
            message.objects[0].id.clone()
        };
        let (a, b) = (scene("a"), scene("b"));
        assert_eq!(a.id(), b.id());
        assert_eq!(id(&a, 1), id(&a, 1));
        assert!(id(&a, 1) != id(&a, 2) && id(&a, 1) != id(&b, 1));
        let lengths: Vec<usize> = a.id().split('-').map(str::len).collect();
        assert_eq!(lengths, [8, 4, 4, 4, 12]);
        assert_eq!(&a.id()[14..15], "8");
    }
}
