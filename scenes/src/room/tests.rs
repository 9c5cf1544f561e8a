//! Rooms written and read, and every kind of invalid room directory.

use std::path::{Path, PathBuf};

use approx::assert_relative_eq;
use calib::{Camera, Fisheye, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Translation3, UnitQuaternion};
use proptest::prelude::*;
use tempfile::TempDir;

use super::{Geo, Line, Markings, Region, Room, RoomCamera, Zone, ZoneKind, read_markings};
use crate::geometry::{Disc, Geometry};
use crate::polygon::Polygon;

fn room() -> Room {
    let camera = |name: &str, turn: f64| {
        let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 73.3);
        intrinsics.distortion = [-0.2, 0.1, 1e-4, -2e-3, 0.012_345_678_9].into();
        let camera_from_world = Isometry3::from_parts(
            Translation3::new(0.1 + turn, -1.0 / 3.0, std::f64::consts::PI),
            UnitQuaternion::from_euler_angles(turn, 1.0, -0.3),
        );
        RoomCamera {
            name: name.into(),
            camera: Camera { intrinsics, camera_from_world },
            reference: Some(format!("reference/{name}.jpg").into()),
        }
    };
    let rectangle = |x: f64| Polygon::rectangle(Point2::new(x, 1.0 / 7.0), Point2::new(x + 1.0, 2.0));
    Room {
        cameras: vec![camera("cam1", 0.2), camera("Küche links", 2.0)],
        zones: vec![
            Zone { name: "door".into(), polygon: rectangle(0.1), kind: ZoneKind::Both },
            Zone { name: "gate".into(), polygon: rectangle(3.0), kind: ZoneKind::Exit },
        ],
        regions: vec![
            Region { name: "counter".into(), polygon: rectangle(5.0), dwell_s: Some(60.0) },
            Region { name: "shelf".into(), polygon: rectangle(7.0), dwell_s: None },
        ],
        lines: vec![Line {
            name: "till".into(),
            points: vec![Point2::new(0.0, 1.0 / 3.0), Point2::new(2.0, 0.0), Point2::new(2.5, 1.0)],
        }],
        source: Some(super::Source { shift: [-500_000.0, 0.5, 0.0] }),
        geo: Some(Geo { latitude: 52.516_274_1, longitude: -0.1, heading: 271.25 }),
        walkable: Some(vec![rectangle(-5.0), rectangle(-2.5)]),
        geometry: Some(Geometry::Discs(vec![Disc {
            center: Vec3::new(0.1, 0.2, 0.3),
            normal: Vec3::Z,
            radius: 0.05,
            color: [1, 2, 3],
            filled: true,
            confidence: 1.0,
        }])),
    }
}

/// A directory with [`room`] in it.
fn written() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    room().write(folder.path()).unwrap();
    folder
}

