//! Timeline of predicted visibility: a strip for each person and camera, as wide as the page.

use std::fmt::Write;

use mot::jsonl::FrameLine;
use shell::canvas::Color;

use super::markup::{css, escape, path};
use super::recording::RunRecording;
use super::time_axis::TimeAxis;
use crate::TrackId;

/// Largest number of columns, which are the drawing's units: longer recordings are averaged, because a screen shows no
/// more.
const COLUMNS: usize = 1200;
/// Height of a strip in drawing units.
const STRIP: f64 = 34.0;

/// Visible fraction of a person in a camera for each column; `None` outside the picture.
type VisibilitySeries = Vec<Option<f64>>;

/// Strips of these people.
pub(super) fn html(recording: &RunRecording, people: &[TrackId], axis: &TimeAxis) -> String {
    let mut html = String::new();
    for id in people {
        let (color, ink) = (Color::of_id(id.0), css(Color::of_id(id.0).text_on()));
        let color = css(color);
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(
            html,
            "<h3><b class=\"chip\" style=\"background:{color};color:{ink}\">{id}</b> person {id}</h3>"
        );
        for camera in &recording.cameras {
            let strip = strip(&series(recording, *id, camera), &color);
            let name = escape(camera);
            let _ = writeln!(html, "<div class=\"row\"><span title=\"{name}\">{name}</span>{strip}</div>");
        }
    }
    let _ = writeln!(html, "<div class=\"row\"><span></span>{}</div>", axis.html());
    html
}

/// Ids with the longest tracks, ascending.
pub(super) fn longest(recording: &RunRecording, people: usize) -> Vec<TrackId> {
    let mut lengths: Vec<(usize, TrackId)> =
        recording.tracks().into_iter().map(|(id, places)| (places.len(), id)).collect();
    lengths.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut ids: Vec<TrackId> = lengths.into_iter().take(people).map(|(_, id)| id).collect();
    ids.sort_unstable();
    ids
}

/// Visible fraction of a person in a camera, column by column; frames are averaged where there are more than columns.
fn series(recording: &RunRecording, id: TrackId, camera: &str) -> VisibilitySeries {
    let per_column = recording.frames.len().div_ceil(COLUMNS).max(1);
    let seen = |frame: &FrameLine| {
        let person = frame.people.iter().find(|p| p.id == id)?;
        let visibility = recording.visibility(person, camera);
        visibility.is_in_view.then_some(visibility.visible)
    };
    recording
        .frames
        .chunks(per_column)
        .map(|frames| {
            let values: Vec<f64> = frames.iter().filter_map(seen).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        })
        .collect()
}

/// One strip: an area for each stretch in which the person is in the picture.
fn strip(series: &VisibilitySeries, color: &str) -> String {
    let columns = series.len().max(1);
    let mut svg = format!(
        "<svg class=\"strip\" viewBox=\"0 0 {columns} {STRIP}\" preserveAspectRatio=\"none\" role=\"img\" \
         aria-label=\"Predicted visible share over time\">"
    );
    let y = |visible: f64| STRIP * (1.0 - visible.clamp(0.0, 1.0));
    let mut column = 0;
    while column < series.len() {
        let stretch = series[column..].iter().take_while(|v| v.is_some()).count();
        if stretch == 0 {
            column += 1;
            continue;
        }
        let end = column + stretch;
        let surface: Vec<(f64, f64)> = (column..end)
            .filter_map(|i| series[i].map(|v| (i, y(v))))
            .flat_map(|(i, y)| [(i as f64, y), ((i + 1) as f64, y)])
            .collect();
        let base = [(end as f64, STRIP), (column as f64, STRIP)];
        let _ = write!(
            svg,
            "<rect class=\"hidden\" x=\"{column}\" y=\"0\" width=\"{stretch}\" height=\"{STRIP}\"/>\
             <path fill=\"{color}\" d=\"{}Z\"/>",
            path(surface.into_iter().chain(base))
        );
        column = end;
    }
    svg + "</svg>"
}
