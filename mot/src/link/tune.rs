//! Thresholds by cross-validation, and the paper's experiment (section 6, table 1, figure 9).
//!
//! The recording is cut into folds. Each fold is linked with the thresholds that were best on all others, so reported
//! results were never tuned on their own data.

use std::fmt::Write;

use rayon::prelude::*;
use serde::Serialize;

use super::detection::Detections;
use super::{LinkOptions, Linked, link};
use crate::eval::{Continuity, EvalOptions, Evaluation, FrameRange, FrameSelection};
use crate::rows::{Row, RowFile};
use crate::{Error, Result};

/// Tested thresholds, in median box heights (for areas: in median areas).
const DISTANCES: [f64; 5] = [0.08, 0.12, 0.18, 0.28, 0.42];
const AREA_CHANGES: [f64; 3] = [0.15, 0.35, 0.8];
const TURNS: [f64; 6] = [0.04, 0.07, 0.11, 0.17, 0.26, 0.4];

/// Score of a setting.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize)]
pub struct TuningScore {
    /// People tracked from their first frame to their last by one track, percent: the paper's measure.
    pub success: f64,
    /// IDF1, percent: decides between equal successes.
    pub idf1: f64,
}

/// Result of one fold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fold {
    /// First and last frame.
    pub frames: [u32; 2],
    /// Thresholds that were best on all other folds.
    pub chosen: Chosen,
    /// Score of those thresholds on this fold.
    pub score: TuningScore,
    /// Number of people in the fold.
    pub people: usize,
}

/// Thresholds, as options of `tracker link`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Chosen {
    /// `--max-distance`
    pub max_distance: f64,
    /// `--max-area-change`
    pub max_area_change: f64,
    /// `--direction-threshold`, where the constraint is used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction_threshold: Option<f64>,
    /// `--skip`
    pub skip: u32,
}

/// Result of a cross-validation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CrossValidation {
    /// Results of the folds.
    pub folds: Vec<Fold>,
    /// Score over all folds' people together (IDF1: mean of the folds).
    pub score: TuningScore,
    /// Thresholds that are best on all folds together: those to use.
    pub best: Chosen,
}

/// Options of a cross-validation.
#[derive(Debug, Clone, PartialEq)]
pub struct TuneOptions {
    /// Number of folds.
    pub folds: usize,
    /// Whether the direction constraint is used.
    pub direction: bool,
    /// All options that are not tuned: costs, gap, skip; a given threshold stays as it is.
    pub link: LinkOptions,
}

/// Score and number of people of one fold and setting.
type Tried = (TuningScore, usize);

/// Cross-validates the thresholds on folds of a recording.
///
/// # Errors
/// Fewer than 2 folds or more than there are frames; truth without ids; errors of linking and of the evaluator.
pub fn cross_validate(
    detections: &RowFile,
    truth: &RowFile,
    options: &TuneOptions,
) -> Result<CrossValidation> {
    if truth.rows.iter().any(|r| r.id.is_none()) {
        return Err(Error::content(&truth.path, "whole file", "has no ids; tracks are tuned on who is who"));
    }
    // Frames without truth cannot be learnt from or judged.
    let frames = truth.rows.iter().map(|r| r.frame);
    let known = frames.clone().min().unwrap_or(0)..=frames.max().unwrap_or(0);
    let mut all = Detections::from_rows(detections, |row| options.link.wants(row))?;
    all.all.retain(|d| known.contains(&d.frame));
    let ranges = fold_ranges(&all, options.folds)?;
    let settings = settings(&all, options);
    let folds: Vec<Detections> = ranges
        .iter()
        .map(|range| Detections {
            all: all.all.iter().filter(|d| (range.first..=range.last).contains(&d.frame)).cloned().collect(),
            on_floor: all.on_floor,
        })
        .collect();
    let tried: Vec<Vec<Tried>> = settings
        .par_iter()
        .map(|setting| {
            let options = with(&options.link, setting);
            let fold = |(detections, range): (&Detections, &FrameRange)| {
                try_fold(detections, truth, *range, &options)
            };
            folds.iter().zip(&ranges).map(fold).collect::<Result<Vec<Tried>>>()
        })
        .collect::<Result<_>>()?;
    // Index of the best setting on all folds but one; `None` leaves none out.
    let best_without = |left_out: Option<usize>| -> usize {
        let of = |setting: &[Tried]| {
            together(setting.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, t)| *t))
        };
        let mut best = 0;
        for index in 1..tried.len() {
            if of(&tried[index]) > of(&tried[best]) {
                best = index;
            }
        }
        best
    };
    let folds: Vec<Fold> = ranges
        .iter()
        .enumerate()
        .map(|(fold, range)| {
            let chosen = best_without(Some(fold));
            let (score, people) = tried[chosen][fold];
            Fold { frames: [range.first, range.last], chosen: settings[chosen], score, people }
        })
        .collect();
    Ok(CrossValidation {
        score: together(folds.iter().map(|f| (f.score, f.people))),
        best: settings[best_without(None)],
        folds,
    })
}

/// Success over all people, and the folds' mean IDF1.
fn together(folds: impl Iterator<Item = Tried> + Clone) -> TuningScore {
    let (count, people) = folds.clone().fold((0, 0), |(n, p), (_, people)| (n + 1, p + people));
    let sum =
        folds.fold((0.0, 0.0), |s, (score, people)| (s.0 + score.success * people as f64, s.1 + score.idf1));
    TuningScore { success: sum.0 / people.max(1) as f64, idf1: sum.1 / f64::from(count.max(1)) }
}

