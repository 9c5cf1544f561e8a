//! The program `calib` as a person runs it: output, exit status, and error lines.
#![allow(clippy::unwrap_used)] // a test that cannot go on should stop

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use calib::files::read_intrinsics;
use calib::{Camera, Intrinsics};
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point3, Rotation3, Vector3};
use tempfile::TempDir;

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: &str) {
        std::fs::write(self.path(name), content).unwrap();
    }

    fn calib(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_calib")).args(arguments).current_dir(self.0.path()).output().unwrap()
    }

    /// Standard output and standard error of a successful run.
    fn said(&self, arguments: &[&str]) -> (String, String) {
        let output = self.calib(arguments);
        let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(output.status.code(), Some(0), "{err}");
        (out, err)
    }

    /// A run that is refused in one line with these words, and leaves every file as it was.
    fn refused(&self, arguments: &[&str], words: &[&str]) {
        let before = files(self.0.path());
        let output = self.calib(arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(words.iter().all(|word| said.contains(word)) && !said.contains("panicked"), "{said}");
        assert_eq!(files(self.0.path()), before, "{said}");
    }
}

fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(self::files(&path));
        } else {
            let content = std::fs::read(&path).unwrap();
            files.push((path, content));
        }
    }
    files.sort();
    files
}

fn camera() -> Camera {
    let camera_from_world =
        Isometry3::face_towards(&Point3::new(3.0, 2.0, 2.2), &Point3::new(0.0, 0.0, 0.6), &-Vector3::z());
    Camera {
        intrinsics: Intrinsics::from_horizontal_fov(640, 480, 60.0),
        camera_from_world: camera_from_world.inverse(),
    }
}

/// Corners of a box, which the camera sees.
fn corners() -> Vec<Point3<f64>> {
    (0..8).map(|i| Point3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2) * 1.2)).collect()
}

fn picks(camera: &Camera, points: &[Point3<f64>]) -> String {
    let mut text = "x,y,z,u,v\n".to_owned();
    for p in points {
        let seen = camera.project(p).unwrap();
        writeln!(text, "{},{},{},{},{}", p.x, p.y, p.z, seen.x, seen.y).unwrap();
    }
    text
}

fn pose_in(path: &Path) -> Vector3<f64> {
    let table: toml::Table = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let t: Vec<f64> =
        table["translation"].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect();
    Vector3::from_column_slice(&t)
}

/// A folder with a lens, picks and the image that they were picked in.
fn posed() -> Folder {
    let folder = Folder::new();
    calib::files::write_intrinsics(&folder.path("lens.toml"), &camera().intrinsics).unwrap();
    folder.write("picks.csv", &picks(&camera(), &corners()));
    RgbImage::from_pixel(640, 480, Rgb([90; 3])).save(folder.path("seen.png")).unwrap();
    folder
}

const WITH_LENS: [&str; 7] =
    ["pose", "--intrinsics", "lens.toml", "--picks", "picks.csv", "--out", "pose.toml"];

#[test]
fn a_pose_is_written_and_drawn() {
    let folder = posed();
    let (out, err) =
        folder.said(&[&WITH_LENS[..], &["--image", "seen.png", "--picture", "check.jpg"]].concat());
    assert!(out.contains("camera   at 3.000 2.000 2.200 m") && err.is_empty(), "{out}{err}");
    let off = pose_in(&folder.path("pose.toml")) - camera().camera_from_world.translation.vector;
    assert!(off.norm() < 1e-6, "{off}");
    assert_eq!(image::open(folder.path("check.jpg")).unwrap().into_rgb8().dimensions(), (640, 480));
    // Five corners in space suffice, four of a far square leave two poses.
    folder.write("picks.csv", &picks(&camera(), &corners()[2..7]));
    folder.said(&WITH_LENS);
    let off = pose_in(&folder.path("pose.toml")) - camera().camera_from_world.translation.vector;
    assert!(off.norm() < 1e-6, "{off}");
    let square: Vec<Point3<f64>> = corners()[..4].iter().map(|p| Point3::from(p.coords * 0.1)).collect();
    folder.write("picks.csv", &picks(&camera(), &square));
    let (_, err) = folder.said(&WITH_LENS);
    assert!(err.contains("WARN") && err.contains("almost as well") && err.contains("picks.csv"), "{err}");
}

