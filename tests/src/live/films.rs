//! Recordings that are made for the measurement and kept beside the programs: the office through a wide lens at full
//! high definition, and a synthetic hall.

use std::path::{Path, PathBuf};

use calib::video::{FilmWriter, FrameSource};
use calib::{BrownConrady, Distortion, Intrinsics};
use image::{Rgb, RgbImage};
use nalgebra::{Point2, Point3};
use scenes::room::Room;
use synthetic::{
    RenderOptions, RoomKind, RoomOptions, Sequence, SequenceOptions, SyntheticRoom, WalkerOptions,
};

use crate::chain::StepResult;
use crate::data::office;
use crate::live::office::{CAMERAS, RATE_HZ, video};

/// Path of a film or room that is kept between measurements: `target/PROFILE/live-films/NAME`.
///
/// # Errors
/// The running program lies in no folder.
pub fn kept(name: &str) -> StepResult<PathBuf> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let profile = program.parent().and_then(Path::parent).ok_or("the program is in no folder")?;
    Ok(profile.join("live-films").join(name))
}

/// A room and its cameras' recordings.
#[derive(Debug)]
pub struct RecordedRoom {
    /// The room's directory.
    pub room: PathBuf,
    /// Each camera's name and recording.
    pub videos: Vec<(String, PathBuf)>,
}

/// Width and height in pixels of full high definition.
const FULL_HD: [u32; 2] = [1920, 1080];

/// A lens with k1 = −0.3. With k1 alone the image of the plane folds back 46° from the axis, within a picture of this
/// shape; lenses that see so far have a positive k2.
const WIDE_LENS: Distortion =
    Distortion::BrownConrady(BrownConrady { k1: -0.3, k2: 0.09, ..BrownConrady::NONE });

/// Camera of full high definition at the place of another, with the wide lens. The other camera's picture fills its
/// height; beside that picture its own is black.
fn wide(camera: &Intrinsics) -> Intrinsics {
    let [width, height] = FULL_HD;
    let edge = WIDE_LENS.distort(nalgebra::Vector2::new(0.0, 0.5 * f64::from(camera.height) / camera.fy)).y;
    let focal = 0.5 * f64::from(height) / edge;
    Intrinsics::centred(width, height, focal, WIDE_LENS)
}

/// Place in `from`'s picture that shows the same as each pixel of `to`, row by row; `None` outside that picture.
fn places(to: &Intrinsics, from: &Intrinsics) -> Vec<Option<Point2<f32>>> {
    let pixels = (0..to.height).flat_map(|y| (0..to.width).map(move |x| (x, y)));
    let place = |(x, y): (u32, u32)| {
        let ray = to.unproject(&Point2::new(f64::from(x), f64::from(y)))?;
        let place = from.project(&Point3::from(ray))?;
        let inside = (0.0..=f64::from(from.width - 1)).contains(&place.x)
            && (0.0..=f64::from(from.height - 1)).contains(&place.y);
        inside.then(|| place.cast())
    };
    pixels.map(place).collect()
}

/// Picture sampled at these places, interpolated.
fn seen(picture: &RgbImage, places: &[Option<Point2<f32>>], [width, height]: [u32; 2]) -> RgbImage {
    let mut seen = RgbImage::new(width, height);
    for (pixel, place) in seen.pixels_mut().zip(places) {
        let Some(place) = place else { continue };
        let (x, y) = (place.x as u32, place.y as u32);
        let (right, below) = ((x + 1).min(picture.width() - 1), (y + 1).min(picture.height() - 1));
        let (fx, fy) = (place.x.fract(), place.y.fract());
        let corners = [(x, y), (right, y), (x, below), (right, below)].map(|(x, y)| picture.get_pixel(x, y));
        let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
        let channel = |c: usize| {
            let sum: f32 =
                corners.iter().zip(weights).map(|(corner, weight)| f32::from(corner[c]) * weight).sum();
            sum.round() as u8
        };
        *pixel = Rgb([channel(0), channel(1), channel(2)]);
    }
    seen
}

