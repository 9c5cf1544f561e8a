//! Tests of round trips, hostile bytes, and the size of the office's messages.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use calib::video::FrameSource;
use image::{GrayImage, Rgb, RgbImage};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::foreground::backdrop::Backdrop;
use crate::foreground::{Foreground, ForegroundOptions, InitialBackground};
use crate::observation::{Colours, Mask, PersonBox};

const HEALTHS: [Verdict; 10] = [
    Verdict::Moved,
    Verdict::Usable,
    Verdict::Frozen,
    Verdict::Dark,
    Verdict::AllForeground,
    Verdict::Learning,
    Verdict::Lost,
    Verdict::Between,
    Verdict::Silent,
    Verdict::OtherShape,
];

fn limits_of(seen: &ObservedFrame) -> Limits {
    let (width, height) = seen.observation.mask.as_ref().map_or((0, 0), Mask::dimensions);
    Limits { width, height }
}

fn decoded(bytes: &[u8], limits: Limits) -> ObservedFrame {
    match Message::decode(bytes, limits) {
        Ok(Message::Seen(seen)) => *seen,
        other => panic!("{other:?}"),
    }
}

/// An observation of noise in blobs of about `grain` pixels.
fn noise(seed: u64, width: u32, height: u32, grain: u32, step: u8) -> ObservedFrame {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let columns = width.div_ceil(grain).max(1);
    let blobs: Vec<bool> = (0..columns * height.div_ceil(grain)).map(|_| rng.random_bool(0.5)).collect();
    let mask = Mask::from_fn(width, height, |x, y| blobs[(y / grain * columns + x / grain) as usize]);
    let picture = RgbImage::from_fn(width, height, |_, _| Rgb(rng.random()));
    ObservedFrame {
        observation: Observation {
            sequence: rng.random(),
            time_s: rng.random_range(-1e6..1e6),
            health: HEALTHS[rng.random_range(0..HEALTHS.len())],
            colours: (step > 0).then(|| Colours::of_picture(&mask, step, &picture)),
            mask: Some(mask),
            boxes: rng.random_bool(0.5).then(|| (0..seed % 4).map(|i| person_box(&mut rng, i)).collect()),
        },
        pictures: Pictures::default(),
        decode: Duration::from_nanos(rng.random_range(0..1 << 40)),
        foreground: Duration::from_nanos(rng.random_range(0..1 << 30)),
    }
}

/// A box with random edges and cuts, and a vector of so many values.
fn person_box(rng: &mut Pcg64Mcg, values: u64) -> PersonBox {
    let [left, top, right, bottom] = [(); 4].map(|()| rng.random_range(-1e3..1e3));
    let appearance = (values > 0).then(|| (0..values).map(|_| rng.random_range(-1.0_f32..1.0)).collect());
    PersonBox { left, top, right, bottom, cut: rng.random(), appearance }
}

proptest! {
    #[test]
    fn observations_return_bit_for_bit(
        seed in any::<u64>(), width in 0_u32..150, height in 0_u32..40, grain in 1_u32..20, step in 0_u8..6,
    ) {
        let seen = noise(seed, width, height, grain, step);
        let bytes = Message::Seen(Box::new(seen.clone())).encode()?;
        let limits = limits_of(&seen);
        let again = decoded(&bytes, limits);
        prop_assert_eq!(&again.observation, &seen.observation);
        prop_assert_eq!((again.decode, again.foreground), (seen.decode, seen.foreground));
        prop_assert!(bytes.len() <= limits.longest_message() - LONGEST_PICTURE);
        for end in 0..bytes.len() {
            prop_assert!(Message::decode(&bytes[..end], limits).is_err(), "cut at {}", end);
        }
        let longer = [&bytes[..], &[0]].concat();
        prop_assert!(Message::decode(&longer, limits).is_err());
        let others = Limits { width: width + 1, height };
        prop_assert!(Message::decode(&bytes, others).is_err());
    }

    #[test]
    fn random_bytes_never_panic(kind in 0_u8..24, bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let limits = Limits { width: 64, height: 8 };
        let _ = Message::decode(&bytes, limits);
        let _ = Message::decode(&[&[VERSION, kind], &bytes[..]].concat(), limits);
    }

    #[test]
    fn small_messages_return(
        camera in "[^\\p{Cc}]{0,60}", size in (1_u32..=LARGEST_SIDE, 1_u32..=LARGEST_SIDE), [is_live, has_boxes_alone] in any::<[bool; 2]>(),
        rate_hz in prop::option::of(0.1..240.0), sequence in any::<u64>(), bodies in prop::collection::vec(any::<[i32; 4]>(), 0..9),
    ) {
        let room = Fingerprint([7; Fingerprint::BYTES]);
        let hello = Hello { room, camera, width: size.0, height: size.1, is_live, rate_hz, has_boxes_alone };
        let bytes = Message::Hello(hello.clone()).encode()?;
        match Message::decode(&bytes, Limits::NO_MASK)? {
            Message::Hello(again) => prop_assert_eq!(again, hello),
            other => prop_assert!(false, "{:?}", other),
        }
        let people = bodies.iter().map(|b| b.map(|v| f64::from(v) / 3.0)).map(|[x_m, y_m, radius_m, height_m]| {
            Body { x_m, y_m, radius_m, height_m }
        });
        let feedback = Feedback { sequence, people: people.collect() };
        match Message::decode(&Message::Feedback(feedback.clone()).encode()?, Limits::NO_MASK)? {
            Message::Feedback(again) => prop_assert_eq!(again, feedback),
            other => prop_assert!(false, "{:?}", other),
        }
    }
}