/// One-line error of reading after a change of `scene.toml`'s text.
fn said_after(change: impl Fn(&str) -> String) -> String {
    let folder = written();
    let path = folder.path().join("scene.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let changed = change(&text);
    assert_ne!(text, changed, "the change does nothing");
    std::fs::write(&path, changed).unwrap();
    said(folder.path())
}

fn said(dir: &Path) -> String {
    let line = Room::read(dir).unwrap_err().to_string();
    assert!(!line.contains('\n'), "{line}");
    assert!(line.contains(&*dir.to_string_lossy()), "names no file: {line}");
    line
}

#[test]
fn a_written_room_reads_back_equal() {
    let (folder, room) = (written(), room());
    let back = Room::read(folder.path()).unwrap();
    assert_eq!(back.zones, room.zones);
    assert_eq!((&back.regions, &back.lines), (&room.regions, &room.lines));
    assert_eq!(back.geo, room.geo);
    assert_eq!(back.walkable, room.walkable);
    assert_eq!(back.geometry, room.geometry);
    for (a, b) in back.cameras.iter().zip(&room.cameras) {
        assert_eq!((&a.name, &a.reference), (&b.name, &b.reference));
        assert_eq!(a.camera.intrinsics, b.camera.intrinsics);
        assert_eq!(a.camera.camera_from_world.translation, b.camera.camera_from_world.translation);
        assert_relative_eq!(a.camera.camera_from_world, b.camera.camera_from_world, epsilon = 1e-11);
    }
    assert_eq!(back.camera("cam1").unwrap().name, "cam1");
    assert!(back.camera("cam9").unwrap_err().to_string().contains("`Küche links`"));
    // Missing reference images are reported, and are no failure.
    assert_eq!(back.missing_references(folder.path()).len(), 2);
}

#[test]
fn optional_parts_may_be_missing() {
    let folder = tempfile::tempdir().unwrap();
    let mut bare = Room { cameras: room().cameras, ..Room::default() };
    bare.cameras[0].reference = None;
    bare.write(folder.path()).unwrap();
    // A table may be appended by hand: no empty list is in its way.
    let scene = folder.path().join("scene.toml");
    let mut text = std::fs::read_to_string(&scene).unwrap();
    let lists = [("zone", "polygon"), ("region", "polygon"), ("line", "points")];
    let table =
        |(table, list)| format!("\n[[{table}]]\nname = \"a {table}\"\n{list} = [[0, 0], [1, 0], [1, 1]]\n");
    text += &lists.map(table).concat();
    let appended = tempfile::tempdir().unwrap();
    std::fs::write(appended.path().join("scene.toml"), text).unwrap();
    let read = Room::read(appended.path()).unwrap();
    assert_eq!((read.zones.len(), read.regions.len(), read.lines.len()), (1, 1, 1));
    let back = Room::read(folder.path()).unwrap();
    assert!(back.zones.is_empty() && back.walkable.is_none() && back.geometry.is_none());
    assert_eq!(back.cameras[0].reference, None);
    assert!(!folder.path().join("room.ply").exists());
}

#[test]
fn the_shipped_office_is_read() {
    let dir = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/office/room"));
    let room = Room::read(dir).unwrap();
    assert_eq!((room.cameras.len(), room.zones.len()), (2, 2));
    assert_eq!(room.geometry.map(|g| g.len()), Some(122_902));
}

#[test]
fn rooms_of_other_makers_are_read_from_shared_data() {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    for (name, cameras, zones) in [("cmc1", 4, 1), ("terrace", 4, 4), ("pets", 1, 0)] {
        let dir = data.join(name);
        if !dir.exists() {
            eprintln!("skipped: {} is not here", dir.display());
            continue;
        }
        let room = Room::read(&dir).unwrap();
        assert_eq!((room.cameras.len(), room.zones.len()), (cameras, zones), "{name}");
        assert!(room.geometry.is_none(), "{name}");
    }
}

#[test]
fn missing_and_broken_directories_are_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(said(&folder.path().join("nowhere")).contains("no such room directory"));
    assert!(said(folder.path()).contains("no scene.toml"));
    std::fs::write(folder.path().join("scene.toml"), " \n").unwrap();
    assert!(said(folder.path()).contains("empty"));
    assert!(said(&folder.path().join("scene.toml")).contains("this is a file"));
    std::fs::write(folder.path().join("scene.toml"), [0xff, 0xfe, 0x00]).unwrap();
    assert!(said(folder.path()).contains("UTF-8"));
    std::fs::write(folder.path().join("scene.toml"), "format = 1\n").unwrap();
    assert!(said(folder.path()).contains("[[camera]]"));
}

#[test]
fn a_cut_off_scene_is_an_error_with_its_line() {
    let cut = said_after(|text| text[..text.find("rotation").unwrap() + 20].to_owned());
    assert!(cut.contains("line"), "{cut}");
    let cut = said_after(|text| text[..text.find("rotation").unwrap()].to_owned());
    assert!(cut.contains("rotation"), "{cut}");
}

