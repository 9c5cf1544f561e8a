//! Follows people in masks of one's own: the masks here are of one person who walks through a bare room of two cameras.
//!
//! `cargo run --release --example feed_masks -p tracker`
#![forbid(unsafe_code)]

use calib::{Camera, Intrinsics};
use nalgebra::{Point2, Point3};
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera, Zone, ZoneKind};
use scenes::view::look_at;
use tracker::method::Method;
use tracker::method::mcmc::{Mcmc, McmcOptions};
use tracker::observation::Mask;
use tracker::prepared_room::{PreparationOptions, PreparedCamera, PreparedRoom};
use tracker::silhouette::{Body, Silhouette, View};
use tracker::{CameraFrame, Moment};

/// Frames a second of the cameras.
const RATE_HZ: f64 = 12.0;

fn main() -> anyhow::Result<()> {
    let rectangle = |x0, y0, x1, y1| Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1));
    let camera = |name: &str, x_m: f64, y_m: f64| RoomCamera {
        name: name.to_owned(),
        camera: Camera {
            intrinsics: Intrinsics::from_horizontal_fov(320, 240, 80.0),
            camera_from_world: look_at(&Point3::new(x_m, y_m, 2.4), &Point3::new(3.0, 2.5, 0.9)),
        },
        reference: None,
    };
    let room = Room {
        cameras: vec![camera("left", 0.2, 0.2), camera("right", 0.2, 4.8)],
        zones: vec![Zone {
            name: "door".into(),
            polygon: rectangle(5.0, 1.0, 6.0, 2.2),
            kind: ZoneKind::Both,
        }],
        walkable: Some(vec![rectangle(0.0, 0.0, 6.0, 5.0)]),
        ..Room::default()
    };
    // The room has no files of its own, so results of its preparation are kept in a temporary folder.
    let folder = std::env::temp_dir();
    let prepared = PreparedRoom::prepare(&room, &folder, &PreparationOptions::default())?;
    let mut method = Mcmc::new(prepared.clone(), McmcOptions::default())?;

    for frame in 1..=60_u32 {
        let walker = Body { x_m: 6.0 - 0.06 * f64::from(frame), y_m: 1.6, ..Body::ADULT };
        let cameras: Vec<CameraFrame> =
            prepared.cameras.iter().map(|camera| frame_of(camera, &walker)).collect();
        let moment = Moment { frame, time_s: f64::from(frame) / RATE_HZ, cameras: &cameras };
        for person in method.step(&moment)? {
            let [x, y] = [person.x_m, person.y_m];
            println!(
                "frame {frame}: person {} at ({x:.2}, {y:.2}) m, really at x = {:.2} m",
                person.id, walker.x_m
            );
        }
    }
    Ok(())
}

/// Mask of a person in a camera; a detector or segmentation of one's own takes its place.
fn frame_of(camera: &PreparedCamera, person: &Body) -> CameraFrame {
    let silhouette = Silhouette::new(&View::new(camera), &person.ellipsoid());
    let mask = Mask::from_fn(camera.width(), camera.height(), |u, v| silhouette.contains(u, v));
    CameraFrame::of_mask(mask)
}