/// Office at full high definition through the wide lens, with `copies` of each camera under further names. The films
/// play `times` times; they are H.264 where this FFmpeg has an encoder for it.
///
/// # Errors
/// A film that cannot be written.
pub fn office_full_hd(copies: usize, times: usize) -> StepResult<RecordedRoom> {
    let mut room = Room::read(&office().join("room")).map_err(|e| e.to_string())?;
    let mut videos = Vec::new();
    for camera in &mut room.cameras {
        let own = wide(&camera.camera.intrinsics);
        let film = kept(&format!("{}_full_hd_{times}.mp4", camera.name))?;
        if !film.is_file() {
            remade(&video(&camera.name), &film, &places(&own, &camera.camera.intrinsics), times)?;
        }
        camera.camera.intrinsics = own;
        camera.reference = None;
        videos.push((camera.name.clone(), film));
    }
    let originals = (room.cameras.clone(), videos.clone());
    for copy in 1..copies {
        for (camera, (name, film)) in originals.0.iter().zip(&originals.1) {
            let name = format!("{name}_{copy}");
            room.cameras.push(scenes::room::RoomCamera { name: name.clone(), ..camera.clone() });
            videos.push((name, film.clone()));
        }
    }
    let folder = kept(&format!("office_full_hd_{}", room.cameras.len()))?;
    room.write(&folder).map_err(|e| e.to_string())?;
    Ok(RecordedRoom { room: folder, videos })
}

/// Writes a video as seen at other places, `times` times over.
fn remade(video: &Path, film: &Path, places: &[Option<Point2<f32>>], times: usize) -> StepResult<()> {
    let [width, height] = FULL_HD;
    let mut writer = FilmWriter::create(film, width, height, RATE_HZ).map_err(|e| e.to_string())?;
    for _ in 0..times {
        let spec = video.to_str().ok_or("the video's path is not UTF-8")?;
        let mut source = FrameSource::open(spec).map_err(|e| e.to_string())?;
        let mut frame = RgbImage::default();
        while source.read(&mut frame).map_err(|e| e.to_string())? {
            writer.write(&seen(&frame, places, FULL_HD)).map_err(|e| e.to_string())?;
        }
    }
    writer.finish().map_err(|e| e.to_string())
}

/// The office's own recordings.
pub fn office_recorded() -> RecordedRoom {
    let videos = CAMERAS.map(|name| (name.to_owned(), video(name)));
    RecordedRoom { room: office().join("room"), videos: videos.to_vec() }
}

/// Duration of a hall's recording, seconds.
const HALL_S: f64 = 20.0;
/// Size of a hall's films, pixels.
const HALL_PX: [u32; 2] = [640, 480];

/// A synthetic hall of 8 × 6 m.
#[derive(Debug, Clone, Copy)]
pub struct Hall {
    /// Seed of the scene, the people and their ways.
    pub seed: u64,
    /// Number of cameras, of 640 × 480.
    pub cameras: usize,
    /// Number of people, who come in one after the other.
    pub people: usize,
    /// Lens of all cameras.
    pub lens: Distortion,
}

impl Hall {
    /// Six people, seen by six cameras with wide lenses.
    pub const SIX_WIDE_CAMERAS: Self = Self { seed: 1031, cameras: 6, people: 6, lens: WIDE_LENS };

    fn file(&self, what: &str) -> StepResult<PathBuf> {
        let Self { seed, cameras, people, lens } = self;
        let bent = if *lens == Distortion::NONE { "" } else { "_wide" };
        kept(&format!("hall_{seed}_{cameras}_{people}{bent}_{what}"))
    }

