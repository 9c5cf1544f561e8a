//! The office's films, one of which is treated as begun later.

use std::path::Path;

use calib::video::FrameSource;
use image::RgbImage;

use super::*;
use crate::foreground::backdrop::Backdrop;
use crate::foreground::{Foreground, ForegroundOptions, Verdict};
use crate::observation::Mask;
use crate::source::sampling;

const RATE_HZ: f64 = 12.0;

/// Masks of a film, in the pinhole image; `None` where the foreground of a frame is not usable.
fn masks(video: &Path, camera: &crate::prepared_room::PreparedCamera) -> Vec<Option<Mask>> {
    let path = video.to_str().unwrap();
    let (width, height) = (camera.width(), camera.height());
    let backdrop = Backdrop::learn(&sampling::spread(path, (width, height)).unwrap()).unwrap();
    let options = ForegroundOptions::default();
    let mut foreground = Foreground::new(width, height, backdrop.into(), options).unwrap();
    let (mut source, mut image, mut mask) =
        (FrameSource::open(path).unwrap(), RgbImage::default(), GrayImage::default());
    let mut masks = Vec::new();
    while source.read(&mut image).unwrap() {
        let verdict = foreground.mask(&image, masks.len() as f64 / RATE_HZ, &mut mask).unwrap();
        let mut seen = GrayImage::new(width, height);
        camera.undistort.mask(&mask, &mut seen);
        masks.push((verdict == Verdict::Usable).then(|| Mask::from(&seen)));
    }
    masks
}

#[test]
fn an_office_film_that_began_later_is_found_to_40_ms() {
    let office = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/office");
    // The room is copied, since preparing it writes its cache.
    let folder = tempfile::tempdir().unwrap();
    Room::read(&office.join("room")).unwrap().write(folder.path()).unwrap();
    let room = Room::read(folder.path()).unwrap();
    let prepared = PreparedRoom::prepare(&room, folder.path(), &PreparationOptions::default()).unwrap();
    let films: Vec<_> = prepared
        .cameras
        .iter()
        .map(|camera| masks(&office.join(format!("video/{}.mp4", camera.name)), camera))
        .collect();
    // A film without its first frames still begins at time 0. 1.3 s is not a whole number of frames, so part of that
    // shift is a disagreement of the clocks from the beginning.
    for shift_s in [0.0, 0.4, 1.3, 2.5] {
        for late in [0, 1] {
            let options = OffsetOptions::recording();
            let mut estimator = OffsetEstimator::new(&prepared, options).unwrap();
            for (camera, film) in films.iter().enumerate() {
                let first = if camera == late { (shift_s * RATE_HZ).ceil() as usize } else { 0 };
                for (frame, mask) in film.iter().enumerate().skip(first) {
                    let true_s = frame as f64 / RATE_HZ;
                    let time_s = if camera == late { true_s - shift_s } else { true_s };
                    if let Some(mask) = mask {
                        estimator.observe(camera, time_s, mask).unwrap();
                    }
                }
            }
            let found = estimator.estimate().cameras[1];
            let truth_s = if late == 1 { shift_s } else { -shift_s };
            let error_s = found.offset_s - truth_s;
            println!(
                "camera {late} {shift_s} s later: {:.1} ± {:.1} ms off",
                1e3 * error_s,
                1e3 * found.sigma_s
            );
            assert!(found.is_known && error_s.abs() <= 0.04, "camera {late} {shift_s} s later: {found:?}");
        }
    }
}
