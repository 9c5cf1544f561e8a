//! Accuracy of the office's tracks, from cameras whose clocks disagree: live, and from recordings.

use std::path::Path;
use std::time::{Duration, Instant};

use calib::video::{FilmWriter, FrameSource};
use image::RgbImage;

use crate::chain::{StepResult, Tracking, evaluate_against};
use crate::live::Figure;
use crate::live::office::{self, CAMERAS, FRAMES, RATE_HZ, Truth};
use crate::live::rows::{self, LiveRow};
use crate::live::run::{LiveRun, Scratch, videos};
use crate::network_camera::{AtEnd, CameraOptions};

/// Time for which the cameras show the empty room before the film begins, seconds.
const EMPTY_S: f64 = 8.0;
/// Number of frames by which the second recording begins later: 1.33 s.
const LATER_FRAMES: usize = 16;
/// Longest time that a run of recordings may take.
const LONGEST: Duration = Duration::from_mins(5);

/// Evaluates rows of a run against the truth at their times. The time of the film's first frame on the run's clock is
/// estimated.
fn judged(rows: &[LiveRow], room: &Path, scratch: &Scratch) -> StepResult<Tracking> {
    let truth = Truth::read()?;
    let first_s = office::first_frame_s(rows, &truth);
    let (true_rows, tracks) = office::matched_rows(rows, &truth, first_s);
    let (path, out) = (scratch.path("truth.txt"), scratch.path("judged"));
    std::fs::create_dir_all(&out).map_err(|e| e.to_string())?;
    std::fs::write(&path, true_rows).map_err(|e| e.to_string())?;
    std::fs::write(out.join("tracks.txt"), tracks).map_err(|e| e.to_string())?;
    evaluate_against(&path, &office::room(), room, &out)
}

fn figures(what: &str, tracking: StepResult<Tracking>, asked: [&'static str; 3]) -> Vec<Figure> {
    match tracking {
        Ok(tracking) => vec![
            Figure::new(format!("{what}: MOTA"), tracking.mota, "%", asked[0]),
            Figure::new(format!("{what}: IDF1"), tracking.idf1, "%", asked[1]),
            Figure::new(format!("{what}: mean error"), 100.0 * tracking.mean_m, "cm", asked[2]),
        ],
        Err(why) => vec![Figure::unavailable(format!("{what}: MOTA"), why, asked[0])],
    }
}

/// The office from two network cameras: clocks 0.4 s apart, one drifting by 200 ppm, 80 ms of jitter, 2 % of the
/// pictures lost. Further arguments go to `tracker run`.
pub fn live(seed: u64, arguments: &[&str]) -> Vec<Figure> {
    let what =
        ["office, two network cameras of different clocks"].into_iter().chain(arguments.iter().copied());
    let what = what.collect::<Vec<_>>().join(" ");
    figures(&what, follow_live(seed, arguments), [">= 96", ">= 97", "<= 7"])
}

fn follow_live(seed: u64, arguments: &[&str]) -> StepResult<Tracking> {
    let options = CameraOptions {
        jitter_s: 0.08,
        loss: 0.02,
        seed: 2 * seed,
        at_end: AtEnd::Black,
        ..CameraOptions::default()
    };
    let other = CameraOptions { delay_s: 0.4, drift_ppm: 200.0, seed: 2 * seed + 1, ..options.clone() };
    let lead = (EMPTY_S * RATE_HZ) as usize;
    let order: Vec<usize> = office::empty(lead).chain(0..FRAMES).collect();
    let (cameras, epoch) = office::cameras(&order, false, [options, other])?;
    let scratch = Scratch::new()?;
    let mut given = office::videos(&cameras);
    given.push("--no-film".to_owned());
    given.extend(arguments.iter().map(|argument| (*argument).to_owned()));
    let mut run = LiveRun::start(&office::room(), &scratch.path("out"), &given)?;
    // The run ends before the later camera shows its last picture.
    run.wait_until(epoch + Duration::from_secs_f64(order.len() as f64 / RATE_HZ))?;
    let ended = run.interrupt()?;
    judged(&ended.rows, &office::room(), &scratch)
}

/// Two recordings of the office with unknown offset, the second begun 1.33 s later: the estimated offset, and the
/// tracks.
pub fn recordings() -> Vec<Figure> {
    let what = "two recordings, one begun 1.33 s later, --offset auto";
    match follow_recordings() {
        Ok((offset, tracking)) => {
            let error = format!("{what}: error of the offset");
            let mut all = vec![match offset {
                Ok(offset_s) => {
                    let truth_s = LATER_FRAMES as f64 / RATE_HZ;
                    Figure::new(error, 1e3 * (offset_s - truth_s).abs(), "ms", "<= 40")
                }
                Err(why) => Figure::unavailable(error, why, "<= 40"),
            }];
            all.extend(figures(what, tracking, [">= 96", "", ""]));
            all
        }
        Err(why) => vec![Figure::unavailable(what, why, ">= 96")],
    }
}

fn follow_recordings() -> StepResult<(StepResult<f64>, StepResult<Tracking>)> {
    let scratch = Scratch::new()?;
    let (early, late) = (office::video(CAMERAS[0]), scratch.path("late.mp4"));
    trimmed(&office::video(CAMERAS[1]), LATER_FRAMES, &late)?;
    let specs = [&early, &late].map(|path| path.display().to_string());
    let mut given = videos(CAMERAS.into_iter().zip(specs));
    given.extend(["--no-film", "--offset", "auto"].map(str::to_owned));
    let out = scratch.path("out");
    LiveRun::start(&office::room(), &out, &given)?.finish(Instant::now() + LONGEST)?;
    let rows = rows::read(&out.join("tracks.jsonl"))?;
    Ok((offset_s(&out), judged(&rows, &office::room(), &scratch)))
}

/// Writes a video without its first frames.
fn trimmed(video: &Path, frames: usize, to: &Path) -> StepResult<()> {
    let spec = video.to_str().ok_or("the video's path is not UTF-8")?;
    let mut source = FrameSource::open(spec).map_err(|e| e.to_string())?;
    let (width, height) = source.size();
    let mut film = FilmWriter::create(to, width, height, RATE_HZ).map_err(|e| e.to_string())?;
    let (mut frame, mut number) = (RgbImage::default(), 0);
    while source.read(&mut frame).map_err(|e| e.to_string())? {
        number += 1;
        if number > frames {
            film.write(&frame).map_err(|e| e.to_string())?;
        }
    }
    film.finish().map_err(|e| e.to_string())
}

/// Offset of the second camera against the first, seconds, from `timings.json`.
fn offset_s(out: &Path) -> StepResult<f64> {
    let path = out.join("timings.json");
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let json: serde_json::Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let clocks = json["offsets"].as_array().ok_or("timings.json has no offsets")?;
    let of = |camera: &str| clocks.iter().find(|clock| clock["camera"] == camera)?["offset_s"].as_f64();
    // The reference camera may be left out.
    match CAMERAS.map(of) {
        [None, None] => Err("timings.json: no offset is known".into()),
        [first, second] => Ok(second.unwrap_or(0.0) - first.unwrap_or(0.0)),
    }
}
