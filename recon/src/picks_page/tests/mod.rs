//! The page over its socket and in a browser, with two rendered views of a synthetic room.

mod page;
mod server;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use calib::Camera;
use nalgebra::{Point2, Point3};
use scenes::raycast::RayScene;
use shell::loopback::Protection;
use synthetic::RoomOptions;
use tempfile::TempDir;

use super::state::{Progress, ReferencePicture, Views};
use super::{Server, Session};
use crate::pipeline::{BuildOptions, ReferenceView};
use crate::surface::rendered::Rendering;

const WIDTH: u32 = 160;
const HEIGHT: u32 = 120;

/// A project of two cameras, and its page.
struct PickedProject {
    _folder: TempDir,
    project: PathBuf,
    address: SocketAddr,
    session: Arc<Session>,
    cameras: [Camera; 2],
    /// Pixels of places that both cameras see.
    shared: Vec<[Point2<f64>; 2]>,
}

impl PickedProject {
    /// Serves a project without points, whose captures are worked through.
    fn new() -> Self {
        let options = RoomOptions { seed: 3, image_px: [WIDTH, HEIGHT], ..RoomOptions::default() };
        let room = options.build().unwrap();
        let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
        let cameras = [0, 1].map(|i| room.room.cameras[i].camera.clone());
        let folder = tempfile::tempdir().unwrap();
        let views: Vec<ReferenceView> = (0..2)
            .map(|i| {
                let rendering = Rendering { unit_m: 0.8 + i as f64, noise: 0.002, holes: 0.0, seed: 1 };
                let surface = rendering.filmed(&room, &cameras[i]);
                let capture = folder.path().join(format!("cam{i}"));
                std::fs::create_dir(&capture).unwrap();
                for frame in 1..=3 {
                    surface.picture.save(capture.join(format!("{frame}.png"))).unwrap();
                }
                ReferenceView::of_surface(&format!("cam{i}"), surface)
            })
            .collect();
        let project = folder.path().join("room.toml");
        let camera = |name: &str| format!("[[camera]]\nname = \"{name}\"\ncapture = \"{name}\"\n");
        let text = format!("# Two cameras.\n{}\n{}", camera("cam0"), camera("cam1"));
        std::fs::write(&project, text).unwrap();
        let room_dir = folder.path().join("room");
        let protection = Protection::default();
        let session =
            Session::open(&project, &room_dir, BuildOptions::default(), "127.0.0.1", &protection).unwrap();
        let pictures: Vec<_> =
            session.cameras().iter().map(|c| Some(Arc::new(ReferencePicture::read(c).unwrap()))).collect();
        session.update(|state| {
            state.pictures = pictures;
            state.views = Some(Arc::new(Views { views, pairs: Vec::new() }));
            state.captures = Progress::Done;
        });
        let server = Server::bind("127.0.0.1", 0, &protection).unwrap();
        let (address, served) = (server.address(), Arc::clone(&session));
        std::thread::spawn(move || server.serve(served));
        let shared = shared(&scene, &cameras);
        Self { _folder: folder, project, address, session, cameras, shared }
    }

    fn text(&self) -> String {
        std::fs::read_to_string(&self.project).unwrap()
    }
}

/// Pixels of places that both cameras see, from a grid on the first picture, far apart.
fn shared(scene: &RayScene, [a, b]: &[Camera; 2]) -> Vec<[Point2<f64>; 2]> {
    let single = |p: Point3<f64>| glam::Vec3::new(p.x as f32, p.y as f32, p.z as f32);
    let mut shared = Vec::new();
    for (v, u) in (1..8).flat_map(|v| (1..10).map(move |u| (v, u))) {
        let pixel = Point2::new(16.0 * f64::from(u), 15.0 * f64::from(v));
        let ray = a.camera_from_world.rotation.inverse() * a.intrinsics.unproject(&pixel).unwrap();
        let Some(hit) = scene.cast(single(a.center()), single(Point3::from(ray))) else { continue };
        let place = a.center() + ray * f64::from(hit.distance);
        let inside = |p: &Point2<f64>| {
            (6.0..f64::from(WIDTH) - 6.0).contains(&p.x) && (6.0..f64::from(HEIGHT) - 6.0).contains(&p.y)
        };
        let Some(other) = b.project(&place).filter(inside) else { continue };
        if !scene.is_blocked(single(b.center()), single(place)) {
            shared.push([pixel, other]);
        }
    }
    shared
}
