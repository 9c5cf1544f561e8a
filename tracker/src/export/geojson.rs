//! `GeoJSON` (RFC 7946): a room's cameras, zones, regions and lines, and the tracks of a run, in WGS 84.

use std::collections::BTreeMap;
use std::path::Path;

use mot::jsonl;
use nalgebra::Point2;
use scenes::polygon::Polygon;
use scenes::room::{Geo, Room, SCENE_FILE, ZoneKind};
use serde_json::{Value, json};

use crate::{Error, Result, TrackId};

/// A track with a gap longer than this is written in parts, seconds.
const BREAK_S: f64 = 1.0;
/// Decimals of longitudes and latitudes: 0.1 mm on the ground.
const DECIMALS: f64 = 1e9;

/// One time of a track.
type Fix = (f64, Point2<f64>);

/// Writes the file, atomically, for the run in `out` and a room that was read from `room_dir`.
///
/// # Errors
/// A room without `[geo]`, a run that cannot be read, a file that cannot be written.
pub fn write(out: &Path, room: &Room, room_dir: &Path, file: &Path) -> Result<()> {
    let Some(geo) = room.geo else {
        let problem = "the room's place on Earth is not known, and GeoJSON has no local metres; add [geo] with latitude, \
                       longitude and heading (degrees; heading: where the x axis points, clockwise from north) to it";
        return Err(Error::content(&room_dir.join(SCENE_FILE), "geo", problem));
    };
    let mut features = room_features(room, &geo);
    features.extend(track_features(&out.join("tracks.jsonl"), &geo)?);
    let collection = json!({ "type": "FeatureCollection", "features": features });
    let text = collection.to_string() + "\n";
    Ok(calib::files::write_atomic(file, text.as_bytes())?)
}

fn room_features(room: &Room, geo: &Geo) -> Vec<Value> {
    let mut features = Vec::new();
    for camera in &room.cameras {
        let place = camera.camera.center();
        let point = position(geo, &Point2::new(place.x, place.y));
        let properties = json!({ "kind": "camera", "name": camera.name, "height_m": place.z });
        features.push(feature("Point", &json!(point), &properties));
    }
    for zone in &room.zones {
        let passage = match zone.kind {
            ZoneKind::Entry => "entry",
            ZoneKind::Exit => "exit",
            ZoneKind::Both => "both",
        };
        let properties = json!({ "kind": "zone", "name": zone.name, "passage": passage });
        features.push(feature("Polygon", &ring(geo, &zone.polygon), &properties));
    }
    for region in &room.regions {
        let properties = json!({ "kind": "region", "name": region.name, "dwell_s": region.dwell_s });
        features.push(feature("Polygon", &ring(geo, &region.polygon), &properties));
    }
    for line in &room.lines {
        let points: Vec<[f64; 2]> = line.points.iter().map(|p| position(geo, p)).collect();
        features.push(feature("LineString", &json!(points), &json!({ "kind": "line", "name": line.name })));
    }
    features
}

/// Features of the tracks: one for each unbroken part, by ascending id and time.
fn track_features(path: &Path, geo: &Geo) -> Result<Vec<Value>> {
    let mut tracks: BTreeMap<TrackId, Vec<Vec<Fix>>> = BTreeMap::new();
    for line in jsonl::lines(path)? {
        let line = line?;
        for person in &line.people {
            let parts = tracks.entry(person.id).or_default();
            let fix = (line.time, Point2::new(person.x, person.y));
            match parts.last_mut() {
                Some(part) if part.last().is_some_and(|(time, _)| line.time - time <= BREAK_S) => {
                    part.push(fix);
                }
                _ => parts.push(vec![fix]),
            }
        }
    }
    let parts = tracks.iter().flat_map(|(id, parts)| parts.iter().map(move |part| (id, part)));
    Ok(parts.map(|(id, part)| track_feature(*id, part, geo)).collect())
}

fn track_feature(id: TrackId, part: &[Fix], geo: &Geo) -> Value {
    let times: Vec<f64> = part.iter().map(|(time, _)| *time).collect();
    let positions: Vec<[f64; 2]> = part.iter().map(|(_, place)| position(geo, place)).collect();
    let properties = json!({ "kind": "track", "id": id, "times": times });
    match positions[..] {
        // A line needs two positions.
        [single] => feature("Point", &json!(single), &properties),
        _ => feature("LineString", &json!(positions), &properties),
    }
}

fn feature(kind: &str, coordinates: &Value, properties: &Value) -> Value {
    json!({
        "type": "Feature",
        "geometry": { "type": kind, "coordinates": coordinates },
        "properties": properties,
    })
}

/// A polygon's single ring: counter-clockwise, closed (RFC 7946, section 3.1.6).
fn ring(geo: &Geo, polygon: &Polygon) -> Value {
    let mut corners = polygon.0.clone();
    let doubled_area: f64 = polygon.edges().map(|(a, b)| a.x * b.y - b.x * a.y).sum();
    if doubled_area < 0.0 {
        corners.reverse();
    }
    let mut ring: Vec<[f64; 2]> = corners.iter().map(|corner| position(geo, corner)).collect();
    ring.extend(ring.first().copied());
    json!([ring])
}

