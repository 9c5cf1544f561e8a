//! Stereo against the depth of a rendered synthetic room.

use nalgebra::Point2;
use scenes::depth;
use scenes::raycast::RayScene;
use synthetic::{CaptureOptions, RoomOptions};

use super::*;

/// Share of a rendered room's image that has a depth, and the shares of it within half a pixel, one and two of the
/// truth: shifts in the farthest view.
fn depth_of_a_rendered_room(options: &DenseOptions) -> (f64, [f64; 3]) {
    let room = RoomOptions { seed: 4, image_px: [200, 150], ..RoomOptions::default() }.build().unwrap();
    let camera = &room.room.cameras[0].camera;
    let (frames, poses) = room.capture(camera, &CaptureOptions { frames: 9, ..CaptureOptions::default() });
    let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
    let truth = depth::render(&scene, camera);
    // Points as a sparse reconstruction would have them.
    let to_reference = camera.camera_from_world.inverse();
    let points: Vec<Point3<f64>> = (0..150)
        .step_by(15)
        .flat_map(|v| (0..200).step_by(15).map(move |u| (u, v)))
        .filter_map(|(u, v)| {
            let ray = camera.intrinsics.unproject(&Point2::new(f64::from(u), f64::from(v)))?;
            Some(to_reference * Point3::from(ray * f64::from(truth.at(u, v))))
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
    for v in 0..150 {
        for u in 0..200 {
            let Some(z) = views[0].depth(u, v) else { continue };
            known += 1.0;
            let shift = (1.0 / z - 1.0 / truth.at(u as u32, v as u32)).abs() / views[0].step;
            within[0] += f64::from(shift < 0.5);
            within[1] += f64::from(shift < 1.0);
            within[2] += f64::from(shift < 2.0);
        }
    }
    let known_share = known / 30_000.0;
    let within = within.map(|count| count / known);
    assert!((report.covered - known_share).abs() < 1e-9);
    (known_share, within)
}

#[test]
fn a_rendered_room_has_the_depth_it_was_rendered_with() {
    let (known, within) =
        depth_of_a_rendered_room(&DenseOptions { key_frames: 5, ..DenseOptions::default() });
    // A pixel's shift in the farthest view is 8 % of a depth of 5 m here; plaster shows little.
    assert!(known > 0.8 && within[0] > 0.6 && within[2] > 0.85, "{known} {within:?}");
}

#[test]
fn a_quarter_of_the_size_tells_depth_in_the_rough() {
    // Half and full size only take over the depths and check consistency.
    let options = DenseOptions { iterations: [6, 0, 0], ..DenseOptions::draft() };
    let (known, within) = depth_of_a_rendered_room(&options);
    assert!(known > 0.5 && within[2] > 0.6, "{known} {within:?}");
}
