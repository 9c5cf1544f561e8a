//! Which frames of a capture take part: spread as wide as the camera went, yet looking at what the reference sees.

use nalgebra::{Isometry3, Point2, Point3};

use super::DenseOptions;
use calib::Intrinsics;

/// What the choice needs to know of one frame.
pub(super) struct Candidate {
    pub(super) frame: usize,
    pub(super) camera_from_reference: Isometry3<f64>,
    /// Mean absolute brightness gradient: blurred frames have less of it.
    pub(super) sharpness: f64,
}

impl Candidate {
    fn center(&self) -> Point3<f64> {
        self.camera_from_reference.inverse() * Point3::origin()
    }

    /// The median angle between the rays from the reference and from here to the points, degrees.
    fn parallax_deg(&self, points: &[Point3<f64>]) -> f64 {
        let center = self.center();
        let mut angles: Vec<f64> = points.iter().map(|p| p.coords.angle(&(p - center))).collect();
        angles.sort_by(f64::total_cmp);
        angles.get(angles.len() / 2).map_or(0.0, |angle| angle.to_degrees())
    }
}

/// Which of the points (in the reference camera's frame) fall into a camera's image.
pub(super) fn seen_by(
    camera_from_reference: &Isometry3<f64>,
    points: &[Point3<f64>],
    intrinsics: &Intrinsics,
) -> Vec<usize> {
    let seen = |p: &Point3<f64>| {
        intrinsics.project(&(camera_from_reference * p)).is_some_and(|pixel| intrinsics.contains(&pixel))
    };
    (0..points.len()).filter(|i| seen(&points[*i])).collect()
}

/// What the reference image shows, every part of it alike: points in the middles of a grid's cells, each as deep as the
/// sparse point nearest in the image. Sparse points themselves leave out what is plain, and the image's border.
pub(super) fn over_image(points: &[Point3<f64>], intrinsics: &Intrinsics) -> Vec<Point3<f64>> {
    /// Cells along the longer side.
    const CELLS: f64 = 24.0;
    let known: Vec<(Point2<f64>, f64)> = points
        .iter()
        .filter_map(|p| Some((intrinsics.project(p).filter(|pixel| intrinsics.contains(pixel))?, p.z)))
        .collect();
    let (width, height) = (f64::from(intrinsics.width), f64::from(intrinsics.height));
    let side = width.max(height) / CELLS;
    let (columns, rows) = ((width / side).round().max(1.0) as u32, (height / side).round().max(1.0) as u32);
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (f64::from(column) + 0.5, f64::from(row) + 0.5)))
        .filter_map(|(column, row)| {
            let pixel = Point2::new(column * side - 0.5, row * side - 0.5);
            let nearest =
                known.iter().min_by(|a, b| (a.0 - pixel).norm().total_cmp(&(b.0 - pixel).norm()))?;
            Some(Point3::from(intrinsics.unproject(&pixel)? * nearest.1))
        })
        .collect()
}

