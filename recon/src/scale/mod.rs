//! Metres of the common frame, from all that is known in metres: lengths in a picture, heights of cameras, boards, control points.
//!
//! Each known length gives the logarithm of the metres in a unit, with a standard deviation: of its ends in the picture and in
//! depth, or of the board. Their weighted mean is the scale, with Cauchy's weights from three on, so that one wrong length does not
//! spoil the others. The residual of each length is reported ([`LengthResidual`]).

pub mod board;
pub mod control;

use board::Square;
use nalgebra::{Point2, Point3, Vector3};
use serde::Serialize;

use crate::floor::Plane;
use crate::merge::{Merged, measured_at, pinhole_pixel};
use crate::project::{KnownLength, Project, scale_place};
use crate::ray_depth::MeasuredPixel;
use crate::surface::Surface;
use crate::{Error, Result};

/// Standard deviation of a pixel that a person gives, pixels.
const PIXEL_SIGMA: f64 = 0.5;
/// Relative standard deviation of a depth that stereo measured at such a pixel.
const DENSE_SIGMA: f64 = 0.01;
/// Standard deviation of a tape that is laid by hand, metres, …
const TAPE_SIGMA_M: f64 = 0.003;
/// … and of the height of a camera's optical centre above the floor, which lies within the camera.
const HEIGHT_SIGMA_M: f64 = 0.01;
/// Relative standard deviation of any length: the error of the room's shape.
const SHAPE_SIGMA: f64 = 0.005;
/// Largest relative standard deviation of a length from which metres are taken.
const LARGEST_SIGMA: f64 = 0.3;
/// Least sine of the angle at which two cameras see a picked point.
const LEAST_SINE: f64 = 0.02;
/// Number of standard deviations at which a length counts half, where there are three or more.
const HALF_WEIGHT: f64 = 2.0;
/// Number of rounds of reweighting.
const ROUNDS: usize = 30;

/// Metres of the common frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Metres {
    /// Metres in a unit of the common frame.
    pub per_unit: f64,
    /// Each known length, in the project's order, then the extent of the control points.
    pub lengths: Vec<LengthResidual>,
}

/// A known length beside what the room has there.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LengthResidual {
    /// Its table in the project, and what it is.
    pub name: String,
    /// Known length, metres.
    pub known_m: f64,
    /// Length in the room, metres.
    pub found_m: f64,
    /// Standard deviation of the difference, metres, without that of the other lengths.
    pub sigma_m: f64,
}

/// Cameras in the common frame, with what their pictures show.
#[derive(Debug, Clone, Copy)]
pub struct JoinedPictures<'a> {
    /// The project.
    pub project: &'a Project,
    /// Surface seen by each reference view.
    pub surfaces: &'a [Surface],
    /// Each camera's intrinsics as filmed.
    pub lenses: &'a [calib::Intrinsics],
    /// Picked pixels with individually measured depths.
    pub measured: &'a [Vec<MeasuredPixel>],
    /// Cameras and points in the common frame.
    pub merged: &'a Merged,
}

/// A point of the room in the common frame and unit, with the standard deviations of its position.
#[derive(Debug, Clone, Copy)]
struct Located {
    place: Point3<f64>,
    /// Unit vector along the ray that shows it.
    ray: Vector3<f64>,
    along_ray: f64,
    across_ray: f64,
}

impl Located {
    /// Variance along a unit vector.
    fn variance(&self, direction: &Vector3<f64>) -> f64 {
        let share = self.ray.dot(direction).powi(2);
        share * self.along_ray.powi(2) + (1.0 - share) * self.across_ray.powi(2)
    }
}

/// Metres in a unit of the common frame, from all known lengths and the extent of the control points.
///
/// # Arguments
/// `squares`: the side of each board among the project's lengths, in its camera's unit. `floor`: the floor in the common frame.
///
/// # Errors
/// [`Error::File`] naming the pixel without a depth, or the board that was not measured.
pub fn metres(joined: &JoinedPictures<'_>, squares: &[Option<Square>], floor: &Plane) -> Result<Metres> {
    let lengths = &joined.project.lengths;
    let mut estimates: Vec<LengthEstimate> = Vec::with_capacity(lengths.len() + 1);
    for (index, length) in lengths.iter().enumerate() {
        let square = squares.get(index).copied().flatten();
        estimates.push(joined.length(index, length, square, floor)?);
    }
    estimates.extend(control::extent(joined, floor)?);
    let per_unit = scale_of(&estimates);
    let residual = |estimate: LengthEstimate| LengthResidual {
        found_m: per_unit * estimate.units,
        sigma_m: estimate.sigma * estimate.known_m,
        known_m: estimate.known_m,
        name: estimate.name,
    };
    Ok(Metres { per_unit, lengths: estimates.into_iter().map(residual).collect() })
}

