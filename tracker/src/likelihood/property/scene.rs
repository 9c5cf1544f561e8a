//! A room with one camera and its lens: prepared as in a run, and beside it ray by ray.

use std::ops::RangeInclusive;
use std::path::Path;

use calib::{Camera, Fisheye, Intrinsics};
use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera};

use super::lens::{FilmLens, FilmedPlace};
use super::room::{DepthRange, FurnishedRoom, floor_depth};
use crate::likelihood::pack;
use crate::observation::Mask;
use crate::prepared_room::{PreparationOptions, PreparedCamera, PreparedRoom};
use crate::silhouette::{Ellipsoid, View};

/// Distance from the middle between two filmed pixels (in pixels) within which the nearest one is undecided: positions
/// are f32 there.
const BETWEEN_PX: f64 = 2e-5;
/// Distance from its outline, relative to the deciding square, within which an intersection of a ray with a body is
/// undecided.
const OUTLINE: f64 = 1e-9;

pub(super) struct TestScene {
    pub(super) room: FurnishedRoom,
    lens: FilmLens,
    pub(super) camera: PreparedCamera,
    pub(super) view: View,
    /// Ray of each pixel of the view, row by row.
    pub(super) traced_pixels: Vec<TracedPixel>,
}

/// Ray of one pixel of the view, through the lens.
pub(super) struct TracedPixel {
    /// Direction, world frame, of length 1 along the camera's z.
    pub(super) ray: Vector3<f64>,
    pub(super) furniture: DepthRange,
    pub(super) floor: DepthRange,
    /// Whether the film shows anything there; `None` if undecided.
    pub(super) is_shown: Option<bool>,
}

