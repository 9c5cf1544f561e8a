//! Stereo against the depth of a rendered synthetic room.

use calib::{Camera, Fisheye};
use nalgebra::Point2;
use scenes::depth;
use scenes::raycast::RayScene;
use synthetic::{CaptureOptions, RoomOptions};

use super::*;

/// Shares of a depth map within half a pixel, one and two of the truth: shifts in the farthest view.
type Within = [f64; 3];

/// Views of a rendered room through a lens of 200 × 150 pixels, or its own; the share of what was filmed that has a depth, and how
/// near that is to the truth.
fn depth_of_a_rendered_room(
    lens: Option<Intrinsics>,
    options: &DenseOptions,
) -> (Vec<DenseView>, f64, Within) {
    let room = RoomOptions { seed: 4, image_px: [200, 150], ..RoomOptions::default() }.build().unwrap();
    let camera = &room.room.cameras[0].camera;
    let camera = &Camera { intrinsics: lens.unwrap_or_else(|| camera.intrinsics.clone()), ..camera.clone() };
    let (frames, poses) = room.capture(camera, &CaptureOptions { frames: 9, ..CaptureOptions::default() });
    let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
    let twin = Camera { intrinsics: camera.intrinsics.pinhole(), ..camera.clone() };
    let truth = depth::render(&scene, &twin);
    let (width, height) = (twin.intrinsics.width, twin.intrinsics.height);
    // Points as a sparse reconstruction would have them.
    let to_reference = camera.camera_from_world.inverse();
    let points: Vec<Point3<f64>> = (0..height)
        .step_by(15)
        .flat_map(|v| (0..width).step_by(15).map(move |u| (u, v)))
        .filter_map(|(u, v)| {
            let ray = twin.intrinsics.unproject(&Point2::new(f64::from(u), f64::from(v)))?;
            let place = Point3::from(ray * f64::from(truth.at(u, v)));
            let seen = camera.intrinsics.project(&place)?;
            camera.intrinsics.contains(&seen).then(|| to_reference * place)
        })
        .collect();
    let poses: Vec<_> = poses.into_iter().map(Some).collect();
    let capture = PosedCapture {
        name: "cam0",
        frames: &frames,
        reference: 8,
        intrinsics: &camera.intrinsics,
        camera_from_world: &poses,
        points: &points,
    };
    let (views, report) = reconstruct(&capture, options).unwrap();
    let (mut known, mut within) = (0.0, [0.0; 3]);
    for v in 0..height {
        for u in 0..width {
            let Some(z) = views[0].depth(u as usize, v as usize) else { continue };
            known += 1.0;
            let shift = (1.0 / z - 1.0 / truth.at(u, v)).abs() / views[0].step;
            within[0] += f64::from(shift < 0.5);
            within[1] += f64::from(shift < 1.0);
            within[2] += f64::from(shift < 2.0);
        }
    }
    let known_share = known / report.filmed_pixels as f64;
    let within = within.map(|count| count / known);
    assert!((report.covered - known_share).abs() < 1e-9);
    (views, known_share, within)
}

#[test]
fn a_rendered_room_has_the_depth_it_was_rendered_with() {
    let options = DenseOptions { key_frames: 5, ..DenseOptions::default() };
    let (_, known, within) = depth_of_a_rendered_room(None, &options);
    // A pixel's shift in the farthest view is 8 % of a depth of 5 m here; plaster shows little.
    assert!(known > 0.8 && within[0] > 0.6 && within[2] > 0.85, "{known} {within:?}");
}

#[test]
fn a_quarter_of_the_size_tells_depth_in_the_rough() {
    // Half and full size only take over the depths and check consistency.
    let options = DenseOptions { iterations: [6, 0, 0], ..DenseOptions::draft() };
    let (_, known, within) = depth_of_a_rendered_room(None, &options);
    assert!(known > 0.5 && within[2] > 0.6, "{known} {within:?}");
}

#[test]
fn a_fisheye_has_depth_where_it_filmed_and_nowhere_else() {
    // 140° across; straightened, its picture leaves the corners of the frame and more empty.
    let focal = 100.0 / 70.0_f64.to_radians();
    let lens = Intrinsics { fx: focal, fy: focal, ..Intrinsics::from_horizontal_fov(200, 150, 60.0) };
    let lens = Intrinsics { distortion: Fisheye::from([0.0; 4]).into(), ..lens };
    let options = DenseOptions { key_frames: 5, ..DenseOptions::default() };
    let (views, known, within) = depth_of_a_rendered_room(Some(lens), &options);
    for view in &views {
        let empty = view.filmed.iter().filter(|filmed| !**filmed).count();
        assert!(20 * empty > view.filmed.len(), "{empty} of {}", view.filmed.len());
        let invented =
            view.filmed.iter().zip(&view.agreeing).filter(|(filmed, agreeing)| !**filmed && **agreeing > 0);
        assert_eq!(invented.count(), 0);
    }
    assert!(known > 0.5 && within[2] > 0.7, "{known} {within:?}");
}
