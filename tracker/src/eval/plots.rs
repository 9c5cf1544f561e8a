//! Pictures of an evaluation: HOTA over the strictness, the detection curve, everybody's life.

use std::path::Path;

use image::RgbImage;
use nalgebra::Point2;
use scenes::canvas::{Canvas, Color, TextStyle};

use super::roc::DetectionCurve;
use super::{Evaluation, Hota};
use crate::chart::{Axis, Chart, Series};
use crate::{Error, Result};

const LIFE_WIDTH_PX: f64 = 1200.0;
const LIFE_HEIGHT_PX: f64 = 22.0;
const LIFE_LEFT_PX: f64 = 90.0;
const LIFE_TOP_PX: f64 = 46.0;
/// More people than this are not drawn: nobody could read it.
const MOST_LIVES: usize = 400;

/// Writes `hota.png`, `roc.png` and `lives.png` into a folder, as far as there is something to show.
///
/// # Errors
/// Naming the file that could not be written.
pub fn write(folder: &Path, evaluation: &Evaluation, curve: Option<&DetectionCurve>) -> Result<()> {
    if !evaluation.hota.by_threshold.is_empty() {
        save(&hota(&evaluation.hota).draw(), &folder.join("hota.png"))?;
    }
    if let Some(curve) = curve {
        save(&roc(curve).draw(), &folder.join("roc.png"))?;
    }
    if evaluation.scenario.has_identities {
        save(&lives(evaluation), &folder.join("lives.png"))?;
    }
    Ok(())
}

/// Writes a picture, whole or not at all.
/// # Errors
/// Naming the file.
pub fn save(image: &RgbImage, path: &Path) -> Result<()> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|e| Error::content(path, "whole file", format!("cannot be written ({e})")))?;
    Ok(calib::files::write_atomic(path, bytes.get_ref())?)
}

fn hota(hota: &Hota) -> Chart {
    let series = |name: &str, part: fn(&super::HotaScores) -> f64| Series {
        name: name.to_owned(),
        points: Hota::thresholds().zip(&hota.by_threshold).map(|(a, s)| [a, 100.0 * part(s)]).collect(),
        is_line: true,
    };
    Chart {
        title: "HOTA over the strictness".to_owned(),
        x: Axis { name: "least similarity of a match".to_owned(), range: [0.0, 1.0] },
        y: Axis { name: "%".to_owned(), range: [0.0, 100.0] },
        series: vec![series("HOTA", |s| s.hota), series("DetA", |s| s.det_a), series("AssA", |s| s.ass_a)],
    }
}

fn roc(curve: &DetectionCurve) -> Chart {
    let points: Vec<[f64; 2]> =
        curve.points.iter().map(|p| [p.false_positives_per_frame, 100.0 * p.recall]).collect();
    Chart {
        title: format!("detections (average precision {:.1} %)", 100.0 * curve.average_precision),
        x: Axis::fitting("false positives per frame", points.iter().map(|p| p[0]), [0.0, 0.5]),
        y: Axis { name: "found, % of the truth".to_owned(), range: [0.0, 100.0] },
        series: vec![Series { name: String::new(), points, is_line: true }],
    }
}

/// A strip for each person: the colour of the track that stands for them, pale where none does.
fn lives(evaluation: &Evaluation) -> RgbImage {
    let scenario = &evaluation.scenario;
    let people = scenario.people.min(MOST_LIVES);
    let height = LIFE_TOP_PX + LIFE_HEIGHT_PX * people as f64 + 12.0;
    let mut canvas = Canvas::new(LIFE_WIDTH_PX as u32, height as u32, Color::PAPER);
    let text = TextStyle::new(14.0).color(Color::INK);
    let title = "who stands for whom: a strip a person, a colour a track, grey where nobody stands for them";
    canvas.text(Point2::new(12.0, 12.0), title, &text.bold().anchor(0.0, 0.0));
    let frames = scenario.instants.len().max(1) as f64;
    let width = (LIFE_WIDTH_PX - LIFE_LEFT_PX - 12.0) / frames;
    for (number, instant) in scenario.instants.iter().enumerate() {
        let left = LIFE_LEFT_PX + number as f64 * width;
        for person in instant.truth.iter().filter(|p| **p < people) {
            let found = instant.matches.iter().find(|m| m.person == *person);
            let color =
                found.map_or(Color::PAPER.mix(Color::INK, 0.15), |m| Color::of_id(m.track as u32 + 1));
            let top = LIFE_TOP_PX + LIFE_HEIGHT_PX * *person as f64;
            // Half a pixel over the next one, or the seams between frames would show.
            let (right, bottom) = (left + width + 0.5, top + LIFE_HEIGHT_PX - 4.0);
            let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
            canvas.fill_polygon(&corners.map(|[x, y]| Point2::new(x, y)), color);
        }
    }
    for (person, id) in scenario.people_ids.iter().enumerate().take(people) {
        let middle = LIFE_TOP_PX + LIFE_HEIGHT_PX * (person as f64 + 0.5) - 2.0;
        canvas.text(Point2::new(LIFE_LEFT_PX - 10.0, middle), &format!("{id}"), &text.anchor(1.0, 0.5));
    }
    canvas.into_image()
}
