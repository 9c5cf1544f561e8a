//! Good content for each reader: texts as they stand, and the bytes of small binary files.

use std::path::Path;
use std::time::Duration;

use glam::Vec3;
use image::{Rgb, RgbImage};
use nalgebra::{Matrix2, Point2, Vector2};
use scenes::depth::{DepthMap, png};
use scenes::geometry::{Mesh, gltf};
use tracker::foreground::Verdict;
use tracker::method::agents::{AgentId, MediatorMessage, Packet, Report, StationId, TargetId};
use tracker::observation::{Colours, Mask, Observation, PersonBox};
use tracker::station::{ObservedFrame, Pictures};
use tracker::wire::encoding::Message;
use tracker::wire::packet;

pub(super) const ROWS: &str =
    "1,1,10,20,30,60,0.9,-1,-1,-1\n2,1,11,20,30,60,0.9\n# end\n3,2,-1,-1,-1,-1,1,0.5,1.5,0\n";

pub(super) const TRACKS: &str = r#"{"frame":1,"time":0.5,"people":[{"id":1,"x":1.0,"y":2.0,"radius":0.2,"height":1.7,"vx":0.0,"vy":0.1,"sigma":[0.1,0.1],"confidence":0.9,"visible":{"a":0.5}}],"count":[0.1,0.9]}
"#;

pub(super) const ROOM: &str = r#"format = 1
[geo]
latitude = 48.1
longitude = 11.5
heading = 90.0
[floor]
walkable = [[[0.0, 0.0], [5.0, 0.0], [5.0, 4.0]]]
[[camera]]
name = "a"
width = 64
height = 48
matrix = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]
distortion = [0.1, 0.0, 0.0, 0.0, 0.0]
rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
translation = [0.0, 1.2, 3.0]
[[zone]]
name = "door"
polygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
[[region]]
name = "desk"
polygon = [[2.0, 2.0], [3.0, 2.0], [3.0, 3.0]]
dwell_s = 3.0
[[line]]
name = "gate"
points = [[0.0, 1.0], [2.0, 1.0]]
"#;

pub(super) const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";

pub(super) const OBJ: &str = "mtllib none.mtl\no floor\nv 0 0 0 0.5 0.5 0.5\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n";

pub(super) const NERFSTUDIO: &str = r#"{"w": 64, "h": 48, "fl_x": 60.0, "fl_y": 60.0, "cx": 32.0, "cy": 24.0, "camera_model": "OPENCV",
"frames": [{"file_path": "a.jpg", "transform_matrix": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}]}"#;

pub(super) const LENS: &str = "width = 64\nheight = 48\nmatrix = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]\n\
    distortion = [0.1, 0.0, 0.0, 0.0, 0.0]\n";

pub(super) const OPTIONS: &str = "[motion.features]\ncount = 500\n[dense]\nkey_frames = 10\n";

pub(super) const PROJECT: &str = r#"[[camera]]
name = "a"
capture = "film.mp4"
reference = "last"
intrinsics = "lens.toml"
[[camera]]
name = "b"
capture = "film.mp4"
reference = 3
[[point]]
a = [10.0, 20.0]
b = [30.5, 40.0]
[[point]]
a = [50.0, 20.0]
b = [3.5, 40.0]
[[point]]
a = [20.0, 40.0]
b = [13.5, 4.0]
[[scale]]
camera = "a"
height = 1.9
[[control]]
at = [1.0, 2.0]
pixels = { a = [20.0, 30.0], b = [22.0, 31.0] }
[[control]]
at = [4.0, 2.0, 0.5]
pixels = { a = [40.0, 30.0], b = [42.0, 31.0] }
"#;

pub(super) const KNOWN_POINTS: &str =
    "x,y,z,room_x,room_y,room_z,name\n0,0,0,1,2,0,corner\n1,0,0,2,2,0,\n0,1,0,1,3,0,desk\n";

pub(super) const COLMAP_CAMERAS: &str = "# cameras\n1 OPENCV 64 48 60 60 32 24 0.1 0 0 0\n";
pub(super) const COLMAP_IMAGES: &str = "# images\n1 1 0 0 0 0 0 2 1 a.jpg\n10 20 1 30 40 -1\n";
pub(super) const COLMAP_POINTS: &str = "# points\n1 0.5 0.5 3 200 100 50 0.4 1 0\n";
pub(super) const COLMAP_RIGS: &str = "# rigs\n4 3 CAMERA 1 CAMERA 2 1 1 0 0 0 0.2 0 0 IMU 9 0\n";
pub(super) const COLMAP_FRAMES: &str = "# frames\n7 4 1 0 0 0 0 0 2 1 CAMERA 1 1\n";

