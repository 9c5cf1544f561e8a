//! The office as films of network cameras, and its truth at any time.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;
use std::time::{Duration, Instant};

use nalgebra::Point2;

use crate::chain::StepResult;
use crate::data::office;
use crate::live::rows::LiveRow;
use crate::network_camera::film::Film;
use crate::network_camera::{CameraOptions, NetworkCamera};

/// Frames a second of the office's videos.
pub const RATE_HZ: f64 = 12.0;
/// Frames of the office's videos.
pub const FRAMES: usize = 300;
/// Number of first frames that show the empty room.
const EMPTY_FRAMES: usize = 20;
/// The room's cameras.
pub const CAMERAS: [&str; 2] = ["cam0", "cam1"];
/// Gate of `tracker eval`, metres: an estimate farther away than this belongs to another person.
const GATE_M: f64 = 0.5;

/// Frames (from 0) of the empty room, `pictures` in all: to and fro through the first frames.
pub fn empty(pictures: usize) -> impl Iterator<Item = usize> {
    to_and_fro(0..EMPTY_FRAMES).take(pictures)
}

/// A range of frames to and fro, without end.
pub fn to_and_fro(frames: Range<usize>) -> impl Iterator<Item = usize> {
    let (first, last) = (frames.start, frames.end - 1);
    frames.chain((first + 1..last).rev()).cycle()
}

/// A range of frames to and fro, without end, as a pendulum swings: it starts in the middle, at the film's speed, and is slower
/// towards both ends, because people stop before they turn round.
pub fn pendulum(frames: Range<usize>) -> impl Iterator<Item = usize> {
    let half = half_of(&frames);
    (0..)
        .map(move |picture| frames.start + (half + half * (f64::from(picture) / half).sin()).round() as usize)
}

/// Period of [`pendulum`]: time until the same frame comes again in the same direction.
pub fn pendulum_period(frames: Range<usize>) -> Duration {
    Duration::from_secs_f64(TAU * half_of(&frames) / RATE_HZ)
}

/// Half the number of frames between the first and the last.
fn half_of(frames: &Range<usize>) -> f64 {
    0.5 * frames.len().saturating_sub(1) as f64
}

/// Frames of the empty room for `empty_s` seconds, then the film again and again, `pictures` in all.
pub fn repeated(empty_s: f64, pictures: usize) -> Vec<usize> {
    let lead = (empty_s * RATE_HZ) as usize;
    empty(lead).chain((0..FRAMES).cycle()).take(pictures).collect()
}

/// Starts both cameras with the same epoch, which is now. Each plays the frames of `order`.
///
/// # Errors
/// As [`NetworkCamera::start`].
pub fn cameras(
    order: &[usize],
    is_stamped: bool,
    options: [CameraOptions; 2],
) -> StepResult<([NetworkCamera; 2], Instant)> {
    let film = |name: &str| {
        let frames = Film::frames(&office().join(format!("video/{name}.mp4")))?;
        Film::encode(&frames, order, is_stamped)
    };
    let films = [film(CAMERAS[0])?, film(CAMERAS[1])?];
    let epoch = Instant::now();
    let [first, second] = films;
    let [of_first, of_second] = options;
    let cameras =
        [NetworkCamera::start(first, of_first, epoch)?, NetworkCamera::start(second, of_second, epoch)?];
    Ok((cameras, epoch))
}

/// `--video` for both cameras.
pub fn videos(cameras: &[NetworkCamera; 2]) -> Vec<String> {
    super::run::videos(CAMERAS.into_iter().zip(cameras.iter().map(NetworkCamera::url)))
}

/// Positions of all people in the office.
#[derive(Debug, Clone)]
pub struct Truth {
    /// For each frame (from 0) ids and places on the floor, metres.
    frames: Vec<BTreeMap<u32, Point2<f64>>>,
}

impl Truth {
    /// Reads the truth of the office.
    ///
    /// # Errors
    /// A file that cannot be read, a row that is none.
    pub fn read() -> StepResult<Self> {
        let path = office().join("truth.txt");
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let mut frames = vec![BTreeMap::new(); FRAMES];
        for line in text.lines() {
            let columns: Vec<f64> = line.split(',').map_while(|value| value.trim().parse().ok()).collect();
            let [frame, id, _, _, _, _, _, x, y, _] = columns[..] else {
                return Err(format!("{}: {line}", path.display()));
            };
            let people = frames.get_mut((frame as usize).wrapping_sub(1));
            let people = people.ok_or_else(|| format!("{}: {line}", path.display()))?;
            people.insert(id as u32, Point2::new(x, y));
        }
        Ok(Self { frames })
    }

    /// Positions of all people at a time since the first frame, seconds. Between two frames, the people who are in
    /// both are interpolated. `None` before the first frame and after the last.
    pub fn at(&self, time_s: f64) -> Option<Vec<(u32, Point2<f64>)>> {
        let frame = time_s * RATE_HZ;
        if frame < 0.0 {
            return None;
        }
        let (before, share) = (self.frames.get(frame as usize)?, frame.fract());
        if share < 1e-9 {
            return Some(before.iter().map(|(id, place)| (*id, *place)).collect());
        }
        let after = self.frames.get(frame as usize + 1)?;
        let between = |(id, place): (&u32, &Point2<f64>)| {
            after.get(id).map(|later| (*id, place + share * (later - place)))
        };
        Some(before.iter().filter_map(between).collect())
    }
}

