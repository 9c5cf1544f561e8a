//! Control points: points with known coordinates give the room its place and direction, and count as a length.
//!
//! The floor is z = 0 and stays so. What is left is a turn about the vertical and a shift on the floor: the least-squares motion
//! in the plane, in closed form (two dimensions of S. Umeyama, "Least-squares estimation of transformation parameters between two
//! point patterns", PAMI 1991, equations 40 to 42 with a scale of one). Their extent, the root of the sum of squared distances from their
//! mean, is a length like others.

use nalgebra::{
    Isometry2, Isometry3, Point2, Point3, Similarity3, Translation3, UnitQuaternion, Vector2, Vector3,
};
use serde::Serialize;

use super::{JoinedPictures, LARGEST_SIGMA, LengthEstimate, Located, SHAPE_SIGMA};
use crate::floor::{self, Plane};
use crate::{Error, Result};

/// Distance that control points must fit better mirrored than as they are to be refused, as a multiple and in metres.
const MIRRORED: f64 = 3.0;
const MIRRORED_M: f64 = 0.1;

/// A control point beside where the room has it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ControlResidual {
    /// Its number in the project, from 1.
    pub number: usize,
    /// Position in the room less the known one, metres: x, y and, where the height is known, z.
    pub off_m: Vec<f64>,
    /// Standard deviation of the position in the picture and in depth, metres.
    pub sigma_m: f64,
}

/// Positions of the control points in the common frame, with their standard deviations: the weighted mean of those by each of
/// their pixels.
fn located(joined: &JoinedPictures<'_>) -> Result<Vec<(Point3<f64>, f64)>> {
    let numbered = (1..).zip(&joined.project.control_points);
    let of_point = |(number, point): (usize, &crate::project::ControlPoint)| {
        let seen: Vec<Located> = point
            .picks
            .iter()
            .map(|(camera, pixel)| {
                let name = &joined.project.cameras[*camera].name;
                joined.located(*camera, pixel, &format!("[[control]] {number}, {name}"))
            })
            .collect::<Result<_>>()?;
        let weight = |s: &Located| 1.0 / (s.along_ray.powi(2) + s.across_ray.powi(2));
        let weights: f64 = seen.iter().map(weight).sum();
        let mean = seen.iter().map(|s| s.place.coords * weight(s)).sum::<Vector3<f64>>() / weights;
        Ok((Point3::from(mean), weights.sqrt().recip()))
    };
    numbered.map(of_point).collect()
}

/// Extent of the control points as a known length; `None` without any.
pub(super) fn extent(joined: &JoinedPictures<'_>, floor: &Plane) -> Result<Option<LengthEstimate>> {
    let points = &joined.project.control_points;
    if points.is_empty() {
        return Ok(None);
    }
    let level = floor::world_frame(floor, &joined.merged.poses()[0]);
    let located = located(joined)?;
    let found: Vec<Point2<f64>> = located.iter().map(|(place, _)| (level * place).xy()).collect();
    let known: Vec<Point2<f64>> = points.iter().map(|point| point.place).collect();
    let (units, known_m) = (spread(&found), spread(&known));
    let variance = located.iter().map(|(_, sigma)| sigma.powi(2)).sum::<f64>() / located.len() as f64;
    if variance.sqrt() < LARGEST_SIGMA * units {
        let sigma = (variance.sqrt() / units).hypot(SHAPE_SIGMA);
        return Ok(Some(LengthEstimate { name: "[[control]], their extent".into(), known_m, units, sigma }));
    }
    let problem = "they show points too near each other, or too far away, to give the metres; pick points that lie apart";
    Err(Error::content(&joined.project.path, "[[control]]", problem))
}