#[test]
fn a_lens_is_found_beside_the_pose_and_read_back() {
    let folder = posed();
    let bare = ["pose", "--picks", "picks.csv", "--out", "camera.toml"];
    for size in [["--size", "640x480"], ["--image", "seen.png"]] {
        let (out, _) = folder.said(&[&bare[..], &size].concat());
        assert!(out.contains("focal length"), "{out}");
        let found = read_intrinsics(&folder.path("camera.toml")).unwrap();
        assert!((found.matrix() - camera().intrinsics.matrix()).norm() < 1e-3, "{found:?}");
        assert_eq!((found.width, found.height), (640, 480));
        std::fs::remove_file(folder.path("camera.toml")).unwrap();
    }
    folder.refused(&bare, &["--size 640x480"]);
    folder.write("picks.csv", &picks(&camera(), &corners()[..4]));
    folder.refused(&[&bare[..], &["--size", "640x480"]].concat(), &["picks.csv", "4 points", "at least 6"]);
    let floor: Vec<Point3<f64>> =
        (0..9).map(|i| Point3::new(f64::from(i % 3), f64::from(i / 3), 0.0)).collect();
    folder.write("picks.csv", &picks(&camera(), &floor));
    folder.refused(&[&bare[..], &["--size", "640x480"]].concat(), &["picks.csv", "one plane"]);
    for wrong in ["640", "0x480", "640x-1"] {
        assert_eq!(folder.calib(&[&bare[..], &["--size", wrong]].concat()).status.code(), Some(2), "{wrong}");
    }
}

#[test]
fn poses_that_cannot_be_are_refused() {
    let folder = posed();
    folder.refused(
        &["pose", "--intrinsics", "gone.toml", "--picks", "picks.csv", "--out", "p"],
        &["gone.toml"],
    );
    let drawn = |image: &'static str, picture: &'static str| {
        [&WITH_LENS[..], &["--image", image, "--picture", picture]].concat()
    };
    folder.refused(&drawn("seen.png", "seen.png"), &["seen.png", "would be lost"]);
    folder.refused(&drawn("seen.png", "./picks.csv"), &["picks.csv", "would be lost"]);
    folder.refused(&drawn("seen.png", "pose.toml"), &["pose.toml", "same file"]);
    folder.refused(&drawn("seen.png", "check.pgn"), &["check.pgn", ".png"]);
    folder.refused(&drawn("gone.png", "check.png"), &["gone.png"]);
    RgbImage::new(320, 240).save(folder.path("small.png")).unwrap();
    folder.refused(&drawn("small.png", "check.png"), &["small.png", "320 × 240", "lens.toml"]);
    for (content, words) in [
        ("x,y,z,u,v\n0,0,0,1,2\n0,0,0,1\n", &["picks.csv", "line: 3"][..]),
        ("x,y,z,u,v\n0,0,0,1,2\n0,0,zero,1,2\n", &["picks.csv", "line: 3"]),
        ("x,y,z,u\n0,0,0,1\n", &["picks.csv", "v"]),
        ("x,y,z,u,v\n", &["picks.csv", "no points"]),
        ("", &["picks.csv", "no points"]),
        ("x,y,z,u,v\n0,0,0,1,2\n1,0,0,50,2\n0,1,0,1,60\n", &["picks.csv", "3 points", "at least 4"]),
        ("x,y,z,u,v\n0,0,0,1,2\n1,0,nan,50,2\n0,1,0,1,60\n1,1,0,50,60\n", &["picks.csv", "pick 2"]),
    ] {
        folder.write("picks.csv", content);
        folder.refused(&WITH_LENS, words);
    }
    std::fs::remove_file(folder.path("picks.csv")).unwrap();
    folder.refused(&WITH_LENS, &["picks.csv"]);
}

/// A chessboard of 9 × 6 inner corners and 25 mm squares, half a metre away and turned by these angles.
fn board(tilt_deg: [f64; 2], at_m: [f64; 2]) -> RgbImage {
    let turn = Rotation3::from_euler_angles(tilt_deg[0].to_radians(), tilt_deg[1].to_radians(), 0.0);
    let middle = Vector3::new(at_m[0], at_m[1], 0.5);
    let normal = turn * Vector3::z();
    let lens = camera().intrinsics;
    let level = |x: f64, y: f64| {
        let ray = Vector3::new((x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1.0);
        let on_board = turn.inverse() * (ray * (normal.dot(&middle) / normal.dot(&ray)) - middle);
        let (column, row) = ((on_board.x / 0.025 + 5.0).floor(), (on_board.y / 0.025 + 3.5).floor());
        let is_square = (0.0..10.0).contains(&column) && (0.0..7.0).contains(&row);
        if is_square && (column + row) % 2.0 == 0.0 { 20.0 } else { 230.0 }
    };
    RgbImage::from_fn(lens.width, lens.height, |x, y| {
        let parts = [-0.375, -0.125, 0.125, 0.375];
        let sum: f64 =
            parts.iter().flat_map(|dx| parts.map(|dy| level(f64::from(x) + dx, f64::from(y) + dy))).sum();
        Rgb([(sum / 16.0) as u8; 3])
    })
}

const VIEWS: [([f64; 2], [f64; 2]); 5] = [
    ([0.0, 0.0], [0.0, 0.0]),
    ([30.0, 0.0], [0.05, 0.02]),
    ([-25.0, 20.0], [-0.05, 0.03]),
    ([0.0, 30.0], [0.03, -0.04]),
    ([10.0, -30.0], [-0.03, -0.03]),
];

fn boards() -> Folder {
    let folder = Folder::new();
    for (i, (tilt, at)) in VIEWS.iter().enumerate() {
        // Two folders, the same names in both.
        let name = format!("{}/{}.png", ["a", "b"][i % 2], i / 2);
        std::fs::create_dir_all(folder.path(&name).parent().unwrap()).unwrap();
        board(*tilt, *at).save(folder.path(&name)).unwrap();
    }
    folder
}

fn intrinsics<'a>(images: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    let options = ["--pattern", "9x6", "--square", "0.025", "--out", "lens.toml"];
    [&["intrinsics"], images, &options, more].concat()
}

