//! The program `scenes` as a person runs it: output, exit status, and error lines.
#![allow(clippy::unwrap_used)] // a test that cannot go on should stop

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use scenes::depth::png;
use scenes::geometry::{Disc, Geometry};
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera, Zone, ZoneKind};
use tempfile::TempDir;

/// A floor of four square metres below a camera that looks straight down at its middle.
fn room() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (eye, target) = (Point3::new(1.0, 1.0, 2.5), Point3::new(1.0, 1.0, 0.0));
    let camera_from_world = Isometry3::face_towards(&eye, &target, &-Vector3::y()).inverse();
    let camera = Camera { intrinsics: Intrinsics::from_horizontal_fov(64, 48, 60.0), camera_from_world };
    let disc = |i: u32| Disc {
        center: Vec3::new(0.05 + 0.1 * (i % 20) as f32, 0.05 + 0.1 * (i / 20) as f32, 0.0),
        normal: Vec3::Z,
        radius: 0.08,
        color: [100; 3],
        filled: false,
        confidence: 1.0,
    };
    let zone = |name: &str, x: f64| Zone {
        name: name.into(),
        polygon: Polygon::rectangle(Point2::new(x, 0.2), Point2::new(x + 0.5, 0.7)),
        kind: ZoneKind::Entry,
    };
    Room {
        cameras: vec![RoomCamera { name: "up".into(), camera, reference: Some("reference/up.jpg".into()) }],
        zones: vec![zone("door", 0.1)],
        geometry: Some(Geometry::Discs((0..400).map(disc).collect())),
        ..Room::default()
    }
    .write(folder.path())
    .unwrap();
    folder
}

