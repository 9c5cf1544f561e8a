//! Trajectories of six people, after the picture in Nakazawa et al., figure 13; the numbers are not in the paper.
//!
//! In each layout persons 0 to 3 meet at the Y axis, and persons 2, 4 and 5 meet, as the paper says. In *sequence*
//! persons 3 and 4, whose attributes are the closest, meet after that.

use nalgebra::{Point2, Vector2, point, vector};

use super::Layout;

/// Walking speed, m/s.
pub(super) const SPEED: f64 = 1.2;
/// Distance between people who meet, metres.
const GAP_M: f64 = 0.6;
/// Length of the trajectory after a meeting, metres.
const BEYOND_M: f64 = 12.0;
/// Time of the first meeting, seconds.
const MEETING_S: f64 = 5.0;

/// Function from a person (0 to 5) and a time, seconds, to the person's place, metres; `None` for a layout of any
/// number of people.
pub(super) fn place(layout: Layout) -> Option<fn(usize, f64) -> Point2<f64>> {
    match layout {
        Layout::Once => Some(once),
        Layout::Sequence => Some(sequence),
        Layout::Along => Some(along),
        Layout::Hall | Layout::Corridor => None,
    }
}

fn direction(degrees: f64) -> Vector2<f64> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    vector![cos, sin]
}

/// Place, metres, on a trajectory along `come` to `middle`, reached at `middle_s`, and on along `go`, at the end of
/// which the person stays.
fn bent(middle: Point2<f64>, middle_s: f64, come: Vector2<f64>, go: Vector2<f64>, t: f64) -> Point2<f64> {
    let s = SPEED * (t - middle_s);
    if s < 0.0 { middle + come * s } else { middle + go * s.min(BEYOND_M) }
}

/// All six cross the Y axis together.
fn once(person: usize, t: f64) -> Point2<f64> {
    const UP: [f64; 6] = [2.5, 1.5, 0.0, 0.6, -0.6, -1.6];
    /// Bearings of the trajectory's start and end from the meeting point, degrees.
    const FROM: [f64; 6] = [150.0, 30.0, 0.0, 180.0, 210.0, -30.0];
    const TO: [f64; 6] = [40.0, 140.0, 180.0, -40.0, 0.0, 220.0];
    bent(point![0.0, UP[person] * GAP_M], MEETING_S, -direction(FROM[person]), direction(TO[person]), t)
}

/// Persons 0 to 3 meet at (0, 3) after 5 s; person 2 walks down the Y axis and meets 4 and 5; 3 and 4 meet after that.
fn sequence(person: usize, t: f64) -> Point2<f64> {
    const HEADING: [f64; 6] = [-10.0, 190.0, -90.0, 235.0, 192.0, 8.0];
    const UP: [f64; 6] = [1.0, 0.4, 0.0, -0.4, 0.4, -0.6];
    let second_s = MEETING_S + 4.5 / SPEED;
    let (height, middle_s) = if person < 4 { (3.0, MEETING_S) } else { (-1.5, second_s) };
    let straight = |person: usize, t: f64| {
        let way = direction(HEADING[person]);
        bent(point![0.0, height + UP[person] * GAP_M], middle_s, way, way, t)
    };
    let turn_s = MEETING_S + 0.6;
    if person != 3 || t < turn_s {
        return straight(person, t);
    }
    // Person 3 turns towards a later place of person 4, and walks on.
    let meeting_s = 0.5 * (second_s + MEETING_S + 9.0);
    let (from, to) = (straight(3, turn_s), sequence(4, meeting_s));
    from + (to - from) * ((t - turn_s) / (meeting_s - turn_s))
}

/// Persons 0 to 3 walk up the Y axis side by side for 2.5 s; person 2 stays there and meets 4 and 5.
fn along(person: usize, t: f64) -> Point2<f64> {
    const ASIDE: [f64; 4] = [-1.5, -0.5, 0.5, 1.5];
    const IN: [f64; 4] = [35.0, 75.0, 105.0, 145.0];
    const OUT: [f64; 4] = [160.0, 125.0, 95.0, 80.0];
    const TOGETHER_S: f64 = 2.5;
    if person < 4 {
        let begin = point![ASIDE[person] * GAP_M, -2.0 + 0.1 * person as f64];
        let (s, length) = (SPEED * (t - MEETING_S), TOGETHER_S * SPEED);
        return if s < 0.0 {
            begin + direction(IN[person]) * s
        } else {
            let apart = (s - length).clamp(0.0, BEYOND_M);
            begin + vector![0.0, s.min(length)] + direction(OUT[person]) * apart
        };
    }
    let meeting_s = MEETING_S + TOGETHER_S + 2.0;
    let (heading, up) = if person == 4 { (185.0, 0.5) } else { (-20.0, -0.5) };
    let middle = along(2, meeting_s) + vector![0.0, up * GAP_M];
    bent(middle, meeting_s, direction(heading), direction(heading), t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(layout: Layout, frames: usize, rate_hz: f64) -> Vec<Vec<Point2<f64>>> {
        let place = place(layout).unwrap();
        (0..frames).map(|f| (0..6).map(|person| place(person, f as f64 / rate_hz)).collect()).collect()
    }

    /// First and last time at which two people are within 1 m of each other, seconds; `None` if they never are.
    fn encounter(paths: &[Vec<Point2<f64>>], a: usize, b: usize, rate_hz: f64) -> Option<[f64; 2]> {
        let mut close = (0..paths.len()).filter(|f| (paths[*f][a] - paths[*f][b]).norm() < 1.0);
        let first = close.next()?;
        Some([first as f64 / rate_hz, close.next_back().unwrap_or(first) as f64 / rate_hz])
    }

    #[test]
    fn people_meet_as_the_paper_says() {
        for layout in Layout::SIX {
            let paths = paths(layout, 520, 20.0);
            let meets = |a, b| encounter(&paths, a, b, 20.0);
            // Neighbours of 0 1 3 2, and 2 with 4 and 5.
            let first =
                if layout == Layout::Along { [(0, 1), (1, 2), (2, 3)] } else { [(0, 1), (1, 3), (3, 2)] };
            for (a, b) in first.into_iter().chain([(2, 4), (2, 5)]) {
                assert!(meets(a, b).is_some(), "{layout}: {a} and {b}");
            }
            // All people are apart before, and for the last 8 s.
            for a in 0..6 {
                for b in 0..a {
                    if let Some([begin, end]) = meets(a, b) {
                        assert!(begin > 2.0 && end < 18.0, "{layout}: {a} and {b}, {begin} to {end} s");
                    }
                }
            }
        }
    }

    #[test]
    fn people_move_continuously() {
        for layout in Layout::SIX {
            let paths = paths(layout, 260, 10.0);
            for (before, after) in paths.iter().zip(&paths[1..]) {
                assert!(before.iter().zip(after).all(|(a, b)| (b - a).norm() < 0.2), "{layout}");
            }
        }
    }
}
