//! Films of synthetic rooms as people give them to a run, and the same with one of the usual mix-ups, for `tracker check`.

use std::path::{Path, PathBuf};

use calib::video::FilmWriter;
use image::RgbImage;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use synthetic::{RoomOptions, SequenceOptions, SyntheticRoom, WalkerOptions};

use crate::chain::StepResult;
use crate::data::program;

/// Rate and length of all films.
const RATE_HZ: f64 = 12.0;
const FRAMES: u32 = 180;
/// Times by which a film is shifted, seconds.
const SHIFTED_S: std::ops::Range<f64> = 0.2..3.0;
/// Turn and shift of a camera with another pose, degrees and metres.
const TURNED_DEG: std::ops::Range<f64> = 0.5..10.0;
const MOVED_M: std::ops::Range<f64> = 0.0..0.3;

/// One of the usual mix-ups.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MixUp {
    /// The films of two cameras are exchanged.
    Swapped,
    /// One film begins later than the other.
    Shifted,
    /// One camera was bumped since the room was built.
    OtherPose,
    /// One film was taken in another room.
    OtherRoom,
}

impl MixUp {
    /// All mix-ups.
    pub const ALL: [Self; 4] = [Self::Swapped, Self::Shifted, Self::OtherPose, Self::OtherRoom];
}

/// Two films, one a camera.
#[derive(Debug, Clone)]
pub struct Films {
    /// Kind and size of the mix-up, or of the clean set.
    pub what: String,
    /// Path of each camera's film.
    pub paths: [PathBuf; 2],
}

/// A furnished room with two cameras and their reference pictures, filmed twice.
pub struct FilmedRoom {
    folder: PathBuf,
    made: SyntheticRoom,
    seed: u64,
    /// Pictures of each recording, camera by camera.
    recordings: [Vec<Vec<RgbImage>>; 2],
}

