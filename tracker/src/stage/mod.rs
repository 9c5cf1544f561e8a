//! A room made ready for simulation: its cameras as pinholes, what each of them can see past, floor and zones.
//!
//! All simulation happens in pinhole images. Masks and pictures are brought there once a frame by
//! [`StageCamera::undistort`]; boxes and outlines are taken back to real pixels by [`StageCamera::to_real`].

mod doorway;
mod floor;
mod footprint;

use std::path::Path;

use calib::Camera;
use calib::undistort::UndistortMap;
use image::{GrayImage, Luma};
use nalgebra::{Point2, Vector3};
use scenes::depth::{self, DepthMap};
use scenes::room::{Room, Zone};
use scenes::walkable::{self, WalkableMap};

pub use self::floor::Floor;
use crate::{Error, Result};

/// How to prepare a room.
#[derive(Debug, Clone, PartialEq)]
pub struct StageOptions {
    /// The cameras to use, by name, in this order. Empty: all of the room's, in the room's order.
    pub cameras: Vec<String>,
    /// Whether the room's geometry hides people (default). Without it only the floor does.
    pub occlusion: bool,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self { cameras: Vec::new(), occlusion: true }
    }
}

/// One camera of the stage.
#[derive(Debug, Clone)]
pub struct StageCamera {
    /// Its name in the room.
    pub name: String,
    /// As it films, with distortion.
    pub real: Camera,
    /// Its pinhole twin, where everything is simulated. Same size as `real`.
    pub pinhole: Camera,
    /// From the real image to the pinhole image.
    pub undistort: UndistortMap,
    /// Distance along the camera's z to the nearest static surface, per pinhole pixel, row by row, metres. Infinite where
    /// nothing is hit; 0 where the lens shows nothing, so that nothing is ever expected to be seen there.
    pub static_z_m: Vec<f32>,
}

/// A room made ready for simulation.
#[derive(Debug, Clone)]
pub struct Stage {
    /// The cameras in use. Moments list theirs in this order.
    pub cameras: Vec<StageCamera>,
    /// Where people can be, appear and disappear.
    pub floor: Floor,
    /// The zones the floor was made with, for drawing.
    pub zones: Vec<Zone>,
}

impl Stage {
    /// Prepares a room that was read from `room_dir`; static depth comes from the directory's cache where it is still true.
    ///
    /// # Errors
    /// When a camera is asked for that the room lacks, or the geometry cannot be used.
    pub fn prepare(room: &Room, room_dir: &Path, options: &StageOptions) -> Result<Self> {
        let names: Vec<&str> = if options.cameras.is_empty() {
            room.cameras.iter().map(|c| c.name.as_str()).collect()
        } else {
            options.cameras.iter().map(String::as_str).collect()
        };
        if names.is_empty() {
            return Err(Error::option(
                "room",
                "the room has no camera; add a [[camera]] table to scene.toml",
            ));
        }
        let mut cameras = Vec::new();
        for name in names {
            let mut camera = StageCamera::new(name, &room.camera(name)?.camera);
            if options.occlusion && room.geometry.is_some() {
                camera.set_static_depth(&depth::cached(room_dir, room, name)?);
            }
            camera.set_floor();
            cameras.push(camera);
        }
        let walkable = if options.occlusion || room.walkable.is_some() {
            walkable::cached(room_dir, room)?
        } else {
            WalkableMap::everywhere()
        };
        let seen: Vec<Point2<f64>> = cameras.iter().flat_map(|c| footprint::of(&c.pinhole)).collect();
        let floor = Floor::new(walkable, &room.zones, &seen);
        Ok(Self { cameras, floor, zones: room.zones.clone() })
    }

    /// The number of a camera.
    pub fn camera_index(&self, name: &str) -> Option<usize> {
        self.cameras.iter().position(|c| c.name == name)
    }
}

impl StageCamera {
    /// A camera before which nothing stands.
    pub fn new(name: &str, real: &Camera) -> Self {
        let k = &real.intrinsics;
        let pinhole = Camera { intrinsics: k.pinhole(), camera_from_world: real.camera_from_world };
        let undistort = UndistortMap::new(k);
        let mut shown = GrayImage::new(k.width, k.height);
        undistort.mask(&GrayImage::from_pixel(k.width, k.height, Luma([255])), &mut shown);
        let static_z_m = shown.iter().map(|shown| if *shown == 0 { 0.0 } else { f32::INFINITY }).collect();
        Self { name: name.to_owned(), real: real.clone(), pinhole, undistort, static_z_m }
    }

    /// Takes over what a camera sees of the empty room. Both maps are of the pinhole image.
    fn set_static_depth(&mut self, map: &DepthMap) {
        for (own, seen) in self.static_z_m.iter_mut().zip(&map.z_m) {
            // Nothing hit is infinitely far; where the lens shows nothing, it stays so.
            if *own > 0.0 && *seen > 0.0 {
                *own = *seen;
            }
        }
    }

    /// Puts the floor, z = 0, where nothing nearer is known: whatever the geometry lacks, nobody is seen below it.
    pub(crate) fn set_floor(&mut self) {
        let floor: Vec<f32> = self.floor_z_m().collect();
        for (z_m, floor_z_m) in self.static_z_m.iter_mut().zip(floor) {
            *z_m = z_m.min(floor_z_m);
        }
    }

    /// Whether the floor hides what is below it, as after [`Self::set_floor`].
    pub(crate) fn is_floor_opaque(&self) -> bool {
        self.static_z_m.iter().zip(self.floor_z_m()).all(|(z_m, floor_z_m)| *z_m <= floor_z_m)
    }

    /// Distance along the camera's z to the floor, per pinhole pixel, row by row; infinite where it is not in front.
    fn floor_z_m(&self) -> impl Iterator<Item = f32> {
        let (center, k) = (self.pinhole.center(), &self.pinhole.intrinsics);
        let world_from_camera = self.pinhole.camera_from_world.rotation.inverse();
        (0..k.width * k.height).map(move |i| {
            let (u, v) = (f64::from(i % k.width), f64::from(i / k.width));
            let ray = world_from_camera * Vector3::new((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0);
            if ray.z < 0.0 && center.z > 0.0 { (-center.z / ray.z) as f32 } else { f32::INFINITY }
        })
    }

    /// Image width in pixels.
    pub fn width(&self) -> u32 {
        self.pinhole.intrinsics.width
    }

    /// Image height in pixels.
    pub fn height(&self) -> u32 {
        self.pinhole.intrinsics.height
    }

    /// A pixel of the pinhole image → the pixel of the real image that shows the same; `None` outside the lens.
    pub fn to_real(&self, pinhole_pixel: &Point2<f64>) -> Option<Point2<f64>> {
        let ray = self.pinhole.intrinsics.unproject(pinhole_pixel)?;
        self.real.intrinsics.project(&ray.into())
    }
}
