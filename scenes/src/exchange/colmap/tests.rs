//! Models there and back, those of pycolmap, and what is refused.

use super::*;
use crate::exchange::CORNER_PX;
use crate::exchange::test_room;
use crate::geometry::vec3_from_point;
use crate::room::Room;
use approx::assert_relative_eq;
use calib::{Distortion, Fisheye, Rational};
use glam::Vec3;

/// The cameras of a model.
pub(super) fn cameras(dir: &Path) -> Result<Vec<RoomCamera>> {
    let model = read(dir, &ModelOptions::default())?;
    Ok(model.cameras.into_iter().map(|camera| camera.entry).collect())
}

/// The points of a model, facing the cameras.
fn points(dir: &Path, viewpoints: &[Vec3]) -> Result<Option<Geometry>> {
    geometry(dir, &Placing { viewpoints, ..Placing::default() })
}

pub(super) fn room() -> Room {
    let mut room = test_room::room(3);
    room.cameras[1].camera.intrinsics.distortion = [-0.2, 0.1, 1e-3, -2e-3, 0.0].into();
    room.cameras[2].camera.intrinsics.distortion = [-0.2, 0.1, 1e-3, -2e-3, 0.05].into();
    room
}

fn same(found: &[RoomCamera], expected: &[RoomCamera]) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        let (a, b) = (&f.camera.intrinsics, &e.camera.intrinsics);
        assert_eq!((&f.name, a.width, a.height, a.distortion), (&e.name, b.width, b.height, b.distortion));
        assert_relative_eq!(a.matrix(), b.matrix(), epsilon = 1e-9);
        assert_relative_eq!(f.camera.camera_from_world, e.camera.camera_from_world, epsilon = 1e-12);
    }
}

#[test]
fn text_comes_back() {
    let (folder, room) = (tempfile::tempdir().unwrap(), room());
    write(folder.path(), &room).unwrap();
    same(&cameras(folder.path()).unwrap(), &room.cameras);
    let points = std::fs::read_to_string(folder.path().join("points3D.txt")).unwrap();
    let Some(Geometry::Mesh(mesh)) = &room.geometry else { unreachable!() };
    assert_eq!(points.lines().count(), 1 + mesh.vertices.len());
}

/// The binary form, written here after COLMAP's description of it.
fn binary_model(dir: &Path, cameras: &[RoomCamera]) {
    let count = (cameras.len() as u64).to_le_bytes();
    let (mut camera_bytes, mut images) = (count.to_vec(), count.to_vec());
    for (id, entry) in (7_u32..).zip(cameras) {
        let k = &entry.camera.intrinsics;
        let numbers = k.distortion.coefficients();
        let [k1, k2, p1, p2, k3] = numbers[..] else { panic!("{numbers:?}") };
        camera_bytes.extend(id.to_le_bytes());
        camera_bytes.extend(6_i32.to_le_bytes());
        camera_bytes.extend([k.width, k.height].map(u64::from).map(u64::to_le_bytes).concat());
        let parameters = [k.fx, k.fy, k.cx + 0.5, k.cy + 0.5, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0];
        camera_bytes.extend(parameters.map(f64::to_le_bytes).concat());
        let (q, t) = (entry.camera.camera_from_world.rotation, entry.camera.camera_from_world.translation);
        images.extend(id.to_le_bytes());
        images.extend([q.w, q.i, q.j, q.k, t.x, t.y, t.z].map(f64::to_le_bytes).concat());
        images.extend(id.to_le_bytes());
        images.extend(format!("{}.jpg\0", entry.name).as_bytes());
        images.extend(2_u64.to_le_bytes());
        images.extend([0_u8; 48]);
    }
    std::fs::write(dir.join("cameras.bin"), camera_bytes).unwrap();
    std::fs::write(dir.join("images.bin"), images).unwrap();
}

