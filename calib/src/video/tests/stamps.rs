//! Times of frames from files of several formats.

use std::path::Path;

use ffmpeg::Rational;
use ffmpeg::codec::Id;
use image::RgbImage;

use super::films::{EncodedTrack, MILLISECONDS, mux, smooth};
use crate::video::FrameSource;

/// Presentation times of all frames of a file, milliseconds; the file has to be whole.
fn times_ms(path: &Path) -> Vec<i64> {
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let mut times = Vec::new();
    while source.advance().unwrap() {
        times.push((1000.0 * source.stamp().presentation_s.unwrap()).round() as i64);
    }
    times
}

/// Frame times in milliseconds of a film that begins late and loses frames in the middle.
fn late_and_lossy() -> Vec<i64> {
    (0..40).filter(|frame| !(15..22).contains(frame)).map(|frame| 2000 + 100 * frame).collect()
}

#[test]
fn times_are_the_files_own_where_frames_are_late_or_lost() {
    let folder = tempfile::tempdir().unwrap();
    let expected = late_and_lossy();
    for name in ["film.mp4", "film.mov", "film.mkv", "film.flv"] {
        let path = folder.path().join(name);
        mux(&path, &[EncodedTrack::of_times(Id::H264, MILLISECONDS, expected.iter().copied())], &[]);
        assert_eq!(times_ms(&path), expected, "{name}");
    }
    // MPEG-TS has no zero: times count from the first frame.
    let path = folder.path().join("film.ts");
    mux(&path, &[EncodedTrack::of_times(Id::H264, MILLISECONDS, expected.iter().copied())], &[]);
    let from_start: Vec<i64> = expected.iter().map(|time| time - 2000).collect();
    assert_eq!(times_ms(&path), from_start);
    // AVI counts frames and stores empty ones for those that were lost.
    let path = folder.path().join("film.avi");
    let frames = (0..40).filter(|frame| !(15..22).contains(frame));
    mux(&path, &[EncodedTrack::of_times(Id::MJPEG, Rational(1, 10), frames)], &[]);
    assert_eq!(times_ms(&path), from_start);
}

#[test]
fn a_stream_that_starts_after_the_others_of_a_transport_stream_is_late() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.ts");
    let late = EncodedTrack::of_times(Id::H264, MILLISECONDS, (0..30).map(|frame| 5000 + 100 * frame));
    let other = EncodedTrack::of_times(Id::H264, MILLISECONDS, (0..6).map(|frame| 3000 + 500 * frame));
    mux(&path, &[late, other], &[]);
    assert_eq!(times_ms(&path), (0..30).map(|frame| 2000 + 100 * frame).collect::<Vec<_>>());
}

#[test]
fn a_trimmed_film_is_as_long_as_its_edit_list_shows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trimmed.mp4");
    // Film as left by `ffmpeg -ss 1 -c copy`: ten frames before zero are decoded, but not shown.
    mux(
        &path,
        &[EncodedTrack::of_times(Id::H264, MILLISECONDS, (0..40).map(|frame| 100 * frame - 1000))],
        &[],
    );
    assert_eq!(times_ms(&path), (0..30).map(|frame| 100 * frame).collect::<Vec<_>>());
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    assert_eq!(source.frame_count(), Some(30));
    let mut picture = RgbImage::default();
    assert!(source.read(&mut picture).unwrap());
    let difference = |seed: u32| -> u64 {
        let other = smooth(64, 48, seed);
        picture.iter().zip(other.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum()
    };
    assert_eq!((0..40).min_by_key(|seed| difference(*seed)), Some(10));
}

#[test]
fn times_of_raw_streams_are_made_up_and_therefore_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mjpeg");
    mux(&path, &[EncodedTrack::of_times(Id::MJPEG, Rational(1, 10), 0..5)], &[]);
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    assert!(source.skip());
    let mut arrival = source.stamp().arrival;
    for _ in 1..5 {
        assert!(source.skip());
        assert_eq!((source.stamp().presentation_s, source.stamp().sender_s), (None, None));
        assert!(source.stamp().arrival >= arrival);
        arrival = source.stamp().arrival;
    }
    assert!(!source.skip());
}

#[test]
fn times_that_run_backwards_are_told_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let (path, again) = (folder.path().join("film.ts"), folder.path().join("again.ts"));
    mux(&path, &[EncodedTrack::of_times(Id::H264, MILLISECONDS, (0..20).map(|frame| 50 * frame))], &[]);
    let film = std::fs::read(&path).unwrap();
    std::fs::write(&again, [film.as_slice(), &film].concat()).unwrap();
    let times = times_ms(&again);
    assert!(times.len() >= 39, "{times:?}");
    let back = times.windows(2).filter(|pair| pair[1] < pair[0]).count();
    assert_eq!(back, 1, "{times:?}");
}