/// A known length as it is in the common frame.
#[derive(Debug, Clone)]
struct LengthEstimate {
    name: String,
    known_m: f64,
    /// Length in the common unit.
    units: f64,
    /// Relative standard deviation.
    sigma: f64,
}

/// Metres in a unit: the weighted mean of the logarithms; of three or more from their median on, reweighted. In the median all count
/// alike: one that claims to be precise may be the wrong one.
fn scale_of(estimates: &[LengthEstimate]) -> f64 {
    let logs: Vec<(f64, f64)> =
        estimates.iter().map(|e| ((e.known_m / e.units).ln(), e.sigma.powi(-2))).collect();
    let mean = |weighted: &dyn Fn(f64, f64) -> f64| {
        let (sum, weights) = logs.iter().fold((0.0, 0.0), |(sum, weights), (log, precision)| {
            let weight = weighted(*log, *precision);
            (sum + weight * log, weights + weight)
        });
        sum / weights
    };
    if logs.len() < 3 {
        return mean(&|_, precision| precision).exp();
    }
    let mut sorted: Vec<f64> = logs.iter().map(|(log, _)| *log).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    let mut log_scale = if sorted.len().is_multiple_of(2) {
        0.5 * (sorted[middle - 1] + sorted[middle])
    } else {
        sorted[middle]
    };
    for _ in 0..ROUNDS {
        let at = log_scale;
        log_scale =
            mean(&|log, precision| precision / (1.0 + (log - at).powi(2) * precision / HALF_WEIGHT.powi(2)));
    }
    log_scale.exp()
}

impl JoinedPictures<'_> {
    /// One known length in the common frame.
    fn length(
        &self,
        index: usize,
        length: &KnownLength,
        square: Option<Square>,
        floor: &Plane,
    ) -> Result<LengthEstimate> {
        let Self { project, merged, .. } = *self;
        let place = scale_place(index + 1, project.lengths.len());
        let name = |what: &str| format!("{place}, `{}`, {what}", project.cameras[length.camera()].name);
        let known_m = length.metres();
        let estimate = |what: &str, units: f64, sigma: f64| LengthEstimate {
            name: name(what),
            known_m,
            units,
            sigma: sigma.hypot(SHAPE_SIGMA),
        };
        match length {
            KnownLength::Board { camera, board, .. } => {
                let square = square.ok_or_else(|| {
                    let problem = format!("the {board} board was not measured");
                    Error::content(&project.path, format!("{place}, board"), problem)
                })?;
                let side = square.side * merged.common_from_camera[*camera].scaling();
                Ok(estimate("a square of the board", side, square.sigma))
            }
            KnownLength::Height { camera, .. } => {
                let units = floor.height(&(merged.poses()[*camera].inverse() * Point3::origin()));
                if units <= 0.0 {
                    let problem = format!(
                        "`{}` is not above the floor that was found; let the captures show more of the floor",
                        project.cameras[*camera].name
                    );
                    return Err(Error::content(&project.path, format!("{place}, height"), problem));
                }
                Ok(estimate("its height", units, HEIGHT_SIGMA_M / known_m))
            }
            KnownLength::Distance { camera, from, to, .. } => {
                let end = |key: &str, pixel| self.located(*camera, pixel, &format!("{place}, {key}"));
                let (from, to) = (end("from", from)?, end("to", to)?);
                let apart = to.place - from.place;
                let units = apart.norm();
                let direction = apart.try_normalize(0.0).unwrap_or_default();
                let sigma = (from.variance(&direction) + to.variance(&direction)).sqrt();
                if sigma > LARGEST_SIGMA * units || units <= 0.0 {
                    let problem = "`from` and `to` show points too near each other, or too far away, to give the metres; choose a \
                                   longer distance";
                    return Err(Error::content(&project.path, place, problem));
                }
                Ok(estimate("the distance", units, (sigma / units).hypot(TAPE_SIGMA_M / known_m)))
            }
        }
    }

    /// Position of what a pixel of a reference picture shows. `place`: its place in the project, for messages.
    fn located(&self, camera: usize, pixel: &Point2<f64>, place: &str) -> Result<Located> {
        let Self { project, surfaces, lenses, measured, merged } = *self;
        let common = &merged.common_from_camera[camera];
        let found = || {
            let pinhole = pinhole_pixel(&lenses[camera], pixel)?;
            let surface = &surfaces[camera];
            let ray = surface.intrinsics.unproject(&pinhole)?;
            let centre =
                |camera: usize| Point3::from(merged.common_from_camera[camera].isometry.translation.vector);
            let at = |place: Point3<f64>, along: &dyn Fn(f64) -> f64| {
                let far = (place - centre(camera)).norm();
                let across_ray = far * PIXEL_SIGMA / surface.intrinsics.fx;
                let ray = common.isometry.rotation * ray.normalize();
                Located { place, ray, along_ray: along(far), across_ray }
            };
            if let Some((place, cameras)) = picked(project, merged, camera, pixel) {
                let rays =
                    cameras.iter().filter(|other| **other != camera).map(|other| place - centre(*other));
                let sine =
                    rays.map(|ray| ray.angle(&(place - centre(camera))).sin()).fold(LEAST_SINE, f64::max);
                let along = |far: f64| far * PIXEL_SIGMA / surface.intrinsics.fx / sine;
                return Some(at(place, &along));
            }
            if let Some(own) = measured_at(&measured[camera], pixel) {
                let place = common * Point3::from(ray * own.depth.depth);
                return Some(at(place, &|far| own.depth.sigma * far));
            }
            Some(at(common * surface.point_at(&pinhole)?, &|far| DENSE_SIGMA * far))
        };
        found().ok_or_else(|| {
            let problem = format!(
                "there is no depth at [{}, {}] of `{}`; choose a pixel on something textured",
                pixel.x, pixel.y, project.cameras[camera].name
            );
            Error::content(&project.path, place, problem)
        })
    }
}

