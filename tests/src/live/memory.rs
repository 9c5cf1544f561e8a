//! Memory of a long run.

use std::time::Duration;

use crate::chain::StepResult;
use crate::live::office::{self, RATE_HZ};
use crate::live::run::{LiveRun, Scratch};
use crate::live::{Figure, quantile};
use crate::network_camera::CameraOptions;

/// Number of samples of the resident set, of which the median is taken…
const LOOKS: u32 = 11;
/// …and the interval between them.
const EVERY: Duration = Duration::from_secs(1);

/// Resident set of a process, bytes.
pub(super) fn resident_bytes(pid: u32) -> StepResult<f64> {
    let path = format!("/proc/{pid}/status");
    let status = std::fs::read_to_string(&path).map_err(|e| format!("{path}: {e}"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kilobytes = line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<f64>().ok());
    Ok(1024.0 * kilobytes.ok_or_else(|| format!("{path}: no VmRSS"))?)
}

/// Resident sets in bytes of a run on two network cameras, at two times from its start, seconds.
///
/// # Errors
/// The run's line, if it ends.
pub fn resident(early_s: f64, late_s: f64, arguments: &[&str]) -> StepResult<[f64; 2]> {
    let order = office::repeated(8.0, office::FRAMES + (8.0 * RATE_HZ) as usize);
    let options = CameraOptions::default();
    let (cameras, epoch) = office::cameras(&order, false, [options.clone(), options])?;
    let scratch = Scratch::new()?;
    let mut given = office::videos(&cameras);
    given.extend(arguments.iter().map(|argument| (*argument).to_owned()));
    let mut run = LiveRun::start(&office::room(), &scratch.path("out"), &given)?;
    let mut median = |at_s: f64| -> StepResult<f64> {
        let half_s = EVERY.as_secs_f64() * f64::from(LOOKS / 2);
        let first = epoch + Duration::from_secs_f64((at_s - half_s).max(0.0));
        let mut seen = Vec::new();
        for look in 0..LOOKS {
            run.wait_until(first + EVERY * look)?;
            seen.push(resident_bytes(run.pid())?);
        }
        quantile(seen, 0.5).ok_or_else(|| "nothing was seen".into())
    };
    let resident = [median(early_s)?, median(late_s)?];
    run.interrupt()?;
    Ok(resident)
}

/// [`resident`] without films as figures.
pub fn growth(early_s: f64, late_s: f64) -> Vec<Figure> {
    let what = format!("memory of a run on streams, {early_s} s to {late_s} s");
    match resident(early_s, late_s, &["--no-film"]) {
        Ok([early, late]) => vec![
            Figure::new(format!("{what}: growth"), 100.0 * (late / early - 1.0), "%", "<= 2 (10 to 60 min)"),
            Figure::new(format!("{what}: at the end"), late / 1e6, "MB", ""),
        ],
        Err(why) => vec![Figure::unavailable(what, why, "<= 2")],
    }
}