/// Score of the fit between rows and truth, if the film's first frame is at `first_s` on the run's clock: the number
/// of people who are found; of shifts that find as many, the one with the smaller distances scores higher.
/// (Everything else that MOTA counts, except changes of identity, which no shift alters, follows from it: all rows
/// together have a fixed number of estimates.)
fn score(rows: &[LiveRow], truth: &Truth, first_s: f64) -> f64 {
    let (mut distance_m, mut found) = (0.0, 0);
    for row in rows {
        let Some(people) = truth.at(row.time_s - first_s) else { continue };
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (i, (_, place)) in people.iter().enumerate() {
            let distances = row.people.iter().map(|(_, estimate)| (estimate - place).norm());
            pairs.extend(distances.enumerate().filter(|(_, d)| *d <= GATE_M).map(|(j, d)| (d, i, j)));
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut seen, mut used) = (vec![false; people.len()], vec![false; row.people.len()]);
        for (d, i, j) in pairs {
            if !seen[i] && !used[j] {
                (seen[i], used[j]) = (true, true);
                distance_m += d;
                found += 1;
            }
        }
    }
    // The mean distance is at most the gate, which is less than one person found.
    f64::from(found) - distance_m / f64::from(found.max(1))
}

/// Time of the film's first frame on the clock of a run's rows, seconds: the shift, on a grid of 10 ms, that makes
/// the rows fit best.
pub fn first_frame_s(rows: &[LiveRow], truth: &Truth) -> f64 {
    let (first, last) = match (rows.first(), rows.last()) {
        (Some(first), Some(last)) => (first.time_s, last.time_s),
        _ => (0.0, 0.0),
    };
    let length_s = FRAMES as f64 / RATE_HZ;
    let best = |grid: &mut dyn Iterator<Item = f64>| {
        let scored = grid.map(|shift_s| (score(rows, truth, shift_s), shift_s));
        scored.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, shift_s)| shift_s)
    };
    let steps = ((last - first + length_s) / 0.1) as u32;
    let coarse_s = best(&mut (0..=steps).map(|i| first - length_s + 0.1 * f64::from(i)));
    best(&mut (-15..=15).map(|i| coarse_s + 0.01 * f64::from(i)))
}

/// `MOTChallenge` rows of truth and of tracks for the rows within the film, whose first frame is at `first_s` on the
/// run's clock; frames are the run's.
pub fn matched_rows(rows: &[LiveRow], truth: &Truth, first_s: f64) -> (String, String) {
    let (mut true_rows, mut tracks) = (String::new(), String::new());
    for row in rows {
        let Some(people) = truth.at(row.time_s - first_s) else { continue };
        for (text, people) in [(&mut true_rows, &people), (&mut tracks, &row.people)] {
            for (id, place) in people {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "{},{id},-1,-1,-1,-1,1,{:.4},{:.4},0", row.frame, place.x, place.y);
            }
        }
    }
    (true_rows, tracks)
}

/// Whether each person of the truth is found by an estimate of the row within the gate.
pub fn all_found(row: &LiveRow, people: &[(u32, Point2<f64>)]) -> bool {
    people.iter().all(|(_, place)| row.people.iter().any(|(_, estimate)| (estimate - place).norm() <= GATE_M))
}

/// The room's directory.
pub fn room() -> std::path::PathBuf {
    office().join("room")
}

/// Path of one camera's film.
pub fn video(camera: &str) -> std::path::PathBuf {
    office().join("video").join(Path::new(camera).with_extension("mp4"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a perfect run, on whose clock the film begins at `first_s`, at moments between the frames.
    fn perfect(truth: &Truth, first_s: f64) -> Vec<LiveRow> {
        let row = |i: u32| {
            let time_s = f64::from(i) * 0.09;
            let people = truth.at(time_s - first_s).unwrap_or_default();
            LiveRow { frame: i + 1, time_s, people, found: Instant::now() }
        };
        (0..400).map(row).collect()
    }

    #[test]
    fn the_film_is_found_on_the_runs_clock() {
        let truth = Truth::read().unwrap();
        for first_s in [-2.37, 0.0, 5.62] {
            let rows = perfect(&truth, first_s);
            let found_s = first_frame_s(&rows, &truth);
            assert!((found_s - first_s).abs() < 0.011, "{found_s} for {first_s}");
            let (true_rows, tracks) = matched_rows(&rows, &truth, first_s);
            assert!(true_rows == tracks && true_rows.lines().count() > 300);
        }
    }

    #[test]
    fn truth_between_two_frames_is_in_between() {
        let truth = Truth::read().unwrap();
        let (before, after) = (truth.at(99.0 / 12.0).unwrap()[0].1, truth.at(100.0 / 12.0).unwrap()[0].1);
        let between = truth.at(99.25 / 12.0).unwrap()[0].1;
        assert!((between - (before + 0.25 * (after - before))).norm() < 1e-9);
        assert_eq!((truth.at(-0.01), truth.at(25.0)), (None, None));
        assert_eq!(truth.at(0.0).unwrap().len(), 0);
    }

    #[test]
    fn a_pendulum_starts_in_the_middle_turns_slowly_and_is_never_faster_than_the_film() {
        let period = (pendulum_period(3..10).as_secs_f64() * RATE_HZ).round() as usize;
        let frames: Vec<usize> = pendulum(3..10).take(2 * period).collect();
        assert_eq!((frames[0], frames[1], period), (6, 7, 19));
        assert!(frames.windows(2).all(|pair| pair[0].abs_diff(pair[1]) <= 1));
        for end in [3, 9] {
            assert!(frames.windows(3).any(|three| three.iter().all(|frame| *frame == end)), "{frames:?}");
        }
        assert_eq!(pendulum(5..6).take(3).collect::<Vec<_>>(), [5; 3]);
    }

    #[test]
    fn frames_go_to_and_fro() {
        assert_eq!(to_and_fro(3..6).take(9).collect::<Vec<_>>(), [3, 4, 5, 4, 3, 4, 5, 4, 3]);
    }
}
