//! Known lengths that contradict each other, and control points that are not where the room has them.

use super::{Light, Reason};
use crate::scale::LengthResidual;
use crate::scale::control::ControlResidual;

/// Number of standard deviations from which on a difference is doubtful, …
const OFF_SIGMAS: f64 = 3.0;
/// … if a length is off by at least this share, …
const LENGTH_OFF: f64 = 0.01;
/// … and a control point by this distance, metres.
const POINT_OFF_M: f64 = 0.05;

/// Known lengths beside what the room has there.
pub(super) fn lengths(lengths: &[LengthResidual], reasons: &mut Vec<Reason>) {
    if let [a, b] = lengths {
        let apart = (a.found_m / a.known_m) / (b.found_m / b.known_m) - 1.0;
        let sigma = (a.sigma_m / a.known_m).hypot(b.sigma_m / b.known_m);
        if apart.abs() > LENGTH_OFF.max(OFF_SIGMAS * sigma) {
            let text = format!(
                "{} ({:.3} m) and {} ({:.3} m) contradict each other by {:.1} %: one of them is wrong",
                a.name,
                a.known_m,
                b.name,
                b.known_m,
                100.0 * apart.abs()
            );
            reasons.push(Reason { light: Light::Amber, text });
        }
    }
    if lengths.len() < 3 {
        return;
    }
    for length in lengths {
        let off_m = length.found_m - length.known_m;
        if off_m.abs() > (LENGTH_OFF * length.known_m).max(OFF_SIGMAS * length.sigma_m) {
            let text = format!(
                "{} is {:.3} m, and comes out as {:.3} m: measure it again, and check its table",
                length.name, length.known_m, length.found_m
            );
            reasons.push(Reason { light: Light::Amber, text });
        }
    }
}

/// Control points beside where the room has them.
pub(super) fn control_points(points: &[ControlResidual], reasons: &mut Vec<Reason>) {
    for point in points {
        let off_m = point.off_m.iter().map(|off| off * off).sum::<f64>().sqrt();
        if off_m > POINT_OFF_M.max(OFF_SIGMAS * point.sigma_m) {
            let axes = ["x", "y", "height"].iter().zip(&point.off_m);
            let axes: Vec<String> =
                axes.map(|(axis, off)| format!("{axis} {:+.1} cm", 100.0 * off)).collect();
            let text = format!(
                "[[control]] {} is off by {:.1} cm in the room ({}): check its coordinates and its pixels",
                point.number,
                100.0 * off_m,
                axes.join(", ")
            );
            reasons.push(Reason { light: Light::Amber, text });
        }
    }
}
