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

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::super::read_points;
    use super::super::tests::{cameras, room};
    use super::*;

    /// A model with sightings: what is read back is what was written, and each line of a point names the sightings that name it.
    #[test]
    fn a_sparse_model_comes_back_with_its_sightings() {
        let (folder, room) = (tempfile::tempdir().unwrap(), room());
        let lenses: Vec<_> = room.cameras.iter().map(|entry| entry.camera.intrinsics.clone()).collect();
        let point =
            |place: [f64; 3], color| SparsePoint { place: Point3::from(place), color, error_px: 0.25 };
        let pictures = [0, 1, 1].into_iter().enumerate().map(|(number, lens)| SparsePicture {
            name: format!("{}/{number:04}.jpg", room.cameras[lens].name),
            lens,
            camera_from_world: room.cameras[number].camera.camera_from_world,
            sightings: vec![(1, Point2::new(3.25, 4.5)), (0, Point2::new(100.0, 7.0))][..2 - number % 2]
                .to_vec(),
        });
        let points = vec![point([0.1, -2.5, 1.0 / 3.0], [1, 2, 3]), point([4.0, 5.0, 6.0], [250, 0, 9])];
        let model = SparseModel { lenses, pictures: pictures.collect(), points };
        model.write(folder.path()).unwrap();
        let found = cameras(folder.path()).unwrap();
        assert_eq!(found.len(), 3);
        for (found, written) in found.iter().zip(&model.pictures) {
            assert_relative_eq!(found.camera.camera_from_world, written.camera_from_world, epsilon = 1e-12);
            let (a, b) = (&found.camera.intrinsics, &model.lenses[written.lens]);
            assert_eq!((a.width, a.height, a.distortion), (b.width, b.height, b.distortion));
            assert_relative_eq!(a.matrix(), b.matrix(), epsilon = 1e-9);
        }
        let back = read_points(folder.path()).unwrap().unwrap();
        let back: Vec<[f64; 3]> = back.vertices.iter().map(|vertex| vertex.position).collect();
        assert_eq!(back, [[0.1, -2.5, 1.0 / 3.0], [4.0, 5.0, 6.0]]);
        // COLMAP counts pixels from the corner, and its lists refer to each other.
        let text = |name| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let [points, images] = ["points3D.txt", "images.txt"].map(text);
        let tracks: Vec<&str> =
            points.lines().skip(1).map(|line| line.split(" 0.25").last().unwrap()).collect();
        assert_eq!(tracks, [" 1 1 3 1", " 1 0 2 0 3 0"]);
        assert!(images.contains("\n3.75 5 2 100.5 7.5 1\n") && images.contains("\n3.75 5 2\n"), "{images}");
    }
}