#[test]
fn binary_is_read_and_every_cut_of_it_refused() {
    let (folder, room) = (tempfile::tempdir().unwrap(), room());
    binary_model(folder.path(), &room.cameras);
    same(&cameras(folder.path()).unwrap(), &room.cameras);
    for name in ["cameras.bin", "images.bin"] {
        let path = folder.path().join(name);
        let whole = std::fs::read(&path).unwrap();
        for length in (0..whole.len()).step_by(3) {
            std::fs::write(&path, &whole[..length]).unwrap();
            let line = cameras(folder.path()).unwrap_err().to_string();
            assert!(line.contains(name) && !line.contains('\n'), "{line}");
        }
        let mut many = whole.clone();
        many[..8].fill(0xff);
        std::fs::write(&path, many).unwrap();
        assert!(cameras(folder.path()).is_err());
        std::fs::write(&path, whole).unwrap();
    }
}

/// Output of pycolmap (`tests/peers/colmap.py`), and the pixels at which pycolmap sees the points.
#[derive(serde::Deserialize)]
struct PeerModel {
    points: Vec<PeerPoint>,
    pixels: std::collections::BTreeMap<String, Vec<[f64; 2]>>,
}

#[derive(serde::Deserialize)]
struct PeerPoint {
    place: [f64; 3],
    color: [u8; 3],
}

fn peers() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers")
}

#[test]
fn models_written_by_colmap_project_as_in_colmap() {
    let expected = std::fs::read_to_string(peers().join("colmap.json")).unwrap();
    let expected: PeerModel = serde_json::from_str(&expected).unwrap();
    for folder in ["colmap_binary", "colmap_text"] {
        let folder = peers().join(folder);
        let placed = cameras(&folder).unwrap();
        assert_eq!(placed.len(), expected.pixels.len());
        for (picture, pixels) in &expected.pixels {
            let name = camera_names(std::slice::from_ref(picture), NamedAfter::Path).remove(0);
            let camera = placed.iter().find(|c| c.name == name).unwrap();
            for (point, pixel) in expected.points.iter().zip(pixels) {
                let seen = camera.camera.project(&point.place.into()).unwrap();
                let off = (seen.x + CORNER_PX - pixel[0]).hypot(seen.y + CORNER_PX - pixel[1]);
                assert!(off < 1e-9, "{picture}: {off} px");
            }
        }
        let eyes: Vec<Vec3> = placed.iter().map(|c| vec3_from_point(&c.camera.center())).collect();
        let Some(Geometry::Discs(discs)) = points(&folder, &eyes).unwrap() else { panic!("no discs") };
        assert_eq!(discs.len(), expected.points.len());
        for (disc, point) in discs.iter().zip(&expected.points) {
            assert!(disc.center.distance(vec3_from_point(&point.place.into())) < 1e-6, "{disc:?}");
            assert_eq!(disc.color, point.color);
            assert!(disc.normal.z > 0.999, "{disc:?}");
        }
    }
}

#[test]
fn every_cut_of_points_is_refused_and_none_are_no_geometry() {
    for (from, name) in [("colmap_binary", "points3D.bin"), ("colmap_text", "points3D.txt")] {
        let folder = tempfile::tempdir().unwrap();
        for entry in std::fs::read_dir(peers().join(from)).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
        }
        let path = folder.path().join(name);
        let whole = std::fs::read(&path).unwrap();
        let said = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            points(folder.path(), &[]).unwrap_err().to_string()
        };
        if name == "points3D.bin" {
            for length in 0..whole.len() {
                assert!(said(&whole[..length]).contains("points3D.bin"), "cut to {length}");
            }
            let mut many = whole.clone();
            many[..8].fill(0xff);
            assert!(said(&many).contains("ends here"));
            let mut wild = whole.clone();
            wild[16..24].copy_from_slice(&f64::NAN.to_le_bytes());
            assert!(said(&wild).contains("point 1 of 42: a coordinate is not finite"));
            std::fs::write(&path, 0_u64.to_le_bytes()).unwrap();
        } else {
            for (line, words) in [
                ("1 0 0", "line 1: coordinate is missing"),
                ("# a comment\n1 0 zero 0 1 2 3 0", "line 2: `zero` is no coordinate"),
                ("1 0 0 0 1 256 3 0", "line 1: `256` is no colour"),
                ("1 0 1e300 0 1 2 3 0", "point 1 of 1: a coordinate is not finite"),
            ] {
                let said = said(line.as_bytes());
                assert!(said.contains("points3D.txt") && said.contains(words), "{said}");
            }
            std::fs::write(&path, "# nothing\n").unwrap();
        }
        assert_eq!(points(folder.path(), &[]).unwrap(), None);
        std::fs::remove_file(&path).unwrap();
        assert_eq!(points(folder.path(), &[]).unwrap(), None);
    }
}

