//! Cache of the finished stages of each capture: an interrupted or refused build (because of a wrong pick, most often)
//! resumes at its last stage, and a room is rebuilt from other picks without processing its films again.
//!
//! While a room is unfinished the files are in `OUT.unfinished`, afterwards in the room's cache ([`scenes::cache`]),
//! in postcard's format and each keyed by all its inputs: the camera's motion by the program, frames, lens, its options,
//! seed; the surface ([`surface`]) by these and the options of stereo, planes and fusion. The motion in the finished room
//! ([`super::posed_capture`]) is keyed by the frames alone, for `recon export` by any version of the program.

mod surface;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use nalgebra::Similarity3;
use scenes::cache;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::BuildOptions;
use super::camera::{CameraMotion, ProcessedCapture};
use super::posed_capture::PosedCapture;
use crate::capture::Capture;
use surface::CachedCapture;

/// Cache folders of a room's finished stages.
pub(super) struct StageCache {
    unfinished: PathBuf,
    room: PathBuf,
}

/// Cache keys of a capture's stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Keys {
    motion: blake3::Hash,
    surface: blake3::Hash,
    film: blake3::Hash,
}

impl Keys {
    /// Keys of a capture as filmed, from everything that decides its results.
    pub(super) fn of(capture: &Capture, options: &BuildOptions) -> Self {
        let film = film_key(capture);
        let lens = (&capture.intrinsics, capture.exif_focal_px);
        let motion = key_of(&(film.as_bytes(), lens, options.seed, &options.motion));
        let made_from = (motion.as_bytes(), &options.dense, &options.planes, &options.assemble.fusion);
        Self { motion, surface: key_of(&made_from), film }
    }
}

/// Key of a capture's frames as filmed, the same for every program and its options.
pub(super) fn film_key(capture: &Capture) -> blake3::Hash {
    let frame = |frame: &image::RgbImage| (frame.width(), *blake3::hash(frame.as_raw()).as_bytes());
    let frames: Vec<(u32, [u8; 32])> = capture.frames.iter().map(frame).collect();
    blake3::hash(&encoded(&(&capture.name, capture.sampled, capture.reference, frames)))
}

/// Hash of everything that a result is made from, the program included.
fn key_of(made_from: &impl Serialize) -> blake3::Hash {
    blake3::Hasher::new().update(program().as_bytes()).update(&encoded(made_from)).finalize()
}

fn encoded(value: &impl Serialize) -> Vec<u8> {
    #[allow(clippy::expect_used)]
    // Postcard refuses only sequences of unknown length; these are numbers and vectors.
    postcard::to_extend(value, Vec::new()).expect("options are data")
}

/// Motion of a capture in the room that was built from it; `None` where it is of another film, or no longer kept.
pub(super) fn posed(room: &Path, camera: &str, film: &blake3::Hash) -> Option<PosedCapture> {
    decoded(&cache::read(room, &posed_file(camera), film)?)
}

/// Hash of the running program: another program may compute another result from the same options.
fn program() -> &'static blake3::Hash {
    static PROGRAM: OnceLock<blake3::Hash> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let mut hasher = blake3::Hasher::new();
        let hashed = std::env::current_exe().and_then(File::open).and_then(|file| {
            hasher.update_reader(file)?;
            Ok(hasher.finalize())
        });
        // A program that may not be read is known by its version.
        hashed.unwrap_or_else(|_| blake3::hash(env!("CARGO_PKG_VERSION").as_bytes()))
    })
}

