//! The page and its sections.

use std::fmt::Write;

use image::RgbImage;
use mot::jsonl::FrameLine;

use super::markup::{data_url, escape};
use super::moments::{self, HIDDEN};
use super::recording::RunRecording;
use super::time_axis::TimeAxis;
use super::{ReportOptions, day, floor_plan, stills, tables, timeline};
use crate::events::duration;
use crate::{Result, TrackId};

const STYLE: &str = include_str!("page.css");

/// HTML of the whole page.
///
/// # Errors
/// A film, reference image or geometry that cannot be read.
pub(super) fn html(recording: &RunRecording, options: &ReportOptions) -> Result<String> {
    let title = "Who was where";
    let mut body = header(recording, title);
    let day = &recording.day;
    let day_s = day.clock.map(|clock| clock.seconds_of_day(0.0));
    let axis = TimeAxis::new(recording.span_s(), day_s);
    let people = timeline::longest(recording, options.people);
    section(&mut body, "Who came, and when", "", &day::overview(day, &axis));
    if !people.is_empty() {
        let bars = day::stays(day, recording, &people, &axis);
        section(&mut body, "Who was where, and how long", STAYS, &(bars + &day::places(day)));
    }
    if let Some(heat) = &recording.heat {
        section(
            &mut body,
            "Where people spent their time",
            HEAT,
            &picture(heat, "Heat map over the floor plan"),
        );
    }
    section(&mut body, "The way everybody went", PLAN, &floor_plan::svg(recording)?);
    let pictures = film_stills(recording, options)?;
    if !pictures.is_empty() {
        section(&mut body, "What the cameras saw, and what was expected", STILLS, &pictures);
    }
    if !people.is_empty() {
        section(&mut body, "Predicted visibility", TIMELINE, &timeline::html(recording, &people, &axis));
    }
    if let Some(evaluation) = &recording.evaluation {
        let headline = escape(&evaluation.headline());
        let lead = format!("Compared with the {headline}.");
        folded(&mut body, "How good it is", &lead, &tables::evaluation(evaluation));
    }
    if let Some(timings) = &recording.timings {
        let lead = format!(
            "{} frames on {} threads. One count a frame, all cameras together, wall time; stages run side by \
             side, so they do not add up to the run.",
            timings.frames, timings.threads
        );
        folded(&mut body, "Where the time went", &lead, &tables::timings(timings));
    }
    Ok(format!(
        "<!doctype html>\n<html lang=\"en-GB\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n\
         <footer>Written by <code>tracker report</code>. Nothing on this page is fetched from anywhere.</footer>\n\
         </body>\n</html>\n"
    ))
}

const STAYS: &str = "A bar is the time in which a person was followed, of those who were there longest; colours are \
    the zones and regions they stood in.";
const HEAT: &str = "Seconds that people spent on each square of the floor: the darker, the longer.";
const PLAN: &str = "The room from above, with each person's track on the floor. A ring marks where a track begins, \
    a number where it ends. Thin dashed lines, if any, are the truth.";
const STILLS: &str = "Left, the picture: tinted where a person is predicted to be visible, dashed and pale where the \
    room or somebody else hides them; the percentage is the predicted visible share of the body. Right, the \
    simulated view: the room's own geometry with the people in it, and in white the outline of what really moved.";
const TIMELINE: &str = "For each person and camera, how much of the body is predicted to be visible: a full strip is \
    all of it. The pale part is in the picture but hidden by furniture or by other people. Where the strip is \
    empty, the person is outside the picture or not there.";

fn section(body: &mut String, title: &str, lead: &str, content: &str) {
    let lead = if lead.is_empty() { String::new() } else { format!("<p class=\"lead\">{lead}</p>\n") };
    // Writing to a string cannot fail.
    let _ = write!(body, "<section>\n<h2>{title}</h2>\n{lead}{content}\n</section>\n");
}