/// Position of a pixel that is also a picked point, and the cameras in which it is picked: several cameras determine it better than a
/// depth alone.
fn picked(
    project: &Project,
    merged: &Merged,
    camera: usize,
    pixel: &Point2<f64>,
) -> Option<(Point3<f64>, Vec<usize>)> {
    /// Largest distance between identical pixels.
    const SAME_PX: f64 = 1.0;
    let close = |p: Point2<f64>| (p - pixel).norm() <= SAME_PX;
    let point = project.points.iter().position(|p| p.pixel(camera).is_some_and(close))?;
    let place = merged.points.get(point).copied().flatten()?;
    Some((place, project.points[point].picks.iter().map(|(camera, _)| *camera).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn estimate(units: f64, known_m: f64, sigma: f64) -> LengthEstimate {
        LengthEstimate { name: String::new(), known_m, units, sigma }
    }

    #[test]
    fn two_lengths_count_by_their_precision() {
        // ln 2 known four times as precisely in the variance: the mean of the logarithms by hand.
        let scale = scale_of(&[estimate(1.0, 2.0, 0.01), estimate(1.0, 2.1, 0.02)]);
        let expected = ((4.0 * 2.0_f64.ln() + 2.1_f64.ln()) / 5.0).exp();
        assert!((scale / expected - 1.0).abs() < 1e-12, "{scale}, {expected}");
    }

    proptest! {
        #[test]
        fn one_wrong_length_of_several_moves_the_scale_by_less_than_its_precision(
            scale in 0.1..10.0_f64,
            lengths in prop::collection::vec((0.2..5.0_f64, -1.0..1.0_f64, 0.006..0.015_f64), 3..8),
            wrong in prop_oneof![0.1..0.8_f64, 1.25..10.0],
        ) {
            // The wrong one claims to be the most precise.
            const LEAST_SIGMA: f64 = 0.005;
            let right = lengths
                .iter()
                .map(|(units, off, sigma)| estimate(*units, units * scale * (1.0 + sigma * off), *sigma));
            let mut estimates: Vec<LengthEstimate> = right.collect();
            estimates.push(estimate(1.0, scale * wrong, LEAST_SIGMA));
            let found = scale_of(&estimates);
            prop_assert!((found / scale - 1.0).abs() < 0.018, "{found} for {scale}");
        }
    }
}
