//! The day: people who came and went, in words, over time and by place.

use std::fmt::Write;

use super::markup::{css, escape, path};
use super::recording::RunRecording;
use super::time_axis::TimeAxis;
use crate::TrackId;
use crate::events::duration;
use crate::events::stats::{DayStats, PlaceStats};
use shell::canvas::Color;

/// Drawing units of the charts, which are stretched to the page's width.
const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 120.0;
/// Largest number of bars of arrivals.
const MOST_BARS: f64 = 48.0;

/// Figures for the cards at the head of the page, with their names.
pub(super) fn cards(day: &DayStats) -> Vec<(String, &'static str)> {
    let came = day.room.entries_s.len();
    let mut cards = vec![(came.to_string(), if came == 1 { "person came" } else { "people came" })];
    if let Some((most, _)) = day.room.most() {
        cards.push((most.to_string(), "at most at once"));
    }
    cards
}

/// The day in words, and how many people were there over time.
pub(super) fn overview(day: &DayStats, axis: &TimeAxis) -> String {
    // Writing to a string cannot fail, here and below.
    let mut html = String::from("<ul class=\"words\">\n");
    for line in day.text().lines().skip(1) {
        let _ = writeln!(html, "<li>{}</li>", escape(line));
    }
    html.push_str("</ul>\n");
    if !day.room.entries_s.is_empty() {
        html.push_str(&inside_chart(day, axis));
    }
    html
}

/// Number of people inside, as a surface, and those who came, as bars.
fn inside_chart(day: &DayStats, axis: &TimeAxis) -> String {
    let most = day.room.most().map_or(1, |(most, _)| most.max(1)) as f64;
    let mut changes: Vec<(f64, f64)> = day.room.entries_s.iter().map(|s| (*s, 1.0)).collect();
    changes.extend(day.room.exits_s.iter().map(|s| (*s, -1.0)));
    changes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let y = |inside: f64| HEIGHT * (1.0 - inside.max(0.0) / most);
    let (mut inside, mut outline) = (0.0, vec![(0.0, HEIGHT)]);
    for (time_s, change) in changes {
        let x = WIDTH * axis.share(time_s);
        outline.extend([(x, y(inside)), (x, y(inside + change))]);
        inside += change;
    }
    outline.extend([(WIDTH, y(inside)), (WIDTH, HEIGHT)]);
    let bars = arrivals(&day.room, axis);
    let tallest = bars.iter().copied().max().unwrap_or(1).max(1);
    let mut html = format!(
        "<h3>People inside: {most} at most</h3>\n<div class=\"chart\"><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         preserveAspectRatio=\"none\" role=\"img\" aria-label=\"Number of people inside over time\">\
         <path class=\"inside\" d=\"{}Z\"/></svg>\n{}</div>\n\
         <h3>People who came: {tallest} at most in one bar</h3>\n<div class=\"chart\"><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         preserveAspectRatio=\"none\" role=\"img\" aria-label=\"Number of people who came over time\">",
        path(outline),
        axis.html()
    );
    let wide = WIDTH / bars.len() as f64;
    for (i, bar) in bars.iter().enumerate().filter(|(_, bar)| **bar > 0) {
        let tall = HEIGHT * *bar as f64 / tallest as f64;
        let _ = write!(
            html,
            "<rect class=\"came\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{tall:.1}\"><title>{bar}</title></rect>",
            (i as f64 + 0.08) * wide,
            HEIGHT - tall,
            0.84 * wide
        );
    }
    let _ = write!(html, "</svg>\n{}</div>\n", axis.html());
    html
}

/// Number of people who came in equal parts of the time.
fn arrivals(room: &PlaceStats, axis: &TimeAxis) -> Vec<usize> {
    let mut bars = vec![0; MOST_BARS as usize];
    for time_s in &room.entries_s {
        let bar = (axis.share(*time_s) * MOST_BARS) as usize;
        bars[bar.min(MOST_BARS as usize - 1)] += 1;
    }
    bars
}

/// Table of zones, regions and lines; empty where the room has none.
pub(super) fn places(day: &DayStats) -> String {
    if day.places.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    let time = |seconds: Option<f64>| seconds.map_or("–".to_owned(), duration);
    for (name, place) in &day.places {
        let most =
            place.most().filter(|_| !place.is_line).map_or("–".to_owned(), |(most, _)| most.to_string());
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">{}</th><td class=\"number\">{}</td><td class=\"number\">{}</td>\
             <td class=\"number\">{most}</td><td class=\"number\">{}</td><td class=\"number\">{}</td></tr>",
            escape(name),
            place.entries_s.len(),
            place.exits_s.len(),
            time(place.median_s()),
            time(place.stays.last().map(|stay| stay.seconds))
        );
    }
    format!(
        "<div class=\"scroll\"><table class=\"places\"><thead><tr><th>place</th><th class=\"number\">in</th>\
         <th class=\"number\">out</th><th class=\"number\">most at once</th><th class=\"number\">median stay</th>\
         <th class=\"number\">longest stay</th></tr></thead><tbody>\n{rows}</tbody></table></div>\n"
    )
}

/// A bar for each of the people with the longest tracks: when they were there, and in which zones and regions.
pub(super) fn stays(day: &DayStats, recording: &RunRecording, people: &[TrackId], axis: &TimeAxis) -> String {
    let tracks = recording.tracks();
    let places: Vec<&(String, PlaceStats)> =
        day.places.iter().filter(|(_, place)| !place.is_line && !place.stays.is_empty()).collect();
    let color = |index: usize| css(Color::of_id(index as u32 + 1));
    let mut html = String::from("<p class=\"legend\"><i class=\"there\"></i> in the room");
    for (index, (name, _)) in places.iter().enumerate() {
        let _ = write!(html, " <i style=\"background:{}\"></i> {}", color(index), escape(name));
    }
    html.push_str("</p>\n");
    for id in people {
        let Some([first, .., last]) = tracks.get(id).map(Vec::as_slice) else { continue };
        let _ = write!(html, "<div class=\"row\"><span>person {id}</span><div class=\"stays\">");
        let mut bar = |class: &str, from_s: f64, to_s: f64, style: &str, title: &str| {
            let (from, to) = (100.0 * axis.share(from_s), 100.0 * axis.share(to_s));
            let _ = write!(
                html,
                "<i class=\"{class}\" style=\"left:{from:.2}%;width:{:.2}%{style}\" title=\"{title}\"></i>",
                to - from
            );
        };
        bar("there", first.0, last.0, "", &format!("in the room for {}", duration(last.0 - first.0)));
        for (index, (name, place)) in places.iter().enumerate() {
            for stay in place.stays.iter().filter(|stay| stay.id == Some(*id)) {
                let title = format!("{} for {}", escape(name), duration(stay.seconds));
                let style = format!(";background:{}", color(index));
                bar("stay", stay.until_s - stay.seconds, stay.until_s, &style, &title);
            }
        }
        html.push_str("</div></div>\n");
    }
    let _ = writeln!(html, "<div class=\"row\"><span></span>{}</div>", axis.html());
    html
}
