//! The capture project `room.toml`: the captures, the picked points that join them, and the metric scale.
//!
//! Every error that can be found before hours of film are read is reported here, with its place.

mod checked_pick;
mod connected;
mod edit;
mod metres;
mod pixels;
mod tables;
#[cfg(test)]
mod tests;
mod width;

use std::path::{Path, PathBuf};

use calib::Intrinsics;
use calib::vision::chessboard::Chessboard;
use nalgebra::Point2;

use crate::Result;
use crate::capture::ReferenceFrame;
use tables::ProjectFile;

pub use edit::{Picked, PickedTable, ProjectVersion, read_picked, save_picked};
pub(crate) use metres::scale_place;
pub use metres::{ControlPoint, KnownLength, LEAST_CONTROL_POINTS, ScaleTable};
pub(crate) use width::is_wide;

/// Number of points that a pair of cameras must share for Horn's closed form.
pub const LEAST_SHARED_POINTS: usize = 3;

/// A capture project, checked.
#[derive(Debug, Clone)]
pub struct Project {
    /// Path of the file, for messages.
    pub path: PathBuf,
    /// Cameras in file order; the first one gives the room its origin.
    pub cameras: Vec<ProjectCamera>,
    /// Physical points picked in two or more reference images.
    pub points: Vec<PickedPoint>,
    /// Whether the program proposed the points to itself, since the file has none.
    pub are_points_proposed: bool,
    /// Lengths that give the metres.
    pub lengths: Vec<KnownLength>,
    /// Points with known coordinates, which give the room its place, its direction and, with the lengths, the metres.
    pub control_points: Vec<ControlPoint>,
}

/// One camera of the project.
#[derive(Debug, Clone)]
pub struct ProjectCamera {
    /// Name, unique; letters, digits, `-`, `_` and `.`: it becomes a file name.
    pub name: String,
    /// A folder of images or a video file, relative paths resolved against the project file's folder.
    pub capture: PathBuf,
    /// The frame at the installed pose.
    pub reference: ReferenceFrame,
    /// Calibrated intrinsics, if given.
    pub intrinsics: Option<Intrinsics>,
}

/// One physical point and its pixels in reference images.
#[derive(Debug, Clone, PartialEq)]
pub struct PickedPoint {
    /// Index into [`Project::cameras`] and the pixel, distorted as filmed.
    pub picks: Vec<(usize, Point2<f64>)>,
}

impl PickedPoint {
    /// Pixel in one camera.
    pub fn pixel(&self, camera: usize) -> Option<Point2<f64>> {
        self.picks.iter().find(|(c, _)| *c == camera).map(|(_, pixel)| *pixel)
    }
}

impl Project {
    /// Reads and checks a project file and the intrinsics files it names. Captures need only exist; they are not read.
    ///
    /// # Errors
    /// [`crate::Error::File`] naming the table and key at fault, or [`crate::Error::Calib`] for a file that cannot be read or
    /// parsed.
    pub fn read(path: &Path) -> Result<Self> {
        let project = Self::read_to_build(path)?;
        project.check_connected()?;
        Ok(project)
    }

    /// Reads and checks a project file as [`Self::read`] does; but one without any points is taken, too: where the captures
    /// show enough of the same, a build proposes them to itself.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_to_build(path: &Path) -> Result<Self> {
        let file: ProjectFile = calib::files::read_toml(path)?;
        let cameras = file.cameras(path)?;
        let points = file.points(path, &cameras)?;
        let lengths = file.lengths(path, &cameras)?;
        let control_points = file.control_points(path, &cameras)?;
        let project = Self {
            path: path.to_owned(),
            cameras,
            points,
            are_points_proposed: false,
            lengths,
            control_points,
        };
        let known: Vec<Option<(u32, u32)>> =
            project.cameras.iter().map(|c| c.intrinsics.as_ref().map(|k| (k.width, k.height))).collect();
        if let Some(sizes) = known.into_iter().collect::<Option<Vec<_>>>() {
            project.check_pixels(&sizes)?;
        }
        if !project.points.is_empty() {
            project.check_connected()?;
        }
        Ok(project)
    }

    /// Takes points over that the program proposes; tells whether they join all cameras.
    pub(crate) fn take_proposed(&mut self, points: Vec<PickedPoint>) -> bool {
        self.points = points;
        self.are_points_proposed = true;
        self.check_connected().is_ok()
    }

    /// Reads a project without picks: its cameras, and the points that exist.
    ///
    /// # Errors
    /// As [`Self::read`]; but points and scale may be missing.
    pub fn read_unpicked(path: &Path) -> Result<(Vec<ProjectCamera>, Vec<PickedPoint>)> {
        let file: ProjectFile = calib::files::read_toml(path)?;
        let cameras = file.cameras(path)?;
        let points = file.points(path, &cameras)?;
        Ok((cameras, points))
    }

    /// Files and folders that a project file names: captures and intrinsics. None of one that cannot be read.
    pub fn inputs(path: &Path) -> Vec<PathBuf> {
        calib::files::read_toml::<ProjectFile>(path).map(|file| file.inputs(path)).unwrap_or_default()
    }

    /// All pixels of one camera that need a depth: its picks, the ends of known distances, control points.
    pub fn pixels_of(&self, camera: usize) -> Vec<Point2<f64>> {
        let ends = self.lengths.iter().flat_map(|length| match length {
            KnownLength::Distance { camera: measured, from, to, .. } if *measured == camera => {
                vec![*from, *to]
            }
            _ => Vec::new(),
        });
        let known = self.control_points.iter().flat_map(|point| &point.picks);
        let known = known.filter(|(of, _)| *of == camera).map(|(_, pixel)| *pixel);
        self.points.iter().filter_map(|p| p.pixel(camera)).chain(ends).chain(known).collect()
    }

    /// Calibration boards in one camera's capture, each with the index of its length.
    pub fn boards_of(&self, camera: usize) -> impl Iterator<Item = (usize, Chessboard)> {
        self.lengths.iter().enumerate().filter_map(move |(index, length)| match length {
            KnownLength::Board { camera: of, board, .. } if *of == camera => Some((index, *board)),
            _ => None,
        })
    }

    /// Moves all pixels of one camera, as when its reference image is rectified.
    pub fn move_pixels(&mut self, of: usize, to: &dyn Fn(&Point2<f64>) -> Point2<f64>) {
        for length in &mut self.lengths {
            if let KnownLength::Distance { camera, from: start, to: end, .. } = length
                && *camera == of
            {
                (*start, *end) = (to(start), to(end));
            }
        }
        let picked = self.points.iter_mut().flat_map(|point| &mut point.picks);
        let known = self.control_points.iter_mut().flat_map(|point| &mut point.picks);
        for (camera, pixel) in picked.chain(known) {
            if *camera == of {
                *pixel = to(pixel);
            }
        }
    }

    /// Points picked in both cameras, as pairs of pixels.
    pub fn shared(&self, a: usize, b: usize) -> Vec<(Point2<f64>, Point2<f64>)> {
        self.points.iter().filter_map(|p| Some((p.pixel(a)?, p.pixel(b)?))).collect()
    }
}
