//! Pictures at other sizes than their frames', and frames that change theirs.

use ffmpeg::codec::Id;
use image::{Rgb, RgbImage};

use super::films::{EncodedTrack, MILLISECONDS, mux, smooth};
use super::lying_film;
use crate::video::FrameSource;

/// The mean colour of the part of a picture that each pixel of a smaller one covers, computed pixel by pixel.
fn area_averaged(picture: &RgbImage, width: u32, height: u32) -> RgbImage {
    let cover = |place: u32, of: u32, from: u32| {
        let (start, end) =
            (f64::from(place * from) / f64::from(of), f64::from((place + 1) * from) / f64::from(of));
        (0..from).map(move |at| (end.min(f64::from(at) + 1.0) - start.max(f64::from(at))).max(0.0))
    };
    RgbImage::from_fn(width, height, |x, y| {
        let (mut sum, mut weight) = ([0.0; 3], 0.0);
        for (row, tall) in cover(y, height, picture.height()).enumerate().filter(|(_, tall)| *tall > 0.0) {
            for (column, wide) in cover(x, width, picture.width()).enumerate().filter(|(_, wide)| *wide > 0.0)
            {
                for (sum, value) in sum.iter_mut().zip(picture.get_pixel(column as u32, row as u32).0) {
                    *sum += tall * wide * f64::from(value);
                }
                weight += tall * wide;
            }
        }
        Rgb(sum.map(|sum| (sum / weight).round() as u8))
    })
}

fn largest_difference(a: &[u8], b: &[u8]) -> u8 {
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
}

/// Brightness of each pixel, which films store at full resolution, unlike their colours.
fn luma(picture: &RgbImage) -> Vec<u8> {
    let level = |Rgb([r, g, b]): &Rgb<u8>| {
        (0.299 * f64::from(*r) + 0.587 * f64::from(*g) + 0.114 * f64::from(*b)).round() as u8
    };
    picture.pixels().map(level).collect()
}

fn mean_difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    a.iter().zip(b.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

#[test]
fn smaller_pictures_are_area_averages_of_films_and_of_folders() {
    let folder = tempfile::tempdir().unwrap();
    let images = folder.path().join("images");
    std::fs::create_dir(&images).unwrap();
    let shown: Vec<(i64, RgbImage)> = (0..3).map(|k| (100 * i64::from(k), smooth(192, 128, k))).collect();
    for (time, picture) in &shown {
        picture.save(images.join(format!("{time:03}.png"))).unwrap();
    }
    let film = folder.path().join("film.mp4");
    mux(&film, &[EncodedTrack::new(Id::H264, &[], MILLISECONDS, &shown)], &[]);
    for spec in [&film, &images] {
        let [mut whole, mut scaled] = [0; 2].map(|_| FrameSource::open(spec.to_str().unwrap()).unwrap());
        let mut full = RgbImage::default();
        let mut sizes = [(192, 128), (96, 64), (64, 40), (33, 21)].map(|(w, h)| RgbImage::new(w, h));
        while whole.read(&mut full).unwrap() {
            assert!(scaled.advance().unwrap());
            for _ in 0..2 {
                for picture in &mut sizes {
                    scaled.picture(picture).unwrap();
                    let (width, height) = picture.dimensions();
                    let expected = area_averaged(&full, width, height);
                    let place = format!("{} at {width} × {height}", spec.display());
                    // A film's colours are interpolated between its pixels: once in one pass, twice in two passes.
                    let (most_luma, most) = match (width, height) {
                        (192, 128) => (0, 0),
                        _ if *spec == film => (4, 14),
                        _ => (2, 2),
                    };
                    let luma = largest_difference(&luma(picture), &luma(&expected));
                    let largest = largest_difference(picture, &expected);
                    assert!(luma <= most_luma && largest <= most, "{place}: {luma}, {largest}");
                }
            }
            assert_eq!(scaled.stamp().presentation_s, whole.stamp().presentation_s);
        }
        assert!(!scaled.advance().unwrap() && scaled.picture(&mut sizes[0]).is_err());
    }
}

#[test]
fn masks_stay_black_and_white_inside_at_any_size() {
    let folder = tempfile::tempdir().unwrap();
    let mask = image::GrayImage::from_fn(80, 60, |x, _| image::Luma([if x < 40 { 0 } else { 255 }]));
    mask.save(folder.path().join("0.png")).unwrap();
    let mut source = FrameSource::open(folder.path().to_str().unwrap()).unwrap();
    assert!(source.skip());
    for (width, height) in [(80, 60), (40, 30), (20, 20), (160, 120)] {
        let mut picture = RgbImage::new(width, height);
        source.picture(&mut picture).unwrap();
        let edge = f64::from(width) / 2.0;
        for (x, _, pixel) in picture.enumerate_pixels() {
            let level = if f64::from(x) < edge { 0 } else { 255 };
            if (f64::from(x) + 0.5 - edge).abs() > 3.0 {
                assert!(pixel.0.iter().all(|value| value.abs_diff(level) <= 1), "{width}: {x} {pixel:?}");
            }
        }
    }
}

#[test]
fn a_turned_film_is_turned_at_any_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("telephone.mp4");
    for matrix in [[0, 1, -1, 0], [-1, 0, 0, -1], [0, -1, 1, 0]] {
        lying_film(&path, matrix);
        let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
        let mut full = RgbImage::default();
        assert!(source.read(&mut full).unwrap());
        assert_eq!(source.frame_size(), full.dimensions());
        let (width, height) = (full.width() / 2, full.height() / 2);
        let mut half = RgbImage::new(width, height);
        source.picture(&mut half).unwrap();
        let mean = mean_difference(&half, &area_averaged(&full, width, height));
        assert!(mean < 2.0, "{matrix:?}: {mean}");
    }
}

