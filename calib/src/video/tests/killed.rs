//! Films of programs that are killed while they write.

use std::path::Path;

use super::films::{noise, smooth};
use crate::video::{FilmWriter, FrameSource, complete_film};

const RATE_HZ: f64 = 12.0;

/// Frames that can be read of a film.
fn readable(path: &Path) -> Vec<image::RgbImage> {
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    source.read_all().unwrap()
}

#[test]
fn a_film_in_the_making_can_be_read_up_to_its_last_second() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    let copy = folder.path().join("as_it_was.mp4");
    let mut writer = FilmWriter::create(&path, 320, 240, RATE_HZ).unwrap();
    let mut seen_early = 0;
    for frame in 1..=60u32 {
        writer.write(&smooth(320, 240, frame / 12)).unwrap();
        // A copy of the file is what a kill at this moment would leave.
        std::fs::copy(folder.path().join("film.partial.mp4"), &copy).unwrap();
        if f64::from(frame) > RATE_HZ {
            let frames = readable(&copy);
            let lost_s = (f64::from(frame) - frames.len() as f64) / RATE_HZ;
            assert!(lost_s <= 1.0, "{lost_s:.2} s of the {frame} frames are lost");
            seen_early = frames.len();
        }
    }
    assert!(seen_early < 60 && !path.exists());
    writer.finish().unwrap();
    assert_eq!(readable(&path).len(), 60);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn a_whole_film_has_its_index_in_front_of_its_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    let mut writer = FilmWriter::create(&path, 64, 48, RATE_HZ).unwrap();
    (0..40).for_each(|seed| writer.write(&noise(64, 48, seed)).unwrap());
    writer.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    // Names of the boxes side by side, ISO 14496-12.
    let (mut at, mut names) = (0, Vec::new());
    while at < bytes.len() {
        names.push(String::from_utf8_lossy(&bytes[at + 4..at + 8]).into_owned());
        at += u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    }
    let place = |name: &str| names.iter().position(|n| n == name).unwrap();
    assert!(place("moov") < place("mdat") && !names.iter().any(|name| name == "moof"), "{names:?}");
    // The first frame is at time 0, and the pictures keep their distance.
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let (mut picture, mut times) = (image::RgbImage::default(), Vec::new());
    while source.read(&mut picture).unwrap() {
        times.push(source.stamp().presentation_s.unwrap());
    }
    for (frame, time_s) in times.iter().enumerate() {
        approx::assert_relative_eq!(*time_s, frame as f64 / RATE_HZ, epsilon = 1e-3);
    }
}

#[test]
fn a_film_that_is_given_up_keeps_its_frames_and_one_without_frames_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    drop(FilmWriter::create(&path, 64, 48, RATE_HZ).unwrap());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let mut writer = FilmWriter::create(&path, 64, 48, RATE_HZ).unwrap();
    (0..36).for_each(|seed| writer.write(&noise(64, 48, seed)).unwrap());
    drop(writer);
    assert!(readable(&folder.path().join("film.partial.mp4")).len() >= 24 && !path.exists());
    // The next film of this name takes its place.
    let mut writer = FilmWriter::create(&path, 64, 48, RATE_HZ).unwrap();
    writer.write(&noise(64, 48, 1)).unwrap();
    writer.finish().unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert_eq!(readable(&path).len(), 1);
}

/// A full disk takes a part of what is written, and FFmpeg does not always tell.
#[test]
fn a_film_that_is_not_whole_on_the_disk_does_not_take_the_name_of_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let (path, partial) = (folder.path().join("film.mp4"), folder.path().join("film.partial.mp4"));
    let film = |frames: u32| {
        let mut writer = FilmWriter::create(&path, 64, 48, RATE_HZ).unwrap();
        (0..frames).for_each(|seed| writer.write(&noise(64, 48, seed)).unwrap());
        writer
    };
    film(5).finish().unwrap();
    for kept in [0, 300, 20_000] {
        let writer = film(60);
        std::fs::OpenOptions::new().write(true).open(&partial).unwrap().set_len(kept).unwrap();
        let error = writer.finish().unwrap_err().to_string();
        assert!(error.contains("the disk has not taken it"), "{error}");
        assert_eq!(readable(&path).len(), 5);
    }
}

#[test]
fn the_same_frames_are_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let film = |name: &str| {
        let path = folder.path().join(name);
        let mut writer = FilmWriter::create(&path, 320, 240, RATE_HZ).unwrap();
        (0..50).for_each(|seed| writer.write(&noise(320, 240, seed)).unwrap());
        writer.finish().unwrap();
        std::fs::read(&path).unwrap()
    };
    assert!(film("a.mp4") == film("b.mp4"));
}

#[test]
fn a_film_of_a_killed_program_is_completed() {
    let folder = tempfile::tempdir().unwrap();
    let (path, partial) = (folder.path().join("film.mp4"), folder.path().join("film.partial.mp4"));
    let mut writer = FilmWriter::create(&path, 64, 48, RATE_HZ).unwrap();
    (0..60).for_each(|seed| writer.write(&noise(64, 48, seed)).unwrap());
    drop(writer);
    let whole = std::fs::read(&partial).unwrap();
    for kept in [whole.len(), whole.len() / 2, 300, 0] {
        std::fs::write(&partial, &whole[..kept]).unwrap();
        complete_film(&partial).unwrap();
        assert!(!partial.exists());
        if kept < 1000 {
            assert!(!path.exists(), "{kept} bytes are no film");
            continue;
        }
        let frames = readable(&path).len();
        let expected = 60.0 * kept as f64 / whole.len() as f64;
        assert!(
            (expected - 13.0..=expected + 1.0).contains(&(frames as f64)),
            "{frames} frames of {expected}"
        );
        // A film that has the name already stays.
        std::fs::write(&partial, b"another").unwrap();
        complete_film(&partial).unwrap();
        assert_eq!(readable(&path).len(), frames);
        std::fs::remove_file(&path).unwrap();
    }
}