#[test]
fn wrong_values_name_their_place() {
    let format = said_after(|text| text.replace("format = 1", "format = 2"));
    assert!(format.contains("format 2 is not known"), "{format}");
    let none = said_after(|text| text.replace("format = 1", ""));
    assert!(none.contains("format"), "{none}");
    let misspelt = said_after(|text| text.replacen("translation", "translaton", 1));
    assert!(misspelt.contains("translaton") && misspelt.contains("line"), "{misspelt}");
    let misspelt = said_after(|text| text.replacen("kind = \"exit\"", "kind = \"out\"", 1));
    assert!(misspelt.contains("out") && misspelt.contains("line"), "{misspelt}");
    let word = said_after(|text| text.replacen("width = 640", "width = \"wide\"", 1));
    assert!(word.contains("line"), "{word}");

    let doubled = said_after(|text| text.replace("Küche links", "cam1"));
    assert!(doubled.contains("camera 2 (`cam1`)") && doubled.contains("same name"), "{doubled}");
    let path = said_after(|text| text.replace("Küche links", "../cam"));
    assert!(path.contains("camera 2") && path.contains("file names"), "{path}");
    let no_rotation = said_after(|text| text.replacen("rotation = [[", "rotation = [[1", 1));
    assert!(no_rotation.contains("camera 1 (`cam1`): rotation") && no_rotation.contains("orthonormal"));
    let translation = said_after(|text| replace_value(text, "translation", "[nan, 0.0, 0.0]"));
    assert!(translation.contains("not finite"), "{translation}");
    let rotation = said_after(|text| replace_value(text, "rotation", "[[nan, 0, 0], [0, 1, 0], [0, 0, 1]]"));
    assert!(rotation.contains("rotation") && rotation.contains("not finite"), "{rotation}");
    let matrix = said_after(|text| replace_value(text, "matrix", "[[0.0, 0, 0], [0, 1, 0], [0, 0, 1]]"));
    assert!(matrix.contains("matrix") && matrix.contains("not positive"), "{matrix}");
    let distortion = said_after(|text| replace_value(text, "distortion", "[0.0, 0.0]"));
    assert!(distortion.contains("`cam1`") && distortion.contains("2 numbers"), "{distortion}");
    let size = said_after(|text| text.replacen("width = 640", "width = 4000000000", 1));
    assert!(size.contains("image size"), "{size}");
    let size = said_after(|text| text.replacen("width = 640", "width = 0", 1));
    assert!(size.contains("empty"), "{size}");

    let zone = said_after(|text| replace_value(text, "polygon", "[[0.0, 0.0], [1.0, 0.0]]"));
    assert!(zone.contains("zone 1 (`door`)") && zone.contains("3 corners"), "{zone}");
    let geo = said_after(|text| replace_value(text, "latitude", "95.0"));
    assert!(geo.contains("geo: latitude is 95"), "{geo}");
    let geo = said_after(|text| text.replace("heading = 271.25\n", ""));
    assert!(geo.contains("heading"), "{geo}");
    let floor = said_after(|text| replace_value(text, "walkable", "[]"));
    assert!(floor.contains("floor"), "{floor}");
}

/// Replaces the value of a key in the text.
fn replace_value(text: &str, key: &str, value: &str) -> String {
    let start = text.find(&format!("{key} = ")).unwrap();
    let end = start + text[start..].find('\n').unwrap();
    format!("{}{key} = {value}{}", &text[..start], &text[end..])
}

#[test]
fn bad_geometry_is_named() {
    let folder = written();
    let ply = folder.path().join("room.ply");
    let whole = std::fs::read(&ply).unwrap();
    std::fs::write(&ply, &whole[..whole.len() - 3]).unwrap();
    assert!(said(folder.path()).contains("room.ply: element vertex"));
    std::fs::write(&ply, "").unwrap();
    assert!(said(folder.path()).contains("empty"));
    std::fs::remove_file(&ply).unwrap();
    let missing = said(folder.path());
    assert!(missing.contains("geometry") && missing.contains("room.ply"), "{missing}");
}

#[test]
fn invalid_rooms_are_not_written() {
    let folder = written();
    let before = std::fs::read(folder.path().join("scene.toml")).unwrap();
    let mut bad = room();
    bad.zones[1].polygon.0.truncate(2);
    assert!(bad.write(folder.path()).unwrap_err().to_string().contains("zone 2 (`gate`)"));
    let mut bad = room();
    bad.geometry = Some(Geometry::Discs(vec![]));
    assert!(bad.write(folder.path()).is_err());
    assert!(Room { cameras: vec![], ..room() }.validate().is_err());
    assert_eq!(std::fs::read(folder.path().join("scene.toml")).unwrap(), before);
}

