//! The path between two fixes that are far apart in time, by a gap of the track or a low rate: a cubic with the velocities at both.

use nalgebra::Vector2;

use super::fix::Fix;

/// Longest time between two fixes that is passed straight, seconds.
const STRAIGHT_S: f64 = 0.15;
/// Time between two positions of the path, seconds.
const STEP_S: f64 = 0.1;
/// Largest speed of a person, metres a second: a faster one is no velocity, and the path is straight.
pub(super) const FASTEST_M_S: f64 = 3.0;
/// Standard deviation of a change of velocity that nobody has seen, metres a second squared.
const ACCELERATION_M_S2: f64 = 0.5;

/// Positions between two fixes with their velocities, by time; none where the fixes are near each other, more than `longest_s`
/// apart, or of unknown velocity (zero).
pub(super) fn path_between(
    (from, start): (&Fix, &Vector2<f64>),
    (to, end): (&Fix, &Vector2<f64>),
    longest_s: f64,
) -> impl Iterator<Item = Fix> + use<> {
    let span_s = to.time_s - from.time_s;
    let is_known = |v: &Vector2<f64>| *v != Vector2::zeros() && v.norm() <= FASTEST_M_S;
    let is_curved = span_s > STRAIGHT_S && span_s <= longest_s && is_known(start) && is_known(end);
    let steps = if is_curved { (span_s / STEP_S).ceil() as u32 } else { 0 };
    let (from, to, start, end) = (*from, *to, *start, *end);
    (1..steps).map(move |step| {
        // Hermite's form of the cubic.
        let s = f64::from(step) / f64::from(steps);
        let (toward, rest) = (s * s * (3.0 - 2.0 * s), 1.0 - s);
        let bend = (start * (rest * rest * s) - end * (s * s * rest)) * span_s;
        let unseen_m = 0.5 * ACCELERATION_M_S2 * s * rest * span_s * span_s;
        let sigma_m = from.sigma_m * rest + to.sigma_m * s;
        Fix {
            time_s: from.time_s + s * span_s,
            place: from.place + (to.place - from.place) * toward + bend,
            sigma_m: sigma_m.map(|sigma_m| sigma_m.hypot(unseen_m)),
            ..from
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    fn fix(time_s: f64, x: f64, y: f64) -> Fix {
        Fix { frame: 1, time_s, place: Point2::new(x, y), sigma_m: Vector2::repeat(0.03) }
    }

    /// x = t, y = t² for one second: a cubic is exact on a parabola.
    #[test]
    fn a_parabola_is_met_exactly() {
        let path: Vec<Fix> = path_between(
            (&fix(2.0, 0.0, 0.0), &Vector2::new(1.0, 0.0)),
            (&fix(3.0, 1.0, 1.0), &Vector2::new(1.0, 2.0)),
            2.0,
        )
        .collect();
        assert_eq!(path.len(), 9);
        for fix in path {
            let t = fix.time_s - 2.0;
            assert!((fix.place - Point2::new(t, t * t)).norm() < 1e-12, "{fix:?}");
            assert!(fix.sigma_m.x > 0.03 && fix.sigma_m.x < 0.08);
        }
    }

    #[test]
    fn near_fixes_long_gaps_and_unknown_velocities_are_passed_straight() {
        let count = |span_s: f64, speed: f64| {
            let v = Vector2::new(speed, 0.0);
            path_between((&fix(0.0, 0.0, 0.0), &v), (&fix(span_s, 1.0, 0.0), &v), 2.0).count()
        };
        assert_eq!([count(0.1, 1.0), count(2.5, 1.0), count(1.0, 0.0), count(1.0, 9.0)], [0; 4]);
        assert_eq!(count(0.0, 1.0) + count(f64::NAN, 1.0), 0);
        assert_eq!(count(1.0, 1.0), 9);
    }
}
