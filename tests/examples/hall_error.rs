//! Prints the errors of halls of 3 to 6 cameras built by each of several `recon` programs: those of the worst pair of
//! cameras, what is left of them at the right scale, and the depth.
//!
//! `cargo run --release -p tests --example hall_error -- FOLDER PROGRAM… [--seeds COUNT] [--first SEED] [--frames COUNT]
//! [--pick-sigma PX] [--office [--width PX]] [--draft]`
//!
//! Captures are kept in the folder for the next time; the rooms as well, beside them. With `--office` the rooms are offices of two
//! cameras, filmed at 640 × 480 or at another width.
#![forbid(unsafe_code)]

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use calib::Camera;
use scenes::depth;
use scenes::raycast::RayScene;
use scenes::room::Room;
use synthetic::{RoomOptions, SyntheticRoom};
use tests::accuracy::{camera_against_floor, relative_pose};
use tests::chain::{StepResult, run};

const USAGE: &str = "FOLDER PROGRAM… [--seeds COUNT] [--first SEED] [--frames COUNT] [--pick-sigma PX] [--office [--width PX]] [--draft]";
/// Width of an office's pictures, pixels, where none is given.
const OFFICE_WIDTH_PX: u32 = 640;
/// Largest error of a depth that counts as right.
const TOLERANCE_M: f32 = 0.05;
/// Names of the printed figures.
const FIGURES: [&str; 8] =
    ["pair cm", "pair deg", "scaled cm", "scale %", "tilt deg", "height cm", "depth %", "seconds"];
type Figures = [f64; FIGURES.len()];

fn main() -> StepResult<()> {
    let (mut folder, mut programs) = (None, Vec::new());
    let (mut seeds, mut first, mut frames, mut sigma_px) = (8, 1, 24, 0.0);
    let (mut draft, mut office, mut width) = (false, false, None);
    let mut given = std::env::args().skip(1);
    while let Some(argument) = given.next() {
        let mut number = || -> StepResult<f64> {
            let value = given.next().ok_or_else(|| format!("{argument}: how many?"))?;
            value.parse().map_err(|e| format!("{argument} {value}: {e}"))
        };
        match argument.as_str() {
            "--seeds" => seeds = number()? as u64,
            "--first" => first = number()? as u64,
            "--frames" => frames = number()? as usize,
            "--pick-sigma" => sigma_px = number()?,
            "--office" => office = true,
            "--width" => width = Some(number()? as u32),
            "--draft" => draft = true,
            _ if argument.starts_with("--") => return Err(format!("{argument}: no such option; {USAGE}")),
            _ if folder.is_none() => folder = Some(argument),
            _ => programs.push(argument),
        }
    }
    let folder = folder.filter(|_| !programs.is_empty()).ok_or(USAGE)?;
    if width.is_some() && !office {
        return Err(format!(
            "--width goes with --office, since a hall's pictures have a fixed size; {USAGE}"
        ));
    }
    let width = width.unwrap_or(OFFICE_WIDTH_PX);
    println!("{:>4} {:3} {:24} {}", "seed", "of", "program", FIGURES.map(|f| format!("{f:>9}")).join(" "));
    let mut all: Vec<Vec<Figures>> = vec![Vec::new(); programs.len()];
    for seed in first..first + seeds {
        let cameras = 3 + (seed % 4) as usize;
        let truth = if office {
            let options =
                RoomOptions { seed, cameras: 2, image_px: [width, width * 3 / 4], ..RoomOptions::default() };
            options.build().map_err(|e| e.to_string())?
        } else {
            tests::hall::hall(seed, cameras, false)?
        };
        let kind = if office { "office" } else { "hall" };
        let of_width = if width == OFFICE_WIDTH_PX { String::new() } else { format!("_{width}") };
        let project = Path::new(&folder).join(format!("{kind}{seed}_{frames}_{sigma_px}{of_width}"));
        if !project.join("zones.toml").is_file() {
            tests::project::write_with_noise(&project, &truth, frames, sigma_px)?;
        }
        for (index, program) in programs.iter().enumerate() {
            let room = project.join(format!("room{index}"));
            let mut recon = Command::new(program);
            recon.arg("build").arg(project.join("room.toml")).arg("--out").arg(&room);
            if draft {
                recon.args(["--quality", "draft"]);
            }
            let started = Instant::now();
            let done = run(&mut recon);
            let seconds = started.elapsed().as_secs_f64();
            let short: String =
                program.chars().rev().take(24).collect::<Vec<_>>().into_iter().rev().collect();
            let of = truth.room.cameras.len();
            match done.and_then(|_| compare(&room, &truth, seconds)) {
                Ok(figures) => {
                    println!("{seed:4} {of:3} {short:24} {}", row(&figures));
                    all[index].push(figures);
                }
                Err(problem) => println!("{seed:4} {of:3} {short:24} {problem}"),
            }
        }
    }
    for (program, rooms) in programs.iter().zip(&all) {
        for (what, share) in [("median", 0.5), ("95 %", 0.95), ("worst (depth: best)", 1.0)] {
            println!("{program} {what}\n{:33} {}", "", row(&quantile(rooms, share)));
        }
    }
    Ok(())
}

