//! Outages: a camera that falls silent and comes back, and all cameras away.

use std::time::{Duration, Instant};

use crate::chain::StepResult;
use crate::live::Figure;
use crate::live::office::{self, RATE_HZ, Truth};
use crate::live::page::{self, Sighting};
use crate::live::rows::LiveRow;
use crate::live::run::{LiveRun, Scratch};
use crate::network_camera::{CameraOptions, Fault, Outage};

/// Time for which both cameras work before one fails, seconds…
const BEFORE_S: f64 = 12.0;
/// …of which the first seconds are for the run to start…
const START_S: f64 = 7.0;
/// …time after its return before its pictures are judged…
const SETTLE_S: f64 = 2.0;
/// …and time for which they are judged.
const JUDGED_S: f64 = 10.0;

/// Misalignment of two cameras in pictures, before and after an outage of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misalignment {
    /// Greatest misalignment before the outage; `None` if no moment was seen.
    pub before: Option<f64>,
    /// Greatest misalignment after the outage; `None` if no moment was seen.
    pub after: Option<f64>,
}

/// The greatest difference between the two cameras' stamps, in pictures.
fn greatest<'a>(sightings: impl Iterator<Item = &'a Sighting>) -> Option<f64> {
    let differences = sightings.filter_map(|sighting| match sighting.stamps[..] {
        [Some(first), Some(second)] => Some(f64::from(first.abs_diff(second))),
        _ => None,
    });
    differences.max_by(f64::total_cmp)
}

/// Follows the office while `cam1` is silent for `silent_s` seconds with its connection open, and reads from the page
/// which pictures are taken for one moment.
///
/// # Errors
/// The run's line, if it fails.
pub fn misalignment(silent_s: f64) -> StepResult<Misalignment> {
    let back_s = BEFORE_S + silent_s;
    let until_s = back_s + SETTLE_S + JUDGED_S;
    // The film is longer than the run, so it never repeats, and stamps are unique.
    let order = office::repeated(START_S, ((until_s + JUDGED_S) * RATE_HZ) as usize);
    let silence = Outage { from_s: BEFORE_S, until_s: back_s, fault: Fault::Silent };
    let silent = CameraOptions { faults: vec![silence], ..CameraOptions::default() };
    let (cameras, epoch) = office::cameras(&order, true, [CameraOptions::default(), silent])?;
    let at = move |s: f64| epoch + Duration::from_secs_f64(s);
    let scratch = Scratch::new()?;
    let mut given = office::videos(&cameras);
    given.push("--no-film".to_owned());
    let mut run = LiveRun::start_with_page(&office::room(), &scratch.path("out"), &given)?;
    let page = run.page().ok_or("the run has no page")?;
    let watcher = std::thread::spawn(move || page::watch(page, at(until_s)));
    run.wait_until(at(until_s))?;
    let sightings = watcher.join().map_err(|_| "the page's watcher failed")?;
    run.interrupt()?;
    let within = |from_s: f64, until_s: f64| {
        greatest(sightings.iter().filter(move |s| (at(from_s)..at(until_s)).contains(&s.seen)))
    };
    Ok(Misalignment {
        before: within(START_S, BEFORE_S),
        after: within(back_s + SETTLE_S, until_s + JUDGED_S),
    })
}

/// [`misalignment`] as figures.
pub fn silent(silent_s: f64) -> Vec<Figure> {
    let what = format!("one camera silent for {silent_s} s");
    let figure = |when: &str, value: Option<f64>, asked| {
        let what = format!("{what}: greatest misalignment {when}");
        match value {
            Some(frames) => Figure::new(what, frames, "frames", asked),
            None => Figure::unavailable(what, "no moment with both cameras was seen on the page", asked),
        }
    };
    match misalignment(silent_s) {
        Ok(found) => vec![figure("before", found.before, ""), figure("afterwards", found.after, "<= 1")],
        Err(why) => vec![Figure::unavailable(what, why, "<= 1")],
    }
}

/// Frames of the office, from 0, with all three people inside, away from the doors.
const ALL_INSIDE: std::ops::Range<usize> = 225..265;
/// Time after which people who have not been reported count as never reported, seconds.
const LONGEST_S: f64 = 20.0;

/// Result of a run while all cameras were away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Absence {
    /// Rows before the cameras went away.
    pub rows_before: usize,
    /// Time from the cameras' return to the first row with any person, seconds; `None` if there is none.
    pub first_s: Option<f64>,
    /// Time from the cameras' return to the first row with all people, seconds; `None` if there is none.
    pub all_s: Option<f64>,
}

/// Follows the empty office, whose cameras refuse connections for `away_s` seconds; when they are back, three people
/// are inside.
///
/// # Errors
/// The run's line, if it ends.
pub fn all_away(away_s: f64) -> StepResult<Absence> {
    let back_s = BEFORE_S + away_s;
    let until_s = back_s + LONGEST_S;
    let count = |seconds: f64| (seconds * RATE_HZ) as usize;
    let inside = office::to_and_fro(ALL_INSIDE).take(count(LONGEST_S + JUDGED_S));
    let order: Vec<usize> = office::empty(count(back_s)).chain(inside).collect();
    let away = Outage { from_s: BEFORE_S, until_s: back_s, fault: Fault::Refused };
    let options = CameraOptions { faults: vec![away], ..CameraOptions::default() };
    let (cameras, epoch) = office::cameras(&order, false, [options.clone(), options])?;
    let at = move |s: f64| epoch + Duration::from_secs_f64(s);
    let scratch = Scratch::new()?;
    let mut given = office::videos(&cameras);
    given.push("--no-film".to_owned());
    let mut run = LiveRun::start(&office::room(), &scratch.path("out"), &given)?;
    run.wait_until(at(BEFORE_S))?;
    let rows_before = run.rows().len();
    run.wait_until(at(back_s))?;
    let truth = Truth::read()?;
    let since = |found: Instant| found.checked_duration_since(at(back_s)).map(|late| late.as_secs_f64());
    let people = |found: Instant| {
        let picture = (found.checked_duration_since(epoch)?.as_secs_f64() * RATE_HZ) as usize;
        truth.at(*order.get(picture)? as f64 / RATE_HZ)
    };
    let (mut first_s, mut all_s) = (None, None);
    run.wait_for(at(until_s), |rows| {
        let mut back = rows.iter().filter(|row| since(row.found).is_some());
        first_s = back.clone().find(|row| !row.people.is_empty()).and_then(|row| since(row.found));
        let everybody =
            |row: &&LiveRow| people(row.found).is_some_and(|people| office::all_found(row, &people));
        all_s = back.find(everybody).and_then(|row| since(row.found));
        all_s.is_some()
    })?;
    run.interrupt()?;
    Ok(Absence { rows_before, first_s, all_s })
}

/// [`all_away`] as figures.
pub fn away(away_s: f64) -> Vec<Figure> {
    let what = format!("all cameras away for {away_s} s");
    let figure = |when: &str, value: Option<f64>, asked| {
        let what = format!("{what}: {when}");
        match value {
            Some(seconds) => Figure::new(what, seconds, "s", asked),
            None => Figure::unavailable(what, format!("not within {LONGEST_S} s"), asked),
        }
    };
    match all_away(away_s) {
        Ok(found) => vec![
            figure("somebody of those who came in meanwhile is told after", found.first_s, ""),
            figure("all three who came in meanwhile are told after", found.all_s, "<= 2"),
        ],
        Err(why) => vec![Figure::unavailable(what, format!("the run ended: {why}"), "<= 2")],
    }
}