impl TestScene {
    /// Random scene; `block` × `block` pixels of the camera are one of the view.
    pub(super) fn random(block: u8, has_lens: bool, rng: &mut Pcg64Mcg) -> Self {
        let real = random_camera(has_lens, rng);
        let room = FurnishedRoom::random(rng);
        let model = Room {
            cameras: vec![RoomCamera { name: "c".into(), camera: real, reference: None }],
            walkable: Some(vec![Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(1.0, 1.0))]),
            geometry: room.geometry(),
            ..Room::default()
        };
        // The path is not a folder, so that no scene leaves a depth map behind.
        let nowhere = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
        let mut camera = PreparedRoom::prepare(&model, nowhere, &PreparationOptions::default()).unwrap();
        let camera = camera.cameras.remove(0);
        let view = View::coarse(&camera, block);
        let lens = FilmLens::new(&camera.real.intrinsics, &camera.pinhole.intrinsics);
        let mut scene = Self { room, lens, camera, view, traced_pixels: Vec::new() };
        scene.traced_pixels = scene.pixels().map(|(u, v)| scene.traced(u, v)).collect();
        scene
    }

    /// Pixels of the view, row by row.
    pub(super) fn pixels(&self) -> impl Iterator<Item = (i32, i32)> + use<> {
        let (width, height) = (self.size()[0], self.size()[1]);
        (0..height).flat_map(move |v| (0..width).map(move |u| (u, v)))
    }

    /// Number of the twin's pixels for each pixel of the film.
    pub(super) fn pixels_per_filmed(&self) -> f64 {
        let [twin, film] = [&self.camera.pinhole, &self.camera.real]
            .map(|camera| f64::from(camera.intrinsics.width) * f64::from(camera.intrinsics.height));
        twin / film
    }

    /// Width and height of the view, from the twin's size.
    pub(super) fn size(&self) -> [i32; 2] {
        let k = &self.camera.pinhole.intrinsics;
        [k.width, k.height].map(|size| size.div_ceil(u32::from(self.view.block)) as i32)
    }

    pub(super) fn eye(&self) -> Point3<f64> {
        self.camera.real.center()
    }

    /// Converts a direction from the camera's frame to the world's.
    pub(super) fn to_world(&self, ray: &Vector3<f64>) -> Vector3<f64> {
        self.camera.real.camera_from_world.rotation.inverse() * ray
    }

    /// Filmed place of the middle of a pixel of the view, in the image or beside it.
    pub(super) fn middle(&self, u: i32, v: i32) -> FilmedPlace {
        let block = f64::from(self.view.block);
        let at = |i: i32| (f64::from(i) + 0.5) * block - 0.5;
        self.lens.of(&Point2::new(at(u), at(v)))
    }

    /// Ray of one pixel. Bodies are intersected along the middle of a block; the room has the depth of the pixel there,
    /// which is the lower right of four when the block's side is even, and the image's last where the block ends before
    /// its middle.
    fn traced(&self, u: i32, v: i32) -> TracedPixel {
        let block = i32::from(self.view.block);
        let k = &self.camera.pinhole.intrinsics;
        let at = |i: i32, size: u32| f64::from((i * block + block / 2).min(size as i32 - 1));
        let pixel = self.lens.of(&Point2::new(at(u, k.width), at(v, k.height)));
        let room_ray = self.to_world(&pixel.ray);
        TracedPixel {
            ray: self.to_world(&self.middle(u, v).ray),
            furniture: self.room.depth(&self.eye(), &room_ray),
            floor: floor_depth(&self.eye(), &room_ray),
            is_shown: pixel.is_shown,
        }
    }

    /// Foreground of the view as in the tracker, and, pixel by pixel, by the film.
    pub(super) fn foreground(&self, film: &GrayImage) -> (Vec<u64>, Vec<Option<bool>>) {
        let mut twin = GrayImage::new(self.camera.width(), self.camera.height());
        self.camera.undistort.mask(film, &mut twin);
        let by_film = self.pixels().map(|(u, v)| self.is_foreground(film, u, v)).collect();
        (pack(&Mask::from(&twin), &self.view), by_film)
    }

    /// Whether at least half of a block's pixels are foreground, each by its nearest filmed pixel.
    fn is_foreground(&self, film: &GrayImage, u: i32, v: i32) -> Option<bool> {
        let block = u32::from(self.view.block);
        let members = |i: i32, size: u32| (i as u32 * block)..((i as u32 + 1) * block).min(size);
        let (mut all, mut surely, mut perhaps) = (0, 0, 0);
        for y in members(v, self.camera.height()) {
            for x in members(u, self.camera.width()) {
                let filmed = self.lens.of(&Point2::new(f64::from(x), f64::from(y)));
                let is_set = match filmed.is_shown {
                    Some(false) => Some(false),
                    Some(true) => nearest(film, &filmed.place),
                    None => None,
                };
                all += 1;
                surely += u32::from(is_set == Some(true));
                perhaps += u32::from(is_set != Some(false));
            }
        }
        match () {
            () if 2 * surely >= all => Some(true),
            () if 2 * perhaps < all => Some(false),
            () => None,
        }
    }
}

/// Value of the nearest filmed pixel; undecided where two are equally near and differ.
fn nearest(film: &GrayImage, place: &Point2<f64>) -> Option<bool> {
    let beside = |x: f64, size: u32| -> RangeInclusive<u32> {
        let last = f64::from(size - 1);
        let [low, high] = [x - BETWEEN_PX, x + BETWEEN_PX].map(|x| (x + 0.5).floor().clamp(0.0, last) as u32);
        low..=high
    };
    let mut values = beside(place.y, film.height())
        .flat_map(|y| beside(place.x, film.width()).map(move |x| film.get_pixel(x, y)[0] != 0));
    let first = values.next()?;
    values.all(|value| value == first).then_some(first)
}

impl TracedPixel {
    /// Whether a body is met at all, and whether it is seen there: in front of furniture and floor.
    pub(super) fn of(&self, eye: &Point3<f64>, body: &Ellipsoid) -> [Option<bool>; 2] {
        let z_m = match meet(eye, &self.ray, body) {
            RayMeeting::At(z_m) => z_m,
            RayMeeting::Nowhere => return [Some(false); 2],
            RayMeeting::LeftOpen => return [None, self.is_shown.filter(|shown| !shown)],
        };
        let room = self.furniture.first(self.floor);
        let is_in_front = match () {
            () if z_m < room.from_m => Some(true),
            () if z_m >= room.to_m => Some(false),
            () => None,
        };
        let is_seen = match (self.is_shown, is_in_front) {
            (Some(false), _) | (_, Some(false)) => Some(false),
            (Some(true), Some(true)) => Some(true),
            _ => None,
        };
        [Some(true), is_seen]
    }
}

