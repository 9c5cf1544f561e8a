//! COLMAP's sparse model: a folder of `cameras`, `images` and `points3D`, as text or binary
//! (<https://colmap.github.io/format.html>).

mod binary;
mod model;
mod text;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use calib::Camera;
use glam::{DVec3, Vec3};

use super::{CORNER_PX, camera_name, picture_name};
use crate::geometry::{Geometry, cloud};
use crate::room::{Room, RoomCamera};
use crate::{Error, Result};

/// The cameras of a model, in the order of its pictures, named after them. The model's world has to be the room's:
/// metres, Z up, the floor at z = 0 (`colmap model_aligner` brings it there).
///
/// # Errors
/// [`Error::Io`], or [`Error::Content`] naming the file, the place in it and the problem.
pub fn read(dir: &Path) -> Result<Vec<RoomCamera>> {
    let named = |name: &str| dir.join(name);
    let (lens_file, picture_file, cameras, pictures) = if named("cameras.bin").is_file() {
        let (lens_file, picture_file) = (named("cameras.bin"), named("images.bin"));
        let (cameras, pictures) = (bytes_of(&lens_file)?, bytes_of(&picture_file)?);
        (lens_file, picture_file, binary::cameras(&cameras), binary::pictures(&pictures))
    } else if named("cameras.txt").is_file() {
        let (lens_file, picture_file) = (named("cameras.txt"), named("images.txt"));
        let (cameras, pictures) =
            (calib::files::read_text(&lens_file)?, calib::files::read_text(&picture_file)?);
        (lens_file, picture_file, text::cameras(&cameras), text::pictures(&pictures))
    } else {
        let problem =
            "it holds no cameras.txt or cameras.bin, so it is no COLMAP model; name its folder `sparse/0`";
        return Err(Error::content(dir, "folder", problem));
    };
    let cameras = cameras.map_err(|(place, problem)| Error::content(&lens_file, place, problem))?;
    let pictures = pictures.map_err(|(place, problem)| Error::content(&picture_file, place, problem))?;
    if pictures.is_empty() {
        return Err(Error::content(&picture_file, "whole file", "it holds no image; no camera was placed"));
    }
    pictures
        .iter()
        .map(|picture| {
            let place = format!("image `{}`", picture.name);
            let wrong = |problem: String| Error::content(&picture_file, place.as_str(), problem);
            let camera = cameras.iter().find(|camera| camera.id == picture.camera);
            let camera = camera.ok_or_else(|| wrong(format!("there is no camera {}", picture.camera)))?;
            let intrinsics = camera
                .intrinsics()
                .map_err(|problem| Error::content(&lens_file, format!("camera {}", camera.id), problem))?;
            let camera_from_world = picture.pose().map_err(wrong)?;
            let name = camera_name(&picture.name);
            Ok(RoomCamera { name, camera: Camera { intrinsics, camera_from_world }, reference: None })
        })
        .collect()
}

/// The model's points, moved by `shift_m`, as discs that face the cameras at `viewpoints`; `None` without any. They are
/// as sparse as the model: surfaces between them hide nobody.
///
/// # Errors
/// As [`read`]; for a point that is not finite, too.
pub fn read_points(dir: &Path, viewpoints: &[Vec3], shift_m: DVec3) -> Result<Option<Geometry>> {
    let (file, points) = if dir.join("cameras.bin").is_file() {
        let file = dir.join("points3D.bin");
        if !file.is_file() {
            return Ok(None);
        }
        let bytes = bytes_of(&file)?;
        (file, binary::points(&bytes))
    } else {
        let file = dir.join("points3D.txt");
        if !file.is_file() {
            return Ok(None);
        }
        let text = calib::files::read_text(&file)?;
        (file, text::points(&text))
    };
    let points = points.map_err(|(place, problem)| Error::content(&file, place, problem))?;
    let places: Vec<Vec3> = points.iter().map(|p| (DVec3::from(p.place) + shift_m).as_vec3()).collect();
    if let Some(i) = places.iter().position(|place| !place.is_finite()) {
        let problem = "a coordinate is not finite; remove the point";
        return Err(Error::content(&file, format!("point {} of {}", i + 1, places.len()), problem));
    }
    let colors: Vec<[u8; 3]> = points.iter().map(|p| p.color).collect();
    let discs = cloud::discs(&places, &colors, viewpoints);
    Ok((!discs.is_empty()).then_some(Geometry::Discs(discs)))
}

