//! Films that are written and read again, and sources that are no films.

use std::path::Path;

use image::{Rgb, RgbImage};

use super::{FilmWriter, FrameSource};

mod films;
mod killed;
mod live;
mod memory;
mod rtsp;
mod sizes;
mod stamps;
mod torn;

fn flat(level: u8) -> RgbImage {
    RgbImage::from_pixel(64, 48, Rgb([level, 128, 255 - level]))
}

#[test]
fn folders_come_in_name_order_whatever_the_order_of_writing() {
    let folder = tempfile::tempdir().unwrap();
    for level in [30, 10, 20] {
        flat(level).save(folder.path().join(format!("{level:03}.png"))).unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "not an image").unwrap();
    let mut source = FrameSource::open(folder.path().to_str().unwrap()).unwrap();
    assert_eq!((source.frame_count(), source.size(), source.rate()), (Some(3), (64, 48), None));
    let levels: Vec<u8> = source.read_all().unwrap().iter().map(|f| f.get_pixel(5, 5)[0]).collect();
    assert_eq!(levels, [10, 20, 30]);
    let mut source = FrameSource::open(folder.path().to_str().unwrap()).unwrap();
    let mut frame = RgbImage::default();
    assert!(source.is_recording() && source.skip() && source.read(&mut frame).unwrap());
    assert_eq!(frame.get_pixel(5, 5)[0], 20);
    assert!(source.skip() && !source.skip() && !source.read(&mut frame).unwrap());

    let numbered = tempfile::tempdir().unwrap();
    for level in 0..5 {
        flat(level).save(numbered.path().join(format!("{level:03}.png"))).unwrap();
    }
    let mut source = FrameSource::open(numbered.path().join("%03d.png").to_str().unwrap()).unwrap();
    assert!(source.is_recording() && !source.is_live());
    assert_eq!((source.frame_count(), source.read_all().unwrap().len()), (Some(5), 5));
}

#[test]
fn a_film_comes_back_with_its_size_rate_and_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    let mut writer = FilmWriter::create(&path, 64, 48, 12.0).unwrap();
    for level in [0, 60, 120, 180, 240] {
        writer.write(&flat(level)).unwrap();
    }
    writer.finish().unwrap();
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    assert_eq!(source.size(), (64, 48));
    assert!((source.rate().unwrap() - 12.0).abs() < 0.01);
    let frames = source.read_all().unwrap();
    assert_eq!(frames.len(), 5);
    for (frame, level) in frames.iter().zip([0, 60, 120, 180, 240]) {
        let Rgb([r, _, b]) = *frame.get_pixel(32, 24);
        assert!(r.abs_diff(level) < 24 && b.abs_diff(255 - level) < 24, "{r}, {b} against {level}");
    }
}

#[test]
fn bad_sources_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let said = |path: &Path| {
        let opened = FrameSource::open(path.to_str().unwrap()).and_then(|mut s| s.read_all());
        let text = opened.unwrap_err().to_string();
        assert!(text.contains(path.file_name().unwrap().to_str().unwrap()), "{text}");
        text
    };
    said(&folder.path().join("missing.mp4"));
    let empty = folder.path().join("empty.mp4");
    std::fs::write(&empty, "").unwrap();
    assert!(said(&empty).contains("empty"));
    let text = folder.path().join("text.mp4");
    std::fs::write(&text, "this is no video").unwrap();
    assert!(said(&text).contains("cannot be decoded"));

    let images = folder.path().join("images");
    std::fs::create_dir(&images).unwrap();
    assert!(said(&images).contains("no .jpg"));
    flat(1).save(images.join("1.png")).unwrap();
    RgbImage::new(32, 48).save(images.join("2.png")).unwrap();
    let odd = FrameSource::open(images.to_str().unwrap()).unwrap().read_all().unwrap_err().to_string();
    assert!(odd.contains("2.png") && odd.contains("32 × 48"), "{odd}");
}

/// A film of one picture, red at the left and blue at the right, with a rotation matrix for its display.
fn lying_film(path: &Path, matrix: [i32; 4]) {
    let mut writer = FilmWriter::create(path, 64, 48, 10.0).unwrap();
    let picture =
        RgbImage::from_fn(64, 48, |x, _| if x < 32 { Rgb([220, 30, 30]) } else { Rgb([30, 30, 220]) });
    writer.write(&picture).unwrap();
    writer.finish().unwrap();
    // The track's header (ISO 14496-12, `tkhd`) holds the matrix a b u, c d v, x y w as it stands on paper.
    let mut bytes = std::fs::read(path).unwrap();
    let header = bytes.windows(4).position(|name| name == b"tkhd").unwrap();
    for (index, value) in [(0, matrix[0]), (1, matrix[1]), (3, matrix[2]), (4, matrix[3])] {
        let at = header + 4 + 40 + 4 * index;
        bytes[at..at + 4].copy_from_slice(&(value << 16).to_be_bytes());
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_telephones_film_is_turned_the_way_it_was_held() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("telephone.mp4");
    // Directions of the picture's x and y axes, in axes right and down; the size; a pixel that is red then, and one
    // that is blue.
    for (matrix, size, red, blue) in [
        ([1, 0, 0, 1], (64, 48), (10, 24), (54, 24)),
        ([0, 1, -1, 0], (48, 64), (24, 10), (24, 54)),
        ([-1, 0, 0, -1], (64, 48), (54, 24), (10, 24)),
        ([0, -1, 1, 0], (48, 64), (24, 54), (24, 10)),
        // Mirrored left to right, upside down, and both axes exchanged.
        ([-1, 0, 0, 1], (64, 48), (54, 24), (10, 24)),
        ([1, 0, 0, -1], (64, 48), (10, 24), (54, 24)),
        ([0, 1, 1, 0], (48, 64), (24, 10), (24, 54)),
        ([0, -1, -1, 0], (48, 64), (24, 54), (24, 10)),
    ] {
        lying_film(&path, matrix);
        let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
        let mut picture = RgbImage::default();
        assert!(source.read(&mut picture).unwrap());
        assert_eq!((source.size(), picture.dimensions()), (size, size), "{matrix:?}");
        assert!(picture[red][0] > 150 && picture[red][2] < 100, "{matrix:?}: {:?}", picture[red]);
        assert!(picture[blue][2] > 150 && picture[blue][0] < 100, "{matrix:?}: {:?}", picture[blue]);
    }
}

#[test]
fn a_film_that_is_cut_off_is_told_at_the_frame_where_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    films::noisy_film(&path, 64, 48, 60);
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let said = source.read_all().unwrap_err().to_string();
    assert!((10..50).contains(&source.delivered()), "{}", source.delivered());
    let place = format!("frame {}: the file ends here, but its header promises 60", source.delivered() + 1);
    assert!(said.contains("film.mp4") && said.contains(&place), "{said}");
    // Without its index nothing of the film can be read.
    std::fs::write(&path, &whole[..600]).unwrap();
    let said = FrameSource::open(path.to_str().unwrap()).unwrap_err().to_string();
    assert!(said.contains("film.mp4") && said.contains("cannot be decoded"), "{said}");
}
