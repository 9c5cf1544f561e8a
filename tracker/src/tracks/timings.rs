//! `timings.json`: how long each stage of a run takes.

use std::path::Path;
use std::time::{Duration, Instant};

use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{Error, Result};

/// The file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// Worker threads of the run.
    pub threads: usize,
    /// Frames of the run.
    pub frames: usize,
    /// Stages by name, in the order of the data's way.
    #[serde(serialize_with = "in_order", deserialize_with = "as_written")]
    pub stages: Vec<(String, StageTimes)>,
}

/// Wall time of one stage; one count a frame, all cameras together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Frames that were timed.
    pub count: usize,
    /// Half of the frames took less, milliseconds.
    pub median_ms: f64,
    /// 95 % of the frames took no more, milliseconds.
    pub p95_ms: f64,
    /// All of them together, milliseconds.
    pub total_ms: f64,
}

/// Collects the times of a run.
#[derive(Debug, Clone, Default)]
pub struct Stopwatch {
    stages: Vec<(&'static str, Vec<f64>)>,
}

impl Stopwatch {
    /// Notes the time one frame spent in a stage. Stages are listed in the order in which they first come.
    pub fn record(&mut self, stage: &'static str, time: Duration) {
        let milliseconds = time.as_secs_f64() * 1e3;
        match self.stages.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, times)) => times.push(milliseconds),
            None => self.stages.push((stage, vec![milliseconds])),
        }
    }

    /// Does something and notes its time.
    pub fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.record(stage, start.elapsed());
        result
    }

    /// The times so far.
    pub fn timings(&self, threads: usize, frames: usize) -> Timings {
        let stages = self.stages.iter().map(|(name, times)| ((*name).to_owned(), StageTimes::of(times)));
        Timings { threads, frames, stages: stages.collect() }
    }
}

impl StageTimes {
    /// Of the times of each frame, milliseconds. The 95th percentile is by nearest rank.
    fn of(times: &[f64]) -> Self {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let micro = |ms: f64| (ms * 1e3).round() / 1e3;
        let rank = |r: usize| sorted.get(r).copied().unwrap_or(0.0);
        let median = if n == 0 { 0.0 } else { 0.5 * (rank((n - 1) / 2) + rank(n / 2)) };
        Self {
            count: n,
            median_ms: micro(median),
            p95_ms: micro(rank((95 * n).div_ceil(100).saturating_sub(1))),
            total_ms: micro(sorted.iter().sum()),
        }
    }
}

impl Timings {
    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// Naming the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string(self)
            .map_err(|e| Error::content(path, "whole file", format!("cannot be written ({e})")))?;
        Ok(calib::files::write_atomic(path, (text + "\n").as_bytes())?)
    }

    /// Reads the file.
    ///
    /// # Errors
    /// Naming file, line and problem.
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
    struct Stages;
    impl<'de> Visitor<'de> for Stages {
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
    deserializer.deserialize_map(Stages)
}

#[cfg(test)]
mod tests {
    use super::*;

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
