//! The capture project `room.toml`: which captures make the room, the picked points that join them, the metres.
//!
//! Everything that can be known to be wrong before hours of film are read is found here, and named with its place.

mod connected;
mod pixels;
mod tables;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use calib::Intrinsics;
use calib::vision::chessboard::Chessboard;
use nalgebra::Point2;

use crate::Result;
use crate::capture::ReferenceFrame;
use tables::ProjectFile;

/// Points a pair of cameras must share for Horn's closed form.
pub const LEAST_SHARED_POINTS: usize = 3;

/// A capture project, checked.
#[derive(Debug, Clone)]
pub struct Project {
    /// The file it was read from, for messages.
    pub path: PathBuf,
    /// In file order; the first one gives the room its origin.
    pub cameras: Vec<ProjectCamera>,
    /// Physical points picked in two or more reference images.
    pub points: Vec<PickedPoint>,
    /// What fixes the metres.
    pub scale: Scale,
}

/// One camera of the project.
#[derive(Debug, Clone)]
pub struct ProjectCamera {
    /// Unique; letters, digits, `-`, `_` and `.`: it becomes a file name.
    pub name: String,
    /// A folder of images or a video file, relative paths resolved against the project file's folder.
    pub capture: PathBuf,
    /// The frame at the installed pose.
    pub reference: ReferenceFrame,
    /// As calibrated, if it was.
    pub intrinsics: Option<Intrinsics>,
}

/// One physical point and its pixels in reference images.
#[derive(Debug, Clone, PartialEq)]
pub struct PickedPoint {
    /// Index into [`Project::cameras`] and the pixel, distorted as filmed.
    pub picks: Vec<(usize, Point2<f64>)>,
}

impl PickedPoint {
    /// The pixel in one camera.
    pub fn pixel(&self, camera: usize) -> Option<Point2<f64>> {
        self.picks.iter().find(|(c, _)| *c == camera).map(|(_, pixel)| *pixel)
    }
}

/// What fixes the metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// A known distance between what two pixels of one reference image show.
    Distance {
        /// Index of the camera.
        camera: usize,
        /// One end, pixels.
        from: Point2<f64>,
        /// The other end, pixels.
        to: Point2<f64>,
        /// Their distance.
        metres: f64,
    },
    /// A known height of a camera's centre above the floor.
    Height {
        /// Index of the camera.
        camera: usize,
        /// Metres above the floor.
        height_m: f64,
    },
    /// A calibration board that lies still in a camera's capture.
    Board {
        /// Index of the camera.
        camera: usize,
        /// Its inner corners.
        board: Chessboard,
        /// Side of a square, metres.
        square_m: f64,
    },
}

impl Project {
    /// Reads and checks a project file and the intrinsics files it names. Captures are only looked for, not read.
    ///
    /// # Errors
    /// [`crate::Error::Content`] naming the table and key at fault, or [`crate::Error::Calib`] for a file that cannot be read or
    /// parsed.
    pub fn read(path: &Path) -> Result<Self> {
        let file: ProjectFile = calib::files::read_toml(path)?;
        let cameras = file.cameras(path)?;
        let points = file.points(path, &cameras)?;
        let scale = file.scale(path, &cameras)?;
        let project = Self { path: path.to_owned(), cameras, points, scale };
        let known: Vec<Option<(u32, u32)>> =
            project.cameras.iter().map(|c| c.intrinsics.as_ref().map(|k| (k.width, k.height))).collect();
        if let Some(sizes) = known.into_iter().collect::<Option<Vec<_>>>() {
            project.check_pixels(&sizes)?;
        }
        project.check_connected()?;
        Ok(project)
    }

    /// Reads a project that is not picked yet: its cameras, and the points that are there.
    ///
    /// # Errors
    /// As [`Self::read`]; but points and scale may be missing.
    pub fn read_unpicked(path: &Path) -> Result<(Vec<ProjectCamera>, Vec<PickedPoint>)> {
        let file: ProjectFile = calib::files::read_toml(path)?;
        let cameras = file.cameras(path)?;
        let points = file.points(path, &cameras)?;
        Ok((cameras, points))
    }

    /// All pixels of one camera whose depth matters: its picks, and the ends of a known distance.
    pub fn pixels_of(&self, camera: usize) -> Vec<Point2<f64>> {
        let ends = match &self.scale {
            Scale::Distance { camera: measured, from, to, .. } if *measured == camera => vec![*from, *to],
            _ => Vec::new(),
        };
        self.points.iter().filter_map(|p| p.pixel(camera)).chain(ends).collect()
    }

    /// The calibration board in one camera's capture, if the metres come from there.
    pub fn board_of(&self, camera: usize) -> Option<Chessboard> {
        match self.scale {
            Scale::Board { camera: of, board, .. } if of == camera => Some(board),
            _ => None,
        }
    }

    /// Moves all pixels of one camera, as when its reference image is rectified.
    pub fn move_pixels(&mut self, of: usize, to: &dyn Fn(&Point2<f64>) -> Point2<f64>) {
        if let Scale::Distance { camera, from: start, to: end, .. } = &mut self.scale
            && *camera == of
        {
            (*start, *end) = (to(start), to(end));
        }
        for (camera, pixel) in self.points.iter_mut().flat_map(|point| &mut point.picks) {
            if *camera == of {
                *pixel = to(pixel);
            }
        }
    }

    /// The points seen by both cameras, as pairs of pixels.
    pub fn shared(&self, a: usize, b: usize) -> Vec<(Point2<f64>, Point2<f64>)> {
        self.points.iter().filter_map(|p| Some((p.pixel(a)?, p.pixel(b)?))).collect()
    }
}
