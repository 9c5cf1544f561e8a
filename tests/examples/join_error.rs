//! Prints the accuracy of small unseen rooms built by each of several `recon` programs: the accuracy cost of a change
//! shows over many rooms, not in one.
//!
//! `cargo run --release -p tests --example join_error -- PROGRAM… [--seeds COUNT] [--first SEED] [--width PX] [--draft]`
//!
//! One row a room and program; then medians, the worst, and the differences from the first program's rooms.
#![forbid(unsafe_code)]

use std::path::Path;
use std::process::Command;

use calib::Camera;
use scenes::depth;
use scenes::raycast::RayScene;
use scenes::room::Room;
use synthetic::RoomOptions;
use tests::accuracy::{camera_against_floor, relative_pose};
use tests::chain::{StepResult, run};

/// Number of frames of a capture.
const FRAMES: usize = 24;
/// Largest error of a depth that counts as right.
const TOLERANCE_M: f32 = 0.05;
/// Names of the printed figures.
const FIGURES: [&str; 5] = ["joining cm", "turn deg", "tilt deg", "height cm", "depth %"];

fn main() -> StepResult<()> {
    let mut programs = Vec::new();
    let (mut seeds, mut first, mut width, mut draft) = (8_u64, 1_u64, 256_u32, false);
    let mut given = std::env::args().skip(1);
    while let Some(argument) = given.next() {
        let mut number = || -> StepResult<u64> {
            let value = given.next().ok_or_else(|| format!("{argument}: how many?"))?;
            value.parse().map_err(|e| format!("{argument} {value}: {e}"))
        };
        match argument.as_str() {
            "--seeds" => seeds = number()?,
            "--first" => first = number()?,
            "--width" => width = number()? as u32,
            "--draft" => draft = true,
            _ => programs.push(argument),
        }
    }
    println!("{:>4} {:40} {}", "seed", "program", FIGURES.map(|name| format!("{name:>10}")).join(" "));
    let mut all: Vec<Vec<[f64; 5]>> = vec![Vec::new(); programs.len()];
    for seed in first..first + seeds {
        let options = RoomOptions { seed, image_px: [width, width * 3 / 4], ..RoomOptions::default() };
        let truth = options.build().map_err(|e| e.to_string())?;
        let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
        let project = scratch.path().join("project");
        std::fs::create_dir(&project).map_err(|e| e.to_string())?;
        tests::project::write(&project, &truth, FRAMES)?;
        for (index, program) in programs.iter().enumerate() {
            let room = scratch.path().join(format!("room{index}"));
            let mut recon = Command::new(program);
            recon.arg("build").arg(project.join("room.toml")).arg("--out").arg(&room);
            if draft {
                recon.args(["--quality", "draft"]);
            }
            let figures = run(&mut recon).and_then(|_| compare(&room, &truth.room));
            match figures {
                Ok(figures) => {
                    println!("{seed:4} {program:40} {}", row(&figures));
                    all[index].push(figures);
                }
                Err(problem) => {
                    println!("{seed:4} {program:40} {problem}");
                    all[index].push([f64::NAN; 5]);
                }
            }
        }
    }
    for (program, rooms) in programs.iter().zip(&all) {
        let of = |pick: &dyn Fn(usize, usize) -> f64, share: f64| -> [f64; 5] {
            std::array::from_fn(|k| {
                let mut values: Vec<f64> =
                    (0..rooms.len()).map(|i| pick(i, k)).filter(|v| v.is_finite()).collect();
                values.sort_by(f64::total_cmp);
                let last = values.len().saturating_sub(1);
                values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
            })
        };
        println!("     {program:40} median");
        println!("{:45} {}", "", row(&of(&|i, k| rooms[i][k], 0.5)));
        println!("{:45} {}  worst (depth: best)", "", row(&of(&|i, k| rooms[i][k], 1.0)));
        let more = |i: usize, k: usize| rooms[i][k] - all[0][i][k];
        println!("{:45} {}  median of the differences", "", row(&of(&more, 0.5)));
        let mean: [f64; 5] = std::array::from_fn(|k| {
            let values: Vec<f64> = (0..rooms.len()).map(|i| more(i, k)).filter(|v| v.is_finite()).collect();
            values.iter().sum::<f64>() / values.len() as f64
        });
        println!("{:45} {}  mean of the differences", "", row(&mean));
    }
    Ok(())
}

fn row(figures: &[f64; 5]) -> String {
    figures.map(|value| format!("{value:10.2}")).join(" ")
}

fn compare(built: &Path, truth: &Room) -> StepResult<[f64; 5]> {
    let built = Room::read(built).map_err(|e| e.to_string())?;
    let cameras = |room: &Room| [0, 1].map(|i| room.cameras[i].camera.clone());
    let ([a, b], [true_a, true_b]) = (cameras(&built), cameras(truth));
    let relative = relative_pose([&a, &b], [&true_a, &true_b]);
    let floor = camera_against_floor(&b, &true_b);
    let depths = |room: &Room, cameras: [&Camera; 2]| -> StepResult<Vec<f32>> {
        let scene = RayScene::new(room.geometry.as_ref().ok_or("no geometry")?).map_err(|e| e.to_string())?;
        Ok(cameras.into_iter().flat_map(|camera| depth::render(&scene, camera).z_m).collect())
    };
    let (found, wanted) = (depths(&built, [&a, &b])?, depths(truth, [&true_a, &true_b])?);
    let right = found.iter().zip(&wanted).filter(|(f, t)| (*f - *t).abs() <= TOLERANCE_M).count();
    let share = 100.0 * right as f64 / wanted.len() as f64;
    Ok([relative.position_cm, relative.rotation_deg, floor.tilt_deg, floor.height_cm.abs(), share])
}
