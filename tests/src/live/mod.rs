//! The measuring stand for live input: fake network cameras on one side, `tracker run` as a black box on the other.
//!
//! Each scenario gives [`Figure`]s; a feature that the program does not have yet gives a figure with the program's
//! own error line. The scenarios' durations are parameters: the benchmark `live` measures with long ones, tests with
//! short ones.
//!
//! * [`accuracy`] — tracks from live cameras with separate clocks, and from recordings of unknown start, against the
//!   truth.
//! * [`outages`] — a camera that falls silent, and all cameras away.
//! * [`latency`] — from capture to row on disk.
//! * [`publishing`] — from capture to MQTT message.
//! * [`memory`] — growth of a long run.
//! * [`capacity`] — number of cameras that are followed in real time.
//! * [`service`] — a service of two rooms for some minutes.
//! * [`viewers`] — what viewers of the page cost, and its weight.
//! * [`stations`] — one process for each camera.
//! * [`agents`] — one process for each camera, which track together without a gatherer.
//!
//! Parts that the scenarios share:
//!
//! * [`office`] — the office as films of network cameras, and its truth at any time.
//! * [`run`] — `tracker run` as a child process; [`rows`] — its `tracks.jsonl` as it grows; [`page`] — its page.
//! * [`proxy`] — a network between two programs that counts bytes and can be cut.
//! * [`films`] — recordings that are made for the measurement and kept beside the programs.

pub mod accuracy;
pub mod agents;
pub mod capacity;
pub mod films;
pub mod latency;
pub mod memory;
pub mod office;
pub mod outages;
pub mod page;
pub mod proxy;
pub mod publishing;
pub mod rows;
pub mod run;
pub mod service;
pub mod stations;
pub mod viewers;

use crate::chain::StepResult;

/// One measured figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Measured quantity, and its conditions.
    pub what: String,
    /// The value; an error where the program cannot do this yet, in the program's words.
    pub value: StepResult<f64>,
    /// Unit of the value.
    pub unit: &'static str,
    /// Required bound; empty for a figure that only informs.
    pub asked: &'static str,
}

impl Figure {
    /// A value.
    pub fn new(what: impl Into<String>, value: f64, unit: &'static str, asked: &'static str) -> Self {
        Self { what: what.into(), value: Ok(value), unit, asked }
    }

    /// A value that could not be measured, with the reason.
    pub fn unavailable(what: impl Into<String>, why: impl Into<String>, asked: &'static str) -> Self {
        Self { what: what.into(), value: Err(why.into()), unit: "", asked }
    }

    /// The row of a table: `what | measured | asked`.
    pub fn row(&self) -> String {
        let measured = match &self.value {
            Ok(value) => format!("{value:.2} {}", self.unit),
            Err(why) => format!("not available: {why}"),
        };
        format!("{} | {measured} | {}", self.what, self.asked)
    }

    /// The same as a line of JSON.
    pub fn json(&self, scenario: &str) -> String {
        let (value, error) = match &self.value {
            Ok(value) => (Some(value), None),
            Err(why) => (None, Some(why)),
        };
        serde_json::json!({
            "scenario": scenario, "what": self.what, "value": value, "unit": self.unit, "asked": self.asked,
            "unavailable": error,
        })
        .to_string()
    }
}

/// Nearest-rank quantile of some values, `share` from 0 to 1; `None` without values.
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}
