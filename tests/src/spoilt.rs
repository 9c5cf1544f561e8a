//! Capture projects of synthetic rooms as people make them, and the same with one of their usual mistakes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use calib::Camera;
use image::RgbImage;
use nalgebra::{Point2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use scenes::room::Room;
use synthetic::{CaptureOptions, RoomOptions, SyntheticRoom};

use crate::accuracy::{RelativePoseError, relative_pose};
use crate::chain::StepResult;
use crate::project::picks;

/// Frames of a capture.
const FRAMES: usize = 24;
/// Number of picks of a careful person, who chooses them far apart among this many places, and standard deviation of their
/// coordinates, pixels.
const CAREFUL_PICKS: usize = 8;
const PLACES: usize = 60;
const PICK_SIGMA_PX: f64 = 0.5;
/// Distance of the pick that is off, pixels.
const OFF_PX: f64 = 50.0;

/// One of the usual mistakes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mistake {
    /// One of three picks is far off.
    Pick,
    /// The known length is in millimetres.
    Millimetres,
    /// One camera was turned only, not moved.
    Turned,
    /// One camera's film is mirrored; its picks are in the mirrored picture.
    Mirrored,
    /// The captures of both cameras are exchanged; the picks are not.
    Swapped,
}

impl Mistake {
    /// All mistakes, those first that can use the captures without a mistake.
    pub const ALL: [Self; 5] = [Self::Pick, Self::Millimetres, Self::Turned, Self::Mirrored, Self::Swapped];
}

/// Films of a synthetic room with two cameras, on disk, from which projects are written.
pub struct FilmedRoom {
    folder: PathBuf,
    room: SyntheticRoom,
    seed: u64,
}

