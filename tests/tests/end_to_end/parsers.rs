//! Every reader of files on damaged and hostile content: it ends in a value or in one line of error, soon.
//!
//! Good files are changed at random: bytes, numbers that no file should hold, lines cut, doubled and left out. `make fuzz`
//! makes many more changes than `make test`.

use std::path::Path;
use std::time::{Duration, Instant};

use image::{Rgb, RgbImage};
use mot::{jsonl, rows::RowFile};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::exchange::ModelOptions;
use scenes::geometry::scan::Placing;
use tracker::source::{DetectorBoxes, Times};

/// Changes of each file, without `FUZZ_ROUNDS` in the environment.
const ROUNDS: u32 = 150;
/// Longest time of one reading.
const LONGEST: Duration = Duration::from_secs(10);

/// Texts that take the place of a number or a word.
const HOSTILE: [&str; 18] = [
    "1e308",
    "-1e308",
    "nan",
    "inf",
    "1e-320",
    "-1",
    "0",
    "4294967295",
    "4294967296",
    "-2147483648",
    "9223372036854775807",
    "18446744073709551615",
    "1e12",
    "\u{0}",
    "\u{1b}[2J",
    "\"",
    "[[[[[[[[",
    "99999999999999999999",
];

type Read = fn(&Path) -> Result<(), String>;

fn told<T, E: std::fmt::Display>(read: Result<T, E>) -> Result<(), String> {
    read.map(drop).map_err(|e| e.to_string())
}

const ROOM: &str = r#"format = 1
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

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";

const OBJ: &str = "mtllib none.mtl\no floor\nv 0 0 0 0.5 0.5 0.5\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n";

const NERFSTUDIO: &str = r#"{"w": 64, "h": 48, "fl_x": 60.0, "fl_y": 60.0, "cx": 32.0, "cy": 24.0, "camera_model": "OPENCV",
"frames": [{"file_path": "a.jpg", "transform_matrix": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}]}"#;

/// A good file: its name, its content, its reader.
fn files() -> Vec<(&'static str, Vec<u8>, Read)> {
    let mut png = std::io::Cursor::new(Vec::new());
    let picture = RgbImage::from_fn(24, 16, |u, v| Rgb([(u * v) as u8; 3]));
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let line = r#"{"frame":1,"time":0.5,"people":[{"id":1,"x":1.0,"y":2.0,"radius":0.2,"height":1.7,"vx":0.0,"vy":0.1,
        "sigma":[0.1,0.1],"confidence":0.9,"visible":{"a":0.5}}],"count":[0.1,0.9]}"#;
    let lens = "width = 64\nheight = 48\nmatrix = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]\n\
        distortion = [0.1, 0.0, 0.0, 0.0, 0.0]\n";
    let options = "[motion.features]\ncount = 500\n[dense]\nkey_frames = 10\n";
    let text = |text: &str| text.as_bytes().to_vec();
    vec![
        (
            "rows.txt",
            text("1,1,10,20,30,60,0.9,-1,-1,-1\n2,1,11,20,30,60,0.9\n# end\n3,2,-1,-1,-1,-1,1,0.5,1.5,0\n"),
            |p| told(RowFile::read(p)),
        ),
        ("boxes.txt", text("1,-1,20,10,8,20,1\n6,-1,21,10,8,20,1\n"), |p| told(DetectorBoxes::read(p))),
        ("times.txt", text("0\n0.04\n0.08\n0.5\n"), |p| told(Times::read(p))),
        ("tracks.jsonl", text(&(line.replace('\n', " ") + "\n")), |p| told(jsonl::read(p))),
        ("scene.toml", text(ROOM), |p| told(scenes::room::Room::read(p.parent().unwrap()))),
        ("zones.toml", text(ROOM), |p| told(scenes::room::read_markings(p))),
        ("room.ply", text(PLY), |p| told(scenes::geometry::ply::read(p))),
        ("room.obj", text(OBJ), |p| told(scenes::geometry::files::read(p, &Placing::default()))),
        ("transforms.json", text(NERFSTUDIO), |p| told(scenes::exchange::model(p, &ModelOptions::default()))),
        ("lens.toml", text(lens), |p| told(calib::files::read_intrinsics(p))),
        ("options.toml", text(options), |p| told(recon::pipeline::BuildOptions::read(p))),
        ("picture.png", png.into_inner(), |p| told(calib::picture::read(p))),
    ]
}

/// The content after a few random changes.
fn changed(content: &[u8], rng: &mut Pcg64Mcg) -> Vec<u8> {
    let mut bytes = content.to_vec();
    for _ in 0..rng.random_range(1..5) {
        if bytes.is_empty() {
            break;
        }
        let (a, b) = (rng.random_range(0..bytes.len()), rng.random_range(0..bytes.len()));
        let (low, high) = (a.min(b), a.max(b));
        let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_');
        match rng.random_range(0..6) {
            0 => bytes[a] = rng.random(),
            1 => bytes.truncate(a),
            2 => drop(bytes.drain(low..high)),
            3 => {
                let part = bytes[low..high].to_vec();
                bytes.splice(b..b, part);
            }
            _ => {
                // The word around a place.
                let from = bytes[..a].iter().rposition(|byte| !is_word(byte)).map_or(0, |i| i + 1);
                let to = bytes[a..].iter().position(|byte| !is_word(byte)).map_or(bytes.len(), |i| a + i);
                let hostile = HOSTILE[rng.random_range(0..HOSTILE.len())];
                bytes.splice(from.min(to)..to, hostile.bytes());
            }
        }
    }
    bytes
}

#[test]
fn damaged_files_are_read_or_refused_in_one_line() {
    let rounds = std::env::var("FUZZ_ROUNDS").ok().and_then(|text| text.parse().ok()).unwrap_or(ROUNDS);
    let folder = tempfile::tempdir().unwrap();
    for (kind, (name, content, read)) in files().into_iter().enumerate() {
        let path = folder.path().join(name);
        std::fs::write(&path, &content).unwrap();
        assert_eq!(read(&path), Ok(()), "{name} is good");
        let mut refused = 0;
        for round in 0..rounds {
            let mut rng = Pcg64Mcg::seed_from_u64(u64::from(round) << 8 | kind as u64);
            let bytes = changed(&content, &mut rng);
            std::fs::write(&path, &bytes).unwrap();
            let begun = Instant::now();
            let answer = read(&path);
            let shown = || format!("{name}, round {round}: {:?}", String::from_utf8_lossy(&bytes));
            assert!(begun.elapsed() < LONGEST, "{}", shown());
            if let Err(line) = answer {
                refused += 1;
                assert!(!line.contains('\n'), "{line}: {}", shown());
            }
        }
        assert!(refused > rounds / 10, "{name}: {refused} of {rounds} are refused");
    }
}
