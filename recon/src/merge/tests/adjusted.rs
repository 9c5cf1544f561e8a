//! The adjustment of all captures, over captures with known motion whose spaces are bent.

use approx::assert_relative_eq;
use nalgebra::{Isometry3, Point2, Point3, Similarity3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::super::adjustment::{Adjusted, CaptureMotion, JointBundle, SharedFeature, adjust};
use super::super::{LiftedPick, Merged};
use super::box_room::BoxRoom;
use super::{HALF, UNITS, lens, poses, surface};
use crate::floor::Plane;
use crate::motion::SparsePoint;
use crate::surface::Surface;

const FRAMES: usize = 20;
const FEATURES: usize = 300;
const NOISE_PX: f64 = 0.1;
const PICK_PX: f64 = 0.5;

/// A capture's motion in its own frame and unit.
struct Filmed {
    camera_from_world: Vec<Option<Isometry3<f64>>>,
    points: Vec<SparsePoint>,
    /// True places of the points in the room, metres.
    places: Vec<Point3<f64>>,
}

fn normal(rng: &mut Pcg64Mcg) -> Vector2<f64> {
    Vector2::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Films the room from around a camera's pose; the first frame is the reference. `bend` is added to all inverse depths.
fn filmed(camera: usize, bend: f64, rng: &mut Pcg64Mcg) -> Filmed {
    let (pose, unit) = (poses()[camera], UNITS[camera]);
    let mut path = vec![Isometry3::identity()];
    path.extend((1..FRAMES).map(|i| {
        let t = i as f64 / FRAMES as f64 * std::f64::consts::TAU;
        let shift = Vector3::new(0.35 * t.sin(), 0.2 * (2.0 * t).sin(), 0.15 * (1.0 - t.cos())) / unit;
        Isometry3::from_parts(
            shift.into(),
            UnitQuaternion::from_euler_angles(0.03 * t.sin(), -0.05, 0.02 * t.cos()),
        )
    }));
    let room = BoxRoom([Point3::from(-HALF), Point3::from(HALF)]);
    let eye = pose.inverse() * Point3::origin();
    let (mut points, mut places) = (Vec::new(), Vec::new());
    for _ in 0..FEATURES {
        let pixel = Point2::new(rng.random_range(5.0..315.0), rng.random_range(5.0..235.0));
        let ray = pose.rotation.inverse() * lens().unproject(&pixel).unwrap();
        let place = eye + ray * room.hit(&eye, &ray).0;
        let own = Point3::from((pose * place).coords / unit);
        let seen = path.iter().enumerate().filter_map(|(frame, pose)| {
            let pixel = lens().project(&(pose * own)).filter(|pixel| lens().contains(pixel))?;
            Some((frame, pixel + NOISE_PX * normal(rng)))
        });
        let observations = seen.collect();
        points.push(SparsePoint { position: bent(&own, bend), observations });
        places.push(place);
    }
    Filmed { camera_from_world: path.into_iter().map(Some).collect(), points, places }
}

fn bent(point: &Point3<f64>, bend: f64) -> Point3<f64> {
    point / (1.0 + bend * point.z)
}

/// Two captures, bent by so much, with what joins them.
struct Joined {
    filmed: [Filmed; 2],
    surfaces: [Surface; 2],
    picks: Vec<LiftedPick>,
    shared: Vec<SharedFeature>,
    start: Vec<Similarity3<f64>>,
}

impl Joined {
    /// `picked`: number of picks; `shared`: whether features are seen by both cameras.
    fn new(bends: [f64; 2], picked: usize, with_shared: bool) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let filmed = [0, 1].map(|camera| filmed(camera, bends[camera], &mut rng));
        let project = |camera: usize, place: &Point3<f64>| {
            lens().project(&(poses()[camera] * place)).filter(|pixel| lens().contains(pixel))
        };
        let (mut picks, mut shared, mut pairs) = (Vec::new(), Vec::new(), Vec::new());
        for (capture, other) in [(0, 1), (1, 0)] {
            for (feature, place) in filmed[capture].places.iter().enumerate() {
                let Some(pixel) = project(other, place) else { continue };
                if with_shared {
                    let pixel = pixel + 0.3 * normal(&mut rng);
                    shared.push(SharedFeature { capture, feature, camera: other, pixel, share: 1.0 });
                }
                if capture > 0 || pairs.len() >= picked {
                    continue;
                }
                let point = pairs.len();
                let own = [0, 1].map(|camera| {
                    let true_own = Point3::from((poses()[camera] * place).coords / UNITS[camera]);
                    bent(&true_own, bends[camera])
                });
                pairs.push(own);
                for camera in [0, 1] {
                    let slip = PICK_PX * normal(&mut rng);
                    let true_own = Point3::from((poses()[camera] * place).coords / UNITS[camera]);
                    let frames = filmed[camera].camera_from_world.iter().enumerate().skip(1);
                    // The patch of the picked pixel, beside the point by the slip.
                    let ray = lens().unproject(&(project(camera, place).unwrap() + slip)).unwrap();
                    let beside = Point3::from(ray * true_own.z);
                    let frames = frames.filter_map(|(frame, pose)| {
                        Some((frame, lens().project(&((*pose)? * beside))? + NOISE_PX * normal(&mut rng)))
                    });
                    let frames = frames.collect();
                    let pixel = project(camera, place).unwrap() + slip;
                    let seen = Some(bent(&beside, bends[camera]));
                    picks.push(LiftedPick { point, camera, pixel, seen, depth: None, frames });
                }
            }
        }
        let (from, to): (Vec<_>, Vec<_>) = pairs.iter().map(|[a, b]| (*b, *a)).unzip();
        let start = calib::absolute_orientation::similarity(&from, &to).unwrap();
        let start = vec![Similarity3::identity(), start];
        Self { filmed, surfaces: [0, 1].map(surface), picks, shared, start }
    }

    fn adjusted(&self) -> Adjusted {
        self.with_bundle(|bundle| bundle.adjusted())
    }

    /// Result of `then` with the adjusted captures.
    fn with_bundle<T>(&self, then: impl FnOnce(&mut JointBundle<'_>) -> T) -> T {
        let lens = lens();
        let motions = [0, 1].map(|camera| {
            let Filmed { camera_from_world, points, .. } = &self.filmed[camera];
            CaptureMotion { lens: &lens, reference: 0, camera_from_world, points }
        });
        let first = self.picks.iter().filter(|pick| pick.camera == 0);
        let points = first.map(|pick| pick.seen).collect();
        let start = Merged { common_from_camera: self.start.clone(), points };
        then(&mut adjust(&motions, &self.surfaces, &start, (&self.picks, PICK_PX), &self.shared))
    }
}

/// Error of the second camera's place as a share of the distance, and of its orientation in degrees.
fn errors(common_from_camera: &[Similarity3<f64>]) -> (f64, f64) {
    let truth = poses()[0] * poses()[1].inverse();
    let found = common_from_camera[1].isometry;
    let (shift, expected) = (found.translation.vector.normalize(), truth.translation.vector.normalize());
    let turn = calib::rotation::angle_between_deg(&found.rotation, &truth.rotation);
    ((shift - expected).norm(), turn)
}

#[test]
fn captures_unbend_each_other() {
    for (bends, picked, with_shared) in
        [([0.01, -0.015], 12, true), ([0.02, 0.0], 14, false), ([0.0, 0.0], 12, true)]
    {
        let joined = Joined::new(bends, picked, with_shared);
        let before = errors(&joined.start);
        let adjusted = joined.adjusted();
        let after = errors(&adjusted.common_from_camera);
        // Half a pixel of a pick is 0.15°.
        let largest_deg = if with_shared { 0.12 } else { 0.3 };
        assert!(after.0 < 0.002 && after.1 < largest_deg, "{bends:?} {with_shared}: {before:?} {after:?}");
        let is_bent = bends.iter().any(|bend| bend.abs() > 0.0);
        if is_bent {
            assert!(after.0 < 0.5 * before.0 && after.1 < 0.5 * before.1, "{bends:?}: {before:?} {after:?}");
        }
        // Picked points, in the first camera's unit, have the error of a pick by hand.
        assert_eq!(adjusted.picks.len(), picked);
        for (number, place) in &adjusted.picks {
            let truth = poses()[0] * joined.picked_place(*number);
            let unit = place.coords.norm() / truth.coords.norm();
            assert!((place.coords / unit - truth.coords).norm() < 0.03, "{number}: {place} {truth}");
        }
        assert_relative_eq!(adjusted.common_from_camera[0].scaling(), 1.0, epsilon = 1e-15);
        // Told is what the bend does to the depths beside their scale.
        for camera in [0, 1] {
            let (told, expected) =
                (adjusted.depth_sigma[camera].unwrap(), joined.depth_sigma(camera, bends[camera]));
            assert!((told - expected).abs() < 0.25 * expected + 0.003, "{bends:?}: {told} {expected}");
        }
    }
}

impl Joined {
    /// Relative standard deviation, by the median, of a capture's bent depths at the best scale.
    fn depth_sigma(&self, camera: usize, bend: f64) -> f64 {
        let median = |mut of: Vec<f64>| {
            of.sort_by(f64::total_cmp);
            of[of.len() / 2]
        };
        let places = self.filmed[camera].places.iter();
        let stretched = |place: &Point3<f64>| 1.0 + bend * (poses()[camera] * place).z / UNITS[camera];
        let stretched: Vec<f64> = places.map(stretched).collect();
        let scale = median(stretched.clone());
        median(stretched.iter().map(|stretch| (stretch / scale - 1.0).abs()).collect()) / 0.6745
    }

    fn picked_place(&self, number: usize) -> Point3<f64> {
        let seen = self.filmed[0].places.iter().filter(|place| {
            lens().project(&(poses()[1] * **place)).is_some_and(|pixel| lens().contains(&pixel))
        });
        *seen.clone().nth(number).unwrap()
    }
}

#[test]
fn features_found_elsewhere_are_left_out() {
    let mut joined = Joined::new([0.0, 0.0], 12, true);
    let without = errors(&joined.adjusted().common_from_camera);
    for feature in joined.shared.iter_mut().step_by(4) {
        feature.pixel += Vector2::new(30.0, -25.0);
    }
    let with = errors(&joined.adjusted().common_from_camera);
    assert!(with.0 < without.0 + 0.0005 && with.1 < without.1 + 0.03, "{without:?} {with:?}");
}

#[test]
fn picks_without_registrations_count_by_their_rays() {
    let mut joined = Joined::new([0.0, 0.0], 14, false);
    for pick in &mut joined.picks {
        pick.frames.clear();
    }
    let adjusted = joined.adjusted();
    let (shift, turn) = errors(&adjusted.common_from_camera);
    assert!(shift < 0.01 && turn < 0.4 && adjusted.picks.len() == 14, "{shift} {turn}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let joined = Joined::new([0.01, 0.0], 12, true);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let both = |bundle: &mut JointBundle<'_>| {
            let before = bundle.adjusted();
            assert!(bundle.lay_on(&floor_of_surfaces(&before, 0.1, 0.004), &joined.surfaces));
            (before.common_from_camera, bundle.adjusted().common_from_camera)
        };
        pool.install(|| joined.with_bundle(both))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn a_picked_point_behind_its_camera_does_not_fit() {
    let joined = Joined::new([0.0, 0.0], 12, true);
    let pick = &joined.picks[0];
    let misfit_px = |place: Option<Point3<f64>>| {
        let common_from_camera = joined.start.clone();
        let points = vec![place.map(|place| common_from_camera[pick.camera] * place); pick.point + 1];
        Merged { common_from_camera, points }.misfit_px(pick, &joined.surfaces)
    };
    assert!(misfit_px(Some(Point3::new(0.0, 0.0, 2.0))).is_some_and(f64::is_finite));
    assert_eq!(misfit_px(Some(Point3::new(0.0, 0.0, -2.0))), Some(f64::INFINITY));
    assert_eq!(misfit_px(None), None);
}

/// Floor of the room as surfaces may have it: it leans by `tilt_deg`, and lies `low_m` too low. In the first camera's frame and unit.
fn floor_of_surfaces(adjusted: &Adjusted, tilt_deg: f64, low_m: f64) -> Plane {
    let [first, second] = [poses()[0], poses()[1]];
    let height_m = (first.inverse() * Point3::origin()).z + HALF.z;
    let apart_m = (first * second.inverse()).translation.vector.norm();
    let unit_m = apart_m / adjusted.common_from_camera[1].isometry.translation.vector.norm();
    let turn = UnitQuaternion::new(first.rotation * Vector3::x() * f64::to_radians(tilt_deg));
    Plane { normal: turn * (first.rotation * Vector3::z()), distance: -(height_m + low_m) / unit_m }
}

/// Height of the first camera, as a share of the distance between the two.
fn height_share(plane: &Plane, common_from_camera: &[Similarity3<f64>]) -> f64 {
    plane.height(&Point3::origin()) / common_from_camera[1].isometry.translation.vector.norm()
}

#[test]
fn features_on_the_floor_tell_it_where_surfaces_are_off() {
    let truth = poses()[0];
    let up = truth.rotation * Vector3::z();
    let height_m = (truth.inverse() * Point3::origin()).z + HALF.z;
    let apart_m = (truth * poses()[1].inverse()).translation.vector.norm();
    for (bends, tilt_deg) in [([0.0, 0.0], 0.0), ([0.01, -0.015], 0.2), ([0.0, 0.0], -0.2)] {
        let joined = Joined::new(bends, 12, true);
        let (before, floor, after) = joined.with_bundle(|bundle| {
            let before = bundle.adjusted();
            assert!(bundle.lay_on(&floor_of_surfaces(&before, tilt_deg, 0.006), &joined.surfaces));
            (before, bundle.floor(), bundle.adjusted())
        });
        let tilt_deg = floor.normal.angle(&up).to_degrees();
        let share = height_share(&floor, &after.common_from_camera) / (height_m / apart_m) - 1.0;
        assert!(tilt_deg < 0.08 && share.abs() < 0.0015, "{bends:?}: {tilt_deg}° {share}");
        let (before, after) = (errors(&before.common_from_camera), errors(&after.common_from_camera));
        assert!(after.0 < before.0 + 2e-4 && after.1 < before.1 + 0.01, "{bends:?}: {before:?} {after:?}");
    }
}

#[test]
fn a_floor_that_few_features_show_is_left_to_the_surfaces() {
    let joined = Joined::new([0.0, 0.0], 12, true);
    joined.with_bundle(|bundle| {
        let before = bundle.adjusted().common_from_camera;
        // A plane halfway up has none.
        let up = poses()[0].rotation * Vector3::z();
        assert!(!bundle.lay_on(&Plane { normal: up, distance: -0.5 }, &joined.surfaces));
        assert_eq!(bundle.adjusted().common_from_camera, before);
    });
}
