//! Lines of `tracks.jsonl` from a tracker's estimates.

use mot::count;
use mot::jsonl::{FrameLine, PersonLine, rounded};

use crate::PersonEstimate;
use crate::events::Clock;
use crate::foreground::Verdict;

/// Line of a moment. `cameras` are the names of the room's cameras, `set_aside` the indices of those without usable
/// pictures, with the reason.
pub(crate) fn frame_line(
    frame: u32,
    time_s: f64,
    people: &[PersonEstimate],
    cameras: &[String],
    set_aside: &[(usize, Verdict)],
    clock: Option<&Clock>,
) -> FrameLine {
    let time = (time_s * 1e6).round() / 1e6;
    let count = count::distribution(people.iter().map(|p| p.confidence));
    let set_aside: Vec<(&String, Verdict)> =
        set_aside.iter().filter_map(|(camera, why)| Some((cameras.get(*camera)?, *why))).collect();
    FrameLine {
        frame,
        time,
        people: people.iter().map(|p| person_line(p, cameras)).collect(),
        count: count.into_iter().map(rounded).collect(),
        states: set_aside.iter().map(|(_, why)| why.camera_state()).collect(),
        set_aside: set_aside.into_iter().map(|(name, _)| name.clone()).collect(),
        clock: clock.map(|clock| clock.at(time)),
    }
}

/// Line of a person; numbers are rounded to four decimals. `cameras` are the names for the estimate's visible
/// fractions.
pub fn person_line(person: &PersonEstimate, cameras: &[String]) -> PersonLine {
    PersonLine {
        id: person.id,
        x: rounded(person.x_m),
        y: rounded(person.y_m),
        radius: rounded(person.radius_m),
        height: rounded(person.height_m),
        vx: rounded(person.vx),
        vy: rounded(person.vy),
        sigma: person.sigma_m.map(rounded),
        confidence: rounded(person.confidence),
        visible: cameras.iter().cloned().zip(person.visible.iter().map(|v| rounded(*v))).collect(),
    }
}