    /// Writes the room, the films and the true positions (`truth.txt` in the room's folder), where they are not kept.
    ///
    /// # Errors
    /// A room or a film that cannot be written.
    pub fn recorded(&self) -> StepResult<RecordedRoom> {
        let options = RoomOptions {
            seed: self.seed,
            kind: RoomKind::Hall,
            furniture: 3,
            cameras: self.cameras,
            size_m: Some([8.0, 6.0, 2.9]),
            image_px: HALL_PX,
            field_of_view_deg: 80.0,
            distortion: self.lens,
            ..RoomOptions::default()
        };
        let made = options.build().map_err(|e| e.to_string())?;
        let folder = self.file("room")?;
        made.room.write(&folder).map_err(|e| e.to_string())?;
        let name = |camera: &scenes::room::RoomCamera| camera.name.clone();
        let names: Vec<String> = made.room.cameras.iter().map(name).collect();
        let films =
            names.iter().map(|name| self.file(&format!("{name}.mp4"))).collect::<StepResult<Vec<_>>>()?;
        let sequence = self.sequence(&made);
        std::fs::write(folder.join("truth.txt"), sequence.truth_rows()).map_err(|e| e.to_string())?;
        if !films.iter().all(|film| film.is_file()) {
            record(&sequence, &films)?;
        }
        Ok(RecordedRoom { room: folder, videos: names.into_iter().zip(films).collect() })
    }

    fn sequence<'a>(&self, made: &'a SyntheticRoom) -> Sequence<'a> {
        let walkers = made.walkers(&WalkerOptions {
            seed: self.seed,
            people: self.people,
            first_s: 1.5,
            interval_s: 0.7,
            ..WalkerOptions::default()
        });
        let options = SequenceOptions {
            seed: self.seed,
            rate_hz: RATE_HZ,
            frames: (HALL_S * RATE_HZ) as u32,
            render: RenderOptions { samples: 1, ..RenderOptions::default() },
            ..SequenceOptions::default()
        };
        made.sequence(walkers, options)
    }
}

fn record(sequence: &Sequence<'_>, films: &[PathBuf]) -> StepResult<()> {
    let [width, height] = HALL_PX;
    let writer = |film: &PathBuf| FilmWriter::create(film, width, height, RATE_HZ).map_err(|e| e.to_string());
    let mut writers = films.iter().map(writer).collect::<StepResult<Vec<_>>>()?;
    for frame in sequence.frames() {
        for (writer, seen) in writers.iter_mut().zip(&frame.cameras) {
            let picture = seen.image.as_ref().ok_or("a camera without a picture")?;
            writer.write(picture).map_err(|e| e.to_string())?;
        }
    }
    writers.into_iter().try_for_each(|writer| writer.finish().map_err(|e| e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wide_lens_sees_what_the_plain_one_sees_in_the_same_direction() {
        let room = Room::read(&office().join("room")).unwrap();
        let plain = &room.cameras[0].camera.intrinsics;
        let wide = wide(plain);
        let places = places(&wide, plain);
        let at = |x: u32, y: u32| places[(y * wide.width + x) as usize];
        assert_eq!(at(0, 540), None);
        // The top row of the plain picture lies at the top row of the wide one.
        let top = at(960, 2).unwrap();
        assert!((0.0..1.5).contains(&top.y) && (top.x - 319.7).abs() < 0.5, "{top}");
        // A ramp of colours shows that each pixel has the colour of its viewing direction.
        let ramp = RgbImage::from_fn(640, 480, |x, y| Rgb([(x / 3) as u8, (y / 2) as u8, 7]));
        let picture = seen(&ramp, &places, FULL_HD);
        for (x, y) in [(960, 540), (700, 200), (1300, 1000)] {
            let place = plain
                .project(&Point3::from(wide.unproject(&Point2::new(f64::from(x), f64::from(y))).unwrap()));
            let (place, found) = (place.unwrap(), picture.get_pixel(x, y));
            assert!((f64::from(found[0]) - place.x / 3.0).abs() <= 1.0, "{found:?} at {place}");
            assert!((f64::from(found[1]) - place.y / 2.0).abs() <= 1.0, "{found:?} at {place}");
        }
    }
}
