//! Figures of the office, each beside its bound: capture motion, room, depth, tracks, frames per second.
//!
//! `make bench`, or `cargo build --release --bins && cargo bench -p tests --bench office`; with `-- tracks` only what needs
//! no reconstruction, in seconds.
#![forbid(unsafe_code)]

use std::path::Path;
use std::time::Instant;

use recon::capture::{Capture, ReferenceFrame};
use recon::motion::{self, MotionOptions};
use tests::accuracy;
use tests::chain::{StepResult, build_room, compare_rooms, evaluate, track};
use tests::data::office;

/// Frames of the office's videos.
const FRAMES: f64 = 300.0;

/// Prints one figure: name, value, and the bound on it.
fn row(what: &str, value: f64, unit: &str, bound: &str) {
    println!("{what:<62} {value:>8.2} {unit:<9} {bound}");
}

fn main() -> StepResult<()> {
    let office = office();
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let (built, truth) = (scratch.path().join("room"), office.join("room"));
    let mut rooms = vec![("true room", &truth, 97, 98, 6, "<= 30")];
    if std::env::args().all(|argument| argument != "tracks") {
        rebuilt(&office, &built)?;
        rooms.push(("built room", &built, 88, 90, 12, ""));
    }
    for (what, room, mota, idf1, mean_cm, maximum) in rooms {
        let out = scratch.path().join("tracks");
        let started = Instant::now();
        track(&office, room, &out, &[])?;
        let frames_per_second = FRAMES / started.elapsed().as_secs_f64();
        let tracking = evaluate(&office, room, &out)?;
        row(&format!("tracks, {what}: MOTA"), tracking.mota, "%", &format!(">= {mota}"));
        row(&format!("tracks, {what}: IDF1"), tracking.idf1, "%", &format!(">= {idf1}"));
        row(&format!("tracks, {what}: mean error"), 100.0 * tracking.mean_m, "cm", &format!("<= {mean_cm}"));
        row(&format!("tracks, {what}: maximum error"), 100.0 * tracking.maximum_m, "cm", maximum);
        row(&format!("tracks, {what}: whole run without film"), frames_per_second, "frames/s", ">= 100");
        row(&format!("tracks, {what}: confidence off by"), tracking.existence_error, "%", "");
        row(
            &format!("tracks, {what}: true number of people is likely"),
            tracking.count_coverage,
            "%",
            ">= 90",
        );
        if room == &truth {
            let route = accuracy::office_route(&office, &out.join("tracks.txt"))?;
            row(
                "tracks, alone on a known way: mean distance",
                100.0 * route.mean_m,
                "cm",
                "<= 4 (paper: 4.86)",
            );
            let maximum_cm = 100.0 * route.maximum_m;
            row("tracks, alone on a known way: maximum distance", maximum_cm, "cm", "<= 20 (paper: 29.43)");
        }
    }
    hidden(&office, scratch.path())
}

/// Compares the room built from the captures with the truth.
fn rebuilt(office: &Path, built: &Path) -> StepResult<()> {
    for camera in ["cam0", "cam1"] {
        capture_motion(office, camera)?;
    }

    build_room(office, built)?;
    let errors = compare_rooms(built, &office.join("room"), 50)?;
    row("room: cam1 seen from cam0, position", errors.relative.position_cm, "cm", "<= 2");
    row("room: cam1 seen from cam0, orientation", errors.relative.rotation_deg, "degrees", "<= 0.25");
    for (name, camera) in &errors.cameras {
        row(&format!("room: floor tilt seen from {name}"), camera.tilt_deg, "degrees", "<= 0.2");
        row(&format!("room: height of {name} above the floor, error"), camera.height_cm, "cm", "within 1");
    }
    for (name, depth) in &errors.depth {
        row(&format!("room: depth of {name} within 5 cm"), 100.0 * depth.within, "%", ">= 80");
        row(&format!("room: depth of {name} covered"), 100.0 * depth.covered, "%", "");
    }
    for (name, lengths) in &errors.lengths {
        let (what, off) =
            (format!("room: {} lengths seen by {name}", lengths.count), 100.0 * (lengths.median - 1.0));
        row(&format!("{what}, median too long by"), off, "%", "within 1");
        row(&format!("{what}, nine in ten within"), 100.0 * lengths.ninety_off, "%", "");
    }
    Ok(())
}

/// Compares tracking with the room's geometry and without: everybody, and people who are mostly hidden from a camera.
fn hidden(office: &Path, scratch: &Path) -> StepResult<()> {
    let room = office.join("room");
    let mut hidden = Vec::new();
    for (what, options) in [("", &[][..]), (", --no-occlusion", &["--no-occlusion"])] {
        let out = scratch.join("hidden");
        track(office, &room, &out, options)?;
        let matched = accuracy::matched(&office.join("truth.txt"), &out.join("tracks.jsonl"))?;
        let people = accuracy::hidden_people(office, &matched)?;
        let (recall, mean_cm) = (100.0 * people.recall, 100.0 * people.mean_m);
        let bound = if options.is_empty() { ">= 97" } else { "" };
        let bound = format!("of {} {bound}", people.people);
        row(&format!("at least half hidden in a view{what}: people found"), recall, "%", &bound);
        row(&format!("at least half hidden in a view{what}: mean error"), mean_cm, "cm", "");
        hidden.push(people);
        if options.is_empty() {
            let covered = accuracy::coverage(&matched).ok_or("nobody was found")?;
            row("true places within the 95 % ellipse", 100.0 * covered, "%", "90 to 98");
        } else {
            let blind = evaluate(office, &room, &out)?;
            row("--no-occlusion: MOTA", blind.mota, "%", "");
            row("--no-occlusion: mean error", 100.0 * blind.mean_m, "cm", "");
        }
    }
    let lower = 100.0 * (1.0 - hidden[0].mean_m / hidden[1].mean_m);
    row("at least half hidden in a view: error lower with the room by", lower, "%", ">= 30");
    Ok(())
}

fn capture_motion(office: &Path, camera: &str) -> StepResult<()> {
    let told = |e: &dyn std::fmt::Display| e.to_string();
    let lens = calib::files::read_intrinsics(&office.join(format!("{camera}.toml"))).map_err(|e| told(&e))?;
    let film = office.join(format!("capture/{camera}.mp4"));
    let capture = Capture::load(camera, &film, ReferenceFrame::Last, Some(lens)).map_err(|e| told(&e))?;
    let (motion, _) = motion::estimate(&capture, &MotionOptions::default()).map_err(|e| told(&e))?;
    let truth =
        accuracy::capture_truth(&office.join("truth.json"), camera).ok_or("truth.json: no capture poses")?;
    let error =
        accuracy::motion(&motion.camera_from_world, &truth).ok_or("fewer than three frames placed")?;
    row(&format!("capture of {camera}: camera position, rms"), error.position_rms_cm, "cm", "<= 0.3");
    row(
        &format!("capture of {camera}: camera orientation, rms"),
        error.rotation_rms_deg,
        "degrees",
        "<= 0.06",
    );
    row(&format!("capture of {camera}: frames placed"), error.frames as f64, "frames", "of 50");
    Ok(())
}