fn scenes(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_scenes")).args(arguments).output().unwrap()
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Error of a failed run: a line (warnings aside), no panic.
fn complaint(arguments: &[&str], status: i32) -> String {
    let output = scenes(arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{said}");
    assert_eq!(said.lines().filter(|line| !line.contains("WARN")).count(), 1, "{said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

#[test]
fn check_prints_what_is_in_the_room() {
    let folder = room();
    let output = scenes(&["check", path(folder.path())]);
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8(output.stdout).unwrap();
    for part in [
        "up: 64 × 48",
        "2.500 m above the floor",
        "400 discs",
        "door: 0.25 m², people enter",
        "m² to stand on",
    ] {
        assert!(said.contains(part), "no `{part}` in:\n{said}");
    }
    // A reference image that is not there is worth a warning.
    assert!(String::from_utf8(output.stderr).unwrap().contains("reference"));
}

#[test]
fn check_names_regions_and_lines_and_warns_of_those_beyond_the_floor() {
    let folder = room();
    let scene = folder.path().join("scene.toml");
    let before = std::fs::read_to_string(&scene).unwrap();
    let floor = "[floor]\nwalkable = [[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]]\n";
    let places = |x: f64| {
        format!(
            "[[region]]\nname = \"r\"\npolygon = [[{x}, 1], [{0}, 1], [{0}, 2]]\ndwell_s = 30\n\
             [[line]]\nname = \"l\"\npoints = [[{x}, 3], [{0}, 3]]\n",
            x + 2.0
        )
    };
    let check = |text: String| {
        std::fs::write(&scene, text).unwrap();
        let output = scenes(&["check", path(folder.path())]);
        assert_eq!(output.status.code(), Some(0));
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (told, warned) = check(format!("{before}\n{floor}{}", places(1.0)));
    assert!(
        told.contains("region    r: 1.00 m², people are counted and timed, stays longer than 30 s"),
        "{told}"
    );
    assert!(told.contains("line      l: 2.00 m, from its left to its right is in"), "{told}");
    assert!(!warned.contains("region") && !warned.contains("line `"), "{warned}");
    let (_, warned) = check(format!("{before}\n{floor}{}", places(50.0)));
    assert!(warned.contains("region `r`: nobody can stand in it; move it"), "{warned}");
    assert!(warned.contains("line `l`: nobody can cross it; move it"), "{warned}");
    std::fs::write(&scene, format!("{before}\n[[line]]\nname = \"l\"\npoints = [[0, 0]]\n")).unwrap();
    let said = complaint(&["check", path(folder.path())], 1);
    assert!(said.contains("line 1 (`l`): a line needs at least 2 points"), "{said}");
}

#[test]
fn check_exits_with_1_and_says_what_is_wrong() {
    let folder = room();
    assert!(complaint(&["check", "/nowhere/room"], 1).contains("no such room directory"));
    let ply = folder.path().join("room.ply");
    let bytes = std::fs::read(&ply).unwrap();
    std::fs::write(&ply, &bytes[..bytes.len() / 2]).unwrap();
    let said = complaint(&["check", path(folder.path())], 1);
    assert!(said.contains("room.ply: element vertex") && said.contains("cut off"), "{said}");
    let scene = folder.path().join("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text.replace("translation", "transition")).unwrap();
    let said = complaint(&["check", path(folder.path())], 1);
    assert!(said.contains("scene.toml: line") && said.contains("transition"), "{said}");
}

#[test]
fn depth_writes_millimetres() {
    let folder = room();
    let out = folder.path().join("new/depth.png");
    let output = scenes(&["depth", path(folder.path()), "--camera", "up", "--out", path(&out)]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let map = png::read(&out).unwrap();
    assert_eq!((map.width, map.height), (64, 48));
    assert!((map.at(32, 24) - 2.5).abs() < 1e-6, "{}", map.at(32, 24));
}

#[test]
fn misuse_exits_with_2_and_writes_nothing() {
    let folder = room();
    let (dir, out) = (path(folder.path()), folder.path().join("depth.png"));
    let said = complaint(&["depth", dir, "--camera", "down", "--out", path(&out)], 2);
    assert!(said.contains("`down`") && said.contains("`up`"), "{said}");
    assert!(complaint(&["depth", "/nowhere", "--camera", "up", "--out", path(&out)], 2).contains("/nowhere"));
    assert!(!out.exists());
    // A folder in the way.
    std::fs::create_dir(&out).unwrap();
    assert!(complaint(&["depth", dir, "--camera", "up", "--out", path(&out)], 2).contains("depth.png"));
    assert_eq!(scenes(&["depth", dir]).status.code(), Some(2));
    assert_eq!(scenes(&[]).status.code(), Some(2));
    assert_eq!(scenes(&["--help"]).status.code(), Some(0));
}

#[test]
fn edit_serves_the_room_where_it_says() {
    let folder = room();
    let mut child = Command::new(env!("CARGO_BIN_EXE_scenes"))
        .args(["edit", path(folder.path()), "--port", "0"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.split("http://").nth(1).unwrap().split('/').next().unwrap();
    let mut answer = String::new();
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET /room.json HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
    stream.read_to_string(&mut answer).unwrap();

    // A second server at the same address fails before it does anything else.
    let port = address.rsplit(':').next().unwrap();
    let taken = complaint(&["edit", "/nowhere", "--port", port], 2);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(line.contains("Ctrl-C") && address.starts_with("127.0.0.1:"), "{line}");
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("\"door\""), "{answer}");
    assert!(taken.contains(address) && taken.contains("in use") && taken.contains("--port"), "{taken}");
}

#[test]
fn edit_says_what_is_in_its_way() {
    let folder = room();
    let dir = path(folder.path());
    assert!(complaint(&["edit", "/nowhere", "--port", "0"], 2).contains("no such room directory"));
    let elsewhere = complaint(&["edit", dir, "--port", "0", "--host", "192.0.2.1"], 2);
    assert!(elsewhere.contains("192.0.2.1") && elsewhere.contains("--host"), "{elsewhere}");
    assert_eq!(scenes(&["edit", dir, "--port", "70000"]).status.code(), Some(2));
    std::fs::write(folder.path().join("room.ply"), "ply").unwrap();
    assert!(complaint(&["edit", dir, "--port", "0"], 2).contains("room.ply"));
}

#[test]
fn a_reader_who_leaves_is_no_failure() {
    let folder = room();
    let mut child = Command::new(env!("CARGO_BIN_EXE_scenes"))
        .args(["check", path(folder.path())])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(!said.contains("panicked"), "{said}");
}

#[test]
fn a_scan_with_cameras_given_one_by_one_is_the_same_room() {
    let folder = room();
    let dir = folder.path();
    let Room { cameras, geometry, .. } = Room::read(dir).unwrap();
    let Some(Geometry::Discs(discs)) = geometry else { unreachable!() };
    // A scanner's cloud: bare points; lens and pose as `calib` writes them.
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        discs.len()
    );
    let points: Vec<String> =
        discs.iter().map(|d| format!("{} {} {}", d.center.x, d.center.y, d.center.z)).collect();
    let named = |name: &str| dir.join(name);
    std::fs::write(named("scan.ply"), header + &points.join("\n") + "\n").unwrap();
    let camera = &cameras[0].camera;
    calib::files::write_intrinsics(&named("lens.toml"), &camera.intrinsics).unwrap();
    let rotation =
        calib::files::rows_of_matrix(camera.camera_from_world.rotation.to_rotation_matrix().matrix());
    let t = camera.camera_from_world.translation.vector;
    let pose =
        format!("rotation = {rotation:?}\ntranslation = [{:?}, {:?}, {:?}]\nrms_px = 0.3\n", t.x, t.y, t.z);
    std::fs::write(named("pose.toml"), pose).unwrap();

    let (copy, scan) = (named("copy"), named("scan.ply"));
    let given = format!("up={},{}", path(&named("lens.toml")), path(&named("pose.toml")));
    let import = |camera: &str| {
        let geometry = ["--geometry", path(&scan), "--out", path(&copy)];
        scenes(&[&["import", "--camera", camera], &geometry[..]].concat())
    };
    for wrong in ["up", "up=lens.toml", "=a,b", "up=,b"] {
        let output = import(wrong);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && said.contains("NAME=LENS,POSE"), "{said}");
    }
    assert_eq!(scenes(&["import", "--out", path(&copy)]).status.code(), Some(2));
    assert!(!copy.exists());
    let output = import(&given);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let depth_of = |room: &Path, out: &str| {
        let out = named(out);
        assert!(scenes(&["depth", path(room), "--camera", "up", "--out", path(&out)]).status.success());
        image::open(out).unwrap().into_luma16()
    };
    let (expected, found) = (depth_of(dir, "a.png"), depth_of(&copy, "b.png"));
    // The floor comes back in place; its outermost points become slightly larger discs.
    let floor = || expected.pixels().zip(found.pixels()).filter(|(a, _)| a[0] > 0);
    assert!(floor().count() > 1000 && floor().all(|(a, b)| a[0].abs_diff(b[0]) <= 2));
    let Some(Geometry::Discs(discs)) = Room::read(&copy).unwrap().geometry else { unreachable!() };
    assert!(discs.iter().all(|d| d.normal.z > 0.999));
    // An existing room is not written over.
    assert!(complaint(&["import", "--camera", &given, "--out", path(&copy)], 2).contains("a room already"));
}

#[test]
fn a_room_goes_to_nerfstudio_and_comes_back() {
    let folder = room();
    let file = folder.path().join("transforms.json");
    let copy = folder.path().join("copy");
    let export = ["export", path(folder.path()), "--format", "nerfstudio", "--out", path(&file)];
    assert!(scenes(&export).status.success());
    assert!(scenes(&["import", path(&file), "--out", path(&copy)]).status.success());
    let (before, after) = (Room::read(folder.path()).unwrap(), Room::read(&copy).unwrap());
    let point = Point3::new(0.6, 0.7, 0.3);
    let pixel = |room: &Room| room.camera("up").unwrap().camera.project(&point).unwrap();
    assert!((pixel(&before) - pixel(&after)).norm() < 1e-6);
}

#[test]
fn a_room_goes_to_colmap_and_comes_back_with_its_points() {
    let folder = room();
    let (model, copy) = (folder.path().join("sparse"), folder.path().join("copy"));
    let export = ["export", path(folder.path()), "--format", "colmap", "--out", path(&model)];
    assert!(scenes(&export).status.success());
    let output = scenes(&["import", path(&model), "--out", path(&copy)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let (before, after) = (Room::read(folder.path()).unwrap(), Room::read(&copy).unwrap());
    let (Some(Geometry::Discs(before)), Some(Geometry::Discs(after))) = (before.geometry, after.geometry)
    else {
        panic!("discs come back as discs")
    };
    assert_eq!(after.len(), before.len());
    for (a, b) in after.iter().zip(&before) {
        assert_eq!((a.center, a.color), (b.center, b.color));
        assert!(a.normal.z > 0.999 && a.radius > 0.05 && a.radius < 0.2, "{a:?}");
    }
}

#[test]
fn import_leaves_a_geometry_that_is_not_the_rooms_alone() {
    let folder = room();
    let transforms = folder.path().join("transforms.json");
    assert!(
        scenes(&["export", path(folder.path()), "--format", "nerfstudio", "--out", path(&transforms)])
            .status
            .success()
    );
    // The remaining files are a scan and cameras in a folder of the user's own.
    std::fs::remove_file(folder.path().join("scene.toml")).unwrap();
    let scan = folder.path().join("room.ply");
    let before = std::fs::read(&scan).unwrap();
    let import = ["import", path(&transforms), "--geometry", path(&scan), "--out", path(folder.path())];
    let said = complaint(&import, 2);
    assert!(said.contains("room.ply") && said.contains("name a new directory"), "{said}");
    assert_eq!(std::fs::read(&scan).unwrap(), before);
    assert!(!folder.path().join("scene.toml").exists());
}

#[test]
fn a_telephones_reference_image_is_as_large_as_it_stands() {
    let folder = room();
    std::fs::create_dir(folder.path().join("reference")).unwrap();
    let jpeg = |width, height, orientation: u8| {
        let mut plain = std::io::Cursor::new(Vec::new());
        image::RgbImage::new(width, height).write_to(&mut plain, image::ImageFormat::Jpeg).unwrap();
        let plain = plain.into_inner();
        // An EXIF block of one entry: Orientation (0x0112), one short.
        let tiff = [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", &[orientation][..], &[0; 6]].concat();
        let length = (tiff.len() as u16 + 8).to_be_bytes();
        let bytes = [&plain[..2], &[0xff, 0xe1], &length, b"Exif\0\0", &tiff, &plain[2..]].concat();
        std::fs::write(folder.path().join("reference/up.jpg"), bytes).unwrap();
        String::from_utf8(scenes(&["check", path(folder.path())]).stderr).unwrap()
    };
    assert_eq!(jpeg(48, 64, 6), "");
    let said = jpeg(64, 48, 6);
    assert!(said.contains("up.jpg is 48 × 64, not 64 × 48"), "{said}");
}