/// Turns and moves the room about the vertical to the coordinates of the control points: the motion, and how far each point is off.
/// Nothing without control points. `world_from_common`: the room so far, in metres, its floor at z = 0.
///
/// # Errors
/// [`Error::File`] for points that fit mirrored only.
pub fn fit(
    joined: &JoinedPictures<'_>,
    world_from_common: &Similarity3<f64>,
) -> Result<(Isometry3<f64>, Vec<ControlResidual>)> {
    let points = &joined.project.control_points;
    if points.is_empty() {
        return Ok((Isometry3::identity(), Vec::new()));
    }
    let located = located(joined)?;
    let found: Vec<Point3<f64>> = located.iter().map(|(place, _)| world_from_common * place).collect();
    let flat: Vec<Point2<f64>> = found.iter().map(Point3::xy).collect();
    let known: Vec<Point2<f64>> = points.iter().map(|point| point.place).collect();
    let weights: Vec<f64> = located.iter().map(|(_, sigma)| sigma.powi(-2)).collect();
    let motion = motion(&flat, &known, &weights);
    let mirrored: Vec<Point2<f64>> = flat.iter().map(|p| Point2::new(p.x, -p.y)).collect();
    let rms_m = |from: &[Point2<f64>], motion: &Isometry2<f64>| {
        let squares = from.iter().zip(&known).map(|(from, to)| (motion * from - to).norm_squared());
        (squares.sum::<f64>() / known.len() as f64).sqrt()
    };
    let (right_m, mirrored_m) =
        (rms_m(&flat, &motion), rms_m(&mirrored, &self::motion(&mirrored, &known, &weights)));
    if right_m > MIRRORED_M && right_m > MIRRORED * mirrored_m {
        let problem = format!(
            "the points fit mirrored ({mirrored_m:.2} m; {right_m:.2} m unmirrored): seen from above, y has to point to the \
             left of x; in a plan whose y points down, change its sign"
        );
        return Err(Error::content(&joined.project.path, "[[control]]", problem));
    }
    let shift = motion.translation.vector;
    let room_from_world = Isometry3::from_parts(
        Translation3::new(shift.x, shift.y, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), motion.rotation.angle()),
    );
    let residuals = (1..).zip(points).zip(found.iter().zip(&located));
    let residuals = residuals.map(|((number, point), (place, (_, sigma)))| {
        let place = room_from_world * place;
        let off = place.xy() - point.place;
        let height = point.height_m.map(|height_m| place.z - height_m);
        let off_m = [off.x, off.y].into_iter().chain(height).collect();
        ControlResidual { number, off_m, sigma_m: sigma * world_from_common.scaling() }
    });
    Ok((room_from_world, residuals.collect()))
}

/// Root of the sum of squared distances from the mean.
fn spread(points: &[Point2<f64>]) -> f64 {
    let mean = mean(points, &vec![1.0; points.len()]);
    points.iter().map(|point| (point.coords - mean).norm_squared()).sum::<f64>().sqrt()
}

fn mean(points: &[Point2<f64>], weights: &[f64]) -> Vector2<f64> {
    let sum: Vector2<f64> = points.iter().zip(weights).map(|(point, weight)| point.coords * *weight).sum();
    sum / weights.iter().sum::<f64>()
}

/// Motion in the plane that brings one set of points nearest to the other, by the weighted sum of squared distances.
fn motion(from: &[Point2<f64>], to: &[Point2<f64>], weights: &[f64]) -> Isometry2<f64> {
    let (from_mean, to_mean) = (mean(from, weights), mean(to, weights));
    let (mut dot, mut cross) = (0.0, 0.0);
    for ((a, b), weight) in from.iter().zip(to).zip(weights) {
        let (a, b) = (a.coords - from_mean, b.coords - to_mean);
        dot += weight * a.dot(&b);
        cross += weight * a.perp(&b);
    }
    let turn = Isometry2::rotation(cross.atan2(dot));
    Isometry2::new(to_mean - turn * from_mean, turn.rotation.angle())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_motion_is_found_from_points_that_it_moved(
            points in prop::collection::vec((-9.0..9.0_f64, -9.0..9.0_f64, 0.1..10.0_f64), 2..7),
            (x, y, angle) in (-50.0..50.0_f64, -50.0..50.0_f64, -3.1..3.1_f64),
        ) {
            let from: Vec<Point2<f64>> = points.iter().map(|(x, y, _)| Point2::new(*x, *y)).collect();
            prop_assume!(spread(&from) > 0.1);
            let truth = Isometry2::new(Vector2::new(x, y), angle);
            let to: Vec<Point2<f64>> = from.iter().map(|p| truth * p).collect();
            let weights: Vec<f64> = points.iter().map(|(.., weight)| *weight).collect();
            let found = motion(&from, &to, &weights);
            for point in &from {
                prop_assert!((found * point - truth * point).norm() < 1e-9);
            }
        }
    }
}