/// Value of a file's content; `None` when it is not whole.
fn decoded<T: DeserializeOwned>(content: &[u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes(content).ok()?;
    rest.is_empty().then_some(value)
}

impl StageCache {
    pub(super) fn beside(room: &Path) -> Self {
        let mut name = room.file_name().unwrap_or_default().to_owned();
        name.push(".unfinished");
        Self { unfinished: room.with_file_name(name), room: room.to_owned() }
    }

    /// Cached motion of the same capture by the same options.
    pub(super) fn motion(&self, camera: &str, keys: &Keys) -> Option<CameraMotion> {
        decoded(&self.read(&motion_file(camera), &keys.motion)?)
    }

    /// Cached results of the same capture by the same options.
    pub(super) fn surface(&self, camera: &str, keys: &Keys) -> Option<ProcessedCapture> {
        decoded::<CachedCapture>(&self.read(&surface_file(camera), &keys.surface)?)?.restored()
    }

    /// Caches a camera's motion until the room is finished.
    pub(super) fn store_motion(&self, camera: &str, keys: &Keys, motion: &CameraMotion) {
        self.store(&motion_file(camera), &keys.motion, motion);
    }

    /// Caches the results of a capture until the room is finished.
    pub(super) fn store_surface(&self, camera: &str, keys: &Keys, processed: &ProcessedCapture) {
        self.store(&surface_file(camera), &keys.surface, &CachedCapture::of(processed));
    }

    fn store(&self, file: &str, key: &blake3::Hash, value: &impl Serialize) {
        // Only sequences of unknown length cannot be written, and there is none.
        if let Ok(content) = postcard::to_extend(value, Vec::new()) {
            cache::write(&self.unfinished, file, key, &content);
        }
    }

    /// Moves the cached stages of a camera to the finished room in `dir`.
    pub(super) fn hand_over(&self, dir: &Path, camera: &str, keys: &Keys) {
        for (file, key) in [(motion_file(camera), &keys.motion), (surface_file(camera), &keys.surface)] {
            if let Some(content) = self.read(&file, key) {
                cache::write(dir, &file, key, &content);
            }
        }
    }

    /// Keeps a camera's motion in the finished room in `dir` for [`super::export()`].
    pub(super) fn keep_posed(
        &self,
        dir: &Path,
        camera: &str,
        keys: &Keys,
        room_from_camera: &Similarity3<f64>,
    ) {
        if let Some(motion) = self.motion(camera, keys) {
            let posed = PosedCapture::new(motion, room_from_camera);
            cache::write(dir, &posed_file(camera), &keys.film, &encoded(&posed));
        }
    }

    /// Removes the cache folder beside the finished room.
    pub(super) fn done<'a>(&self, cameras: impl Iterator<Item = &'a str>) {
        for file in cameras.flat_map(|camera| [motion_file(camera), surface_file(camera)]) {
            let file = cache::file_of(&self.unfinished, &file);
            // A file that does not exist or cannot be removed does no harm.
            let _ = std::fs::remove_file(&file);
            let _ = file.parent().map(std::fs::remove_dir);
        }
        let _ = std::fs::remove_dir(&self.unfinished);
    }

    fn read(&self, file: &str, key: &blake3::Hash) -> Option<Vec<u8>> {
        [&self.unfinished, &self.room].into_iter().find_map(|dir| cache::read(dir, file, key))
    }
}

fn motion_file(camera: &str) -> String {
    format!("motion_{camera}")
}

fn posed_file(camera: &str) -> String {
    format!("posed_{camera}")
}