pub(super) const EVENTS: &str = r#"{"time":1.0,"frame":2,"kind":"appear","where":"door","id":1,"x":0.5,"y":1.0,"clock":"2026-11-26T09:00:01.000Z"}
{"time":2.0,"frame":3,"kind":"enter","where":"desk","id":1,"x":2.5,"y":2.5}
{"time":3.0,"frame":4,"kind":"cross","where":"gate","id":1,"x":2.5,"y":2.5,"direction":"in"}
{"time":5.0,"frame":6,"kind":"dwell","where":"desk","id":1,"x":2.5,"y":2.5,"seconds":3.0}
{"time":5.5,"frame":6,"kind":"camera","where":"a","state":"frozen"}
{"time":6.0,"frame":7,"kind":"leave","where":"desk","id":1,"x":2.5,"y":2.5,"seconds":4.0}
{"time":6.0,"frame":7,"kind":"revoke","revoked":"dwell","where":"desk","id":1,"x":2.5,"y":2.5,"seconds":3.0}
{"time":9.0,"frame":9,"kind":"disappear","where":"door","id":1,"x":0.5,"y":1.0}
"#;
pub(super) const COUNTS: &str = "time,where,inside,in,out\n300.0,room,0,1,1\n300.0,desk,0,1,1\n300.0,\"gate, left\",1,1,0\n600.0,room,0,0,0\n\
    600.0,desk,0,0,0\n600.0,\"gate, left\",1,0,0\n";
pub(super) const GROUPS: &str = "first,last,people,ids\n1.0,9.0,2,1 2\n";
pub(super) const TIMINGS: &str = r#"{"threads":2,"frames":9,"stages":{"foreground":{"count":9,"median_ms":1.5,"p95_ms":2.0,"total_ms":14.0}}}
"#;
pub(super) const LIVE_BOXES: &str = r#"{"time":0.5,"boxes":[{"left":20,"top":10,"width":8,"height":20,"appearance":[0.5,-0.5]}]}
2,-1,20,10,8,20,1
2,-1,40,10,8,20,1
3,-1,21,10,8,20,1
"#;

/// `cameras.bin`: one camera of the model PINHOLE.
pub(super) fn colmap_cameras() -> Vec<u8> {
    let mut bytes = 1_u64.to_le_bytes().to_vec();
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(1_i32.to_le_bytes());
    bytes.extend([64_u64, 48].into_iter().flat_map(u64::to_le_bytes));
    bytes.extend([60.0_f64, 60.0, 32.0, 24.0].into_iter().flat_map(f64::to_le_bytes));
    bytes
}

/// `images.bin`: one image with one point.
pub(super) fn colmap_images() -> Vec<u8> {
    let mut bytes = 1_u64.to_le_bytes().to_vec();
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend([1.0_f64, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0].into_iter().flat_map(f64::to_le_bytes));
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(b"a.jpg\0");
    bytes.extend(1_u64.to_le_bytes());
    bytes.extend([10.0_f64, 20.0].into_iter().flat_map(f64::to_le_bytes));
    bytes.extend(1_u64.to_le_bytes());
    bytes
}

