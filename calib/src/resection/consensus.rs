//! Resection that tells wrong picks: the pose on which most picks agree, and whether a mirrored world fits better.
//!
//! Poses from three picks at a time are scored by the picks near their projections, as in RANSAC (M. Fischler &
//! R. Bolles, CACM 24, 1981), but with the truncated squares of MSAC (P. Torr & A. Zisserman, CVIU 78, 2000) and, for the
//! numbers of picks that people make, with every triple.

use nalgebra::{Isometry3, Vector2};

use super::{PICK_SIGMA_PX, Pick, Resection, refine_pose, resect, residuals_px, rms, three_points};
use crate::least_squares::{Loss, Options};
use crate::{Camera, Error, Intrinsics, Result};

/// Residual from which on a pick is wrong, in standard deviations of picks by hand.
const WRONG_SIGMAS: f64 = 8.0;
/// Residual of a wrong pick, in root mean squares of the others.
const WRONG_OVER_OTHERS: f64 = 5.0;
/// Image side up to which picks are made to [`PICK_SIGMA_PX`], pixels; in larger images errors grow with the side.
const USUAL_SIDE_PX: f64 = 1000.0;
/// Fewest picks that must agree.
const LEAST_AGREEING: usize = 5;
/// Largest share of wrong picks.
const MOST_WRONG: f64 = 0.34;
/// Most triples that are tried.
const MOST_TRIPLES: usize = 600;
/// Number of best-scored poses that are refined.
const REFINED: usize = 8;
/// Share of the residual that a mirrored world must leave at most.
const MIRRORED_SHARE: f64 = 0.25;

/// A pose that most picks agree on.
#[derive(Debug, Clone)]
pub struct Consensus {
    /// The pose by the agreeing picks; residuals are those of all picks, in their order.
    pub resection: Resection,
    /// Indices of the picks that do not agree with the others; they have no part in the pose.
    pub wrong: Vec<usize>,
}

impl Consensus {
    /// Root mean square residual of the agreeing picks, pixels.
    pub fn rms_px(&self) -> f64 {
        let agreeing: Vec<f64> = (0..self.resection.residuals_px.len())
            .filter(|i| !self.wrong.contains(i))
            .map(|i| self.resection.residuals_px[i])
            .collect();
        rms(&agreeing)
    }
}

/// Residual from which on a pick counts as wrong in an image of this size, pixels.
pub fn wrong_from_px(width: u32, height: u32) -> f64 {
    let side = f64::from(width.max(height));
    WRONG_SIGMAS * PICK_SIGMA_PX * (side / USUAL_SIDE_PX).max(1.0)
}

/// Estimates the pose as [`resect`] does, and leaves out picks that do not agree with most of the others.
///
/// # Errors
/// As [`resect`]; [`Error::Degenerate`] where the mirror image of the world fits much better than the world.
pub fn resect_by_consensus(intrinsics: &Intrinsics, picks: &[Pick]) -> Result<Consensus> {
    let wrong_px = wrong_from_px(intrinsics.width, intrinsics.height);
    let all = resect(intrinsics, picks);
    if all.as_ref().is_ok_and(|all| all.residuals_px.iter().all(|r| *r < wrong_px)) {
        return all.map(|resection| Consensus { resection, wrong: Vec::new() });
    }
    let here = agreeing(intrinsics, picks, wrong_px);
    let mirrored = mirrored_world(picks);
    if let Some(mirror) = agreeing(intrinsics, &mirrored, wrong_px)
        && mirror.fits_better_than(here.as_ref(), picks.len())
    {
        let as_it_is = all.as_ref().map_or(f64::NAN, Resection::rms_px);
        return Err(mirrored_world_error(mirror.rms_px(), as_it_is));
    }
    let Some(here) = here.filter(|here| here.is_enough(picks.len())) else {
        return all.map(|resection| Consensus { resection, wrong: Vec::new() });
    };
    let kept: Vec<Pick> =
        picks.iter().zip(&here.agrees).filter(|(_, agrees)| **agrees).map(|(p, _)| *p).collect();
    let mut resection = resect(intrinsics, &kept)?;
    let Some(residuals) = residuals_of_all(&resection.camera, picks) else {
        return all.map(|resection| Consensus { resection, wrong: Vec::new() });
    };
    let others_px = resection.rms_px().max(PICK_SIGMA_PX);
    let wrong: Vec<usize> = (0..picks.len()).filter(|i| !here.agrees[*i]).collect();
    if wrong.iter().any(|i| residuals[*i] < WRONG_OVER_OTHERS * others_px) {
        // Not a few wrong picks among good ones: all are bad, or the lens is another one.
        return all.map(|resection| Consensus { resection, wrong: Vec::new() });
    }
    resection.residuals_px = residuals;
    Ok(Consensus { resection, wrong })
}