fn surface_file(camera: &str) -> String {
    format!("capture_{camera}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Sampled;
    use crate::pipeline::report::{CameraReport, CameraSeconds, StartErrors};
    use calib::Intrinsics;
    use image::RgbImage;
    use nalgebra::{Point2, Point3};

    fn capture() -> Capture {
        let frames = vec![RgbImage::new(8, 6), RgbImage::new(8, 6)];
        Capture {
            name: "cam0".into(),
            frames,
            sampled: Sampled::ALL,
            reference: 1,
            intrinsics: None,
            exif_focal_px: None,
            larger: None,
        }
    }

    fn motion() -> CameraMotion {
        let ProcessedCapture { lens, camera_from_world, .. } = surface::tests::processed();
        let report = CameraReport {
            name: "cam0".into(),
            start: "two views".into(),
            start_error_px: StartErrors { factorization: None, two_views: Some(0.1 + 0.2) },
            doubts: vec!["two \"different\" motions\nfit".into()],
            ..CameraReport::default()
        };
        let points = vec![Point3::new(0.1 + 0.2, -1.0 / 3.0, 7.0), Point3::new(1e-300, -0.0, 2.5)];
        let observations =
            vec![vec![(0, Point2::new(3.5, 0.1)), (2, Point2::new(1.0 / 3.0, 4.0))], Vec::new()];
        let seconds = CameraSeconds::default();
        CameraMotion { lens, camera_from_world, points, observations, report, seconds }
    }

    #[test]
    fn damaged_contents_count_as_missing() {
        let motion = postcard::to_extend(&motion(), Vec::new()).unwrap();
        let surface =
            postcard::to_extend(&CachedCapture::of(&surface::tests::processed()), Vec::new()).unwrap();
        for (whole, is_motion) in [(&motion, true), (&surface, false)] {
            let is_read = |bytes: &[u8]| {
                if is_motion {
                    decoded::<CameraMotion>(bytes).is_some()
                } else {
                    decoded::<CachedCapture>(bytes).and_then(CachedCapture::restored).is_some()
                }
            };
            assert!(is_read(whole));
            for length in [0, 7, 8, 100, whole.len() - 1] {
                assert!(!is_read(&whole[..length]), "{length}");
            }
            assert!(!is_read(&[&whole[..], &[0]].concat()));
        }
        let mut narrow = CachedCapture::of(&surface::tests::processed());
        narrow.depth.pop();
        assert!(narrow.restored().is_none());
    }

    #[test]
    fn cached_stages_read_back_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let cache = StageCache::beside(&folder.path().join("room"));
        let (processed, motion) = (surface::tests::processed(), motion());
        let keys = Keys::of(&capture(), &BuildOptions::default());
        assert!(cache.surface("cam0", &keys).is_none() && cache.motion("cam0", &keys).is_none());
        cache.store_motion("cam0", &keys, &motion);
        let back = cache.motion("cam0", &keys).unwrap();
        assert_eq!((back.lens, back.report), (motion.lens, motion.report));
        assert_eq!(
            (back.camera_from_world, back.points, back.observations),
            (motion.camera_from_world, motion.points, motion.observations)
        );

        cache.store_surface("cam0", &keys, &processed);
        let whole = |back: ProcessedCapture| {
            assert_eq!((&back.lens, &back.report), (&processed.lens, &processed.report));
            assert_eq!(back.seconds, processed.seconds);
            assert_eq!(
                (&back.camera_from_world, back.range),
                (&processed.camera_from_world, processed.range)
            );
            let (a, b) = (&back.surface, &processed.surface);
            assert_eq!((&a.picture, &a.depth, &a.normal), (&b.picture, &b.depth, &b.normal));
            assert_eq!((&a.agreeing, &a.origin, a.step), (&b.agreeing, &b.origin, b.step));
            assert_eq!((&a.intrinsics, &back.key_frame_discs), (&b.intrinsics, &processed.key_frame_discs));
        };
        whole(cache.surface("cam0", &keys).unwrap());

        // The finished room has both files; nothing is left beside it.
        let room = folder.path().join("room");
        cache.hand_over(&room, "cam0", &keys);
        cache.done(["cam0"].into_iter());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "something was left behind");
        whole(cache.surface("cam0", &keys).unwrap());
        assert!(cache.motion("cam0", &keys).is_some());
    }

    #[test]
    fn another_capture_or_other_options_have_another_key() {
        let same = Keys::of(&capture(), &BuildOptions::default());
        assert_eq!(same, Keys::of(&capture(), &BuildOptions::default()));
        let mut others = Vec::new();
        let mut other = |change: &dyn Fn(&mut Capture, &mut BuildOptions)| {
            let (mut capture, mut options) = (capture(), BuildOptions::default());
            change(&mut capture, &mut options);
            others.push(Keys::of(&capture, &options));
        };
        other(&|capture, _| capture.frames[0].as_mut()[5] = 1);
        other(&|capture, _| capture.reference = 0);
        other(&|capture, _| capture.sampled = Sampled { first: 0, stride: 2 });
        other(&|capture, _| capture.intrinsics = Some(Intrinsics::from_horizontal_fov(8, 6, 60.0)));
        other(&|capture, _| capture.exif_focal_px = Some(7.0));
        other(&|capture, _| capture.frames = vec![RgbImage::new(6, 8), RgbImage::new(6, 8)]);
        other(&|_, options| options.seed = 1);
        let all = |others: &[Keys], of: fn(&Keys) -> blake3::Hash| {
            let all: std::collections::BTreeSet<[u8; 32]> =
                others.iter().map(|k| *of(k).as_bytes()).collect();
            all.len()
        };
        others.push(same);
        assert_eq!(all(&others, |keys| keys.motion), others.len());
        assert_eq!(all(&others, |keys| keys.surface), others.len());
        // Stereo's options do not affect the motion: a draft's serves the full room.
        let mut dense = BuildOptions::default();
        dense.dense.key_frames = 3;
        let dense = Keys::of(&capture(), &dense);
        assert!(dense.motion == same.motion && dense.surface != same.surface);
        // Picks, metres and zones affect the room alone.
        let mut options = BuildOptions { zones: Some("zones.toml".into()), ..BuildOptions::default() };
        options.assemble.merge.outlier_px = 3.0;
        assert_eq!(Keys::of(&capture(), &options), same);
    }
}
