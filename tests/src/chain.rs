//! The chain of programs as a person runs it, with measurements.

use std::path::Path;
use std::process::Command;

use calib::Camera;
use nalgebra::Isometry3;
use scenes::room::{Room, RoomCamera};

use crate::accuracy::{
    CameraError, DepthAgreement, LengthAgreement, RelativePoseError, camera_against_floor, depth,
    installed_truth, lengths, relative_pose,
};
use crate::data::program;

/// Result of a step; the error is the failed step with its message.
pub type StepResult<T> = Result<T, String>;

/// Runs a program and returns what it wrote to standard output.
pub fn run(command: &mut Command) -> StepResult<String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    Err(format!("{command:?}: {}: {}", output.status, String::from_utf8_lossy(&output.stderr)))
}

/// `roomtrack recon build` of a capture project with its zones, where it has some.
pub fn build_room(project: &Path, room: &Path) -> StepResult<String> {
    let mut build = program("roomtrack");
    build.args(["recon", "build"]).arg(project.join("room.toml")).arg("--out").arg(room);
    let zones = project.join("zones.toml");
    if zones.is_file() {
        build.arg("--zones").arg(zones);
    }
    run(&mut build)
}

/// `tracker run` of the office's two videos without film, with further options.
pub fn track(office: &Path, room: &Path, out: &Path, options: &[&str]) -> StepResult<String> {
    let videos = ["cam0", "cam1"].map(|name| (name, office.join(format!("video/{name}.mp4"))));
    track_videos(room, &[(videos[0].0, &videos[0].1), (videos[1].0, &videos[1].1)], out, options)
}

/// `tracker run` of named videos without film, with further options.
pub fn track_videos(
    room: &Path,
    videos: &[(&str, &Path)],
    out: &Path,
    options: &[&str],
) -> StepResult<String> {
    let videos =
        videos.iter().flat_map(|(name, path)| ["--video".to_owned(), format!("{name}={}", path.display())]);
    run(program("tracker")
        .arg("run")
        .arg(room)
        .args(videos)
        .args(["--no-film", "--out"])
        .arg(out)
        .args(options))
}

/// Figures of the evaluator for one run.
#[derive(Debug, Clone, Copy)]
pub struct Tracking {
    /// Tracking accuracy, percent.
    pub mota: f64,
    /// Identity F1, percent.
    pub idf1: f64,
    /// Mean distance from the truth, metres.
    pub mean_m: f64,
    /// Maximum distance from the truth, metres.
    pub maximum_m: f64,
    /// Difference between confidences and the share of tracks that are people, percent.
    pub existence_error: f64,
    /// Share of the frames whose true number of people is likely by the confidences, percent.
    pub count_coverage: f64,
}

/// `tracker eval` against the office's truth; the tracks' room is aligned with the true one by their cameras.
pub fn evaluate(office: &Path, room: &Path, out: &Path) -> StepResult<Tracking> {
    evaluate_against(&office.join("truth.txt"), &office.join("room"), room, out)
}

/// [`evaluate`] against another file of true positions, in the frame of `truth_room`.
pub fn evaluate_against(truth: &Path, truth_room: &Path, room: &Path, out: &Path) -> StepResult<Tracking> {
    let text = run(program("tracker")
        .args(["eval", "--json", "--truth"])
        .arg(truth)
        .arg("--tracks")
        .arg(out.join("tracks.txt"))
        .arg("--truth-room")
        .arg(truth_room)
        .arg("--room")
        .arg(room))?;
    let json: serde_json::Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let figure =
        |name: &str| json[name].as_f64().ok_or_else(|| format!("tracker eval tells no {name}: {text}"));
    Ok(Tracking {
        mota: figure("MOTA")?,
        idf1: figure("IDF1")?,
        mean_m: figure("mean_error_m")?,
        maximum_m: figure("maximum_error_m")?,
        existence_error: figure("existence_error")?,
        count_coverage: figure("count_coverage")?,
    })
}

/// Errors of a built room against the true one.
#[derive(Debug, Clone)]
pub struct RoomErrors {
    /// Error of the second camera's pose relative to the first.
    pub relative: RelativePoseError,
    /// Each camera above the floor, with its name.
    pub cameras: Vec<(String, CameraError)>,
    /// Each camera's static depth, with its name.
    pub depth: Vec<(String, DepthAgreement)>,
    /// Lengths between surface points seen by each camera, with its name.
    pub lengths: Vec<(String, LengthAgreement)>,
}

/// Measures a built room against the truth in a directory: `depth_NAME.png` for each camera, and the true cameras in
/// `scene.toml` or, where the truth is no room, in `truth.json`.
pub fn compare_rooms(built: &Path, truth: &Path, tolerance_mm: u16) -> StepResult<RoomErrors> {
    let built_room = Room::read(built).map_err(|e| e.to_string())?;
    let pairs: Vec<(String, Camera, Camera)> = built_room
        .cameras
        .into_iter()
        .map(|entry| {
            let RoomCamera { name, camera, .. } = entry;
            let true_camera = Camera { camera_from_world: true_pose(truth, &name)?, ..camera.clone() };
            Ok((name, camera, true_camera))
        })
        .collect::<StepResult<_>>()?;
    let [(_, first, true_first), (_, second, true_second), ..] = &pairs[..] else {
        return Err("fewer than two cameras to compare".into());
    };
    let relative = relative_pose([first, second], [true_first, true_second]);
    let cameras = pairs.iter().map(|(name, b, t)| (name.clone(), camera_against_floor(b, t))).collect();
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let (mut depths, mut metres) = (Vec::new(), Vec::new());
    for (name, camera, _) in &pairs {
        let png = scratch.path().join("depth.png");
        run(program("scenes").arg("depth").arg(built).args(["--camera", name, "--out"]).arg(&png))?;
        let pixels = |path: &Path| -> StepResult<Vec<u16>> {
            let picture = image::open(path).map_err(|e| format!("{}: {e}", path.display()))?;
            Ok(picture.into_luma16().into_raw())
        };
        let (built_mm, true_mm) = (pixels(&png)?, pixels(&truth.join(format!("depth_{name}.png")))?);
        let agreement = depth(&built_mm, &true_mm, tolerance_mm);
        depths.push((name.clone(), agreement.ok_or("the depth maps are of different sizes")?));
        let agreement = lengths(&camera.intrinsics, &built_mm, &true_mm);
        metres
            .push((name.clone(), agreement.ok_or("nothing is seen in the built room and in the true one")?));
    }
    Ok(RoomErrors { relative, cameras, depth: depths, lengths: metres })
}

fn true_pose(truth: &Path, camera: &str) -> StepResult<Isometry3<f64>> {
    let json = truth.join("truth.json");
    if json.is_file() {
        return installed_truth(&json, camera)
            .ok_or_else(|| format!("{}: no pose of `{camera}`", json.display()));
    }
    let room = Room::read(truth).map_err(|e| e.to_string())?;
    Ok(room.camera(camera).map_err(|e| e.to_string())?.camera.camera_from_world)
}
