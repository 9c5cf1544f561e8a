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
    /// The person.
    pub person: u32,
    /// Zone, region or line.
    pub place: String,
    /// Direction of a crossing.
    pub direction: Option<Direction>,
    /// Time at which the path is on the border, seconds.
    pub time_s: f64,
    /// Position at that time, metres.
    pub position: Point2<f64>,
    /// Duration of the stay, for [`EventKind::Leave`].
    pub seconds: Option<f64>,
}

/// Events of the paths, at the zones, regions and lines of the room, by time. A border is passed by who comes at least
/// `margin_m` beyond it; lines reach `prolonged_m` beyond their free ends.
/// People who are in the room when the recording ends, at `end_s`, have not left; they have passed the borders that they are
/// `margin_m` beyond by then.
pub fn true_events(
    room: &Room,
    paths: &[TruePath],
    end_s: f64,
    margin_m: f64,
    prolonged_m: f64,
) -> Vec<TrueEvent> {
    let lines: Vec<Line> = room.lines.iter().map(|line| prolonged(line, prolonged_m)).collect();
    let zones = room.zones.iter().map(|zone| (&zone.name, &zone.polygon));
    let areas: Vec<_> = zones.chain(room.regions.iter().map(|r| (&r.name, &r.polygon))).collect();
    let mut events = Vec::new();
    for path in paths {
        for (name, polygon) in &areas {
            stays(&mut events, path, (name, polygon), end_s, margin_m);
        }
        for line in &lines {
            crossings(&mut events, path, line, end_s, margin_m);
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

/// A sample of a path: time, seconds, and position.
type Sample = (f64, Point2<f64>);

fn stays(
    events: &mut Vec<TrueEvent>,
    path: &TruePath,
    (name, polygon): (&str, &Polygon),
    end_s: f64,
    margin_m: f64,
) {
    let event = |kind, (time_s, position): Sample, seconds| TrueEvent {
        kind,
        person: path.id,
        place: name.to_owned(),
        direction: None,
        time_s,
        position,
        seconds,
    };
    let depth_m = |place: &Point2<f64>| {
        let edges = polygon.edges().map(|(a, b)| distance_m(place, &a, &b));
        edges.fold(f64::INFINITY, f64::min)
    };
    let (mut inside_since, mut border, mut before): (Option<Sample>, Option<Sample>, Option<Sample>) =
        (None, None, None);
    for sample in &path.samples {
        let is_in = polygon.contains(&sample.1);
        let turned = match before {
            None => Some(*sample),
            Some(last) if polygon.contains(&last.1) != is_in => {
                let (was_m, is_m) = (depth_m(&last.1), depth_m(&sample.1));
                Some(between(&last, sample, was_m / (was_m + is_m)))
            }
            Some(_) => None,
        };
        before = Some(*sample);
        border = turned.or(border);
        let Some(border) = border.filter(|_| depth_m(&sample.1) >= margin_m) else { continue };
        match inside_since {
            None if is_in => {
                inside_since = Some(border);
                events.push(event(EventKind::Enter, border, None));
            }
            Some(since) if !is_in => {
                inside_since = None;
                events.push(event(EventKind::Leave, border, Some(border.0 - since.0)));
            }
            _ => {}
        }
    }
    if let (Some(since), Some(last), Some(border)) = (inside_since, before, border) {
        let is_in = polygon.contains(&last.1);
        let end = if is_in { last } else { border };
        if !is_in || last.0 < end_s {
            events.push(event(EventKind::Leave, end, Some(end.0 - since.0)));
        }
    }
}

fn crossings(events: &mut Vec<TrueEvent>, path: &TruePath, line: &Line, end_s: f64, margin_m: f64) {
    // Crossings inward less those outward, and the latest of each direction.
    let (mut net, mut latest): (i32, [Option<Sample>; 2]) = (0, [None; 2]);
    let mut settle = |net: &mut i32, latest: &[Option<Sample>; 2]| {
        let direction = if *net > 0 { Direction::In } else { Direction::Out };
        if let Some((time_s, position)) = latest[usize::from(*net > 0)].filter(|_| *net != 0) {
            let (kind, place) = (EventKind::Cross, line.name.clone());
            events.push(TrueEvent {
                kind,
                person: path.id,
                place,
                direction: Some(direction),
                time_s,
                position,
                seconds: None,
            });
        }
        *net = 0;
    };
    for pair in path.samples.windows(2) {
        let ((_, p), (_, q)) = (pair[0], pair[1]);
        for (a, b) in line.pieces() {
            // Twice the areas of triangles; left is positive, and so is the line itself: a sample on it has one side.
            let turn = |a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>| (b - a).perp(&(c - a));
            let (before, after) = (turn(&a, &b, &p), turn(&a, &b, &q));
            let changes_side = (before >= 0.0) != (after >= 0.0);
            if changes_side && (turn(&p, &q, &a) >= 0.0) != (turn(&p, &q, &b) >= 0.0) {
                net += if before >= 0.0 { 1 } else { -1 };
                let crossing = between(&pair[0], &pair[1], before / (before - after));
                latest[usize::from(before >= 0.0)] = Some(crossing);
            }
        }
        if line.pieces().all(|(a, b)| distance_m(&q, &a, &b) >= margin_m) {
            settle(&mut net, &latest);
        }
    }
    if path.span_s().1 < end_s {
        settle(&mut net, &latest);
    }
}

/// Time and position at a share of the way from one sample to the next.
fn between(a: &Sample, b: &Sample, share: f64) -> Sample {
    (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share)
}

fn distance_m(place: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let along = b - a;
    let share = (place - a).dot(&along) / along.norm_squared();
    (place - (a + along * share.clamp(0.0, 1.0))).norm()
}
