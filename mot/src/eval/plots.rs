//! Pictures of an evaluation: HOTA over the strictness, the detection curve, and the tracks of each person.

use std::path::Path;

use image::RgbImage;
use nalgebra::Point2;
use shell::canvas::{Canvas, Color, TextStyle};

use super::instant::Instant;
use super::roc::DetectionCurve;
use super::{Evaluation, Hota};
use crate::Result;
use crate::chart::{self, Axis, Chart, Series};

const LIFE_WIDTH_PX: f64 = 1200.0;
const LIFE_HEIGHT_PX: f64 = 22.0;
const LIFE_LEFT_PX: f64 = 90.0;
const LIFE_TOP_PX: f64 = 46.0;
const LIFE_FOOT_PX: f64 = 28.0;
/// Largest number of people drawn; more would be unreadable.
const MOST_LIVES: usize = 400;

/// Writes `hota.png`, `roc.png` and `lives.png` into a folder, as far as there is something to show.
///
/// # Errors
/// Names the file that could not be written.
pub fn write(folder: &Path, evaluation: &Evaluation, curve: Option<&DetectionCurve>) -> Result<()> {
    if !evaluation.hota.by_threshold.is_empty() {
        chart::save(&hota(&evaluation.hota).draw(), &folder.join("hota.png"))?;
    }
    if let Some(curve) = curve {
        chart::save(&roc(curve).draw(), &folder.join("roc.png"))?;
    }
    if evaluation.scenario.has_identities {
        chart::save(&lives(evaluation), &folder.join("lives.png"))?;
    }
    Ok(())
}

fn hota(hota: &Hota) -> Chart {
    let series = |name: &str, part: fn(&super::HotaScores) -> f64| Series {
        name: name.to_owned(),
        points: Hota::thresholds().zip(&hota.by_threshold).map(|(a, s)| [a, 100.0 * part(s)]).collect(),
        is_line: true,
        color: None,
    };
    Chart {
        title: "HOTA over the strictness".to_owned(),
        x: Axis::new("least similarity of a match", [0.0, 1.0]),
        y: Axis::new("%", [0.0, 100.0]),
        series: vec![series("HOTA", |s| s.hota), series("DetA", |s| s.det_a), series("AssA", |s| s.ass_a)],
    }
}

fn roc(curve: &DetectionCurve) -> Chart {
    let points: Vec<[f64; 2]> =
        curve.points.iter().map(|p| [p.false_positives_per_frame, 100.0 * p.recall]).collect();
    Chart {
        title: format!("detections (average precision {:.1} %)", 100.0 * curve.average_precision),
        x: Axis::fitting("false positives per frame", points.iter().map(|p| p[0]), [0.0, 0.5]),
        y: Axis::new("found, % of the truth", [0.0, 100.0]),
        series: vec![Series { name: String::new(), points, is_line: true, color: None }],
    }
}

