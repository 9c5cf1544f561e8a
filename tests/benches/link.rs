//! Linking: accuracy on MOT15 with the default choices, crossings with and without the direction constraint, and time
//! on many detections and many links.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench link`. Against OR-tools on the same graph:
//! `tracker/tests/peers/flow.py --time`, against TrackEval: `tracker/tests/peers/figures.py`.
#![forbid(unsafe_code)]

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use tests::chain::{StepResult, run};
use tests::crossing_boxes::{self, Crossings};
use tests::data::{program, shared};

fn main() -> StepResult<()> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    if let Some(mot15) = shared("mot15") {
        sequences(&mot15, &scratch.path().join("mot15"))?;
    }
    crossings(&scratch.path().join("crossings"))?;
    sizes(scratch.path())
}

/// Every sequence with the defaults, then all together.
fn sequences(mot15: &Path, out: &Path) -> StepResult<()> {
    let mut folders: Vec<_> = std::fs::read_dir(mot15)
        .map_err(|e| e.to_string())?
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.join("detections.txt").is_file())
        .collect();
    folders.sort();
    for folder in &folders {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        link(&folder.join("detections.txt"), &out.join(format!("{name}.txt")), &[])?;
    }
    let told = evaluate(mot15, out)?;
    println!("{:<16} {:>7} {:>7} {:>7} {:>9}", "MOT15", "IDF1 %", "MOTA %", "HOTA %", "switches");
    let each =
        told["sequences"].as_object().into_iter().flatten().map(|(name, figures)| (name.as_str(), figures));
    for (name, figures) in each.chain([("together", &told["together"])]) {
        let [idf1, mota, hota, switches] =
            ["IDF1", "MOTA", "HOTA", "id_switches"].map(|f| number(&figures[f]));
        println!("{name:<16} {idf1:>7.1} {mota:>7.1} {hota:>7.1} {switches:>9}");
    }
    Ok(())
}

/// Two people who walk towards each other and meet at one place for a moment, a hundred times.
fn crossings(out: &Path) -> StepResult<()> {
    println!(
        "\n{:<46} {:>9} {:>10}",
        "100 crossings, noise 1 px, 3 to 5 px a frame", "switches", "success %"
    );
    let Crossings { truth, found } = crossing_boxes::crossings();
    let save = |path: &Path, text: &str| {
        std::fs::create_dir_all(path.parent().unwrap_or(path)).and_then(|()| std::fs::write(path, text))
    };
    let (truth_file, found_file) = (out.join("truth/crossings/truth.txt"), out.join("found.txt"));
    save(&truth_file, &truth).map_err(|e| e.to_string())?;
    save(&found_file, &found).map_err(|e| e.to_string())?;
    let paper =
        ["--max-distance", "25", "--link-cost", "0.1", "--birth-cost", "1", "--detection-offset", "0.2"];
    let choices: [(&str, &[&str], &[&str]); 5] = [
        ("the paper's graph", &paper, &[]),
        ("… with --direction-threshold 8", &paper, &["--direction-threshold", "8"]),
        ("… and --skip 1", &paper, &["--direction-threshold", "8", "--skip", "1"]),
        ("nothing said", &[], &[]),
        ("… with --direction-threshold 4", &[], &["--direction-threshold", "4"]),
    ];
    for (name, base, more) in choices {
        link(&found_file, &out.join("tracks/crossings.txt"), &[base, more].concat())?;
        let told = evaluate(&out.join("truth"), &out.join("tracks"))?;
        let figures = &told["together"];
        let (switches, success) = (number(&figures["id_switches"]), number(&figures["tracking_success"]));
        println!("{name:<46} {switches:>9} {success:>10.1}");
    }
    Ok(())
}

/// Walkers over a long recording: some detections and links, and many.
fn sizes(out: &Path) -> StepResult<()> {
    println!(
        "\n{:>10} {:>10} {:>9} {:>9} {:>10} {:>9}",
        "detections", "links", "build s", "solve s", "whole s", "optimal"
    );
    for (people, frames, gap) in [(30, 7000, "1"), (30, 7000, "4"), (60, 8000, "2")] {
        let path = out.join("walkers.txt");
        std::fs::write(&path, walkers(people, frames)).map_err(|e| e.to_string())?;
        let started = Instant::now();
        let options = ["--max-distance", "40", "--max-area-change", "8000", "--max-gap", gap];
        let report = link(&path, &out.join("tracks.txt"), &options)?;
        println!(
            "{:>10} {:>10} {:>9.3} {:>9.3} {:>10.2} {:>9}",
            report["detections"],
            report["edges"],
            number(&report["build_seconds"]),
            number(&report["solve_seconds"]),
            started.elapsed().as_secs_f64(),
            report["is_optimal"]
        );
    }
    Ok(())
}

/// People who walk about in 1920 × 1080 pixels, a tenth of them missed, with false detections.
fn walkers(people: usize, frames: u32) -> String {
    let mut random = Pcg64Mcg::seed_from_u64(2);
    let enter = |random: &mut Pcg64Mcg| {
        [
            random.random_range(0.0..1920.0),
            random.random_range(300.0..1080.0),
            random.random_range(-4.0..4.0),
            random.random_range(-1.0..1.0),
        ]
    };
    let mut walking: Vec<[f64; 4]> = (0..people).map(|_| enter(&mut random)).collect();
    let mut text = String::new();
    for frame in 1..=frames {
        for walker in &mut walking {
            walker[0] += walker[2];
            walker[1] += walker[3];
            let [x, y, ..] = *walker;
            if !((0.0..1920.0).contains(&x) && (300.0..1080.0).contains(&y)) || random.random_bool(0.002) {
                *walker = enter(&mut random);
            }
            let mut row = |x: f64, y: f64, score: f64| {
                let height = 0.25 * y;
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{frame},-1,{:.2},{:.2},{:.2},{height:.2},{score:.3}",
                    x - 0.2 * height,
                    y - height,
                    0.4 * height
                );
            };
            let noise = random.random_range(-4.0..4.0);
            if random.random_bool(0.9) {
                row(x + noise, y + 0.5 * noise, random.random_range(0.7..1.0));
            }
            if random.random_bool(0.1) {
                let place = enter(&mut random);
                row(place[0], place[1], random.random_range(0.5..0.8));
            }
        }
    }
    text
}

fn link(detections: &Path, tracks: &Path, options: &[&str]) -> StepResult<Value> {
    let report = tracks.with_extension("json");
    let mut command = program("tracker");
    command.arg("link").arg(detections).arg("--out").arg(tracks).arg("--report").arg(&report).args(options);
    run(&mut command)?;
    parse(&std::fs::read_to_string(&report).map_err(|e| e.to_string())?)
}

fn evaluate(truth: &Path, tracks: &Path) -> StepResult<Value> {
    let mut command = program("tracker");
    parse(&run(command.args(["eval", "--json", "--truth"]).arg(truth).arg("--tracks").arg(tracks))?)
}

fn parse(text: &str) -> StepResult<Value> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}