/// Contiguous ranges of equal length.
fn fold_ranges(detections: &Detections, folds: usize) -> Result<Vec<FrameRange>> {
    let (Some(first), Some(last)) = (detections.all.first(), detections.all.last()) else {
        return Err(Error::option("folds", "there is no detection in the frames of the truth"));
    };
    let frames = last.frame - first.frame + 1;
    if folds < 2 || folds as u64 > u64::from(frames) {
        return Err(Error::option("folds", format!("is {folds}; give 2 to {frames}, the frames there are")));
    }
    let cut = |i: usize| first.frame + (u64::from(frames) * i as u64 / folds as u64) as u32;
    Ok((0..folds).map(|i| FrameRange { first: cut(i), last: cut(i + 1) - 1 }).collect())
}

/// All combinations of thresholds, scaled to the recording.
fn settings(detections: &Detections, options: &TuneOptions) -> Vec<Chosen> {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(1.0)
    };
    let height = median(detections.all.iter().map(super::detection::Detection::scale).collect());
    let area = median(detections.all.iter().map(super::detection::Detection::area).collect());
    // People move farther between frames when some are skipped.
    let stride = f64::from(options.link.skip + 1);
    let or = |given: Option<f64>, tried: &[f64], unit: f64| {
        given.map_or_else(|| tried.iter().map(|t| t * unit).collect(), |fixed| vec![fixed])
    };
    let distances = or(options.link.max_distance, &DISTANCES, height * stride.sqrt());
    let changes = or(options.link.max_area_change_px2, &AREA_CHANGES, area);
    let turns: Vec<Option<f64>> = if options.direction {
        or(options.link.direction_threshold, &TURNS, height * stride.sqrt()).into_iter().map(Some).collect()
    } else {
        vec![None]
    };
    let mut settings = Vec::with_capacity(distances.len() * changes.len() * turns.len());
    for max_distance in &distances {
        for max_area_change in &changes {
            settings.extend(turns.iter().map(|direction_threshold| Chosen {
                max_distance: *max_distance,
                max_area_change: *max_area_change,
                direction_threshold: *direction_threshold,
                skip: options.link.skip,
            }));
        }
    }
    settings
}

fn with(options: &LinkOptions, chosen: &Chosen) -> LinkOptions {
    LinkOptions {
        max_distance: Some(chosen.max_distance),
        max_area_change_px2: Some(chosen.max_area_change),
        direction_threshold: chosen.direction_threshold,
        ..options.clone()
    }
}

fn try_fold(
    detections: &Detections,
    truth: &RowFile,
    range: FrameRange,
    options: &LinkOptions,
) -> Result<Tried> {
    let linked = row_file(&link(detections, options)?);
    let frames = FrameSelection { range: Some(range), annotated: None };
    let evaluation =
        Evaluation::of_rows(truth, &linked, &EvalOptions { frames, ..EvalOptions::default() }, None)?;
    let success = evaluation.clear.continuity.as_ref().and_then(Continuity::success);
    let percent = |share: Option<f64>| 100.0 * share.unwrap_or(0.0);
    let score = TuningScore { success: percent(success), idf1: percent(evaluation.identity.idf1()) };
    Ok((score, evaluation.scenario.people))
}

/// Converts linked tracks to rows, as if they had been written and read.
fn row_file(linked: &Linked) -> RowFile {
    let rows = linked.ids.iter().zip(&linked.tracks).flat_map(|(id, track)| {
        track.iter().map(|row| Row {
            line: 0,
            frame: row.frame,
            id: Some(*id),
            confidence: row.score,
            pixel_box: row.pixel_box,
            position: row.pixel_box.is_none().then_some(row.place),
            class_column: None,
            visibility_column: None,
        })
    });
    RowFile { path: "linked tracks".into(), rows: rows.collect() }
}

impl Chosen {
    /// The thresholds as flags of `tracker link`.
    pub fn flags(&self) -> String {
        let mut text =
            format!("--max-distance {:.1} --max-area-change {:.0}", self.max_distance, self.max_area_change);
        if let Some(threshold) = self.direction_threshold {
            // Writing to a string cannot fail.
            let _ = write!(text, " --direction-threshold {threshold:.1}");
        }
        if self.skip > 0 {
            let _ = write!(text, " --skip {}", self.skip);
        }
        text
    }
}

impl CrossValidation {
    /// Text table with a line a fold, and the thresholds to use.
    pub fn table(&self) -> String {
        let mut text = format!(
            "{:>15} {:>7} {:>10} {:>8}  thresholds, best on the other folds\n",
            "frames", "people", "success", "IDF1"
        );
        let line = |what: &str, people: usize, score: &TuningScore, rest: &str| {
            format!("{what:>15} {people:>7} {:>8.1} % {:>6.1} %  {rest}\n", score.success, score.idf1)
        };
        for fold in &self.folds {
            let frames = format!("{}-{}", fold.frames[0], fold.frames[1]);
            text += &line(&frames, fold.people, &fold.score, &fold.chosen.flags());
        }
        let people = self.folds.iter().map(|f| f.people).sum();
        text += &line("together", people, &self.score, "");
        text + &format!("best on all: {}\n", self.best.flags())
    }
}