impl FilmedRoom {
    /// Makes the room in a folder and films it, each time with other people.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn new(folder: &Path, seed: u64) -> StepResult<Self> {
        let options = RoomOptions { seed, cameras: 2, image_px: [480, 360], ..RoomOptions::default() };
        let mut made = options.build().map_err(|e| e.to_string())?;
        let folder = folder.join(seed.to_string());
        std::fs::create_dir_all(folder.join("room")).map_err(|e| e.to_string())?;
        let empty = pictures(&made, seed, 0, 1)?;
        for (camera, film) in made.room.cameras.iter_mut().zip(&empty) {
            let name = format!("{}.png", camera.name);
            film[0].save(folder.join("room").join(&name)).map_err(|e| e.to_string())?;
            camera.reference = Some(name.into());
        }
        made.room.write(&folder.join("room")).map_err(|e| e.to_string())?;
        let recordings = [pictures(&made, seed, 4, FRAMES)?, pictures(&made, seed + 500, 3, FRAMES)?];
        Ok(Self { folder, made, seed, recordings })
    }

    /// Films with a mix-up; those of another room are the other's.
    ///
    /// # Errors
    /// A film that cannot be written.
    pub fn mixed_up(&self, mix_up: MixUp, other: &Self) -> StepResult<Films> {
        let mut random = Pcg64Mcg::seed_from_u64(self.seed ^ 0x5a17);
        let own = &self.recordings[0];
        let name = |camera: usize| format!("{mix_up:?}_{camera}.mp4").to_lowercase();
        let (what, films): (String, [Vec<RgbImage>; 2]) = match mix_up {
            MixUp::Swapped => ("swapped".into(), [own[1].clone(), own[0].clone()]),
            MixUp::Shifted => {
                let frames = (random.random_range(SHIFTED_S) * RATE_HZ).round().max(3.0) as usize;
                let late = random.random_range(0..2);
                let cut = |camera: usize| own[camera][if camera == late { frames } else { 0 }..].to_vec();
                let sign = if late == 1 { 1.0 } else { -1.0 };
                (format!("shifted by {:.2} s", sign * frames as f64 / RATE_HZ), [cut(0), cut(1)])
            }
            MixUp::OtherPose => {
                let [turned_deg, moved_m] = [random.random_range(TURNED_DEG), random.random_range(MOVED_M)];
                let mut direction = || Vector3::from_fn(|_, _| random.random_range(-1.0..1.0)).normalize();
                let turn = UnitQuaternion::new(direction() * f64::to_radians(turned_deg));
                let pose = Isometry3::from_parts(Translation3::from(direction() * moved_m), turn);
                let bumped = self.bumped(pose)?;
                (format!("turned by {turned_deg:.1}°, moved by {moved_m:.2} m"), [own[0].clone(), bumped])
            }
            MixUp::OtherRoom => ("of another room".into(), [own[0].clone(), other.recordings[0][1].clone()]),
        };
        let paths = [self.film(&name(0), &films[0])?, self.film(&name(1), &films[1])?];
        Ok(Films { what, paths })
    }

    /// Sets of films without a mix-up: both recordings, a darker one, and one that begins later in both films.
    ///
    /// # Errors
    /// A film that cannot be written.
    pub fn clean(&self) -> StepResult<Vec<Films>> {
        let darker = |picture: &RgbImage| {
            let mut picture = picture.clone();
            picture.iter_mut().for_each(|level| *level = (f64::from(*level) * 0.75) as u8);
            picture
        };
        let each = |what: &str, of: &dyn Fn(usize) -> Vec<RgbImage>| -> StepResult<Films> {
            let film = |camera| self.film(&format!("{}_{camera}.mp4", what.replace(' ', "_")), &of(camera));
            Ok(Films { what: what.to_owned(), paths: [film(0)?, film(1)?] })
        };
        let [first, second] = &self.recordings;
        Ok(vec![
            each("clean", &|camera| first[camera].clone())?,
            each("clean with others", &|camera| second[camera].clone())?,
            each("clean and darker", &|camera| second[camera].iter().map(darker).collect())?,
            each("clean and later", &|camera| first[camera][18..].to_vec())?,
        ])
    }

    /// Second camera's film after it was bumped.
    fn bumped(&self, bumped_from_installed: Isometry3<f64>) -> StepResult<Vec<RgbImage>> {
        let options =
            RoomOptions { seed: self.seed, cameras: 2, image_px: [480, 360], ..RoomOptions::default() };
        let mut made = options.build().map_err(|e| e.to_string())?;
        let camera = &mut made.room.cameras[1].camera;
        camera.camera_from_world = bumped_from_installed * camera.camera_from_world;
        made.room.cameras.remove(0);
        pictures(&made, self.seed, 4, FRAMES)?.pop().ok_or_else(|| "no film".to_owned())
    }

    fn film(&self, name: &str, pictures: &[RgbImage]) -> StepResult<PathBuf> {
        let path = self.folder.join(name);
        let (width, height) = pictures.first().ok_or("a film without pictures")?.dimensions();
        let mut writer = FilmWriter::create(&path, width, height, RATE_HZ).map_err(|e| e.to_string())?;
        for picture in pictures {
            writer.write(picture).map_err(|e| e.to_string())?;
        }
        writer.finish().map_err(|e| e.to_string())?;
        Ok(path)
    }

    /// Text and exit status of `tracker check` of these films.
    ///
    /// # Errors
    /// A program that does not start.
    pub fn checked(&self, films: &Films) -> StepResult<(String, Option<i32>)> {
        let mut check = program("tracker");
        check.arg("check").arg(self.folder.join("room"));
        for (camera, path) in self.made.room.cameras.iter().zip(&films.paths) {
            check.arg("--video").arg(format!("{}={}", camera.name, path.display()));
        }
        let found = check.output().map_err(|e| e.to_string())?;
        let text = String::from_utf8_lossy(&found.stdout) + String::from_utf8_lossy(&found.stderr);
        Ok((text.into_owned(), found.status.code()))
    }
}

/// Pictures of each camera while some people walk through the room.
fn pictures(made: &SyntheticRoom, seed: u64, people: usize, frames: u32) -> StepResult<Vec<Vec<RgbImage>>> {
    let walkers = made.walkers(&WalkerOptions { seed, people, ..WalkerOptions::default() });
    let options = SequenceOptions { seed, rate_hz: RATE_HZ, frames, ..SequenceOptions::default() };
    let mut films = vec![Vec::new(); made.room.cameras.len()];
    for frame in made.sequence(walkers, options).frames() {
        for (film, seen) in films.iter_mut().zip(frame.cameras) {
            film.push(seen.image.ok_or("a camera without a picture")?);
        }
    }
    Ok(films)
}