#[test]
fn defects_of_models_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let said = || cameras(folder.path()).unwrap_err().to_string();
    assert!(said().contains("no COLMAP model"));
    let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let camera = "# a comment\n1 PINHOLE 64 48 60 60 32 24\n";
    let image = "1 1 0 0 0 0 1.2 3 1 left.png\n\n";
    put("cameras.txt", camera);
    assert!(said().contains("images.txt"));
    put("images.txt", image);
    assert_eq!(cameras(folder.path()).unwrap()[0].name, "left");
    for (from, to, words) in [
        ("PINHOLE", "OPENCV_FISHEYE", &["cameras.txt", "line 2", "8"][..]),
        ("PINHOLE", "PINOLE", &["cameras.txt", "line 2", "PINOLE"]),
        ("60 60 32 24", "60 nan 32 24", &["cameras.txt", "camera 1", "positive"]),
        ("60 60 32 24", "60 60 32", &["cameras.txt", "line 2", "4"]),
        ("64 48", "0 48", &["cameras.txt", "camera 1", "empty"]),
    ] {
        put("cameras.txt", &camera.replace(from, to));
        let line = said();
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    }
    put("cameras.txt", camera);
    for (from, to, words) in [
        ("1 1 0 0 0 0", "1 2 0 0 0 0", &["images.txt", "`left.png`", "rotation"][..]),
        ("3 1 left", "nan 1 left", &["images.txt", "finite"]),
        ("3 1 left", "3 5 left", &["images.txt", "camera 5"]),
        (" left.png", "", &["images.txt", "line 1"]),
        (image, "", &["images.txt", "no image"]),
    ] {
        put("images.txt", &image.replace(from, to));
        let line = said();
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    }
    // Images without their second lines, and a list of points that is none.
    for (second, line) in [
        ("2 1 0 0 0 0 1.2 3 1 right.png", 2),
        ("2 1 0 0 0 0 1.2 3 1 a b 12", 2),
        ("1 2 0.5", 2),
        ("1.5 2 7 8", 2),
    ] {
        put("images.txt", &format!("1 1 0 0 0 0 1.2 3 1 left.png\n{second}\n"));
        let said = said();
        assert!(
            said.contains(&format!("images.txt: line {line}")) && said.contains("list of points"),
            "{said}"
        );
    }
    put("images.txt", "1 1 0 0 0 0 1.2 3 1 left.png\n10.5 20 -1 30 40.25 7\n2 1 0 0 0 0 1.2 3 1 right.png\n");
    assert_eq!(cameras(folder.path()).unwrap().len(), 2);
    put("images.txt", image);
    for (camera, words) in [
        ("1 SIMPLE_DIVISION 64 48 60 32 24 0.1\n", "SIMPLE_DIVISION is not known here"),
        ("1 EQUIRECTANGULAR 64 48 64 48\n", "cut the pictures"),
    ] {
        put("cameras.txt", camera);
        assert!(said().contains(words), "{}", said());
    }
    put("cameras.txt", "1 FOV 64 48 60 60 32 24 0.1\n");
    assert!(said().contains("image_undistorter"));
}

