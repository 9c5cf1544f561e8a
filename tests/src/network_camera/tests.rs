//! The camera as a client sees it, and its schedule against closed forms.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};

use super::film::Film;
use super::schedule::Playback;
use super::{AtEnd, CameraOptions, Fault, NetworkCamera, Outage, POLL, stamp};

fn film(places: usize) -> Film {
    let pictures = [RgbImage::from_pixel(640, 480, Rgb([90, 120, 100]))];
    Film::encode_with_sizes(&pictures, &vec![0; places], true, &[(320, 240)]).unwrap()
}

fn address(camera: &NetworkCamera) -> SocketAddr {
    camera.url().trim_start_matches("http://").split('/').next().unwrap().parse().unwrap()
}

/// Number and width of the first `most` pictures that a client gets, or of those until the camera breaks off. A
/// picture that is not a whole JPEG has number `None` and width 0.
fn watch(address: SocketAddr, most: usize) -> Vec<(Option<u32>, u32)> {
    let mut socket = TcpStream::connect(address).unwrap();
    socket.write_all(b"GET / HTTP/1.1\r\n\r\n").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let (mut bytes, mut seen, mut chunk) = (Vec::new(), Vec::new(), [0; 16384]);
    let started = Instant::now();
    while seen.len() < most && started.elapsed() < Duration::from_secs(30) {
        match socket.read(&mut chunk) {
            Ok(count) if count > 0 => bytes.extend_from_slice(&chunk[..count]),
            _ => break,
        }
        while let Some(jpeg) = take_part(&mut bytes) {
            // Decoders accept half a JPEG: the marker at its end shows whether it is whole.
            let whole = Some(&jpeg).filter(|jpeg| jpeg.ends_with(&[0xFF, 0xD9]));
            let picture =
                whole.and_then(|jpeg| image::load_from_memory(jpeg).ok()).map(image::DynamicImage::into_rgb8);
            let number = picture.as_ref().and_then(|p| stamp::read(p, p.width()));
            seen.push((number, picture.map_or(0, |p| p.width())));
        }
    }
    seen
}

/// Takes the body of the first whole part.
fn take_part(bytes: &mut Vec<u8>) -> Option<Vec<u8>> {
    let text = String::from_utf8_lossy(bytes);
    let named = "Content-Length: ";
    let length: usize = text.split_once(named)?.1.split_once("\r\n")?.0.parse().unwrap();
    let head = bytes.windows(named.len()).position(|w| w == named.as_bytes())?;
    let body = head + bytes[head..].windows(4).position(|w| w == b"\r\n\r\n")? + 4;
    if bytes.len() < body + length {
        return None;
    }
    let jpeg = bytes[body..body + length].to_vec();
    bytes.drain(..body + length);
    Some(jpeg)
}

#[test]
fn stamps_survive_jpeg_and_a_quarter_of_the_size() {
    for number in [0, 299, 43_690, stamp::MAX_NUMBER] {
        let mut picture = RgbImage::from_fn(1920, 1080, |x, y| Rgb([(x / 8) as u8, (y / 5) as u8, 128]));
        assert_eq!(stamp::read(&picture, 1920), None);
        stamp::paint(&mut picture, number);
        for width in [1920, 960, 480] {
            let small = resize(&picture, width, width * 9 / 16, FilterType::Triangle);
            let mut panels = RgbImage::new(2 * width, small.height());
            image::imageops::replace(&mut panels, &small, 0, 0);
            let mut jpeg = std::io::Cursor::new(Vec::new());
            panels.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
            let decoded = image::load_from_memory(jpeg.get_ref()).unwrap().into_rgb8();
            assert_eq!(stamp::read(&decoded, width), Some(number), "{width} pixels");
        }
    }
}

#[test]
fn pictures_come_at_the_drifting_rate_late_by_the_delay_with_jitter_in_order() {
    let options = CameraOptions {
        delay_s: 0.4,
        drift_ppm: 200.0,
        jitter_s: 0.08,
        loss: 0.02,
        seed: 7,
        ..CameraOptions::default()
    };
    let count = 50_000;
    let steps = |options: &CameraOptions| -> Vec<(usize, f64)> {
        let mut playback = Playback::new(options, 1_000_000, 0.0);
        (0..count).map(|_| playback.next()).map(|step| (step.shown.unwrap(), step.due_s)).collect()
    };
    let seen = steps(&options);
    assert_eq!(seen, steps(&options));
    assert_ne!(seen, steps(&CameraOptions { seed: 8, ..options.clone() }));
    assert!(seen.is_sorted_by(|a, b| a.0 < b.0 && a.1 <= b.1));
    let late: Vec<f64> =
        seen.iter().map(|(number, due_s)| due_s - 0.4 - *number as f64 / (12.0 * 1.0002)).collect();
    // Successive pictures are farther apart (83 ms) than the jitter, so that keeping their order adds no delay.
    assert!(late.iter().all(|late_s| (-1e-9..=0.08).contains(late_s)));
    let mean = late.iter().sum::<f64>() / f64::from(count);
    // Five standard deviations of the mean of uniform numbers.
    assert!((mean - 0.04).abs() < 5.0 * 0.08 / (12.0 * f64::from(count)).sqrt(), "{mean}");
    let lost = 1.0 - f64::from(count) / (seen.last().unwrap().0 + 1) as f64;
    assert!((lost - 0.02).abs() < 5.0 * (0.02 * 0.98 / f64::from(count)).sqrt(), "{lost}");
}

