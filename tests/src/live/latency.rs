//! Latency from a picture's capture to the row on disk that contains it.

use std::time::{Duration, Instant};

use crate::chain::StepResult;
use crate::live::office::{self, RATE_HZ};
use crate::live::page;
use crate::live::rows::LiveRow;
use crate::live::run::{LiveRun, Scratch};
use crate::live::{Figure, quantile};
use crate::network_camera::CameraOptions;

/// Time for the run to start, seconds from the epoch.
const START_S: f64 = 7.0;
/// Time for which the page is watched, seconds: it shows which picture belongs to which row.
const WATCHED_S: f64 = 6.0;
/// Time from then until rows count, seconds: the run does not draw for the page any more.
const QUIET_S: f64 = 2.0;

/// Ages of a run's output, seconds from the capture of its newest picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Latencies {
    /// Age of each row when it was found on disk, in order.
    pub rows_s: Vec<f64>,
    /// Ages of the pictures on the page when they were seen there.
    pub page_s: Vec<f64>,
    /// Rate of the run's clock: seconds of the rows' times in one second, 1 if the run knows its cameras' times. Rows
    /// of a run whose clock is wrong have no known age.
    pub clock_rate: f64,
    /// Instant of the run's time 0.
    pub zero: Instant,
    /// Instants between which rows count.
    pub counted: std::ops::Range<Instant>,
}

/// Latencies of a run on two cameras whose clocks agree.
///
/// # Errors
/// The run's line, if it fails; a page from which no picture could be read.
pub fn latencies(measured_s: f64, arguments: &[&str]) -> StepResult<Latencies> {
    let from_s = START_S + WATCHED_S + QUIET_S;
    let until_s = from_s + measured_s;
    let order = office::repeated(START_S, ((until_s + START_S) * RATE_HZ) as usize);
    let options = CameraOptions::default();
    let (cameras, epoch) = office::cameras(&order, true, [options.clone(), options])?;
    let at = move |s: f64| epoch + Duration::from_secs_f64(s);
    let scratch = Scratch::new()?;
    let mut given = office::videos(&cameras);
    given.extend(["--no-film", "--lag", "0"].iter().chain(arguments).map(|argument| (*argument).to_owned()));
    let mut run = LiveRun::start_with_page(&office::room(), &scratch.path("out"), &given)?;
    let page = run.page().ok_or("the run has no page")?;
    let watcher = std::thread::spawn(move || page::watch(page, at(START_S + WATCHED_S)));
    run.wait_until(at(until_s))?;
    let sightings = watcher.join().map_err(|_| "the page's watcher failed")?;
    let rows = run.interrupt()?.rows;
    let since = |time: Instant| time.saturating_duration_since(epoch).as_secs_f64();
    // A moment is as old as its newest picture, and all cameras capture at the same time here.
    let moments = sightings.iter().filter_map(|sighting| {
        let newest = sighting.stamps.iter().flatten().max()?;
        Some((sighting, cameras[0].captured_at_s(u64::from(*newest))))
    });
    let page_s = moments.clone().map(|(sighting, captured_s)| since(sighting.seen) - captured_s).collect();
    let starts = moments.map(|(sighting, captured_s)| captured_s - sighting.time_s);
    let start_s = quantile(starts, 0.5).ok_or("no stamped picture was seen on the page")?;
    let rows = rows.iter().filter(|row| row.found >= at(from_s) && row.found < at(until_s));
    let rows: Vec<&LiveRow> = rows.collect();
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return Err("no row came".into()) };
    let clock_rate = (last.time_s - first.time_s) / (since(last.found) - since(first.found));
    let rows_s = rows.iter().map(|row| since(row.found) - (start_s + row.time_s)).collect();
    Ok(Latencies { rows_s, page_s, clock_rate, zero: at(start_s), counted: at(from_s)..at(until_s) })
}

/// Share by which a clock may be off and still counts as right: jitter of the first and the last row makes up some of
/// it, while a rate that was assumed instead of measured is far off.
const CLOCK_TOLERANCE: f64 = 0.05;

/// [`latencies`] as figures. Further arguments go to `tracker run`.
pub fn capture_to_row(measured_s: f64, arguments: &[&str]) -> Vec<Figure> {
    let what =
        ["two live cameras at 12/s, no lag"].iter().chain(arguments).copied().collect::<Vec<_>>().join(" ");
    let latencies = match latencies(measured_s, arguments) {
        Ok(latencies) => latencies,
        Err(why) => return vec![Figure::unavailable(what, why, "<= 60, <= 200")],
    };
    let figure = |name: &str, share: f64, asked| {
        let what = format!("{what}: capture to row on disk, {name}");
        if (latencies.clock_rate - 1.0).abs() > CLOCK_TOLERANCE {
            return Figure::unavailable(what, "the rows' times are wrong, see their clock's rate", asked);
        }
        match quantile(latencies.rows_s.iter().copied(), share) {
            Some(latency_s) => Figure::new(what, 1e3 * latency_s, "ms", asked),
            None => Figure::unavailable(what, "no row came", asked),
        }
    };
    let rate = latencies.rows_s.len() as f64 / measured_s;
    let page = format!("{what}: capture to page, p50");
    vec![
        figure("p50", 0.5, "<= 60"),
        figure("p99", 0.99, "<= 200"),
        Figure::new(format!("{what}: rows"), rate, "1/s", "12"),
        Figure::new(format!("{what}: rate of the rows' clock"), latencies.clock_rate, "s/s", "1.00"),
        match quantile(latencies.page_s.iter().copied(), 0.5) {
            Some(age_s) => Figure::new(page, 1e3 * age_s, "ms", ""),
            None => Figure::unavailable(page, "no stamped picture was seen", ""),
        },
    ]
}
