//! True events of true paths.

use nalgebra::Point2;
use scenes::polygon::Polygon;
use scenes::room::{Line, Room};
use tracker::events::{Direction, EventKind};

use super::TruePath;

/// Depth beyond a border from which a true path has passed it beyond doubt, metres: about three standard deviations of a
/// tracker's position. Who comes less far, and goes back, grazes the border.
pub const CLEAR_M: f64 = 0.25;
/// The same for any passing at all, metres: less than a body sways.
pub const ANY_M: f64 = 0.02;

/// A true event.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueEvent {
    /// [`EventKind::Enter`], [`EventKind::Leave`] or [`EventKind::Cross`].
    pub kind: EventKind,
    /// Zone, region or line.
    pub place: String,
    /// Direction of a crossing.
    pub direction: Option<Direction>,
    /// Time at which the path is on the border, seconds.
    pub time_s: f64,
    /// Duration of the stay, for [`EventKind::Leave`].
    pub seconds: Option<f64>,
}

/// Events of the paths, at the zones, regions and lines of the room, by time. A border is passed by who comes at least
/// `margin_m` beyond it; a line, between places so far from its free ends, or so far beyond them where `with_ends`.
pub fn true_events(room: &Room, paths: &[TruePath], margin_m: f64, with_ends: bool) -> Vec<TrueEvent> {
    let end_m = if with_ends { CLEAR_M } else { -CLEAR_M };
    let lines: Vec<Line> = room.lines.iter().map(|line| prolonged(line, end_m)).collect();
    let zones = room.zones.iter().map(|zone| (&zone.name, &zone.polygon));
    let areas: Vec<_> = zones.chain(room.regions.iter().map(|r| (&r.name, &r.polygon))).collect();
    let mut events = Vec::new();
    for path in paths {
        for (name, polygon) in &areas {
            stays(&mut events, path, (name, polygon), margin_m);
        }
        for line in &lines {
            crossings(&mut events, path, line, margin_m);
        }
    }
    events.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    events
}

/// A line that reaches further at both ends, or less far.
fn prolonged(line: &Line, by_m: f64) -> Line {
    let mut points = line.points.clone();
    if let [first, second, ..] = line.points[..]
        && let [.., before, last] = line.points[..]
    {
        points[0] = first + (first - second).normalize() * by_m;
        points[line.points.len() - 1] = last + (last - before).normalize() * by_m;
    }
    Line { points, ..line.clone() }
}

fn stays(events: &mut Vec<TrueEvent>, path: &TruePath, (name, polygon): (&str, &Polygon), margin_m: f64) {
    let event =
        |kind, time_s, seconds| TrueEvent { kind, place: name.to_owned(), direction: None, time_s, seconds };
    let depth_m = |place: &Point2<f64>| {
        let edges = polygon.edges().map(|(a, b)| distance_m(place, &a, &b));
        edges.fold(f64::INFINITY, f64::min)
    };
    let (mut inside_since, mut border_s, mut was_in): (Option<f64>, f64, Option<bool>) =
        (None, f64::NAN, None);
    for (time_s, place) in &path.samples {
        let is_in = polygon.contains(place);
        if was_in.is_none_or(|was_in| was_in != is_in) {
            border_s = *time_s;
        }
        was_in = Some(is_in);
        if depth_m(place) < margin_m {
            continue;
        }
        match inside_since {
            None if is_in => {
                inside_since = Some(border_s);
                events.push(event(EventKind::Enter, border_s, None));
            }
            Some(since_s) if !is_in => {
                inside_since = None;
                events.push(event(EventKind::Leave, border_s, Some(border_s - since_s)));
            }
            _ => {}
        }
    }
    if let (Some(since_s), Some((last_s, _))) = (inside_since, path.samples.last()) {
        let end_s = if was_in == Some(true) { *last_s } else { border_s };
        events.push(event(EventKind::Leave, end_s, Some(end_s - since_s)));
    }
}

fn crossings(events: &mut Vec<TrueEvent>, path: &TruePath, line: &Line, margin_m: f64) {
    let (mut net, mut last_s) = (0_i32, [f64::NAN; 2]);
    let mut settle = |net: &mut i32, last_s: &[f64; 2]| {
        let direction = if *net > 0 { Direction::In } else { Direction::Out };
        if *net != 0 {
            let time_s = last_s[usize::from(*net > 0)];
            let (kind, place) = (EventKind::Cross, line.name.clone());
            events.push(TrueEvent { kind, place, direction: Some(direction), time_s, seconds: None });
        }
        *net = 0;
    };
    for pair in path.samples.windows(2) {
        let ((_, p), (time_s, q)) = (pair[0], pair[1]);
        for (a, b) in line.pieces() {
            // Twice the areas of triangles; positive is left.
            let turn = |a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>| (b - a).perp(&(c - a));
            let (before, after) = (turn(&a, &b, &p), turn(&a, &b, &q));
            if before * after < 0.0 && turn(&p, &q, &a) * turn(&p, &q, &b) < 0.0 {
                net += if before > 0.0 { 1 } else { -1 };
                last_s[usize::from(before > 0.0)] = time_s;
            }
        }
        if line.pieces().all(|(a, b)| distance_m(&q, &a, &b) >= margin_m) {
            settle(&mut net, &last_s);
        }
    }
    settle(&mut net, &last_s);
}

fn distance_m(place: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let along = b - a;
    let share = (place - a).dot(&along) / along.norm_squared();
    (place - (a + along * share.clamp(0.0, 1.0))).norm()
}