/// A copy of one of pycolmap's models with rigs, and the poses of its pictures (camera from world, three rows of four).
fn rig_model(form: &str) -> (tempfile::TempDir, std::collections::BTreeMap<String, [[f64; 4]; 3]>) {
    let copy = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(peers().join(format!("colmap_rig_{form}"))).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), copy.path().join(entry.file_name())).unwrap();
    }
    let expected = std::fs::read_to_string(peers().join("colmap_rig.json")).unwrap();
    (copy, serde_json::from_str(&expected).unwrap())
}

#[test]
fn poses_of_pictures_come_from_rigs_and_frames() {
    for form in ["binary", "text"] {
        let (folder, expected) = rig_model(form);
        // Without the copies of the poses in `images` nothing else is left to read them from.
        if form == "text" {
            let path = folder.path().join("images.txt");
            let lines: Vec<String> = std::fs::read_to_string(&path)
                .unwrap()
                .lines()
                .map(|line| match line.split(' ').collect::<Vec<_>>()[..] {
                    [id, .., camera, name] if !line.starts_with('#') => {
                        format!("{id} 1 0 0 0 9 9 9 {camera} {name}")
                    }
                    _ => line.to_owned(),
                })
                .collect();
            std::fs::write(&path, lines.join("\n")).unwrap();
        } else {
            let path = folder.path().join("images.bin");
            let mut bytes = std::fs::read(&path).unwrap();
            let names = [&b"eye1/0.jpg"[..], b"eye2/0.jpg", b"eye1/1.jpg", b"eye2/1.jpg"];
            for name in names {
                let at = bytes.windows(name.len()).position(|part| part == name).unwrap();
                // Seven numbers and the camera stand before the name.
                bytes[at - 60..at - 4]
                    .copy_from_slice(&[1.0_f64, 0.0, 0.0, 0.0, 9.0, 9.0, 9.0].map(f64::to_le_bytes).concat());
            }
            std::fs::write(&path, bytes).unwrap();
        }
        let model = read(folder.path(), &ModelOptions::default()).unwrap();
        assert_eq!(model.cameras.len(), expected.len());
        for camera in &model.cameras {
            let found = camera.entry.camera.camera_from_world.to_homogeneous();
            let rows = &expected[&camera.picture];
            let off = nalgebra::Matrix3x4::from_fn(|r, c| found[(r, c)] - rows[r][c]).amax();
            assert!(off < 1e-9, "{form} {}: {off}", camera.picture);
        }
    }
}

#[test]
fn defects_of_rigs_and_frames_are_named() {
    let said =
        |folder: &tempfile::TempDir| read(folder.path(), &ModelOptions::default()).unwrap_err().to_string();
    let (folder, _) = rig_model("text");
    for (name, from, to, words) in [
        ("frames.txt", "1 4 1 0 0 0 1 2 3", "1 9 1 0 0 0 1 2 3", "frame 1: there is no rig 9"),
        ("frames.txt", "CAMERA 2 2", "CAMERA 7 2", "frame 1: its rig 4 has no camera 7"),
        ("frames.txt", "1 4 1 0 0 0 1 2 3", "1 4 3 0 0 0 1 2 3", "rotation"),
        ("frames.txt", " CAMERA 2 2", "", "line 4: sensor type is missing"),
        ("rigs.txt", "4 2 CAMERA", "4 two CAMERA", "rigs.txt: line 4: `two` is no number of sensors"),
    ] {
        let path = folder.path().join(name);
        let whole = std::fs::read_to_string(&path).unwrap();
        assert!(whole.contains(from), "{from}");
        std::fs::write(&path, whole.replacen(from, to, 1)).unwrap();
        let line = said(&folder);
        assert!(line.contains(words) && !line.contains('\n'), "{line}");
        std::fs::write(&path, whole).unwrap();
    }
    let (folder, _) = rig_model("binary");
    for name in ["rigs.bin", "frames.bin"] {
        let path = folder.path().join(name);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(said(&folder).contains(name), "{name} cut to {length}");
        }
        let mut many = whole.clone();
        many[..8].fill(0xff);
        std::fs::write(&path, many).unwrap();
        assert!(said(&folder).contains(name));
        std::fs::write(&path, whole).unwrap();
    }
}

