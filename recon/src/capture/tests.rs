//! Captures of folders of images: references, sizes, sampling, lenses to start with.

use super::*;

#[test]
fn the_reference_may_be_named_by_its_file() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["9.png", "10.png", "11.png"] {
        RgbImage::new(8, 6).save(folder.path().join(name)).unwrap();
    }
    let load = |text: &str| Capture::load("cam", folder.path(), text.parse()?, None);
    assert_eq!(["9.png", "10.png", "11.png"].map(|name| load(name).unwrap().reference), [0, 1, 2]);
    let said = load("12.png").unwrap_err().to_string();
    assert!(said.contains("no image of the capture is called `12.png`"), "{said}");
    assert!(load("middle").unwrap_err().to_string().contains("file name"));
}

#[test]
fn frames_reference_and_size_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let load = |reference, intrinsics| Capture::load("cam", path, reference, intrinsics);
    for index in 0..2 {
        RgbImage::new(32, 24).save(path.join(format!("{index}.png"))).unwrap();
    }
    assert!(load(ReferenceFrame::Last, None).unwrap_err().to_string().contains("2 frames"));
    for index in 2..5 {
        RgbImage::new(32, 24).save(path.join(format!("{index}.png"))).unwrap();
    }
    for (reference, index) in
        [(ReferenceFrame::First, 0), (ReferenceFrame::Last, 4), (ReferenceFrame::Number(3), 2)]
    {
        let capture = load(reference, None).unwrap();
        assert_eq!((capture.reference, capture.frames.len()), (index, 5));
    }
    let beyond = load(ReferenceFrame::Number(6), None).unwrap_err().to_string();
    assert!(beyond.contains("frame 6") && beyond.contains(path.to_str().unwrap()), "{beyond}");
    let other = load(ReferenceFrame::Last, Some(Intrinsics::from_horizontal_fov(64, 48, 60.0)));
    assert!(other.unwrap_err().to_string().contains("64 × 48"));
    let missing = Capture::load("cam", &path.join("gone"), ReferenceFrame::Last, None).unwrap_err();
    assert!(missing.to_string().contains("gone"));
}

#[test]
fn long_films_are_used_in_even_steps_that_meet_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let count = 2 * MOST_FRAMES + 7;
    for index in 0..count {
        let shade = image::Rgb([(index % 251) as u8, 0, 0]);
        RgbImage::from_pixel(4, 3, shade).save(folder.path().join(format!("{index:04}.png"))).unwrap();
    }
    for (reference, number) in
        [(ReferenceFrame::First, 1), (ReferenceFrame::Last, count), (ReferenceFrame::Number(102), 102)]
    {
        let file = CaptureFile::open("cam", folder.path(), reference.clone(), None).unwrap();
        assert_eq!((file.count(), file.stride(), file.size().filmed), (count, 3, (4, 3)));
        let capture = file.read().unwrap();
        assert!(capture.frames.len() <= MOST_FRAMES, "{}", capture.frames.len());
        assert_eq!(capture.sampled.number(capture.reference), number);
        for (index, frame) in capture.frames.iter().enumerate() {
            let shade = ((capture.sampled.number(index) - 1) % 251) as u8;
            assert_eq!(frame.get_pixel(0, 0).0, [shade, 0, 0], "frame {index} of {reference:?}");
        }
        let last = capture.sampled.number(capture.frames.len() - 1);
        assert!(capture.sampled.first < 3 && last + 3 > count, "{:?}", capture.sampled);
    }
}

/// A JPEG whose EXIF block, big-endian, has one entry: `FocalLengthIn35mmFilm` of this value.
fn photograph(film_mm: u16, entries: u8) -> Vec<u8> {
    let mut jpeg = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
    RgbImage::new(32, 24).write_with_encoder(encoder).unwrap();
    let mut block = b"Exif\0\0MM\0\x2a\0\0\0\x08\0".to_vec();
    // The first directory points to EXIF's own, which has the tag.
    block.extend([1, 0x87, 0x69, 0, 4, 0, 0, 0, 1, 0, 0, 0, 26, 0, 0, 0, 0, 0, entries]);
    block.extend([0xa4, 0x05, 0, 3, 0, 0, 0, 1]);
    block.extend(film_mm.to_be_bytes());
    block.extend([0; 6]);
    let length = (block.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &block, &jpeg[2..]].concat()
}

#[test]
fn motion_starts_with_what_is_known_of_the_lens() {
    let folder = tempfile::tempdir().unwrap();
    let load = |first: &[u8], intrinsics| {
        for index in 0..3 {
            RgbImage::new(32, 24).save(folder.path().join(format!("{index}.jpg"))).unwrap();
        }
        std::fs::write(folder.path().join("0.jpg"), first).unwrap();
        Capture::load("cam", folder.path(), ReferenceFrame::Last, intrinsics).unwrap()
    };
    // A lens of 40 px across the diagonal.
    let told = load(&photograph(26, 1), None);
    let [lens] = &told.start_lenses((32, 24))[..] else { panic!("several lenses") };
    assert!((lens.fx - 26.0 / 43.2666 * 40.0).abs() < 1e-3 && lens.fx.to_bits() == lens.fy.to_bits());
    assert_eq!((lens.cx, lens.cy), (15.5, 11.5));

    let assumed = ASSUMED_FOV_DEG.map(|deg| Intrinsics::from_horizontal_fov(32, 24, deg)).to_vec();
    for nothing in [photograph(0, 1), photograph(9000, 1), photograph(26, 200)] {
        let capture = load(&nothing, None);
        assert_eq!((capture.exif_focal_px, capture.start_lenses((32, 24))), (None, assumed.clone()));
    }
    let given = Intrinsics::from_horizontal_fov(32, 24, 40.0);
    let capture = load(&photograph(26, 1), Some(given.clone()));
    assert_eq!((capture.exif_focal_px, capture.start_lenses((32, 24))), (None, vec![given]));
}

#[test]
fn reference_words() {
    assert_eq!("first".parse::<ReferenceFrame>().unwrap(), ReferenceFrame::First);
    assert_eq!("last".parse::<ReferenceFrame>().unwrap(), ReferenceFrame::Last);
    assert_eq!("12".parse::<ReferenceFrame>().unwrap(), ReferenceFrame::Number(12));
    for bad in ["0", "-1", "middle", "", "1.5"] {
        assert!(bad.parse::<ReferenceFrame>().is_err(), "{bad}");
    }
}