#[test]
fn a_room_that_cannot_be_written_whole_is_not_written() {
    let folder = written();
    let before = std::fs::read(folder.path().join("room.ply")).unwrap();
    let scene = folder.path().join("scene.toml");
    std::fs::remove_file(&scene).unwrap();
    let mut other = room();
    other.geometry = None;
    // A folder in the way of scene.toml: its staging succeeds, its renaming fails.
    std::fs::create_dir(&scene).unwrap();
    assert!(other.write(folder.path()).is_err());
    assert_eq!(std::fs::read(folder.path().join("room.ply")).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing temporary is left");
}

#[test]
fn zones_come_from_any_file_that_has_them() {
    let folder = written();
    let scene = folder.path().join("scene.toml");
    let Room { zones, regions, lines, .. } = room();
    assert_eq!(read_markings(&scene).unwrap(), Markings { zones, regions, lines });
    let path = folder.path().join("zones.toml");
    let said = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let line = read_markings(&path).unwrap_err().to_string();
        assert!(line.contains("zones.toml") && !line.contains('\n'), "{line}");
        line
    };
    assert!(said("").contains("[[zone]]"));
    assert!(said("[[zones]]\nname = \"a\"\n").contains("[[zone]]"));
    assert!(said("[[zone]]\nname = \"a\"\npolygon = [[0, 0], [1, 1]]\n").contains("zone 1 (`a`)"));
    assert!(said("[[zone]]\nname = \"a\"\npolygon = [[0, 0], [nan, 1], [1, 0]]\n").contains("finite"));
    assert!(said("[[zone]]\nname = \"a\"\nkind = \"both\"\n").contains("polygon"));
    assert!(said("[[zone]\n").contains("line 1"));
    std::fs::write(&path, "[[zone]]\nname = \"a\"\npolygon = [[0, 0], [1, 1], [1, 0]]\n").unwrap();
    assert_eq!(read_markings(&path).unwrap().zones[0].kind, ZoneKind::Both);
    assert!(read_markings(Path::new("/nowhere/zones.toml")).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// For any damage to the files, reading ends in a room or in one line; it neither panics nor allocates much memory.
    #[test]
    fn damaged_rooms_are_read_or_refused(
        in_geometry in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let folder = written();
        let path = folder.path().join(if in_geometry { "room.ply" } else { "scene.toml" });
        let mut bytes = std::fs::read(&path).unwrap();
        for (place, value) in changes {
            let i = place.index(bytes.len());
            bytes[i] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        std::fs::write(&path, bytes).unwrap();
        match Room::read(folder.path()) {
            Ok(room) => prop_assert!(room.validate().is_ok()),
            Err(e) => {
                let line = e.to_string();
                prop_assert!(!line.contains('\n') && line.contains(&*folder.path().to_string_lossy()), "{}", line);
            }
        }
    }
}

#[test]
fn a_lens_by_name_comes_back_and_one_without_is_written_as_ever() {
    let folder = TempDir::new().unwrap();
    let mut room = room();
    room.cameras[1].camera.intrinsics.distortion = Fisheye::from([-0.02, 0.1 + 0.2, -0.003, 0.0004]).into();
    room.write(folder.path()).unwrap();
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    assert_eq!(text.matches("lens = ").count(), 1, "{text}");
    assert!(text.contains("distortion = [-0.2, 0.1, 0.0001, -0.002, 0.0123456789]"), "{text}");
    let back = Room::read(folder.path()).unwrap();
    for (found, expected) in back.cameras.iter().zip(&room.cameras) {
        assert_eq!(found.camera.intrinsics, expected.camera.intrinsics);
    }
    let said = |from: &str, to: &str| {
        std::fs::write(folder.path().join("scene.toml"), text.replace(from, to)).unwrap();
        Room::read(folder.path()).unwrap_err().to_string()
    };
    let line = said("lens = \"fisheye\"", "lens = \"rational\"");
    assert!(line.contains("`Küche links`") && line.contains("4 numbers") && line.contains("has 8"), "{line}");
    let line = said("lens = \"fisheye\"\n", "");
    assert!(line.contains("4 numbers") && line.contains("\"fisheye\"") && !line.contains('\n'), "{line}");
    let line = said("lens = \"fisheye\"", "lens = \"fish-eye\"");
    assert!(line.contains("line ") && line.contains("fish-eye"), "{line}");
}