#[test]
fn lenses_without_their_bend_are_pinholes() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("images.txt"), "1 1 0 0 0 0 1.2 3 1 left.png\n\n").unwrap();
    let lens = |line: &str| {
        std::fs::write(folder.path().join("cameras.txt"), format!("1 {line}\n")).unwrap();
        let model = read(folder.path(), &ModelOptions::default()).map_err(|e| e.to_string())?;
        let k = model.cameras[0].entry.camera.intrinsics.clone();
        Ok::<_, String>((k.fx, k.fy, k.cx, k.distortion.is_none()))
    };
    for (line, fy) in [
        ("SIMPLE_DIVISION 64 48 60 32 24 0", 60.0),
        ("DIVISION 64 48 60 61 32 24 0", 61.0),
        ("FOV 64 48 60 61 32 24 0", 61.0),
        ("EUCM 64 48 60 61 32 24 0 1", 61.0),
    ] {
        assert_eq!(lens(line), Ok((60.0, fy, 31.5, true)), "{line}");
        let bent =
            line.strip_suffix(" 0").map_or_else(|| line.replace(" 0 1", " 0.1 1"), |l| format!("{l} 0.1"));
        let said = lens(&bent).unwrap_err();
        assert!(said.contains("is not known here") && said.contains("image_undistorter"), "{said}");
    }
}

#[test]
fn wide_lenses_are_read_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("images.txt"), "1 1 0 0 0 0 1.2 3 1 left.png\n\n").unwrap();
    let fisheye = |numbers: [f64; 4]| Distortion::from(Fisheye::from(numbers));
    for (line, fy, expected) in [
        ("SIMPLE_FISHEYE 64 48 30 32 24", 30.0, fisheye([0.0; 4])),
        ("FISHEYE 64 48 30 31 32 24", 31.0, fisheye([0.0; 4])),
        ("SIMPLE_RADIAL_FISHEYE 64 48 30 32 24 -0.02", 30.0, fisheye([-0.02, 0.0, 0.0, 0.0])),
        ("RADIAL_FISHEYE 64 48 30 32 24 -0.02 0.01", 30.0, fisheye([-0.02, 0.01, 0.0, 0.0])),
        (
            "OPENCV_FISHEYE 64 48 30 31 32 24 -0.02 0.01 -0.003 0.0004",
            31.0,
            fisheye([-0.02, 0.01, -0.003, 0.0004]),
        ),
        (
            "FULL_OPENCV 64 48 30 31 32 24 0.1 0.2 0.001 -0.002 0.01 0.3 0.04 0.005",
            31.0,
            Rational::from([0.1, 0.2, 0.001, -0.002, 0.01, 0.3, 0.04, 0.005]).into(),
        ),
    ] {
        std::fs::write(folder.path().join("cameras.txt"), format!("1 {line}\n")).unwrap();
        let model = read(folder.path(), &ModelOptions::default()).unwrap();
        let k = &model.cameras[0].entry.camera.intrinsics;
        assert_eq!((k.fx, k.fy, k.cx, k.distortion), (30.0, fy, 31.5, expected), "{line}");
        let mut room = test_room::room(2);
        room.cameras[0].camera.intrinsics = k.clone();
        let out = folder.path().join("out");
        write(&out, &room).unwrap();
        let back = read(&out, &ModelOptions::default()).unwrap();
        assert_eq!(back.cameras[0].entry.camera.intrinsics, *k, "{line}");
    }
}
