//! Tracking by a detector's boxes alone: five runs of each set, each with 0.3 pixels of noise of its own on the edges of the
//! boxes, because figures of identities are chaotic.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench boxes [-- FOLDER…]`: the sets of the shared data, or these
//! folders, each with `scene.toml`, `times.txt`, `truth.txt` and `detections/NAME.txt`.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use tests::chain::{StepResult, run};
use tests::data::{program, shared};

/// Number of runs of each set.
const RUNS: u64 = 5;
/// Standard deviation of the noise on each edge of a box, pixels.
const NOISE_PX: f64 = 0.3;
/// Part of the floor that the truth of cmc1 covers.
const CMC1_AREA: &str = "2.07,0 7.67,3.41";
/// Columns of a row before the appearance vector, and those of its box.
const COLUMNS: usize = 10;
const BOX: std::ops::Range<usize> = 2..6;

/// One recording with its truth.
struct BoxRecording {
    name: String,
    folder: PathBuf,
    /// Folder of the detector's files, relative to `folder`.
    detections: &'static str,
    /// Whether the appearance vectors of the rows are kept.
    has_appearance: bool,
    area: Option<&'static str>,
    /// Required figures.
    asked: &'static str,
}

fn main() -> StepResult<()> {
    let folders: Vec<PathBuf> =
        std::env::args().skip(1).filter(|a| !a.starts_with("--")).map(PathBuf::from).collect();
    let recordings = if folders.is_empty() { shared_recordings() } else { recordings_in(folders) };
    println!(
        "{:<22} {:>7} {:>7} {:>9} {:>8} {:>9}   mean over {RUNS} runs (least to most)",
        "set", "MOTA %", "IDF1 %", "switches", "mean cm", "ms/moment"
    );
    for recording in recordings {
        let runs: Vec<[f64; 5]> = (1..=RUNS).map(|seed| recording.follow(seed)).collect::<StepResult<_>>()?;
        let mean = |i: usize| runs.iter().map(|run| run[i]).sum::<f64>() / runs.len() as f64;
        let least = |i: usize| runs.iter().map(|run| run[i]).fold(f64::INFINITY, f64::min);
        let most = |i: usize| runs.iter().map(|run| run[i]).fold(f64::NEG_INFINITY, f64::max);
        println!(
            "{:<22} {:>7.1} {:>7.1} {:>9.1} {:>8.2} {:>9.1}   MOTA {:.1}–{:.1}, IDF1 {:.1}–{:.1}   {}",
            recording.name,
            mean(0),
            mean(1),
            mean(2),
            100.0 * mean(3),
            mean(4),
            least(0),
            most(0),
            least(1),
            most(1),
            recording.asked
        );
    }
    Ok(())
}

fn shared_recordings() -> Vec<BoxRecording> {
    let sets = [
        ("wildtrack", "wildtrack", "detections", None, "asked: MOTA 94, IDF1 91, mean 4.5 cm"),
        ("cmc1", "cmc1", "detections", Some(CMC1_AREA), "asked: MOTA 99.5, IDF1 99.5, mean 7.5 cm"),
        ("cmc1 reid", "cmc1", "detections_reid", Some(CMC1_AREA), "asked: MOTA 99, IDF1 99"),
    ];
    let recording = |(name, set, detections, area, asked): (&str, &str, _, _, _)| {
        let folder = shared(set)?;
        Some(BoxRecording { name: name.to_owned(), folder, detections, has_appearance: true, area, asked })
    };
    let mut recordings: Vec<BoxRecording> = sets.into_iter().filter_map(recording).collect();
    recordings.extend(shared("cmc1").map(|folder| BoxRecording {
        name: "cmc1 reid, no vectors".to_owned(),
        folder,
        detections: "detections_reid",
        has_appearance: false,
        area: Some(CMC1_AREA),
        asked: "asked: MOTA 99, IDF1 99",
    }));
    recordings
}

fn recordings_in(folders: Vec<PathBuf>) -> Vec<BoxRecording> {
    let recording = |folder: PathBuf| BoxRecording {
        name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        folder,
        detections: "detections",
        has_appearance: true,
        area: None,
        asked: "",
    };
    folders.into_iter().map(recording).collect()
}

impl BoxRecording {
    /// MOTA, IDF1, identity switches, mean error in metres and mean time of inference in milliseconds of a run with
    /// noise by this seed.
    fn follow(&self, seed: u64) -> StepResult<[f64; 5]> {
        let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
        let out = scratch.path().join("out");
        let mut command = program("tracker");
        command.arg("run").arg(&self.folder).args(["--no-film", "--threads", "1", "--seed"]);
        command
            .arg(seed.to_string())
            .arg("--out")
            .arg(&out)
            .arg("--times")
            .arg(self.folder.join("times.txt"));
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        for (camera, file) in detector_files(&self.folder.join(self.detections))? {
            let noisy = scratch.path().join(format!("{camera}.txt"));
            let text = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
            let rows: String =
                text.lines().map(|row| self.noisy_row(row, &mut rng)).collect::<StepResult<_>>()?;
            std::fs::write(&noisy, rows).map_err(|e| format!("{}: {e}", noisy.display()))?;
            command.arg("--detections").arg(format!("{camera}={}", noisy.display()));
        }
        run(&mut command)?;
        let mut command = program("tracker");
        command.args(["eval", "--json", "--truth"]).arg(self.folder.join("truth.txt"));
        command.arg("--tracks").arg(out.join("tracks.txt"));
        let evaluation = parse(&run(command.args(self.area.iter().flat_map(|area| ["--area", area])))?)?;
        let timings = std::fs::read_to_string(out.join("timings.json")).map_err(|e| e.to_string())?;
        let inference = &parse(&timings)?["stages"]["inference"];
        let of_timing = |name: &str| inference[name].as_f64().unwrap_or(f64::NAN);
        let mean_ms = of_timing("total_ms") / of_timing("count");
        let figure = |name: &str| evaluation[name].as_f64().unwrap_or(f64::NAN);
        Ok([figure("MOTA"), figure("IDF1"), figure("id_switches"), figure("mean_error_m"), mean_ms])
    }

    /// A row of a detector's file with noise on the edges of its box.
    fn noisy_row(&self, row: &str, rng: &mut Pcg64Mcg) -> StepResult<String> {
        let mut columns: Vec<String> = row.split(',').map(str::to_owned).collect();
        let bad_row = || format!("{row}: no row of a detector");
        let values = columns.get(BOX).ok_or_else(bad_row)?.iter().map(|value| value.trim().parse::<f64>());
        let values: Vec<f64> = values.collect::<Result<_, _>>().map_err(|_| bad_row())?;
        let edges = [values[0], values[1], values[0] + values[2], values[1] + values[3]];
        let [left, top, right, bottom] =
            edges.map(|edge| edge + NOISE_PX * rng.sample::<f64, _>(StandardNormal));
        let noisy = [left, top, (right - left).max(1.0), (bottom - top).max(1.0)];
        for (column, value) in columns[BOX].iter_mut().zip(noisy) {
            *column = format!("{value:.3}");
        }
        if !self.has_appearance {
            columns.truncate(COLUMNS);
        }
        Ok(columns.join(",") + "\n")
    }
}

/// Name of each camera and its detector's file, in the order of the names.
fn detector_files(folder: &Path) -> StepResult<Vec<(String, PathBuf)>> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| e.to_string())?.path();
        if path.extension().is_some_and(|extension| extension == "txt") {
            files.push((path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), path));
        }
    }
    files.sort();
    Ok(files)
}

fn parse(text: &str) -> StepResult<Value> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}
