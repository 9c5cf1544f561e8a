//! Comparison of likelihoods and acceptance rules over all available data, by which the sampler's defaults were chosen.
//! Every row is a whole run of the program on the same masks, with two seeds; figures are means.
//!
//! `make bench`, or `cargo build --release --bins && cargo bench -p tests --bench sampler`
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tests::chain::{StepResult, run};
use tests::data::{office, program, shared};

/// The choices, by the options that make them.
const CHOICES: [(&str, &[&str]); 7] = [
    ("as published", &["--published"]),
    ("as published, overlap to the 100th", &["--published", "--overlap-power", "100"]),
    ("overlap, published rule", &["--likelihood", "overlap", "--acceptance", "published"]),
    ("overlap, reversible jump", &["--likelihood", "overlap"]),
    ("overlap to the 40th, reversible jump", &["--likelihood", "overlap", "--overlap-power", "40"]),
    ("bernoulli, published rule", &["--acceptance", "published"]),
    ("bernoulli, reversible jump (default)", &[]),
];
const SEEDS: [&str; 2] = ["1", "2"];

/// One recording with its truth.
struct MaskRecording {
    name: &'static str,
    room: PathBuf,
    /// `NAME=PATH` of each camera's masks.
    masks: Vec<String>,
    /// Options from which `tracker run` takes the frames' times.
    times: Vec<String>,
    truth: PathBuf,
    /// Options of `tracker eval` that restrict the judged part.
    judged: Vec<String>,
    /// Required figure of the default.
    asked: &'static str,
}

fn main() -> StepResult<()> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    println!(
        "{:<9} {:<38} {:>7} {:>7} {:>7} {:>8} {:>8} {:>9}",
        "data", "choice", "MOTA %", "MODA %", "IDF1 %", "mean cm", "max cm", "ms/frame"
    );
    for recording in recordings(scratch.path())? {
        for (choice, options) in CHOICES {
            let runs: Vec<[f64; 6]> = SEEDS
                .iter()
                .map(|seed| recording.follow(&scratch.path().join("out"), options, seed))
                .collect::<StepResult<_>>()?;
            let mean = |i: usize| runs.iter().map(|figures| figures[i]).sum::<f64>() / runs.len() as f64;
            println!(
                "{:<9} {choice:<38} {:>7.1} {:>7.1} {:>7.1} {:>8.1} {:>8.1} {:>9.2}",
                recording.name,
                mean(0),
                mean(1),
                mean(2),
                100.0 * mean(3),
                100.0 * mean(4),
                mean(5)
            );
        }
        println!("{:<9} asked of the default: {}", recording.name, recording.asked);
    }
    Ok(())
}

/// The office, and further available data. Masks of films are made once, so that every choice gets the same ones.
fn recordings(scratch: &Path) -> StepResult<Vec<MaskRecording>> {
    let text = |path: PathBuf| path.display().to_string();
    let masks_of = |name: &str, videos: &[(&str, PathBuf)], times: &[String]| -> StepResult<Vec<String>> {
        let out = scratch.join(name);
        let mut command = program("tracker");
        command.arg("masks").arg("--out").arg(&out).args(times);
        for (camera, video) in videos {
            command.args(["--video", &format!("{camera}={}", video.display())]);
        }
        run(&mut command)?;
        Ok(videos.iter().map(|(camera, _)| format!("{camera}={}", out.join(camera).display())).collect())
    };
    let home = office();
    let rate = |rate: &str| vec!["--rate".to_owned(), rate.to_owned()];
    let videos = ["cam0", "cam1"].map(|name| (name, home.join(format!("video/{name}.mp4"))));
    let mut recordings = vec![MaskRecording {
        name: "office",
        masks: masks_of("office", &videos, &rate("12"))?,
        times: rate("12"),
        truth: home.join("truth.txt"),
        judged: Vec::new(),
        asked: "MOTA >= 97, IDF1 >= 98, mean <= 6 cm, maximum <= 30 cm",
        room: home.join("room"),
    }];
    if let Some(home) = shared("cmc1") {
        recordings.push(MaskRecording {
            name: "cmc1",
            masks: (1..=4).map(|i| format!("cam{i}={}", text(home.join(format!("masks/cam{i}"))))).collect(),
            times: vec!["--times".to_owned(), text(home.join("times.txt"))],
            truth: home.join("truth.txt"),
            // The part of the floor that its truth covers.
            judged: ["--area", "2.07,0 7.67,3.41"].map(str::to_owned).to_vec(),
            asked: "MOTA >= 99, IDF1 >= 99, mean <= 7 cm (MV-GLMB-OC: 100, 100, 8.3 cm)",
            room: home,
        });
    }
    if let Some(home) = shared("terrace") {
        let videos = ["C1", "C2", "C3", "C4"].map(|name| (name, home.join("video").join(name)));
        let times = vec!["--times".to_owned(), text(home.join("times.txt"))];
        recordings.push(MaskRecording {
            name: "terrace",
            masks: masks_of("terrace", &videos, &times)?,
            times,
            truth: home.join("truth.txt"),
            judged: vec!["--annotated".to_owned(), text(home.join("annotated.txt"))],
            asked: "MODA >= 78",
            room: home,
        });
    }
    if let Some(home) = shared("pets") {
        recordings.push(MaskRecording {
            name: "pets",
            masks: masks_of("pets", &[("view1", home.join("view1.avi"))], &rate("7"))?,
            times: rate("7"),
            truth: home.join("truth.txt"),
            judged: ["--gate", "1", "--frames", "1-400"].map(str::to_owned).to_vec(),
            asked: "MODA >= 70",
            room: home,
        });
    }
    Ok(recordings)
}

impl MaskRecording {
    /// MOTA, MODA, IDF1, mean and maximum error, and the median time of inference; NaN where a figure means nothing.
    fn follow(&self, out: &Path, options: &[&str], seed: &str) -> StepResult<[f64; 6]> {
        let mut command: Command = program("tracker");
        command.arg("run").arg(&self.room).args(["--no-film", "--threads", "1", "--seed", seed, "--out"]);
        command.arg(out).args(&self.times).args(options);
        for masks in &self.masks {
            command.args(["--masks", masks]);
        }
        run(&mut command)?;
        let mut command = program("tracker");
        command.args(["eval", "--json", "--truth"]).arg(&self.truth).arg("--tracks");
        let told: Value = parse(&run(command.arg(out.join("tracks.txt")).args(&self.judged))?)?;
        let timings = out.join("timings.json");
        let timings: Value = parse(&std::fs::read_to_string(&timings).map_err(|e| e.to_string())?)?;
        let figure = |name: &str| told[name].as_f64().unwrap_or(f64::NAN);
        let median_ms = timings["stages"]["inference"]["median_ms"].as_f64().unwrap_or(f64::NAN);
        let [mota, moda, idf1] = ["MOTA", "MODA", "IDF1"].map(figure);
        Ok([mota, moda, idf1, figure("mean_error_m"), figure("maximum_error_m"), median_ms])
    }
}

fn parse(text: &str) -> StepResult<Value> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}
