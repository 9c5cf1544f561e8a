//! A room made ready for simulation: cameras as pinholes, static depth, floor and zones.
//!
//! Simulation happens in pinhole images at a working size, which may be smaller than the camera's own. Pictures are
//! scaled while they are decoded; [`PreparedCamera::undistort`] maps masks from there to the pinhole image.

pub mod blind_border;
mod doorway;
mod floor;
mod footprint;
pub mod resolution;

use std::path::{Path, PathBuf};

use calib::undistort::UndistortMap;
use calib::{Camera, Intrinsics};
use image::{GrayImage, Luma};
use mot::rows::PixelBox;
use nalgebra::{Point2, Vector3};
use scenes::depth::{self, DepthMap};
use scenes::room::{Room, Zone};
use scenes::walkable::{self, WalkableMap};
use shell::options::check_ranges;
use shell::ranges::SIDE_PX;

pub use self::floor::Floor;
use crate::observation::PersonBox;
use crate::{Error, Result};

/// Options of [`PreparedRoom::prepare`].
#[derive(Debug, Clone, PartialEq)]
pub struct PreparationOptions {
    /// Names of the cameras to use, in this order. Empty: all of the room's, in the room's order.
    pub cameras: Vec<String>,
    /// Whether the room's geometry hides people (default). Otherwise only the floor does.
    pub occlusion: bool,
    /// Largest width of the working images, pixels; a narrower camera keeps its size. Default 640.
    pub working_width_px: u32,
}

/// Default of [`PreparationOptions::working_width_px`].
pub const WORKING_WIDTH_PX: u32 = 640;

impl Default for PreparationOptions {
    fn default() -> Self {
        Self { cameras: Vec::new(), occlusion: true, working_width_px: WORKING_WIDTH_PX }
    }
}

/// A camera of the prepared room.
#[derive(Debug, Clone)]
pub struct PreparedCamera {
    /// Its name in the room.
    pub name: String,
    /// Camera model at full size, with distortion.
    pub filmed: Camera,
    /// Camera model at the working size, with distortion.
    pub real: Camera,
    /// Pinhole twin of `real`, of a size of its own, used for all simulation.
    pub pinhole: Camera,
    /// Map from the image of `real` to that of `pinhole`.
    pub undistort: UndistortMap,
    /// Distance along the camera's z to the nearest static surface, metres, per pinhole pixel, row by row. Infinite
    /// where nothing is hit; 0 outside the lens, so that nothing is ever expected to be seen there.
    pub static_z_m: Vec<f32>,
    /// File of the room's reference picture of this camera, at full size.
    pub reference: Option<PathBuf>,
}

/// An edge of a box this near to the image's border, in parts of the width, is cut by it.
const CUT_PART: f64 = 0.012;

/// Narrowest working image in which a person is visible, pixels.
const LEAST_WORKING_PX: u32 = 32;

/// A room made ready for simulation.
#[derive(Debug, Clone)]
pub struct PreparedRoom {
    /// Cameras in use. Moments list theirs in this order.
    pub cameras: Vec<PreparedCamera>,
    /// Positions that people can occupy, and where tracks may begin and end.
    pub floor: Floor,
    /// Zones of the floor, for drawing.
    pub zones: Vec<Zone>,
}

impl PreparedRoom {
    /// Prepares a room that was read from `room_dir`; static depth comes from the directory's cache where that is still
    /// valid.
    ///
    /// # Errors
    /// A requested camera that the room lacks, or geometry that cannot be used.
    pub fn prepare(room: &Room, room_dir: &Path, options: &PreparationOptions) -> Result<Self> {
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
        if options.working_width_px < LEAST_WORKING_PX {
            return Err(Error::option(
                "working_width_px",
                format!(
                    "{} pixels are too few to detect a person; give {LEAST_WORKING_PX} or more",
                    options.working_width_px
                ),
            ));
        }
        check_ranges([("working_width_px", f64::from(options.working_width_px), SIDE_PX)])?;
        let mut cameras = Vec::new();
        for name in names {
            let of_room = room.camera(name)?;
            let mut camera = PreparedCamera::at_width(name, &of_room.camera, options.working_width_px);
            camera.reference = of_room.reference.as_ref().map(|path| room_dir.join(path));
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
        let seen: Vec<Point2<f64>> =
            cameras.iter().flat_map(|c| footprint::of(&c.pinhole, &c.real.intrinsics)).collect();
        let floor = Floor::new(walkable, &room.zones, &seen);
        Ok(Self { cameras, floor, zones: room.zones.clone() })
    }

    /// Index of a camera in [`Self::cameras`].
    pub fn camera_index(&self, name: &str) -> Option<usize> {
        self.cameras.iter().position(|c| c.name == name)
    }
}

impl PreparedCamera {
    /// Camera with nothing in front of it, at full size.
    pub fn new(name: &str, filmed: &Camera) -> Self {
        Self::at_width(name, filmed, filmed.intrinsics.width)
    }