fn quantile(rooms: &[Figures], share: f64) -> Figures {
    std::array::from_fn(|k| {
        let mut values: Vec<f64> = rooms.iter().map(|room| room[k].abs()).collect();
        values.sort_by(f64::total_cmp);
        let last = values.len().saturating_sub(1);
        values.get((share * last as f64).floor() as usize).copied().unwrap_or(f64::NAN)
    })
}

fn row(figures: &Figures) -> String {
    figures.map(|value| format!("{value:9.3}")).join(" ")
}

fn compare(built: &Path, truth: &SyntheticRoom, seconds: f64) -> StepResult<Figures> {
    let built = Room::read(built).map_err(|e| e.to_string())?;
    let cameras = |room: &Room| -> Vec<Camera> { room.cameras.iter().map(|c| c.camera.clone()).collect() };
    let (found, wanted) = (cameras(&built), cameras(&truth.room));
    // Ratio of the distances between cameras, over all pairs.
    let distances = |cameras: &[Camera]| -> Vec<f64> {
        let of = |a: usize| (0..a).map(move |b| (cameras[a].center() - cameras[b].center()).norm());
        (0..cameras.len()).flat_map(of).collect()
    };
    let (ours, theirs) = (distances(&found), distances(&wanted));
    let scale =
        ours.iter().zip(&theirs).map(|(a, b)| a * b).sum::<f64>() / theirs.iter().map(|b| b * b).sum::<f64>();
    let (mut pair_cm, mut pair_deg, mut scaled_cm) = (0.0_f64, 0.0_f64, 0.0_f64);
    for a in 0..found.len() {
        for b in a + 1..found.len() {
            let error = relative_pose([&found[a], &found[b]], [&wanted[a], &wanted[b]]);
            pair_cm = pair_cm.max(error.position_cm);
            pair_deg = pair_deg.max(error.rotation_deg);
            let [mut c, mut d] = [found[a].clone(), found[b].clone()];
            for camera in [&mut c, &mut d] {
                camera.camera_from_world.translation.vector /= scale;
            }
            scaled_cm = scaled_cm.max(relative_pose([&c, &d], [&wanted[a], &wanted[b]]).position_cm);
        }
    }
    let floors: Vec<_> = found.iter().zip(&wanted).map(|(f, w)| camera_against_floor(f, w)).collect();
    let tilt = floors.iter().map(|f| f.tilt_deg).fold(0.0, f64::max);
    let height = floors.iter().map(|f| f.height_cm.abs()).fold(0.0, f64::max);
    let depths = |room: &Room, cameras: &[Camera]| -> StepResult<Vec<f32>> {
        let scene = RayScene::new(room.geometry.as_ref().ok_or("no geometry")?).map_err(|e| e.to_string())?;
        Ok(cameras.iter().flat_map(|camera| depth::render(&scene, camera).z_m).collect())
    };
    let (found, wanted) = (depths(&built, &found)?, depths(&truth.room, &wanted)?);
    let right = found.iter().zip(&wanted).filter(|(f, t)| (*f - *t).abs() <= TOLERANCE_M).count();
    let share = 100.0 * right as f64 / wanted.len() as f64;
    Ok([pair_cm, pair_deg, scaled_cm, 100.0 * (scale - 1.0), tilt, height, share, seconds])
}