#[test]
fn a_stream_may_change_its_size_between_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.ts");
    let film = |width, height, from: i64| {
        let shown: Vec<(i64, RgbImage)> =
            (0..12).map(|k| (100 * (from + i64::from(k)), smooth(width, height, 7))).collect();
        mux(&path, &[EncodedTrack::new(Id::H264, &[], MILLISECONDS, &shown)], &[]);
        std::fs::read(&path).unwrap()
    };
    let both = [film(96, 64, 0), film(64, 48, 12)].concat();
    std::fs::write(&path, both).unwrap();
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let (mut sizes, mut first, mut picture) = (Vec::new(), RgbImage::default(), RgbImage::new(48, 32));
    while source.advance().unwrap() {
        source.picture(&mut picture).unwrap();
        if sizes.is_empty() {
            first = picture.clone();
        }
        // Every frame shows the same scene, whatever its size.
        assert!(mean_difference(&picture, &first) < 6.0);
        sizes.push(source.frame_size());
    }
    assert_eq!(source.size(), (96, 64));
    assert_eq!(sizes.iter().filter(|size| **size == (96, 64)).count(), 12);
    assert_eq!(sizes.iter().filter(|size| **size == (64, 48)).count(), 12);
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let said = source.read_all().unwrap_err().to_string();
    assert!(said.contains("frame 13: is 64 × 48, the frames before it are 96 × 64"), "{said}");
}

#[test]
fn a_picture_is_asked_for_after_a_frame_and_at_a_size() {
    let folder = tempfile::tempdir().unwrap();
    smooth(8, 6, 0).save(folder.path().join("0.png")).unwrap();
    let mut source = FrameSource::open(folder.path().to_str().unwrap()).unwrap();
    assert!(source.picture(&mut RgbImage::new(4, 3)).is_err());
    assert!(source.advance().unwrap());
    assert!(source.picture(&mut RgbImage::default()).is_err());
    source.picture(&mut RgbImage::new(4, 3)).unwrap();
}
