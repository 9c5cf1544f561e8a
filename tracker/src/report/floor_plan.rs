//! Floor plan with the trajectories of all people: the room as a picture, the trajectories as SVG, so that they stay
//! sharp and have tooltips.

use std::fmt::Write;

use nalgebra::Point2;
use scenes::plan::{FloorPlan, PlanOptions};
use shell::canvas::Color;

use super::markup::{css, data_url, path};
use super::recording::RunRecording;
use crate::Result;
use crate::plan::beyond_the_room;

/// Longest side of the picture, pixels.
const SIDE_PX: u32 = 1400;
/// A track with a gap longer than this is drawn in parts, seconds.
const BREAK_S: f64 = 1.0;

/// The plan as inline SVG.
///
/// # Errors
/// Geometry that cannot be drawn.
pub(super) fn svg(recording: &RunRecording) -> Result<String> {
    let tracks = recording.tracks();
    let went = tracks.values().flatten().map(|(_, place)| *place);
    let places =
        beyond_the_room(&recording.room, went.chain(recording.truth_paths.iter().flatten().copied()));
    let options = PlanOptions { longest_side_px: SIDE_PX, places, ..PlanOptions::default() };
    let plan = FloorPlan::new(&recording.room, &options)?;
    let mapping = plan.mapping();
    let picture = plan.into_image();
    let (width, height) = picture.dimensions();
    let way = |places: &mut dyn Iterator<Item = Point2<f64>>| {
        path(places.map(|place| mapping.pixel(&place)).map(|p| (p.x, p.y)))
    };
    let mut svg = format!(
        "<svg class=\"plan\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"Floor plan with trajectories\">\n\
         <image width=\"{width}\" height=\"{height}\" href=\"{}\"/>\n",
        data_url(&picture, 86)
    );
    // Writing to a string cannot fail, here and below.
    for places in &recording.truth_paths {
        let _ = writeln!(svg, "<path class=\"truth\" d=\"{}\"/>", way(&mut places.iter().copied()));
    }
    for (id, track) in tracks {
        let color = css(Color::of_id(id.0));
        let walked: f64 = track.windows(2).map(|w| (w[1].1 - w[0].1).norm()).sum();
        let (from, to) = (track.first().map_or(0.0, |t| t.0), track.last().map_or(0.0, |t| t.0));
        let _ = writeln!(svg, "<g><title>person {id}: {from:.1} s to {to:.1} s, {walked:.1} m</title>");
        for stretch in track.chunk_by(|a, b| b.0 - a.0 <= BREAK_S) {
            let line = way(&mut stretch.iter().map(|(_, place)| *place));
            let _ = writeln!(
                svg,
                "<path class=\"casing\" d=\"{line}\"/><path class=\"way\" stroke=\"{color}\" d=\"{line}\"/>"
            );
        }
        if let Some((_, start)) = track.first() {
            let at = mapping.pixel(start);
            let _ = writeln!(
                svg,
                "<circle class=\"start\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"8\" stroke=\"{color}\"/>",
                at.x, at.y
            );
        }
        if let Some((_, end)) = track.last() {
            let (at, ink) = (mapping.pixel(end), css(Color::of_id(id.0).text_on()));
            let _ = writeln!(
                svg,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"15\" fill=\"{color}\" stroke=\"#fff\" stroke-width=\"2\"/>\
                 <text class=\"label\" x=\"{:.1}\" y=\"{:.1}\" fill=\"{ink}\">{id}</text>",
                at.x,
                at.y,
                at.x,
                at.y + 6.5
            );
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>");
    Ok(svg)
}