    /// Camera with nothing in front of it, at most `width_px` wide.
    fn at_width(name: &str, filmed: &Camera, width_px: u32) -> Self {
        let k = &filmed.intrinsics;
        let width = width_px.min(k.width);
        Self::at_size(name, filmed, (width, height_at(k.width, k.height, width)))
    }

    fn at_size(name: &str, filmed: &Camera, (width, height): (u32, u32)) -> Self {
        let k = if (width, height) == (filmed.intrinsics.width, filmed.intrinsics.height) {
            filmed.intrinsics.clone()
        } else {
            filmed.intrinsics.resized(width, height)
        };
        let camera_from_world = filmed.camera_from_world;
        let pinhole = twin_at(&filmed.intrinsics, &k);
        let undistort = UndistortMap::to(&k, &pinhole);
        let mut shown = GrayImage::new(pinhole.width, pinhole.height);
        undistort.mask(&GrayImage::from_pixel(k.width, k.height, Luma([255])), &mut shown);
        let static_z_m = shown.iter().map(|shown| if *shown == 0 { 0.0 } else { f32::INFINITY }).collect();
        let real = Camera { intrinsics: k, camera_from_world };
        let pinhole = Camera { intrinsics: pinhole, camera_from_world };
        Self {
            name: name.to_owned(),
            filmed: filmed.clone(),
            real,
            pinhole,
            undistort,
            static_z_m,
            reference: None,
        }
    }

    /// The same camera at another size, which may be larger than its own; for drawing. Static depth is taken from the
    /// nearest pixel.
    #[must_use]
    pub fn resized(&self, width_px: u32, height_px: u32) -> Self {
        if (width_px, height_px) == self.real_size() {
            return self.clone();
        }
        let mut other = Self::at_size(&self.name, &self.filmed, (width_px, height_px));
        let map = DepthMap { width: self.width(), height: self.height(), z_m: self.static_z_m.clone() };
        other.set_static_depth(&map);
        other
    }

    /// Sets the static depth from a depth map of any size, sampled at each pixel's middle.
    fn set_static_depth(&mut self, map: &DepthMap) {
        let (width, height) = (self.width(), self.height());
        let nearest =
            |i: u32, size: u32, seen: u32| ((2 * i + 1) * seen / (2 * size)).min(seen.saturating_sub(1));
        let columns: Vec<u32> = (0..width).map(|u| nearest(u, width, map.width)).collect();
        for (v, row) in (0..height).zip(self.static_z_m.chunks_exact_mut(width.max(1) as usize)) {
            let seen_row = nearest(v, height, map.height);
            for (own, column) in row.iter_mut().zip(&columns) {
                let seen = map.at(*column, seen_row);
                // A pixel without a hit is infinitely far; a pixel outside the lens stays 0.
                if *own > 0.0 && seen > 0.0 {
                    *own = seen;
                }
            }
        }
    }

    /// Inserts the floor, z = 0, where no nearer surface is known, so that nobody is seen below the floor even where
    /// the geometry lacks it.
    pub(crate) fn set_floor(&mut self) {
        let floor: Vec<f32> = self.floor_z_m().collect();
        for (z_m, floor_z_m) in self.static_z_m.iter_mut().zip(floor) {
            *z_m = z_m.min(floor_z_m);
        }
    }

    /// Whether the floor hides everything below it, as after [`Self::set_floor`].
    pub(crate) fn is_floor_opaque(&self) -> bool {
        self.static_z_m.iter().zip(self.floor_z_m()).all(|(z_m, floor_z_m)| *z_m <= floor_z_m)
    }