/// A section that shows its title until it is opened.
fn folded(body: &mut String, title: &str, lead: &str, content: &str) {
    let _ = write!(
        body,
        "<section>\n<details>\n<summary><h2>{title}</h2></summary>\n<p class=\"lead\">{lead}</p>\n{content}\n\
         </details>\n</section>\n"
    );
}

fn header(recording: &RunRecording, title: &str) -> String {
    let (first, last) = recording.span_s();
    let cameras = recording.cameras.len();
    let mut cards = String::new();
    for (value, name) in day::cards(&recording.day) {
        let _ = write!(cards, "<div class=\"card\"><b>{}</b><span>{name}</span></div>", escape(&value));
    }
    let shown =
        if recording.every > 1 { format!(" (one in {} is shown)", recording.every) } else { String::new() };
    format!(
        "<header>\n<h1>{title}</h1>\n<p class=\"lead\">{} frames{shown}, {}, {cameras} camera{} ({}), \
         room <code>{}</code>.</p>\n\
         <div class=\"cards\">{cards}</div>\n</header>\n",
        recording.frame_count,
        duration(last - first),
        if cameras == 1 { "" } else { "s" },
        escape(&recording.cameras.join(", ")),
        escape(&recording.room_dir.display().to_string())
    )
}

/// A picture as wide as the page.
fn picture(picture: &RgbImage, name: &str) -> String {
    format!(
        "<figure><img src=\"{}\" alt=\"{name}\" width=\"{}\" height=\"{}\"></figure>",
        data_url(picture, 86),
        picture.width(),
        picture.height()
    )
}

/// An HTML figure for each still, grouped by camera.
fn film_stills(recording: &RunRecording, options: &ReportOptions) -> Result<String> {
    let mut figures = String::new();
    for camera in &recording.cameras {
        let wanted = moments::informative(recording, camera, options.stills);
        let pictures = stills::stills(recording, camera, &wanted)?;
        if !pictures.is_empty() {
            let _ = writeln!(figures, "<h3>{}</h3>", escape(camera));
        }
        for (index, picture) in pictures {
            let frame = &recording.frames[index];
            let caption = escape(&caption(recording, frame, camera));
            let _ = write!(
                figures,
                "<figure>\n<img src=\"{}\" alt=\"{caption}\" width=\"{}\" height=\"{}\">\n\
                 <figcaption>{caption}</figcaption>\n</figure>\n",
                data_url(&picture, 82),
                picture.width(),
                picture.height()
            );
        }
    }
    Ok(figures)
}

/// Largest number of people that a caption lists; more are counted.
const LISTED: usize = 4;

/// Description of a still.
fn caption(recording: &RunRecording, frame: &FrameLine, camera: &str) -> String {
    let in_view: Vec<(TrackId, f64)> = frame
        .people
        .iter()
        .map(|p| (p.id, recording.visibility(p, camera)))
        .filter(|(_, visibility)| visibility.is_in_view)
        .map(|(id, visibility)| (id, visibility.visible))
        .collect();
    let who = if in_view.is_empty() {
        "nobody in view".to_owned()
    } else if in_view.len() <= LISTED {
        in_view.iter().map(|(id, visible)| one(*id, *visible)).collect::<Vec<_>>().join(", ")
    } else {
        let count = |is: fn(f64) -> bool| in_view.iter().filter(|(_, visible)| is(*visible)).count();
        format!(
            "{} people, {} in full view, {} partly and {} wholly hidden",
            in_view.len(),
            count(|v| v >= FULL),
            count(|v| v < FULL && v > HIDDEN),
            count(|v| v <= HIDDEN)
        )
    };
    format!("Frame {}, {:.2}\u{a0}s: {who}.", frame.frame, frame.time)
}

/// Visible fraction above which a person is in full view.
const FULL: f64 = 0.97;

fn one(id: TrackId, visible: f64) -> String {
    if visible <= HIDDEN {
        format!("person\u{a0}{id} hidden and still followed")
    } else if visible >= FULL {
        format!("person\u{a0}{id} in full view")
    } else {
        format!("{:.0}\u{a0}% of person\u{a0}{id} visible", 100.0 * visible)
    }
}
