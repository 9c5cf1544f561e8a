//! Writing of a model in text.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use calib::Intrinsics;
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3};

use super::model;
use crate::Result;
use crate::exchange::{CORNER_PX, picture_name};
use crate::geometry::Geometry;
use crate::room::Room;

/// A sparse model: lenses, pictures taken through them, and points seen in these.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SparseModel {
    /// Lenses.
    pub lenses: Vec<Intrinsics>,
    /// Pictures.
    pub pictures: Vec<SparsePicture>,
    /// Points.
    pub points: Vec<SparsePoint>,
}

/// A picture of a sparse model.
#[derive(Debug, Clone, PartialEq)]
pub struct SparsePicture {
    /// Path below the folder of the pictures.
    pub name: String,
    /// Index of its lens.
    pub lens: usize,
    /// Pose.
    pub camera_from_world: Isometry3<f64>,
    /// Index of each point that it shows, and its pixel there.
    pub sightings: Vec<(usize, Point2<f64>)>,
}

/// A point of a sparse model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SparsePoint {
    /// Position, in the unit of the pictures' poses.
    pub place: Point3<f64>,
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Mean reprojection error, pixels.
    pub error_px: f64,
}

/// The three files' texts while they grow.
struct Texts {
    cameras: String,
    images: String,
    points: String,
}

impl Texts {
    fn new() -> Self {
        Self {
            cameras: "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n".into(),
            images: "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then POINTS2D[]\n".into(),
            points: "# POINT3D_ID X Y Z R G B ERROR TRACK[]\n".into(),
        }
    }

    // Writing into a string cannot fail, so its results are dropped.

    fn camera(&mut self, id: usize, k: &Intrinsics) {
        let (cx, cy) = (k.cx + CORNER_PX, k.cy + CORNER_PX);
        let (model, numbers) = model::written(&k.distortion);
        let more = numbers.iter().fold(String::new(), |more, number| more + " " + &number.to_string());
        let (width, height) = (k.width, k.height);
        let _ = writeln!(self.cameras, "{id} {model} {width} {height} {} {} {cx} {cy}{more}", k.fx, k.fy);
    }

    /// Both lines of a picture.
    fn picture(&mut self, id: usize, camera: usize, pose: &Isometry3<f64>, name: &str, sightings: &str) {
        let (q, t) = (pose.rotation.quaternion(), pose.translation.vector);
        let numbers = [q.w, q.i, q.j, q.k, t.x, t.y, t.z].map(|number| number.to_string()).join(" ");
        let _ = writeln!(self.images, "{id} {numbers} {camera} {name}\n{sightings}");
    }

    /// Staged together: after an error every file is as it was.
    fn write(&self, dir: &Path) -> Result<()> {
        let paths: [PathBuf; 3] = ["points3D.txt", "images.txt", "cameras.txt"].map(|name| dir.join(name));
        Ok(calib::files::write_together(&[
            (&paths[0], self.points.as_bytes()),
            (&paths[1], self.images.as_bytes()),
            (&paths[2], self.cameras.as_bytes()),
        ])?)
    }
}

/// Writes the room as a model in text: its cameras, and its vertices or disc centres as points.
///
/// # Errors
/// [`crate::Error::Calib`] when a file cannot be written; then none is written.
pub fn write(dir: &Path, room: &Room) -> Result<()> {
    let mut texts = Texts::new();
    for (id, entry) in (1..).zip(&room.cameras) {
        texts.camera(id, &entry.camera.intrinsics);
        texts.picture(id, id, &entry.camera.camera_from_world, &picture_name(entry), "");
    }
    let mut point = |id: usize, p: Vec3, [r, g, b]: [u8; 3]| {
        let _ = writeln!(texts.points, "{id} {} {} {} {r} {g} {b} 0", p.x, p.y, p.z);
    };
    match &room.geometry {
        Some(Geometry::Mesh(mesh)) => {
            (1..).zip(mesh.vertices.iter().zip(&mesh.colors)).for_each(|(id, (v, c))| point(id, *v, *c));
        }
        Some(Geometry::Discs(discs)) => (1..).zip(discs).for_each(|(id, d)| point(id, d.center, d.color)),
        None => {}
    }
    texts.write(dir)
}

impl SparseModel {
    /// Writes the model in text.
    ///
    /// # Errors
    /// [`crate::Error::Calib`] when a file cannot be written; then none is written.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let mut texts = Texts::new();
        for (id, lens) in (1..).zip(&self.lenses) {
            texts.camera(id, lens);
        }
        // Pictures that show a point, and the number of its sighting in each, from 0.
        let mut tracks = vec![String::new(); self.points.len()];
        for (id, picture) in (1..).zip(&self.pictures) {
            let mut line = String::new();
            for (number, (point, pixel)) in picture.sightings.iter().enumerate() {
                let before = if number == 0 { "" } else { " " };
                let (x, y) = (pixel.x + CORNER_PX, pixel.y + CORNER_PX);
                let _ = write!(line, "{before}{x} {y} {}", point + 1);
                let _ = write!(tracks[*point], " {id} {number}");
            }
            texts.picture(id, picture.lens + 1, &picture.camera_from_world, &picture.name, &line);
        }
        for ((id, point), track) in (1..).zip(&self.points).zip(&tracks) {
            let (p, [r, g, b]) = (point.place, point.color);
            let _ =
                writeln!(texts.points, "{id} {} {} {} {r} {g} {b} {}{track}", p.x, p.y, p.z, point.error_px);
        }
        texts.write(dir)
    }
}