/// A strip for each person: the colour of the matching track, pale without one.
fn lives(evaluation: &Evaluation) -> RgbImage {
    let scenario = &evaluation.scenario;
    let people = scenario.people.min(MOST_LIVES);
    let bottom = LIFE_TOP_PX + LIFE_HEIGHT_PX * people as f64;
    let mut canvas = Canvas::new(LIFE_WIDTH_PX as u32, (bottom + LIFE_FOOT_PX) as u32, Color::PAPER);
    let text = TextStyle::new(14.0).color(Color::INK);
    let title = "matched tracks: one strip per person, one colour per track, grey while no track matches";
    canvas.text(Point2::new(12.0, 12.0), title, &text.bold().anchor(0.0, 0.0));
    let frame = |instant: Option<&Instant>| instant.map_or(1.0, |i| f64::from(i.frame));
    let (first, last) = (frame(scenario.instants.first()), frame(scenario.instants.last()));
    let width = (LIFE_WIDTH_PX - LIFE_LEFT_PX - 12.0) / (last - first + 1.0);
    let at = |frame: f64| LIFE_LEFT_PX + (frame - first) * width;
    for person in 0..people {
        let top = LIFE_TOP_PX + LIFE_HEIGHT_PX * person as f64;
        for life in track_stretches(evaluation, person) {
            let color = life.track.map_or(Color::PAPER.mix(Color::INK, 0.15), |t| Color::of_id(t as u32 + 1));
            let (left, right) = (at(f64::from(life.first)), at(f64::from(life.last) + 1.0));
            let low = top + LIFE_HEIGHT_PX - 4.0;
            let corners = [[left, top], [right, top], [right, low], [left, low]];
            canvas.fill_polygon(&corners.map(|[x, y]| Point2::new(x, y)), color);
        }
    }
    for (person, id) in scenario.people_ids.iter().enumerate().take(people) {
        let middle = LIFE_TOP_PX + LIFE_HEIGHT_PX * (person as f64 + 0.5) - 2.0;
        canvas.text(Point2::new(LIFE_LEFT_PX - 10.0, middle), &format!("{id}"), &text.anchor(1.0, 0.5));
    }
    for frame in Axis::new("", [first, last]).whole().ticks() {
        let x = at(frame + 0.5);
        canvas.text(Point2::new(x, bottom + 2.0), &format!("{frame}"), &text.anchor(0.5, 0.0));
    }
    canvas.text(Point2::new(LIFE_LEFT_PX - 10.0, bottom + 2.0), "frame", &text.anchor(1.0, 0.0));
    canvas.into_image()
}

/// A part of a person's life with one matching track, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct TrackStretch {
    first: u32,
    last: u32,
    track: Option<usize>,
}

/// Stretches of a person's life; frames in which they are absent divide it.
fn track_stretches(evaluation: &Evaluation, person: usize) -> Vec<TrackStretch> {
    let mut life: Vec<TrackStretch> = Vec::new();
    for instant in evaluation.scenario.instants.iter().filter(|i| i.truth.contains(&person)) {
        let track = instant.matches.iter().find(|m| m.person == person).map(|m| m.track);
        match life.last_mut() {
            Some(now) if now.track == track && now.last + 1 == instant.frame => now.last = instant.frame,
            _ => life.push(TrackStretch { first: instant.frame, last: instant.frame, track }),
        }
    }
    life
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::EvalOptions;
    use crate::rows::RowFile;

    #[test]
    fn a_life_is_parted_where_another_track_or_none_stands_for_somebody() {
        let rows = |frames: &[(u32, u32)]| {
            let line = |(frame, id): &(u32, u32)| format!("{frame},{id},-1,-1,-1,-1,1,0,0,0\n");
            RowFile::parse("rows.txt".as_ref(), &frames.iter().map(line).collect::<String>()).unwrap()
        };
        let truth = rows(&[3, 4, 5, 6, 7, 9, 10].map(|f| (f, 1)));
        let tracks = rows(&[(3, 4), (4, 4), (6, 4), (7, 8), (9, 8), (10, 8)]);
        let evaluation = Evaluation::of_rows(&truth, &tracks, &EvalOptions::default(), None).unwrap();
        let found: Vec<_> =
            track_stretches(&evaluation, 0).iter().map(|s| (s.first, s.last, s.track)).collect();
        let expected = [(3, 4, Some(0)), (5, 5, None), (6, 6, Some(0)), (7, 7, Some(1)), (9, 10, Some(1))];
        assert_eq!(found, expected);
        // The strips begin where the recording does.
        let image = lives(&evaluation);
        let middle = (LIFE_TOP_PX + 0.5 * LIFE_HEIGHT_PX) as u32;
        let color = Color::of_id(1);
        assert_eq!(image.get_pixel(LIFE_LEFT_PX as u32 + 3, middle).0, [color.r, color.g, color.b]);
    }
}
