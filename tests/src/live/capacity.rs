//! Capacity: number of cameras followed in real time, and moments a second.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::chain::{StepResult, Tracking, evaluate_against};
use crate::data::office;
use crate::live::Figure;
use crate::live::films::{self, RecordedRoom};
use crate::live::office::FRAMES;
use crate::live::run::{EndedRun, LiveRun, Scratch, videos};

/// Longest time that a run may take.
const LONGEST: Duration = Duration::from_mins(30);
/// Frames a second of the cameras that are to be followed.
const CAMERA_RATE_HZ: f64 = 15.0;
/// First row that counts for the rate of moments: by then the backgrounds are learnt.
const FIRST_ROWS: usize = 25;

/// Runs over recordings to their end; returns also the duration of the process, seconds.
fn follow(recorded: &RecordedRoom, out: &Path, arguments: &[&str]) -> StepResult<(EndedRun, f64)> {
    let specs = recorded.videos.iter().map(|(name, film)| (name.as_str(), film.display().to_string()));
    let mut given = videos(specs);
    given.extend(arguments.iter().map(|argument| (*argument).to_owned()));
    let started = Instant::now();
    let ended = LiveRun::start(&recorded.room, out, &given)?.finish(started + LONGEST)?;
    Ok((ended, started.elapsed().as_secs_f64()))
}

/// Moments a second, by the times at which the rows came to the disk, without the first rows.
fn moments_per_s(ended: &EndedRun) -> StepResult<f64> {
    match (ended.rows.get(FIRST_ROWS), ended.rows.last()) {
        (Some(first), Some(last)) if last.found > first.found => {
            let moments = (ended.rows.len() - 1 - FIRST_ROWS) as f64;
            Ok(moments / (last.found - first.found).as_secs_f64())
        }
        _ => Err(format!("only {} rows came", ended.rows.len())),
    }
}

/// Number of cameras of 1920 × 1080 and 15 frames/s with a wide lens that are followed in real time, from a run with
/// `cameras` of them; and the loss of MOTA against masks at full size. The films are H.264 where this FFmpeg has an
/// encoder for it.
pub fn full_hd(cameras: usize) -> Vec<Figure> {
    let what = format!("{cameras} cameras of 1920 × 1080, k1 = −0.3");
    let rate = |arguments: &[&str]| -> StepResult<f64> {
        let (recorded, scratch) = (films::office_full_hd(cameras / 2, 1)?, Scratch::new()?);
        let moments = moments_per_s(&follow(&recorded, &scratch.path("out"), arguments)?.0)?;
        Ok(moments * recorded.videos.len() as f64 / CAMERA_RATE_HZ)
    };
    let figure = |with: &str, rate: StepResult<f64>, asked| {
        let what = format!("{what}, {with}: followed in real time");
        match rate {
            Ok(rate) => Figure::new(what, rate, "cameras", asked),
            Err(why) => Figure::unavailable(what, why, asked),
        }
    };
    vec![figure("no film", rate(&["--no-film"]), ">= 8"), figure("films of all", rate(&[]), ">= 4")]
}

/// MOTA of the office at 1920 × 1080 through a wide lens, at the working size and at full size.
pub fn working_size() -> Vec<Figure> {
    let what = "two cameras of 1920 × 1080, k1 = −0.3";
    let tracking = |arguments: &[&str]| -> StepResult<Tracking> {
        let (recorded, scratch) = (films::office_full_hd(1, 1)?, Scratch::new()?);
        let out = scratch.path("out");
        follow(&recorded, &out, &[&["--no-film"], arguments].concat())?;
        evaluate_against(&office().join("truth.txt"), &office().join("room"), &recorded.room, &out)
    };
    let (usual, full) = (tracking(&[]), tracking(&["--mask-width", "1920"]));
    let loss = match (&usual, &full) {
        (Ok(usual), Ok(full)) => Ok(full.mota - usual.mota),
        (Err(why), _) | (_, Err(why)) => Err(why.clone()),
    };
    let figure = |what: String, value: StepResult<f64>, asked| match value {
        Ok(value) => Figure::new(what, value, "%", asked),
        Err(why) => Figure::unavailable(what, why, asked),
    };
    vec![
        figure(format!("{what}: MOTA"), usual.map(|tracking| tracking.mota), ""),
        figure(format!("{what}: loss of MOTA against masks of full size"), loss, "<= 0.5"),
    ]
}

/// Office from its files: frames a second of the whole run without and with films, and whether one thread and two
/// give the same bytes.
pub fn office_from_files() -> Vec<Figure> {
    let recorded = films::office_recorded();
    let rate = |arguments: &[&str]| -> StepResult<f64> {
        let scratch = Scratch::new()?;
        let (_, seconds) = follow(&recorded, &scratch.path("out"), arguments)?;
        Ok(FRAMES as f64 / seconds)
    };
    let figure = |what: &str, rate: StepResult<f64>, asked| match rate {
        Ok(rate) => Figure::new(what, rate, "frames/s", asked),
        Err(why) => Figure::unavailable(what, why, asked),
    };
    let equal = match equal_bytes(&recorded) {
        Ok(equal) => Figure::new(
            "office from files: equal bytes at 1 and 2 threads",
            f64::from(u8::from(equal)),
            "",
            "1",
        ),
        Err(why) => Figure::unavailable("office from files: equal bytes at 1 and 2 threads", why, "1"),
    };
    vec![
        figure("office from files, no film", rate(&["--no-film"]), ">= 200"),
        figure("office from files, with films", rate(&[]), ">= 120"),
        equal,
    ]
}

fn equal_bytes(recorded: &RecordedRoom) -> StepResult<bool> {
    let scratch = Scratch::new()?;
    let mut bytes = Vec::new();
    for threads in ["1", "2"] {
        let out = scratch.path(threads);
        follow(recorded, &out, &["--no-film", "--threads", threads])?;
        bytes.push(track_bytes(&out)?);
    }
    Ok(bytes[0] == bytes[1])
}

/// The bytes of a run's tracks.
///
/// # Errors
/// A file that cannot be read.
pub fn track_bytes(out: &Path) -> StepResult<[Vec<u8>; 2]> {
    let read = |name: &str| std::fs::read(out.join(name)).map_err(|e| format!("{name}: {e}"));
    Ok([read("tracks.txt")?, read("tracks.jsonl")?])
}

/// Moments a second in a synthetic hall with six people and six cameras of 640 × 480 with distortion.
pub fn hall() -> Vec<Figure> {
    let what = "six cameras with distortion, 640 × 480, six people";
    let rate = || -> StepResult<f64> {
        let (recorded, scratch) = (films::Hall::SIX_WIDE_CAMERAS.recorded()?, Scratch::new()?);
        moments_per_s(&follow(&recorded, &scratch.path("out"), &["--no-film"])?.0)
    };
    match rate() {
        Ok(rate) => vec![Figure::new(what, rate, "moments/s", ">= 60")],
        Err(why) => vec![Figure::unavailable(what, why, ">= 60")],
    }
}