const ALL: [&str; 5] = ["a/0.png", "b/0.png", "a/1.png", "b/1.png", "a/2.png"];

#[test]
fn boards_tell_the_lens_and_each_has_its_drawing() {
    let folder = boards();
    let originals = files(folder.0.path());
    let (out, _) = folder.said(&intrinsics(&ALL, &["--pictures", "drawn", "-v"]));
    assert!(out.contains("over 5 views"), "{out}");
    let (found, expected) = (read_intrinsics(&folder.path("lens.toml")).unwrap(), camera().intrinsics);
    assert!((found.fx / expected.fx - 1.0).abs() < 0.01 && (found.fy / expected.fy - 1.0).abs() < 0.01);
    let mut drawings: Vec<_> = files(&folder.path("drawn"));
    assert_eq!(drawings.len(), 5);
    drawings.dedup_by(|a, b| a.1 == b.1);
    assert_eq!(drawings.len(), 5, "each shows another picture");
    let after = files(folder.0.path());
    assert!(originals.iter().all(|original| after.contains(original)), "a photograph was written over");
}

#[test]
fn boards_that_tell_nothing_are_refused() {
    let folder = boards();
    folder.refused(&intrinsics(&ALL, &["--pictures", "a"]), &["a/0.png", "would be lost"]);
    folder.refused(&intrinsics(&["a/0.png", "a/1.png", "gone.png"], &[]), &["gone.png"]);
    std::fs::copy(folder.path("b/0.png"), folder.path("b/2.png")).unwrap();
    folder.refused(&intrinsics(&["b/0.png", "b/2.png", "b/0.png"], &[]), &["3 views", "tilt the board"]);
    folder.refused(&intrinsics(&["a/0.png", "b/0.png"], &[]), &["2 images", "at least 3"]);
    RgbImage::new(64, 48).save(folder.path("small.png")).unwrap();
    folder.refused(&intrinsics(&["a/0.png", "small.png"], &[]), &["small.png", "64 × 48", "640 × 480"]);
    let out = ["intrinsics", "a/0.png", "--pattern", "9x6", "--square", "0.025", "--out", "a/0.png"];
    folder.refused(&out, &["a/0.png", "would be lost"]);
    let square = ["intrinsics", "a/0.png", "--pattern", "9x6", "--square", "-1", "--out", "lens.toml"];
    assert_eq!(folder.calib(&square).status.code(), Some(2));
    let pattern = ["intrinsics", "a/0.png", "--pattern", "9", "--square", "0.025", "--out", "lens.toml"];
    let output = folder.calib(&pattern);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && said.contains("like 9x6"), "{said}");
    assert!(!folder.path("lens.toml").exists());
    assert_eq!(folder.calib(&["--help"]).status.code(), Some(0));
}

#[test]
fn a_wrong_pick_is_named_and_left_out_and_a_mirrored_world_refused() {
    let folder = posed();
    let text = picks(&camera(), &corners());
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let (start, v) = lines[4].rsplit_once(',').unwrap();
    lines[4] = format!("{start},{}", v.parse::<f64>().unwrap() + 40.0);
    folder.write("picks.csv", &lines.join("\n"));
    let (out, err) = folder.said(&WITH_LENS);
    assert!(out.contains("camera   at 3.000 2.000 2.200 m") && out.contains("left out"), "{out}");
    assert!(err.contains("pick 4 does not agree"), "{err}");

    let mirrored: Vec<String> = text
        .lines()
        .map(|line| {
            let words: Vec<&str> = line.split(',').collect();
            match words[1].parse::<f64>() {
                Ok(y) => format!("{},{},{},{},{}", words[0], -y, words[2], words[3], words[4]),
                Err(_) => line.to_owned(),
            }
        })
        .collect();
    folder.write("picks.csv", &mirrored.join("\n"));
    folder.refused(&WITH_LENS, &["picks.csv", "mirror", "right-handed"]);
    folder.refused(
        &["pose", "--size", "640x480", "--picks", "picks.csv", "--out", "camera.toml"],
        &["picks.csv"],
    );
}