/// Refuses a camera that was estimated with its lens, if the mirror image of the world fits its picks much better.
///
/// # Errors
/// [`Error::Degenerate`].
pub fn refuse_mirrored_world(found: &Resection, of_mirrored: Option<&Resection>) -> Result<()> {
    let k = &found.camera.intrinsics;
    let (here, mirror) = (found.rms_px(), of_mirrored.map_or(f64::INFINITY, Resection::rms_px));
    if here >= wrong_from_px(k.width, k.height) && mirror <= MIRRORED_SHARE * here {
        return Err(mirrored_world_error(mirror, here));
    }
    Ok(())
}

/// The picks with the mirror image of their world: y with the other sign. Any other mirror image differs from it by a
/// rotation, which the pose takes up.
pub fn mirrored_world(picks: &[Pick]) -> Vec<Pick> {
    let mirror = |pick: &Pick| {
        let mut pick = *pick;
        pick.world.y = -pick.world.y;
        pick
    };
    picks.iter().map(mirror).collect()
}

fn mirrored_world_error(mirrored_px: f64, as_it_is_px: f64) -> Error {
    let as_it_is = if as_it_is_px.is_finite() {
        format!("{as_it_is_px:.2} px as they are")
    } else {
        "no pose as they are".to_owned()
    };
    Error::Degenerate(format!(
        "the points fit the mirror image of their world ({mirrored_px:.2} px rms with y negated, {as_it_is}): the sign of an \
         axis is wrong, or two axes are swapped; the world is right-handed, with Z up, and v counts downwards"
    ))
}

/// A pose, and the picks that agree with it.
struct Agreement {
    agrees: Vec<bool>,
    /// Sum of the squared residuals, each up to the square of the limit, pixels².
    cost: f64,
    squares: f64,
}

impl Agreement {
    fn count(&self) -> usize {
        self.agrees.iter().filter(|agrees| **agrees).count()
    }

    fn rms_px(&self) -> f64 {
        (self.squares / self.count().max(1) as f64).sqrt()
    }

    fn is_enough(&self, picks: usize) -> bool {
        let wrong = picks - self.count();
        self.count() >= LEAST_AGREEING && wrong as f64 <= MOST_WRONG * picks as f64
    }

    /// Whether the mirrored world is the right one: most picks agree with it, and fewer with the world as it is. Picks
    /// on a plane agree with both.
    fn fits_better_than(&self, other: Option<&Self>, picks: usize) -> bool {
        let of_other = other.map_or(0, Self::count);
        let share = MIRRORED_SHARE * other.map_or(f64::INFINITY, |other| other.cost);
        self.is_enough(picks) && self.count() > of_other && self.cost <= share
    }
}

/// The pose on which most picks agree, if there is one.
fn agreeing(intrinsics: &Intrinsics, picks: &[Pick], wrong_px: f64) -> Option<Agreement> {
    let rays: Vec<Option<Vector2<f64>>> =
        picks.iter().map(|pick| Some(intrinsics.unproject(&pick.pixel)?.xy())).collect();
    let scored = |pose: &Isometry3<f64>| {
        let camera = Camera { intrinsics: intrinsics.clone(), camera_from_world: *pose };
        score(&camera, picks, wrong_px)
    };
    let mut poses: Vec<(f64, Isometry3<f64>)> = Vec::new();
    for triple in triples(picks.len()) {
        let [Some(a), Some(b), Some(c)] = triple.map(|i| rays[i]) else { continue };
        let three = triple.map(|i| picks[i]);
        for pose in three_points::from_triples(&three, &[a, b, c]) {
            if pose.to_homogeneous().iter().all(|v| v.is_finite()) {
                poses.push((scored(&pose).cost, pose));
            }
        }
    }
    poses.sort_by(|a, b| a.0.total_cmp(&b.0));
    let refined = poses.into_iter().take(REFINED).map(|(_, start)| {
        let agrees = scored(&start).agrees;
        let kept: Vec<Pick> =
            picks.iter().zip(agrees).filter(|(_, agrees)| *agrees).map(|(p, _)| *p).collect();
        let options = Options::default();
        let pose = refine_pose(intrinsics, &kept, &start, Loss::Squares, &options);
        scored(&refine_pose(intrinsics, picks, &pose, Loss::Cauchy(0.5 * wrong_px), &options))
    });
    refined.min_by(|a, b| a.cost.total_cmp(&b.cost))
}

fn score(camera: &Camera, picks: &[Pick], wrong_px: f64) -> Agreement {
    let mut found = Agreement { agrees: Vec::with_capacity(picks.len()), cost: 0.0, squares: 0.0 };
    for pick in picks {
        let residual = camera.project(&pick.world).map_or(f64::INFINITY, |seen| (seen - pick.pixel).norm());
        let agrees = residual < wrong_px;
        found.cost += residual.min(wrong_px).powi(2);
        found.squares += if agrees { residual * residual } else { 0.0 };
        found.agrees.push(agrees);
    }
    found
}

