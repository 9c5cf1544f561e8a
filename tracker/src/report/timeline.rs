//! Timeline of predicted visibility: a strip for each person and camera, as inline SVG.

use std::fmt::Write;

use shell::canvas::Color;

use super::markup::{css, escape, path, ticks};
use super::recording::RunRecording;
use crate::TrackId;
use crate::tracks::jsonl::FrameLine;

/// Drawing size, in SVG units.
const WIDTH: f64 = 1000.0;
const LEFT: f64 = 86.0;
const RIGHT: f64 = 12.0;
const STRIP: f64 = 34.0;
const GAP: f64 = 7.0;
const HEADING: f64 = 30.0;
const AXIS: f64 = 34.0;
/// Largest number of columns: longer recordings are averaged, because a screen shows no more.
const COLUMNS: usize = 1200;

/// Visible fraction of a person in a camera for each column; `None` outside the picture.
type VisibilitySeries = Vec<Option<f64>>;

/// Strips of up to `people` people (those with the longest tracks), by id.
pub(super) fn svg(recording: &RunRecording, people: usize) -> String {
    let (first, last) = recording.span_s();
    let duration = (last - first).max(1e-9);
    let ids = longest(recording, people);
    let group = HEADING + recording.cameras.len() as f64 * (STRIP + GAP);
    let height = ids.len() as f64 * group + AXIS;
    let x = |share: f64| LEFT + share * (WIDTH - LEFT - RIGHT);
    let mut svg = format!(
        "<svg class=\"timeline\" viewBox=\"0 0 {WIDTH} {height:.0}\" role=\"img\" \
         aria-label=\"Predicted visible share of each person in each camera over time\">\n"
    );
    // Writing to a string cannot fail, here and below.
    for second in ticks(duration, 10) {
        let at = x(second / duration);
        let _ = writeln!(
            svg,
            "<line class=\"grid\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"0\" y2=\"{:.1}\"/>\
             <text class=\"tick\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{} s</text>",
            height - AXIS + 4.0,
            height - 12.0,
            (second + first).round()
        );
    }
    for (index, id) in ids.iter().enumerate() {
        let top = index as f64 * group;
        let color = css(Color::of_id(id.0));
        let _ = writeln!(
            svg,
            "<rect x=\"0\" y=\"{:.1}\" width=\"22\" height=\"20\" rx=\"5\" fill=\"{color}\"/>\
             <text class=\"chip\" x=\"11\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{}\">{id}</text>\
             <text class=\"who\" x=\"30\" y=\"{:.1}\">person {id}</text>",
            top + 4.0,
            top + 18.5,
            css(Color::of_id(id.0).text_on()),
            top + 18.5
        );
        for (row, camera) in recording.cameras.iter().enumerate() {
            let strip_top = top + HEADING + row as f64 * (STRIP + GAP);
            strip(&mut svg, &series(recording, *id, camera), camera, &color, strip_top, x);
        }
    }
    svg.push_str("</svg>");
    svg
}

/// Ids with the longest tracks, ascending.
fn longest(recording: &RunRecording, people: usize) -> Vec<TrackId> {
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

/// Draws one strip: its frame and name, and an area for each stretch in which the person is in the picture.
fn strip(
    svg: &mut String,
    series: &VisibilitySeries,
    camera: &str,
    color: &str,
    top: f64,
    x: impl Fn(f64) -> f64,
) {
    let bottom = top + STRIP;
    let _ = writeln!(
        svg,
        "<rect class=\"strip\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{STRIP}\" rx=\"3\"/>\
         <text class=\"camera\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
        WIDTH - LEFT - RIGHT,
        LEFT - 8.0,
        top + 0.5 * STRIP + 4.5,
        escape(camera)
    );
    let columns = series.len().max(1) as f64;
    let edge = |column: usize| x(column as f64 / columns);
    let y = |visible: f64| bottom - visible.clamp(0.0, 1.0) * STRIP;
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
            .flat_map(|(i, y)| [(edge(i), y), (edge(i + 1), y)])
            .collect();
        let base = [(edge(end), bottom), (edge(column), bottom)];
        let _ = writeln!(
            svg,
            "<rect class=\"hidden\" x=\"{:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{STRIP}\"/>\
             <path fill=\"{color}\" d=\"{}Z\"/>",
            edge(column),
            edge(end) - edge(column),
            path(surface.into_iter().chain(base))
        );
        column = end;
    }
}