fn position(geo: &Geo, place: &Point2<f64>) -> [f64; 2] {
    geo.longitude_latitude(place).map(|degrees| (degrees * DECIMALS).round() / DECIMALS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::room::{Line, Region, Zone};

    fn room() -> Room {
        let rectangle = |x: f64| Polygon::rectangle(Point2::new(x, 0.0), Point2::new(x + 1.0, 2.0));
        let mut clockwise = rectangle(5.0);
        clockwise.0.reverse();
        Room {
            zones: vec![Zone { name: "door".into(), polygon: rectangle(0.0), kind: ZoneKind::Entry }],
            regions: vec![Region { name: "counter".into(), polygon: clockwise, dwell_s: Some(60.0) }],
            lines: vec![Line { name: "gate".into(), points: vec![Point2::origin(), Point2::new(0.0, 30.0)] }],
            geo: Some(Geo { latitude: 48.0, longitude: 11.0, heading: 90.0 }),
            ..Room::default()
        }
    }

    fn tracks(folder: &Path) {
        let line = |frame: u32, time: f64, people: &[(u32, f64)]| {
            let person = |(id, x): &(u32, f64)| {
                json!({ "id": id, "x": x, "y": 1.0, "radius": 0.2, "height": 1.7, "vx": 0.0, "vy": 0.0,
                        "sigma": [0.1, 0.1], "confidence": 1.0 })
            };
            let people: Vec<Value> = people.iter().map(person).collect();
            json!({ "frame": frame, "time": time, "people": people }).to_string() + "\n"
        };
        let text = line(1, 0.0, &[(7, 0.0)])
            + &line(2, 0.5, &[(7, 10.0), (9, 3.0)])
            + &line(3, 4.0, &[(7, 20.0)])
            + &line(4, 4.5, &[(7, 21.0)]);
        std::fs::write(folder.join("tracks.jsonl"), text).unwrap();
    }

    #[test]
    fn all_of_a_room_and_its_tracks_is_on_the_map() {
        let folder = tempfile::tempdir().unwrap();
        tracks(folder.path());
        let file = folder.path().join("map.geojson");
        write(folder.path(), &room(), Path::new("room"), &file).unwrap();
        let map: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
        assert_eq!(map["type"], "FeatureCollection");
        let features = map["features"].as_array().unwrap();
        let kinds: Vec<(&str, &str)> = features
            .iter()
            .map(|f| (f["properties"]["kind"].as_str().unwrap(), f["geometry"]["type"].as_str().unwrap()))
            .collect();
        let expected = [
            ("zone", "Polygon"),
            ("region", "Polygon"),
            ("line", "LineString"),
            ("track", "LineString"),
            ("track", "LineString"),
            ("track", "Point"),
        ];
        assert_eq!(kinds, expected);
        assert_eq!(features[0]["properties"]["passage"], "entry");
        assert_eq!(features[3]["properties"]["times"], json!([0.0, 0.5]));
        assert_eq!(features[4]["properties"]["times"], json!([4.0, 4.5]));
        // The x axis points east: 10 m along the parallel, whose radius follows from the ellipsoid.
        let (a, e2) = (6_378_137.0_f64, 0.006_694_379_990_14_f64);
        let latitude = 48.0_f64.to_radians();
        let parallel_m = a / (1.0 - e2 * latitude.sin().powi(2)).sqrt() * latitude.cos();
        let longitude = |i: usize| features[3]["geometry"]["coordinates"][i][0].as_f64().unwrap();
        let east_m = (longitude(1) - longitude(0)).to_radians() * parallel_m;
        assert!((east_m - 10.0).abs() < 5e-4, "{east_m}");
        for polygon in &features[..2] {
            let ring = polygon["geometry"]["coordinates"][0].as_array().unwrap();
            let at = |i: usize, k: usize| ring[i][k].as_f64().unwrap() - ring[0][k].as_f64().unwrap();
            assert_eq!((ring.len(), &ring[0]), (5, &ring[4]));
            let doubled: f64 = (0..4).map(|i| at(i, 0) * at(i + 1, 1) - at(i + 1, 0) * at(i, 1)).sum();
            assert!(doubled > 0.0, "counter-clockwise");
        }
    }

    #[test]
    fn a_room_without_a_place_on_earth_is_told_how_to_get_one() {
        let folder = tempfile::tempdir().unwrap();
        tracks(folder.path());
        let file = folder.path().join("map.geojson");
        let room = Room { geo: None, ..room() };
        let line = write(folder.path(), &room, Path::new("myroom"), &file).unwrap_err().to_string();
        assert!(line.contains("myroom/scene.toml") && line.contains("add [geo]"), "{line}");
        assert!(!line.contains('\n') && !file.exists(), "{line}");
    }
}