/// At most `options.key_frames` frames, farthest first: each the one whose centre lies farthest from all chosen
/// before (the reference first) and that sees most of the reference's points; a point counts half as much with each
/// frame that sees it already, so that the image's border gets its frames, too. Blurred frames are put back. Frames
/// that see things from too different a side are left out: patches no longer look alike, and hide behind each other.
/// In the order of falling baselines: a pixel is compared with the first ones that see it.
pub(super) fn choose(
    candidates: &[Candidate],
    points: &[Point3<f64>],
    intrinsics: &Intrinsics,
    options: &DenseOptions,
) -> Vec<usize> {
    let mut sharpness: Vec<f64> = candidates.iter().map(|c| c.sharpness).collect();
    sharpness.sort_by(f64::total_cmp);
    let typical = sharpness.get(sharpness.len() / 2).copied().unwrap_or(1.0).max(1e-9);
    let sharp: Vec<f64> = candidates.iter().map(|c| (c.sharpness / typical).min(1.0).powi(2)).collect();
    let sees: Vec<Vec<usize>> = candidates
        .iter()
        .map(|c| {
            let seen = seen_by(&c.camera_from_reference, points, intrinsics);
            let share = seen.len() as f64 / points.len().max(1) as f64;
            let aside = c.parallax_deg(points) > options.largest_parallax_deg;
            if share < options.least_shared_view || aside { Vec::new() } else { seen }
        })
        .collect();
    let mut chosen: Vec<usize> = Vec::new();
    let mut distance: Vec<f64> = candidates.iter().map(|c| c.center().coords.norm()).collect();
    let mut weight = vec![1.0; points.len()];
    while chosen.len() < options.key_frames {
        let worth = |i: usize| sharp[i] * distance[i] * sees[i].iter().map(|p| weight[*p]).sum::<f64>();
        let best = (0..candidates.len())
            .filter(|i| !chosen.contains(i))
            .map(|i| (i, worth(i)))
            .filter(|(_, worth)| *worth > 0.0)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((best, _)) = best else { break };
        chosen.push(best);
        for p in &sees[best] {
            weight[*p] *= 0.5;
        }
        let center = candidates[best].center();
        for (d, c) in distance.iter_mut().zip(candidates) {
            *d = d.min((c.center() - center).norm());
        }
    }
    let distance_of = |i: &usize| candidates[*i].center().coords.norm();
    chosen.sort_by(|a, b| distance_of(b).total_cmp(&distance_of(a)));
    chosen.iter().map(|i| candidates[*i].frame).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    /// Looks at the middle of things 3 away, from that angle to the side.
    fn from_the_side(frame: usize, angle_deg: f64) -> Candidate {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle_deg.to_radians());
        let middle = Translation3::new(0.0, 0.0, 3.0);
        Candidate { frame, camera_from_reference: middle * turn * middle.inverse(), sharpness: 1.0 }
    }

    fn things() -> Vec<Point3<f64>> {
        (0..25)
            .map(|i| Point3::new(0.2 * f64::from(i % 5) - 0.4, 0.2 * f64::from(i / 5) - 0.4, 3.0))
            .collect()
    }

    #[test]
    fn the_widest_baselines_that_patches_survive_come_first() {
        let candidates: Vec<Candidate> = [2.0, 33.0, -20.0, 60.0, 10.0]
            .into_iter()
            .enumerate()
            .map(|(i, a)| from_the_side(i, a))
            .collect();
        let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        let options = DenseOptions { key_frames: 3, ..DenseOptions::default() };
        assert_eq!(choose(&candidates, &things(), &lens, &options), [1, 2, 4]);
        let apart = choose(&candidates[3..4], &things(), &lens, &options);
        assert!(apart.is_empty(), "{apart:?}");
    }

    #[test]
    fn blurred_frames_and_such_as_look_elsewhere_are_put_back() {
        let mut blurred = from_the_side(7, 25.0);
        blurred.sharpness = 0.2;
        let mut elsewhere = from_the_side(8, 0.0);
        elsewhere.camera_from_reference =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 1.2) * elsewhere.camera_from_reference;
        let candidates = [blurred, elsewhere, from_the_side(9, 15.0), from_the_side(10, -2.0)];
        let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        let options = DenseOptions { key_frames: 1, ..DenseOptions::default() };
        assert_eq!(choose(&candidates, &things(), &lens, &options), [9]);
    }

    #[test]
    fn what_only_frames_nearby_see_gets_its_frames_too() {
        // All wide frames look to the left a little, so that they lose the points at the right border.
        let left = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.25);
        let mut candidates: Vec<Candidate> = (0..6)
            .map(|i| Candidate {
                frame: i,
                camera_from_reference: left * Translation3::new(0.6 - 0.2 * i as f64, 0.3, 0.0),
                sharpness: 1.0,
            })
            .collect();
        let near = Translation3::new(0.02, -0.02, 0.0).into();
        candidates.push(Candidate { frame: 6, camera_from_reference: near, sharpness: 1.0 });
        let points: Vec<Point3<f64>> = (0..40)
            .map(|i| Point3::new(-1.5 + 3.0 * f64::from(i % 10) / 9.0, 0.3 * f64::from(i / 10) - 0.5, 3.0))
            .collect();
        let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        let border = seen_by(&candidates[6].camera_from_reference, &points, &lens);
        assert!(border.iter().any(|p| {
            (0..6).all(|i| !seen_by(&candidates[i].camera_from_reference, &points, &lens).contains(p))
        }));
        let options = DenseOptions { key_frames: 6, least_shared_view: 0.3, ..DenseOptions::default() };
        let chosen = choose(&candidates, &points, &lens, &options);
        assert!(chosen.contains(&6), "{chosen:?}");
        let baseline = |frame: &usize| candidates[*frame].center().coords.norm();
        assert!(chosen.is_sorted_by(|a, b| baseline(a) >= baseline(b)), "{chosen:?}");
    }

    #[test]
    fn the_image_is_covered_evenly_at_the_depth_of_what_is_near() {
        let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        // Two points, 2 deep to the left and 5 deep to the right, one behind and one outside.
        let sparse = [
            Point3::new(-0.5, 0.0, 2.0),
            Point3::new(1.2, 0.1, 5.0),
            Point3::new(0.0, 0.0, -1.0),
            Point3::new(9.0, 0.0, 1.0),
        ];
        let all = over_image(&sparse, &lens);
        assert_eq!(all.len(), 24 * 18);
        assert_eq!(seen_by(&Isometry3::identity(), &all, &lens).len(), all.len());
        let middle = 0.5 * (lens.project(&sparse[0]).unwrap().x + lens.project(&sparse[1]).unwrap().x);
        for p in &all {
            let u = lens.project(p).unwrap().x;
            let expected = if u < middle { 2.0 } else { 5.0 };
            assert!((p.z - expected).abs() < 1e-9 || (u - middle).abs() < 10.0, "{p} {u}");
        }
        assert!(over_image(&[], &lens).is_empty());
    }
}
