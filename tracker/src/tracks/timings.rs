//! `timings.json`: computing time of each stage of a run.

use std::path::Path;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::run::ClockReport;
use crate::{Error, Result};

/// Content of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// Number of worker threads.
    pub threads: usize,
    /// Number of frames of the run.
    pub frames: usize,
    /// Times of the stages, in the order of the data flow.
    #[serde(serialize_with = "in_order", deserialize_with = "as_written")]
    pub stages: Vec<(String, StageTimes)>,
    /// Estimates of the cameras' clocks; omitted with a single camera.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offsets: Vec<ClockReport>,
}

/// Wall time of one stage; one count a frame, all cameras together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Number of timed frames.
    pub count: usize,
    /// Median, milliseconds; in a long run, that of a sample of the frames.
    pub median_ms: f64,
    /// 95th percentile, milliseconds; in a long run, that of the sample.
    pub p95_ms: f64,
    /// Total, milliseconds.
    pub total_ms: f64,
}

/// Largest number of stored times for each stage: a live run may last for weeks, so longer runs are sampled.
const MOST_KEPT: usize = 100_000;

/// Collector of the times of a run.
#[derive(Debug, Clone, Default)]
pub struct Stopwatch {
    stages: Vec<(&'static str, Laps)>,
}

/// Number and sum of the times of one stage, and a uniform sample of them (reservoir sampling: J. S. Vitter, "Random
/// sampling with a reservoir", ACM TOMS 1985, algorithm R).
#[derive(Debug, Clone)]
struct Laps {
    count: usize,
    total_ms: f64,
    kept_ms: Vec<f64>,
    rng: Pcg64Mcg,
}

impl Stopwatch {
    /// Records the time of one frame in a stage. Stages are listed in the order of their first record.
    pub fn record(&mut self, stage: &'static str, time: Duration) {
        let known = self.stages.iter().position(|(name, _)| *name == stage);
        let i = known.unwrap_or_else(|| {
            self.stages.push((stage, Laps::new()));
            self.stages.len() - 1
        });
        self.stages[i].1.record(time.as_secs_f64() * 1e3);
    }

    /// Executes `work` and records its time.
    pub fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.record(stage, start.elapsed());
        result
    }

    /// Times so far.
    pub fn timings(&self, threads: usize, frames: usize) -> Timings {
        let stages = self.stages.iter().map(|(name, laps)| ((*name).to_owned(), StageTimes::of(laps)));
        Timings { threads, frames, stages: stages.collect(), offsets: Vec::new() }
    }
}

impl Laps {
    fn new() -> Self {
        Self { count: 0, total_ms: 0.0, kept_ms: Vec::new(), rng: Pcg64Mcg::seed_from_u64(1) }
    }

    fn record(&mut self, time_ms: f64) {
        self.count += 1;
        self.total_ms += time_ms;
        if self.kept_ms.len() < MOST_KEPT {
            self.kept_ms.push(time_ms);
        } else if let Some(kept_ms) = self.kept_ms.get_mut(self.rng.random_range(0..self.count)) {
            *kept_ms = time_ms;
        }
    }
}

impl StageTimes {
    /// Statistics of a stage's times. The 95th percentile is by nearest rank.
    fn of(laps: &Laps) -> Self {
        let mut sorted = laps.kept_ms.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let micro = |ms: f64| (ms * 1e3).round() / 1e3;
        let rank = |r: usize| sorted.get(r).copied().unwrap_or(0.0);
        let median = if n == 0 { 0.0 } else { 0.5 * (rank((n - 1) / 2) + rank(n / 2)) };
        Self {
            count: laps.count,
            median_ms: micro(median),
            p95_ms: micro(rank((95 * n).div_ceil(100).saturating_sub(1))),
            total_ms: micro(laps.total_ms),
        }
    }
}

impl Timings {
    /// Writes the file atomically.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string(self)
            .map_err(|e| Error::content(path, "whole file", format!("cannot be written ({e})")))?;
        Ok(calib::files::write_atomic(path, (text + "\n").as_bytes())?)
    }

    /// Reads the file.
    ///
    /// # Errors
    /// Names file, line and problem.
    pub fn read(path: &Path) -> Result<Self> {
        serde_json::from_str(&calib::files::read_text(path)?).map_err(|e| {
            Error::content(path, format!("line {}, column {}", e.line(), e.column()), format!("{e}"))
        })
    }
}

fn in_order<S: Serializer>(
    stages: &[(String, StageTimes)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(stages.iter().map(|(name, times)| (name, times)))
}

fn as_written<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<Vec<(String, StageTimes)>, D::Error> {
    struct StagesVisitor;
    impl<'de> Visitor<'de> for StagesVisitor {
        type Value = Vec<(String, StageTimes)>;
        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("an object of stages")
        }
        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> std::result::Result<Self::Value, A::Error> {
            let mut stages = Vec::new();
            while let Some(entry) = map.next_entry()? {
                stages.push(entry);
            }
            Ok(stages)
        }
    }
    deserializer.deserialize_map(StagesVisitor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_long_run_an_even_sample_is_kept_and_everything_counted() {
        let mut watch = Stopwatch::default();
        // A sample of only the first or only the last times has another median.
        let frames = 5 * MOST_KEPT;
        for frame in 0..frames {
            watch.record("decode", Duration::from_micros(frame as u64));
        }
        assert_eq!(watch.stages[0].1.kept_ms.len(), MOST_KEPT);
        let times = watch.timings(1, frames).stages[0].1;
        let all_ms = frames as f64 / 1e3;
        assert_eq!(times.count, frames);
        assert!((times.total_ms / (0.5 * all_ms * (frames - 1) as f64) - 1.0).abs() < 1e-9);
        // The standard deviation of a quantile q of n draws is √(q (1 − q) / n): five of them.
        let n = MOST_KEPT as f64;
        assert!((times.median_ms / all_ms - 0.5).abs() < 5.0 * (0.25 / n).sqrt(), "{times:?}");
        assert!((times.p95_ms / all_ms - 0.95).abs() < 5.0 * (0.95 * 0.05 / n).sqrt(), "{times:?}");
    }

    #[test]
    fn order_and_quantiles_are_kept_through_the_file() {
        let mut watch = Stopwatch::default();
        for ms in 1..=100 {
            watch.record("decode", Duration::from_millis(ms));
            watch.record("background", Duration::from_millis(7));
        }
        assert_eq!(watch.time("alone", || 3), 3);
        let timings = watch.timings(2, 100);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("timings.json");
        timings.write(&path).unwrap();
        let read = Timings::read(&path).unwrap();
        assert_eq!(read, timings);
        assert_eq!(read.stages[0].0, "decode");
        let times = read.stages[0].1;
        assert_eq!((times.count, times.median_ms, times.p95_ms, times.total_ms), (100, 50.5, 95.0, 5050.0));
        assert!((read.stages[1].1.median_ms - 7.0).abs() < 1e-9);

        std::fs::write(&path, "{\"threads\":2,").unwrap();
        let error = Timings::read(&path).unwrap_err().to_string();
        assert!(error.contains("timings.json") && error.contains("line 1"), "{error}");
    }
}