#[test]
fn several_clients_see_the_film_and_after_it_what_was_asked_for() {
    for at_end in [AtEnd::Repeat, AtEnd::Black] {
        let options = CameraOptions { rate_hz: 20.0, at_end, ..CameraOptions::default() };
        let camera = NetworkCamera::start(film(6), options, Instant::now()).unwrap();
        let address = address(&camera);
        let other = thread::spawn(move || watch(address, 12));
        for seen in [watch(address, 12), other.join().unwrap()] {
            assert_eq!(seen.len(), 12);
            for pair in seen.windows(2) {
                let follows = match (pair[0].0, pair[1].0, at_end) {
                    (Some(first), Some(second), AtEnd::Repeat) => second == (first + 1) % 6,
                    (Some(first), Some(second), _) => second == first + 1,
                    (first, None, AtEnd::Black) => first.is_none_or(|first| first == 5),
                    _ => false,
                };
                assert!(follows, "{at_end:?}: {seen:?}");
            }
        }
        assert_eq!(camera.connections(), 2);
    }
}

#[test]
fn a_camera_that_closes_refuses_connections_after_its_film() {
    let options = CameraOptions { rate_hz: 4.0, at_end: AtEnd::Close, ..CameraOptions::default() };
    let camera = NetworkCamera::start(film(3), options, Instant::now()).unwrap();
    let seen = watch(address(&camera), usize::MAX);
    assert!(seen.len() <= 3 && seen.last().unwrap().0 == Some(2), "{seen:?}");
    let mut tries = 0;
    while TcpStream::connect(address(&camera)).is_ok() {
        tries += 1;
        assert!(tries < 100, "it still listens");
        thread::sleep(POLL);
    }
}

#[test]
fn scripted_faults_are_in_force_in_their_time_alone() {
    let fault = |from_s, until_s, fault| Outage { from_s, until_s, fault };
    let options = CameraOptions {
        rate_hz: 20.0,
        faults: vec![
            fault(0.49, 0.74, Fault::Silent),
            fault(0.99, 1.24, Fault::Torn),
            fault(1.49, 1.74, Fault::Resized { width: 320, height: 240 }),
            fault(1.99, 4.99, Fault::Refused),
        ],
        ..CameraOptions::default()
    };
    // The film is encoded before the camera's time begins.
    let (film, epoch) = (film(60), Instant::now());
    let camera = NetworkCamera::start(film, options, epoch).unwrap();
    let seen = watch(address(&camera), usize::MAX);
    assert!(epoch.elapsed() >= Duration::from_secs_f64(1.99), "it broke off too early");
    let numbers: Vec<u32> = seen.iter().filter_map(|(number, _)| *number).collect();
    let expected = |n: &u32| !(10..15).contains(n) && !(20..25).contains(n) && *n < 40;
    assert!(numbers.is_sorted() && numbers.iter().all(expected), "{numbers:?}");
    assert!(numbers.contains(&15) && numbers.contains(&25), "{numbers:?}");
    assert_eq!(seen.iter().filter(|(number, _)| number.is_none()).count(), 5, "{seen:?}");
    for (number, width) in seen {
        let Some(number) = number else { continue };
        assert_eq!(width, if (30..35).contains(&number) { 320 } else { 640 }, "picture {number}");
    }
    let is_open = || TcpStream::connect(address(&camera)).is_ok();
    // The camera's port closes a moment after its connections.
    while is_open() {
        assert!(epoch.elapsed() < Duration::from_secs_f64(4.99), "it does not refuse connections");
        thread::sleep(POLL);
    }
    while !is_open() {
        assert!(epoch.elapsed() < Duration::from_secs(20), "it is not back");
        thread::sleep(POLL);
    }
    assert!(epoch.elapsed() >= Duration::from_secs_f64(4.98), "it is back too early");
    assert!(watch(address(&camera), 1)[0].0.is_some());
}

#[test]
fn a_camera_that_never_answers_accepts_and_stays_silent() {
    let never = Outage { from_s: 0.0, until_s: f64::INFINITY, fault: Fault::Unanswered };
    let options = CameraOptions { faults: vec![never], ..CameraOptions::default() };
    let camera = NetworkCamera::start(film(6), options, Instant::now()).unwrap();
    let mut socket = TcpStream::connect(address(&camera)).unwrap();
    socket.write_all(b"GET / HTTP/1.1\r\n\r\n").unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    let error = socket.read(&mut [0; 16]).unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut), "{error}");
}

#[test]
fn options_that_cannot_be_played_are_refused() {
    for options in [
        CameraOptions { rate_hz: 0.0, ..CameraOptions::default() },
        CameraOptions { loss: 1.0, ..CameraOptions::default() },
        CameraOptions { jitter_s: -0.1, ..CameraOptions::default() },
        CameraOptions {
            // The film has no pictures of this size.
            faults: vec![Outage { from_s: 0.0, until_s: 1.0, fault: Fault::Resized { width: 8, height: 8 } }],
            ..CameraOptions::default()
        },
    ] {
        assert!(NetworkCamera::start(film(1), options, Instant::now()).is_err());
    }
}