/// Distance of each pick to its point's projection, pixels; infinite for points behind the camera. `None` when most are.
fn residuals_of_all(camera: &Camera, picks: &[Pick]) -> Option<Vec<f64>> {
    residuals_px(camera, picks).or_else(|| {
        let residual = |pick: &Pick| {
            camera.project(&pick.world).map_or(f64::INFINITY, |seen| (seen - pick.pixel).norm())
        };
        let residuals: Vec<f64> = picks.iter().map(residual).collect();
        (residuals.iter().filter(|r| r.is_finite()).count() >= LEAST_AGREEING).then_some(residuals)
    })
}

/// Every three of the picks, or [`MOST_TRIPLES`] of them, spread evenly.
fn triples(count: usize) -> Vec<[usize; 3]> {
    let all =
        (0..count).flat_map(|i| (i + 1..count).flat_map(move |j| (j + 1..count).map(move |k| [i, j, k])));
    let number = count * count.saturating_sub(1) * count.saturating_sub(2) / 6;
    all.step_by(number.div_ceil(MOST_TRIPLES).max(1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;

    fn camera(turn: f64) -> Camera {
        let eye = Point3::new(4.0 * turn.cos(), 4.0 * turn.sin(), 2.4);
        let pose = Isometry3::face_towards(&eye, &Point3::new(0.0, 0.0, 0.7), &-Vector3::z()).inverse();
        let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 70.0);
        intrinsics.distortion = [-0.1, 0.02, 0.0, 0.0, 0.0].into();
        Camera { intrinsics, camera_from_world: pose }
    }

    /// Points of a room, on its floor and above it, with errors of up to half a pixel.
    fn picks(camera: &Camera, count: usize) -> Vec<Pick> {
        let pick = |i: usize| {
            let part = |step: f64| (i as f64 * step + 0.3).fract();
            let height = if i.is_multiple_of(2) { 0.0 } else { 1.8 * part(0.29) };
            let world = Point3::new(2.4 * part(0.618) - 1.2, 2.4 * part(0.414) - 1.2, height);
            let error = Vector2::new(part(0.77) - 0.5, part(0.53) - 0.5);
            Pick { world, pixel: camera.project(&world).unwrap() + error }
        };
        (0..count).map(pick).collect()
    }

    proptest! {
        #[test]
        fn wrong_picks_are_told_and_have_no_part_in_the_pose(
            turn in 0.0..6.2, count in 7usize..14, first in 0usize..7, off in 12.0..80.0,
        ) {
            let camera = camera(turn);
            let mut seen = picks(&camera, count);
            let mut wrong = vec![first];
            seen[first].pixel.x += off;
            if count >= 10 {
                let second = (first + 4) % count;
                seen[second].pixel.y -= off;
                wrong.push(second);
                wrong.sort_unstable();
            }
            let found = resect_by_consensus(&camera.intrinsics, &seen).unwrap();
            prop_assert_eq!(&found.wrong, &wrong);
            let away_m = (found.resection.camera.center() - camera.center()).norm();
            prop_assert!(away_m < 0.12 && found.rms_px() < 1.0, "{} m, {} px", away_m, found.rms_px());
        }

        #[test]
        fn a_mirrored_world_is_refused_whichever_axis_it_is(turn in 0.0..6.2, count in 6usize..12, axis in 0usize..4) {
            let camera = camera(turn);
            let mut seen = picks(&camera, count);
            for pick in &mut seen {
                let w = pick.world;
                pick.world = match axis {
                    0 => Point3::new(-w.x, w.y, w.z),
                    1 => Point3::new(w.x, -w.y, w.z),
                    2 => Point3::new(w.x, w.y, -w.z),
                    _ => Point3::new(w.y, w.x, w.z),
                };
            }
            let said = resect_by_consensus(&camera.intrinsics, &seen).map(|c| c.rms_px()).unwrap_err().to_string();
            prop_assert!(said.contains("mirror") && said.contains("right-handed"), "{said}");
        }
    }

    #[test]
    fn good_picks_and_picks_on_a_plane_are_taken_as_they_are() {
        let camera = camera(0.8);
        let seen = picks(&camera, 9);
        let found = resect_by_consensus(&camera.intrinsics, &seen).unwrap();
        assert!(found.wrong.is_empty());
        assert_eq!(found.resection.residuals_px, resect(&camera.intrinsics, &seen).unwrap().residuals_px);
        // A plane's mirror image is the plane turned over: nothing tells them apart.
        let flat: Vec<Pick> = seen.iter().filter(|pick| pick.world.z == 0.0).copied().collect();
        assert!(resect_by_consensus(&camera.intrinsics, &flat).unwrap().wrong.is_empty());
        // Picks that are all bad have no consensus.
        let noise = |i: usize| Vector2::new((i as f64 * 2.4).sin(), (i as f64 * 1.7).cos()) * 25.0;
        let bad: Vec<Pick> =
            seen.iter().enumerate().map(|(i, pick)| Pick { pixel: pick.pixel + noise(i), ..*pick }).collect();
        assert!(resect_by_consensus(&camera.intrinsics, &bad).unwrap().wrong.is_empty());
    }
}
