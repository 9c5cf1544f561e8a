//! All methods on the same recordings: the office, and synthetic halls of three cameras. Each alone, and with `tracker
//! link` on top. kB/s: what each station sends to each neighbour where every camera has a machine of its own.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench methods [-- office|SEED…]`: halls of these seeds.
#![forbid(unsafe_code)]

use std::path::Path;
use std::time::Instant;

use calib::Distortion;
use serde_json::Value;
use tests::chain::{StepResult, run};
use tests::data::{office, program};
use tests::live::films::{Hall, RecordedRoom, office_recorded};

/// Name of each method, and its options.
const METHODS: [(&str, &[&str]); 7] = [
    ("mcmc", &["--method", "mcmc"]),
    ("condensation", &["--method", "condensation"]),
    ("agents", &["--method", "agents"]),
    ("agents --published", &["--method", "agents", "--published"]),
    ("mcmc --smooth", &["--method", "mcmc", "--smooth"]),
    ("condensation --smooth", &["--method", "condensation", "--smooth"]),
    ("agents --smooth", &["--method", "agents", "--smooth"]),
];

/// Halls that are measured where none is asked for. Nothing was tuned on them.
const HALLS: [u64; 3] = [7001, 7002, 7003];
const CAMERAS: usize = 3;
const PEOPLE: usize = 4;

fn main() -> StepResult<()> {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let seeds: Vec<u64> = asked.iter().filter_map(|a| a.parse().ok()).collect();
    let halls = if asked.is_empty() { HALLS.to_vec() } else { seeds };
    println!(
        "{:<10} {:<22} {:>7} {:>7} {:>7} {:>8} {:>8} {:>9}",
        "set", "method", "MOTA %", "IDF1 %", "HOTA %", "mean cm", "time s", "kB/s"
    );
    if asked.is_empty() || asked.iter().any(|a| a == "office") {
        compare("office", &office_recorded(), &office().join("truth.txt"))?;
    }
    for seed in halls {
        let hall = Hall { seed, cameras: CAMERAS, people: PEOPLE, lens: Distortion::NONE }.recorded()?;
        compare(&format!("hall {seed}"), &hall, &hall.room.join("truth.txt"))?;
    }
    Ok(())
}

/// Prints a line for each method.
fn compare(set: &str, recorded: &RecordedRoom, truth: &Path) -> StepResult<()> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    for (method, options) in METHODS {
        let out = scratch.path().join(method.replace(' ', "_"));
        let started = Instant::now();
        let told_by_run = follow(recorded, &out, options)?;
        let time_s = started.elapsed().as_secs_f64();
        let told = evaluate(truth, &out.join("tracks.txt"))?;
        let [mota, idf1, hota, mean_m] = ["MOTA", "IDF1", "HOTA", "mean_error_m"].map(|f| number(&told[f]));
        let traffic = traffic_kb_s(&told_by_run).map_or_else(|| "-".to_owned(), |kb_s| format!("{kb_s:.2}"));
        println!(
            "{set:<10} {method:<22} {mota:>7.1} {idf1:>7.1} {hota:>7.1} {:>8.1} {time_s:>8.1} {traffic:>9}",
            100.0 * mean_m
        );
    }
    Ok(())
}

/// Runs a method; returns its standard error.
fn follow(recorded: &RecordedRoom, out: &Path, options: &[&str]) -> StepResult<String> {
    let videos = recorded.videos.iter();
    let videos = videos.flat_map(|(name, path)| ["--video".to_owned(), format!("{name}={}", path.display())]);
    let mut command = program("tracker");
    command.arg("run").arg(&recorded.room).args(videos).args(["--no-film", "--out"]).arg(out).args(options);
    let output = command.output().map_err(|e| e.to_string())?;
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.success() { Ok(told) } else { Err(told) }
}

fn evaluate(truth: &Path, tracks: &Path) -> StepResult<Value> {
    let mut command = program("tracker");
    command.args(["eval", "--json", "--truth"]).arg(truth).arg("--tracks").arg(tracks);
    serde_json::from_str(&run(&mut command)?).map_err(|e| e.to_string())
}

/// Traffic of each station to each neighbour, from the run's log, kB/s.
fn traffic_kb_s(told: &str) -> Option<f64> {
    told.split("would send ").nth(1)?.split(' ').next()?.parse().ok()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}