/// Writes the room as a model in text: its cameras, and its vertices or disc centres as points.
///
/// # Errors
/// [`Error::Calib`] when a file cannot be written; then none is written.
pub fn write(dir: &Path, room: &Room) -> Result<()> {
    let (mut cameras, mut images, mut points) = (
        "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n".to_owned(),
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then POINTS2D[]\n".to_owned(),
        "# POINT3D_ID X Y Z R G B ERROR TRACK[]\n".to_owned(),
    );
    for (id, entry) in (1..).zip(&room.cameras) {
        let k = &entry.camera.intrinsics;
        let [k1, k2, p1, p2, k3]: [f64; 5] = k.distortion.into();
        let (cx, cy) = (k.cx + CORNER_PX, k.cy + CORNER_PX);
        let (model, more) = if k.distortion.is_none() {
            ("PINHOLE", String::new())
        } else if k3 == 0.0 {
            ("OPENCV", format!(" {k1} {k2} {p1} {p2}"))
        } else {
            ("FULL_OPENCV", format!(" {k1} {k2} {p1} {p2} {k3} 0 0 0"))
        };
        // Writing into a string cannot fail.
        let _ = writeln!(cameras, "{id} {model} {} {} {} {} {cx} {cy}{more}", k.width, k.height, k.fx, k.fy);
        let pose = &entry.camera.camera_from_world;
        let (q, t) = (pose.rotation.quaternion(), pose.translation.vector);
        let _ = writeln!(
            images,
            "{id} {} {} {} {} {} {} {} {id} {}\n",
            q.w,
            q.i,
            q.j,
            q.k,
            t.x,
            t.y,
            t.z,
            picture_name(entry)
        );
    }
    let mut point = |id: usize, p: Vec3, [r, g, b]: [u8; 3]| {
        let _ = writeln!(points, "{id} {} {} {} {r} {g} {b} 0", p.x, p.y, p.z);
    };
    match &room.geometry {
        Some(Geometry::Mesh(mesh)) => {
            (1..).zip(mesh.vertices.iter().zip(&mesh.colors)).for_each(|(id, (v, c))| point(id, *v, *c));
        }
        Some(Geometry::Discs(discs)) => (1..).zip(discs).for_each(|(id, d)| point(id, d.center, d.color)),
        None => {}
    }
    let paths: [PathBuf; 3] = ["points3D.txt", "images.txt", "cameras.txt"].map(|name| dir.join(name));
    Ok(calib::files::write_together(&[
        (&paths[0], points.as_bytes()),
        (&paths[1], images.as_bytes()),
        (&paths[2], cameras.as_bytes()),
    ])?)
}