/// `points3D.bin`: one point, seen in one image.
pub(super) fn colmap_points() -> Vec<u8> {
    let mut bytes = 1_u64.to_le_bytes().to_vec();
    bytes.extend(1_u64.to_le_bytes());
    bytes.extend([0.5_f64, 0.5, 3.0].into_iter().flat_map(f64::to_le_bytes));
    bytes.extend([200, 100, 50]);
    bytes.extend(0.4_f64.to_le_bytes());
    bytes.extend(1_u64.to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(0_u32.to_le_bytes());
    bytes
}

/// A pose as COLMAP writes it: the quaternion (w first), then the translation.
fn colmap_pose(translation: [f64; 3]) -> impl Iterator<Item = u8> {
    [1.0, 0.0, 0.0, 0.0].into_iter().chain(translation).flat_map(f64::to_le_bytes)
}

/// A sensor as COLMAP writes it: its kind, 0 for a camera, and its number.
fn colmap_sensor(kind: i32, number: u32) -> impl Iterator<Item = u8> {
    kind.to_le_bytes().into_iter().chain(number.to_le_bytes())
}

/// `rigs.bin`: the rig of [`COLMAP_RIGS`].
pub(super) fn colmap_rigs() -> Vec<u8> {
    let mut bytes = 1_u64.to_le_bytes().to_vec();
    bytes.extend([4_u32, 3].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend(colmap_sensor(0, 1));
    bytes.extend(colmap_sensor(0, 2));
    bytes.push(1);
    bytes.extend(colmap_pose([0.2, 0.0, 0.0]));
    bytes.extend(colmap_sensor(1, 9));
    bytes.push(0);
    bytes
}

/// `frames.bin`: the frame of [`COLMAP_FRAMES`].
pub(super) fn colmap_frames() -> Vec<u8> {
    let mut bytes = 1_u64.to_le_bytes().to_vec();
    bytes.extend([7_u32, 4].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend(colmap_pose([0.0, 0.0, 2.0]));
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(colmap_sensor(0, 1));
    bytes.extend(1_u64.to_le_bytes());
    bytes
}

/// Four points and two triangles, little-endian.
pub(super) fn binary_ply() -> Vec<u8> {
    let mut bytes = PLY.split_once("end_header\n").map_or(PLY, |(header, _)| header).as_bytes().to_vec();
    bytes.extend(b"end_header\n");
    let text = String::from_utf8_lossy(&bytes).replace("ascii", "binary_little_endian");
    let mut bytes = text.into_bytes();
    for corner in [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]] {
        bytes.extend(corner.into_iter().flat_map(f32::to_le_bytes));
    }
    for triangle in [[0_i32, 1, 2], [0, 2, 3]] {
        bytes.push(3);
        bytes.extend(triangle.into_iter().flat_map(i32::to_le_bytes));
    }
    bytes
}

pub(super) fn glb() -> Result<Vec<u8>, String> {
    let mesh = Mesh {
        vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        triangles: vec![[0, 1, 2]],
        colors: vec![[10, 20, 30]; 3],
    };
    gltf::encode(&mesh).map_err(|e| e.to_string())
}

/// Three points of a laser scanner.
pub(super) fn las() -> Result<Vec<u8>, String> {
    written("points.las", |path| {
        let mut writer = las::Writer::from_path(path, las::Header::default()).map_err(|e| e.to_string())?;
        for x in 0..3 {
            let point = las::Point { x: f64::from(x), y: 1.0, z: 2.0, ..las::Point::default() };
            writer.write_point(point).map_err(|e| e.to_string())?;
        }
        Ok(())
    })
}

pub(super) fn picture() -> Result<Vec<u8>, String> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = RgbImage::from_fn(24, 16, |u, v| Rgb([(u * v) as u8; 3]));
    picture.write_to(&mut bytes, image::ImageFormat::Png).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

pub(super) fn depth() -> Result<Vec<u8>, String> {
    let map = DepthMap { width: 6, height: 4, z_m: (0..24).map(|i| 0.5 * i as f32).collect() };
    written("depth.png", |path| png::write(path, &map).map_err(|e| e.to_string()))
}

/// Content of a file that is written.
fn written(name: &str, write: impl Fn(&Path) -> Result<(), String>) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = folder.path().join(name);
    write(&path)?;
    std::fs::read(&path).map_err(|e| e.to_string())
}

/// A packet of a station with one report and one answer.
pub(super) fn station_packet() -> Result<Vec<u8>, String> {
    let agent = AgentId { station: StationId(1), number: 3 };
    let report = Report {
        agent,
        target: TargetId(2),
        position: Point2::new(1.0, 2.0),
        covariance: Matrix2::identity() * 0.01,
        velocity: Vector2::new(0.5, 0.0),
        height_m: 1.7,
        looks: None,
        confidence: 0.9,
        is_crowded: false,
    };
    let answer = MediatorMessage::Answer { agent, candidate: TargetId(2), is_granted: true };
    let packet = Packet {
        station: StationId(1),
        time_s: 5.0,
        greatest: TargetId(2),
        reports: vec![report],
        messages: vec![answer],
        ..Packet::default()
    };
    packet::encode(&packet, 5.01).map_err(|e| e.to_string())
}

pub(super) fn station_message() -> Result<Vec<u8>, String> {
    Message::Failure("the camera is gone".into()).encode().map_err(|e| e.to_string())
}

/// A frame that a station observed: a person's silhouette with its colours, and a box with a vector.
pub(super) fn station_observation() -> Result<Vec<u8>, String> {
    let mask = Mask::from_fn(64, 48, |x, y| x.abs_diff(30) < 4 && y.abs_diff(25) < 12);
    let picture = RgbImage::from_fn(64, 48, |x, y| Rgb([x as u8, 4 * y as u8, 90]));
    let colours = Colours::of_picture(&mask, 2, &picture);
    let person = PersonBox {
        left: 26.0,
        top: 13.0,
        right: 34.0,
        bottom: 37.0,
        cut: [false; 4],
        appearance: Some([0.5, -0.5].into()),
    };
    let observation = Observation {
        sequence: 3,
        time_s: 0.25,
        health: Verdict::Usable,
        mask: Some(mask),
        colours: Some(colours),
        boxes: Some(vec![person]),
    };
    let time = Duration::from_millis(2);
    let seen = ObservedFrame { observation, pictures: Pictures::default(), decode: time, foreground: time };
    Message::Seen(Box::new(seen)).encode().map_err(|e| e.to_string())
}