#[test]
fn every_health_returns_and_others_are_refused() {
    for health in HEALTHS {
        let observation = Observation::unusable(3, 0.25, health);
        let seen = ObservedFrame {
            observation: observation.clone(),
            pictures: Pictures::default(),
            decode: Duration::ZERO,
            foreground: Duration::ZERO,
        };
        let mut bytes = Message::Seen(Box::new(seen)).encode().unwrap();
        assert_eq!(decoded(&bytes, Limits::NO_MASK).observation, observation);
        bytes[11] = 10;
        let refused = Message::decode(&bytes, Limits::NO_MASK).unwrap_err();
        assert_eq!(refused, Malformed("an observation's health is unknown"));
    }
}

#[test]
fn lines_are_cut_at_their_limit_and_stay_one_line() {
    let long = "é".repeat(LONGEST_LINE);
    for (line, expected) in [("a\nb\u{1b}[31m", "a b [31m"), (&long, &long[..LONGEST_LINE])] {
        match Message::decode(&Message::Failure(line.into()).encode().unwrap(), Limits::NO_MASK).unwrap() {
            Message::Failure(again) => assert_eq!(again, expected),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn undecodable_messages_are_not_encoded() {
    let seen = noise(1, 40, 30, 4, 2);
    let other = noise(2, 40, 30, 4, 2).observation.colours;
    let refused = |change: &dyn Fn(&mut ObservedFrame)| {
        let mut seen = seen.clone();
        change(&mut seen);
        Message::Seen(Box::new(seen)).encode().unwrap_err()
    };
    refused(&|seen| seen.observation.time_s = f64::NAN);
    refused(&|seen| seen.observation.mask = None);
    refused(&|seen| seen.observation.colours.clone_from(&other));
    refused(&|seen| seen.pictures.filmed = Some(Arc::new(RgbImage::new(4097, 1))));
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let endless = PersonBox { left: f64::NAN, ..person_box(&mut rng, 0) };
    let many = vec![person_box(&mut rng, 0); 1025];
    let long = person_box(&mut rng, 4097);
    for boxes in [vec![endless], many, vec![long]] {
        refused(&|seen| seen.observation.boxes = Some(boxes.clone()));
    }
    let hello = Hello {
        room: Fingerprint([0; Fingerprint::BYTES]),
        camera: "a".repeat(LONGEST_NAME + 1),
        width: 1,
        height: 1,
        is_live: true,
        rate_hz: None,
        has_boxes_alone: false,
    };
    Message::Hello(hello).encode().unwrap_err();
}

#[test]
fn filmed_pictures_cross_as_jpeg() {
    let mut seen = noise(3, 64, 48, 8, 4);
    let picture = RgbImage::from_fn(64, 48, |x, y| Rgb([(x * 3) as u8, (y * 4) as u8, 90]));
    seen.pictures.filmed = Some(Arc::new(picture.clone()));
    let limits = limits_of(&seen);
    let bytes = Message::Seen(Box::new(seen)).encode().unwrap();
    let again = decoded(&bytes, limits).pictures.filmed.unwrap();
    assert_eq!(again.dimensions(), picture.dimensions());
    let off = again.iter().zip(picture.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
    assert!(off / (picture.len() as f64) < 3.0, "{off}");
}

/// Changes a message in one of the ways of hostile or broken senders.
fn mutate(bytes: &mut Vec<u8>, rng: &mut Pcg64Mcg) {
    let at = |rng: &mut Pcg64Mcg, length: usize| rng.random_range(0..length.max(1));
    match rng.random_range(0..5) {
        // Lengths and flags are near the start.
        0 => {
            let i = at(rng, bytes.len().min(40));
            bytes[i] = rng.random();
        }
        1 => {
            let i = at(rng, bytes.len());
            bytes[i] ^= 1 << rng.random_range(0..8);
        }
        2 => bytes.truncate(1 + at(rng, bytes.len())),
        3 => {
            let i = at(rng, bytes.len());
            bytes.splice(i..i, [0xff; 9]);
        }
        _ => {
            let (from, to) = (at(rng, bytes.len()), at(rng, bytes.len()));
            let part = bytes[from.min(to)..from.max(to)].to_vec();
            let i = at(rng, bytes.len());
            bytes.splice(i..i, part);
        }
    }
}

#[test]
fn mutated_messages_are_refused_or_stay_within_their_limits() {
    let mut rng = Pcg64Mcg::seed_from_u64(20);
    let mut with_picture = noise(4, 96, 64, 9, 4);
    with_picture.pictures.filmed = Some(Arc::new(RgbImage::from_pixel(96, 64, Rgb([9, 99, 199]))));
    let originals = [noise(5, 96, 64, 9, 2), noise(6, 96, 64, 1, 1), with_picture];
    let originals: Vec<_> =
        originals.map(|seen| (limits_of(&seen), Message::Seen(Box::new(seen)).encode().unwrap())).into();
    let mut refused = 0;
    for round in 0..6000 {
        let (limits, mut bytes) = originals[round % originals.len()].clone();
        for _ in 0..rng.random_range(1..4) {
            mutate(&mut bytes, &mut rng);
        }
        match Message::decode(&bytes, limits) {
            Err(_) => refused += 1,
            Ok(Message::Seen(seen)) => {
                let mask = seen.observation.mask.as_ref();
                assert!(mask.is_none_or(|mask| mask.dimensions() == (limits.width, limits.height)));
            }
            Ok(_) => {}
        }
    }
    assert!(refused > 3000, "{refused}");
}

/// Office's camera in frames 200 to 300, where three people walk: the observation of each frame, and its picture.
fn office(camera: &str) -> Vec<(ObservedFrame, RgbImage)> {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../tests/office/video"].iter().collect();
    let path = path.join(camera).with_extension("mp4");
    let frames = FrameSource::open(path.to_str().unwrap()).unwrap().read_all().unwrap();
    let (width, height) = frames[0].dimensions();
    let start = InitialBackground::from(Backdrop::learn(&frames[..20]).unwrap());
    let mut foreground = Foreground::new(width, height, start, ForegroundOptions::default()).unwrap();
    let mut image = GrayImage::new(width, height);
    let mut seen = Vec::new();
    for (i, frame) in frames.into_iter().enumerate().skip(199) {
        let time_s = i as f64 / 12.0;
        let health = foreground.mask(&frame, time_s, &mut image).unwrap();
        let mask = (health == Verdict::Usable).then(|| Mask::from(&image));
        let observation =
            Observation { sequence: i as u64 + 1, time_s, health, colours: None, mask, boxes: None };
        let (decode, foreground) = (Duration::from_micros(700), Duration::from_micros(4100));
        seen.push((ObservedFrame { observation, pictures: Pictures::default(), decode, foreground }, frame));
    }
    seen
}

#[test]
fn office_observations_of_three_people_fit_forty_kilobytes_a_second() {
    for camera in ["cam0", "cam1"] {
        let mut seen = office(camera);
        for step in [0, 2, 3, 4, 8] {
            let (mut bytes, mut samples, mut longest) = (0, 0, 0);
            let (mut encoding, mut decoding) = (Duration::ZERO, Duration::ZERO);
            for (seen, picture) in &mut seen {
                let observation = &mut seen.observation;
                let mask = observation.mask.as_ref().filter(|_| step > 0);
                observation.colours = mask.map(|mask| Colours::of_picture(mask, step, picture));
                samples += observation.colours.as_ref().map_or(0, |colours| colours.samples().len());
                let message = Message::Seen(Box::new(seen.clone()));
                let started = Instant::now();
                let encoded = message.encode().unwrap();
                encoding += started.elapsed();
                let started = Instant::now();
                let again = decoded(&encoded, Limits { width: 640, height: 480 });
                decoding += started.elapsed();
                assert_eq!(again.observation, seen.observation);
                bytes += encoded.len();
                longest = longest.max(encoded.len());
            }
            let count = seen.len();
            let rate = bytes as f64 / count as f64 * 12.0 / 1000.0;
            println!(
                "{camera}, {count} frames, step {step}: {} bytes (longest {longest}), {} samples, {rate:.1} kB/s at 12/s, \
                 {:.0?} to encode, {:.0?} to decode",
                bytes / count,
                samples / count,
                encoding / count as u32,
                decoding / count as u32,
            );
            // Finer grids are only printed, with their rate.
            if step == 0 || step >= 4 {
                assert!(rate < 40.0, "{camera}, step {step}: {rate} kB/s");
            }
        }
    }
}