fn bytes_of(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exchange::test_room;
    use crate::geometry::vec3_from_point;
    use approx::assert_relative_eq;

    fn room() -> Room {
        let mut room = test_room::room(3);
        room.cameras[1].camera.intrinsics.distortion = [-0.2, 0.1, 1e-3, -2e-3, 0.0].into();
        room.cameras[2].camera.intrinsics.distortion = [-0.2, 0.1, 1e-3, -2e-3, 0.05].into();
        room
    }

    fn same(found: &[RoomCamera], expected: &[RoomCamera]) {
        assert_eq!(found.len(), expected.len());
        for (f, e) in found.iter().zip(expected) {
            let (a, b) = (&f.camera.intrinsics, &e.camera.intrinsics);
            assert_eq!(
                (&f.name, a.width, a.height, a.distortion),
                (&e.name, b.width, b.height, b.distortion)
            );
            assert_relative_eq!(a.matrix(), b.matrix(), epsilon = 1e-9);
            assert_relative_eq!(f.camera.camera_from_world, e.camera.camera_from_world, epsilon = 1e-12);
        }
    }

    #[test]
    fn text_comes_back() {
        let (folder, room) = (tempfile::tempdir().unwrap(), room());
        write(folder.path(), &room).unwrap();
        same(&read(folder.path()).unwrap(), &room.cameras);
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
            let [k1, k2, p1, p2, k3]: [f64; 5] = k.distortion.into();
            camera_bytes.extend(id.to_le_bytes());
            camera_bytes.extend(6_i32.to_le_bytes());
            camera_bytes.extend([k.width, k.height].map(u64::from).map(u64::to_le_bytes).concat());
            let parameters = [k.fx, k.fy, k.cx + 0.5, k.cy + 0.5, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0];
            camera_bytes.extend(parameters.map(f64::to_le_bytes).concat());
            let (q, t) =
                (entry.camera.camera_from_world.rotation, entry.camera.camera_from_world.translation);
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
        same(&read(folder.path()).unwrap(), &room.cameras);
        for name in ["cameras.bin", "images.bin"] {
            let path = folder.path().join(name);
            let whole = std::fs::read(&path).unwrap();
            for length in (0..whole.len()).step_by(3) {
                std::fs::write(&path, &whole[..length]).unwrap();
                let line = read(folder.path()).unwrap_err().to_string();
                assert!(line.contains(name) && !line.contains('\n'), "{line}");
            }
            let mut many = whole.clone();
            many[..8].fill(0xff);
            std::fs::write(&path, many).unwrap();
            assert!(read(folder.path()).is_err());
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
            let cameras = read(&folder).unwrap();
            assert_eq!(cameras.len(), expected.pixels.len());
            for (picture, pixels) in &expected.pixels {
                let camera = cameras.iter().find(|c| c.name == camera_name(picture)).unwrap();
                for (point, pixel) in expected.points.iter().zip(pixels) {
                    let seen = camera.camera.project(&point.place.into()).unwrap();
                    let off = (seen.x + CORNER_PX - pixel[0]).hypot(seen.y + CORNER_PX - pixel[1]);
                    assert!(off < 1e-9, "{picture}: {off} px");
                }
            }
            let eyes: Vec<Vec3> = cameras.iter().map(|c| vec3_from_point(&c.camera.center())).collect();
            let Some(Geometry::Discs(discs)) = read_points(&folder, &eyes, DVec3::ZERO).unwrap() else {
                panic!("no discs")
            };
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
                read_points(folder.path(), &[], DVec3::ZERO).unwrap_err().to_string()
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
            assert_eq!(read_points(folder.path(), &[], DVec3::ZERO).unwrap(), None);
            std::fs::remove_file(&path).unwrap();
            assert_eq!(read_points(folder.path(), &[], DVec3::ZERO).unwrap(), None);
        }
    }

    #[test]
    fn defects_of_models_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let said = || read(folder.path()).unwrap_err().to_string();
        assert!(said().contains("no COLMAP model"));
        let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let camera = "# a comment\n1 PINHOLE 64 48 60 60 32 24\n";
        let image = "1 1 0 0 0 0 1.2 3 1 left.png\n\n";
        put("cameras.txt", camera);
        assert!(said().contains("images.txt"));
        put("images.txt", image);
        assert_eq!(read(folder.path()).unwrap()[0].name, "left");
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
        put(
            "images.txt",
            "1 1 0 0 0 0 1.2 3 1 left.png\n10.5 20 -1 30 40.25 7\n2 1 0 0 0 0 1.2 3 1 right.png\n",
        );
        assert_eq!(read(folder.path()).unwrap().len(), 2);
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
}