/// Intersection of a ray with a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RayMeeting {
    /// At this depth along the camera's z, metres; 0 from inside.
    At(f64),
    Nowhere,
    /// Undecided, because it is too near the outline.
    LeftOpen,
}

/// Intersection at which a ray, of length 1 along the camera's z, enters a body.
pub(super) fn meet(eye: &Point3<f64>, ray: &Vector3<f64>, body: &Ellipsoid) -> RayMeeting {
    // Scaled so that the body is the unit sphere around the origin.
    let o = (eye - body.center).component_div(&body.semi_axes);
    let w = ray.component_div(&body.semi_axes);
    let power = o.norm_squared() - 1.0;
    if power.abs() < OUTLINE {
        return RayMeeting::LeftOpen;
    }
    if power < 0.0 {
        return RayMeeting::At(0.0);
    }
    // Half the chord along the ray by Pythagoras, from the point of the ray that is nearest to the centre.
    let nearest = -o.dot(&w) / w.norm_squared();
    let half_squared = (1.0 - (o + w * nearest).norm_squared()) / w.norm_squared();
    if nearest <= 0.0 {
        return RayMeeting::Nowhere;
    }
    if half_squared.abs() < OUTLINE * nearest * nearest {
        return RayMeeting::LeftOpen;
    }
    if half_squared > 0.0 { RayMeeting::At(nearest - half_squared.sqrt()) } else { RayMeeting::Nowhere }
}

/// A small camera at a random place in a room of 6 × 5 m, with a random direction.
fn random_camera(has_lens: bool, rng: &mut Pcg64Mcg) -> Camera {
    let (width, height) = (rng.random_range(24..100), rng.random_range(20..60));
    let mut intrinsics = Intrinsics::from_horizontal_fov(width, height, rng.random_range(40.0..100.0));
    intrinsics.fy *= rng.random_range(0.8..1.2);
    intrinsics.cx += rng.random_range(-0.1..0.1) * f64::from(width);
    intrinsics.cy += rng.random_range(-0.1..0.1) * f64::from(height);
    if has_lens && rng.random::<f32>() < 0.3 {
        let mut number = |size: f64| rng.random_range(-size..size);
        intrinsics.distortion =
            Fisheye::from([number(0.1), number(0.03), number(0.01), number(0.003)]).into();
    } else if has_lens {
        intrinsics.distortion = [
            rng.random_range(-0.4..0.25),
            rng.random_range(-0.1..0.15),
            rng.random_range(-0.01..0.01),
            rng.random_range(-0.01..0.01),
            rng.random_range(-0.02..0.02),
        ]
        .into();
    }
    let eye = Point3::new(rng.random_range(0.0..6.0), rng.random_range(0.0..5.0), rng.random_range(0.3..3.0));
    let aim = Point3::new(rng.random_range(0.0..6.0), rng.random_range(0.0..5.0), rng.random_range(0.0..2.0));
    let mut down = Vector3::new(rng.random_range(-0.2..0.2), 0.1, -1.0);
    if rng.random::<f32>() < 0.3 {
        // Any roll, upside down as well.
        down = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    }
    Camera { intrinsics, camera_from_world: Isometry3::look_at_lh(&eye, &aim, &down) }
}

/// A film without structure, so that every pixel counts.
pub(super) fn random_film(camera: &PreparedCamera, rng: &mut Pcg64Mcg) -> GrayImage {
    let (width, height) = camera.real_size();
    GrayImage::from_fn(width, height, |u, v| {
        Luma([if (u / 9 + v / 7) % 3 == 0 || rng.random::<f32>() < 0.1 { 255 } else { 0 }])
    })
}