    /// Whether nothing stands before the floor.
    pub(crate) fn is_bare(&self) -> bool {
        /// Depths that differ by no more than this part are the same.
        const SAME: f32 = 1e-3;
        let mut pairs = self.static_z_m.iter().zip(self.floor_z_m());
        pairs.all(|(z_m, floor_z_m)| *z_m <= 0.0 || z_m.is_infinite() || *z_m >= floor_z_m * (1.0 - SAME))
    }

    /// Distance along the camera's z to the floor, metres, per pinhole pixel, row by row; infinite where the floor is
    /// not in front.
    fn floor_z_m(&self) -> impl Iterator<Item = f32> {
        let (center, k) = (self.pinhole.center(), &self.pinhole.intrinsics);
        let world_from_camera = self.pinhole.camera_from_world.rotation.inverse();
        (0..k.width * k.height).map(move |i| {
            let (u, v) = (f64::from(i % k.width), f64::from(i / k.width));
            let ray = world_from_camera * Vector3::new((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0);
            if ray.z < 0.0 && center.z > 0.0 { (-center.z / ray.z) as f32 } else { f32::INFINITY }
        })
    }

    /// Width and height of the working image as filmed, pixels.
    pub fn real_size(&self) -> (u32, u32) {
        (self.real.intrinsics.width, self.real.intrinsics.height)
    }

    /// Width of the pinhole image, pixels.
    pub fn width(&self) -> u32 {
        self.pinhole.intrinsics.width
    }

    /// Height of the pinhole image, pixels.
    pub fn height(&self) -> u32 {
        self.pinhole.intrinsics.height
    }

    /// Maps a pixel of the pinhole image to the pixel of the real image that shows the same; `None` outside the lens.
    pub fn to_real(&self, pinhole_pixel: &Point2<f64>) -> Option<Point2<f64>> {
        let ray = self.pinhole.intrinsics.unproject(pinhole_pixel)?;
        self.real.intrinsics.project(&ray.into())
    }

    /// A detector's box in what the camera films, full size → the box in the pinhole image: the undistorted middles of its
    /// edges. An edge whose middle the lens does not show is only scaled.
    pub fn to_pinhole_box(&self, filmed: &PixelBox) -> PersonBox {
        let k = &self.filmed.intrinsics;
        let (right, bottom) = (filmed.left + filmed.width, filmed.top + filmed.height);
        let middle = Point2::new(0.5 * (filmed.left + right), 0.5 * (filmed.top + bottom));
        let pinhole = &self.pinhole.intrinsics;
        let (scale_u, scale_v) = (pinhole.fx / k.fx, pinhole.fy / k.fy);
        let of = |u: f64, v: f64| {
            let scaled = Point2::new(pinhole.cx + (u - k.cx) * scale_u, pinhole.cy + (v - k.cy) * scale_v);
            if self.undistort.is_identity() {
                return scaled;
            }
            let ray = k.unproject(&Point2::new(u, v));
            ray.and_then(|ray| pinhole.project(&ray.into())).unwrap_or(scaled)
        };
        let margin = CUT_PART * f64::from(k.width);
        let is_cut = |edge: f64, border: f64| (edge - border).abs() < margin;
        PersonBox {
            left: of(filmed.left, middle.y).x,
            top: of(middle.x, filmed.top).y,
            right: of(right, middle.y).x,
            bottom: of(middle.x, bottom).y,
            cut: [
                is_cut(filmed.left, 0.0),
                is_cut(filmed.top, 0.0),
                is_cut(right, f64::from(k.width)),
                is_cut(bottom, f64::from(k.height)),
            ],
            appearance: None,
        }
    }
}

/// Pinhole twin of what is filmed, at the scale of `real`, which is the same camera at another size. The twin of the full
/// size is scaled, so that depth maps of that one fit.
fn twin_at(filmed: &Intrinsics, real: &Intrinsics) -> Intrinsics {
    let twin = filmed.pinhole();
    let scaled = |side: u32, real: u32, filmed: u32| {
        ((f64::from(side) * f64::from(real) / f64::from(filmed)).round() as u32).max(1)
    };
    let width = scaled(twin.width, real.width, filmed.width);
    let height = scaled(twin.height, real.height, filmed.height);
    if (width, height) == (twin.width, twin.height) { twin } else { twin.resized(width, height) }
}

/// Height, at least 1, of an image scaled to a width.
fn height_at(width: u32, height: u32, scaled_width: u32) -> u32 {
    let exact = f64::from(height) * f64::from(scaled_width) / f64::from(width.max(1));
    (exact.round() as u32).max(1)
}