impl FilmedRoom {
    /// Makes the room and films it in `folder`, as a careful person does.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn new(folder: &Path, seed: u64) -> StepResult<Self> {
        let room = RoomOptions { seed, ..RoomOptions::default() }.build().map_err(|e| e.to_string())?;
        let filmed = Self { folder: folder.to_owned(), room, seed };
        for index in 0..2 {
            filmed.film(&Self::capture_name(index, None), index, CaptureOptions::default().reach_m, false)?;
            let camera = filmed.camera(index);
            let file = folder.join(format!("cam{index}.toml"));
            calib::files::write_intrinsics(&file, &camera.intrinsics).map_err(|e| e.to_string())?;
        }
        Ok(filmed)
    }

    fn camera(&self, index: usize) -> &Camera {
        &self.room.room.cameras[index].camera
    }

    fn capture_name(index: usize, mistake: Option<Mistake>) -> String {
        match (index, mistake) {
            (1, Some(Mistake::Turned)) => "turned".into(),
            (1, Some(Mistake::Mirrored)) => "mirrored".into(),
            (index, Some(Mistake::Swapped)) => format!("film{}", 1 - index),
            (index, _) => format!("film{index}"),
        }
    }

    fn film(&self, name: &str, index: usize, reach_m: f64, is_mirrored: bool) -> StepResult<()> {
        let folder = self.folder.join(name);
        std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
        let seed = 10 * self.seed + index as u64;
        let options = CaptureOptions { seed, frames: FRAMES, reach_m, ..CaptureOptions::default() };
        for (i, frame) in self.room.capture(self.camera(index), &options).0.into_iter().enumerate() {
            let frame: RgbImage = if is_mirrored { image::imageops::flip_horizontal(&frame) } else { frame };
            frame.save(folder.join(format!("{i:02}.png"))).map_err(|e| e.to_string())?;
        }
        Ok(())
    }

    /// Writes the project, with a mistake or without, and returns its path.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn project(&self, mistake: Option<Mistake>) -> StepResult<PathBuf> {
        match mistake {
            Some(Mistake::Turned) => self.film("turned", 1, 0.0, false)?,
            Some(Mistake::Mirrored) => {
                self.film("mirrored", 1, CaptureOptions::default().reach_m, true)?;
            }
            _ => {}
        }
        let mut text = String::new();
        for index in 0..2 {
            let capture = Self::capture_name(index, mistake);
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "[[camera]]\nname = \"cam{index}\"\ncapture = \"{capture}\"\nintrinsics = \"cam{index}.toml\""
            );
        }
        for [a, b] in self.picked(mistake)? {
            let _ = writeln!(text, "[[point]]\ncam0 = [{}, {}]\ncam1 = [{}, {}]", a.x, a.y, b.x, b.y);
        }
        let unit = if mistake == Some(Mistake::Millimetres) { 1000.0 } else { 1.0 };
        let _ = writeln!(text, "[scale]\ncamera = \"cam0\"\nheight = {}", unit * self.camera(0).center().z);
        let path = self.folder.join("room.toml");
        std::fs::write(&path, text).map_err(|e| e.to_string())?;
        Ok(path)
    }

    /// Error of the relative pose of a built room's cameras. Of exchanged captures each camera is where its film was taken.
    ///
    /// # Errors
    /// A room that cannot be read.
    pub fn error(&self, room: &Path, mistake: Option<Mistake>) -> StepResult<RelativePoseError> {
        let room = Room::read(room).map_err(|e| e.to_string())?;
        let [Some(first), Some(second)] = [room.cameras.first(), room.cameras.get(1)] else {
            return Err("a room without two cameras".into());
        };
        let filmed_by = if mistake == Some(Mistake::Swapped) { [1, 0] } else { [0, 1] };
        Ok(relative_pose([&first.camera, &second.camera], filmed_by.map(|index| self.camera(index))))
    }

    fn picked(&self, mistake: Option<Mistake>) -> StepResult<Vec<[Point2<f64>; 2]>> {
        let count = if mistake == Some(Mistake::Pick) { 3 } else { CAREFUL_PICKS };
        let cameras = [self.camera(0), self.camera(1)];
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed ^ 0x91c5);
        let slip = Normal::new(0.0, PICK_SIGMA_PX).map_err(|e| e.to_string())?;
        let mut all = far_apart(&picks(&self.room, cameras, PLACES, self.seed)?, count);
        for pixel in all.iter_mut().flatten() {
            *pixel += Vector2::new(slip.sample(&mut rng), slip.sample(&mut rng));
        }
        let [width, height] = [cameras[1].intrinsics.width, cameras[1].intrinsics.height].map(f64::from);
        match mistake {
            Some(Mistake::Pick) => {
                let right = all[0][1];
                let inside =
                    |p: &Point2<f64>| (0.0..width - 1.0).contains(&p.x) && (0.0..height - 1.0).contains(&p.y);
                let drawn = (0..1000).map(|_| {
                    let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
                    right + OFF_PX * Vector2::new(cos, sin)
                });
                let drawn: Vec<Point2<f64>> = drawn.collect();
                all[0][1] = *drawn.iter().find(|p| inside(p)).ok_or("no place for a pick that is off")?;
            }
            Some(Mistake::Mirrored) => all.iter_mut().for_each(|[_, b]| b.x = width - 1.0 - b.x),
            _ => {}
        }
        Ok(all)
    }
}

/// Of these places, `count` far apart in both pictures: each next one is the farthest from those chosen.
fn far_apart(places: &[[Point2<f64>; 2]], count: usize) -> Vec<[Point2<f64>; 2]> {
    let mut chosen: Vec<[Point2<f64>; 2]> = places.first().copied().into_iter().collect();
    let apart = |a: &[Point2<f64>; 2], b: &[Point2<f64>; 2]| (a[0] - b[0]).norm().min((a[1] - b[1]).norm());
    while chosen.len() < count.min(places.len()) {
        let nearest = |place: &[Point2<f64>; 2]| {
            chosen.iter().map(|other| apart(place, other)).fold(f64::INFINITY, f64::min)
        };
        let next = places.iter().max_by(|a, b| nearest(a).total_cmp(&nearest(b)));
        chosen.extend(next.copied());
    }
    chosen
}
