//! Tests of the page's server over its socket, and of the drawer beside a run.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::time::{Duration, Instant};

use calib::{Camera, Intrinsics};
use image::{Rgb, RgbImage};
use nalgebra::Isometry3;
use scenes::room::{Room, RoomCamera};
use serde_json::Value;

use super::*;
use crate::film::{FilmOptions, Painted, Painter, Shot};
use crate::prepared_room::{PreparationOptions, PreparedRoom};

/// Option of the port, which errors name.
pub(super) const PORT_OPTION: &str = "view_port";
pub(super) const LOOPBACK: &str = "127.0.0.1";

/// A frame of one grey, which encodes its number.
pub(super) fn painted(camera: usize, frame: u32) -> Painted {
    let picture = RgbImage::from_pixel(64, 24, Rgb([frame as u8; 3]));
    Painted { camera, frame, time_s: f64::from(frame) / 25.0, people: 2, picture }
}

fn server(names: &[&str]) -> Server {
    let screens = Screens::new("my <room>".into(), names.iter().copied());
    let listener = Server::bind(LOOPBACK, Some(0), PORT_OPTION).unwrap();
    Server::start(
        listener,
        screens,
        RoomPage::default(),
        names.iter().map(|name| (*name).to_owned()).collect(),
    )
    .unwrap()
}

/// Head and body of the answer to a request that is sent byte by byte as given.
pub(super) fn exchange(address: SocketAddr, request: &str) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(request.replace('\n', "\r\n").as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    (String::from_utf8(answer[..end].to_vec()).unwrap(), answer[end + 4..].to_vec())
}

pub(super) fn get(address: SocketAddr, path: &str) -> (String, Vec<u8>) {
    exchange(address, &format!("GET {path} HTTP/1.1\nHost: {address}\nConnection: close\n\n"))
}

fn moment(address: SocketAddr, after: Option<u64>) -> Value {
    let path = after.map_or("/moment".into(), |number| format!("/moment?after={number}"));
    let (head, body) = get(address, &path);
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    serde_json::from_slice(&body).unwrap()
}

fn picture(address: SocketAddr, camera: usize) -> RgbImage {
    let (head, body) = get(address, &format!("/camera/{camera}.jpg"));
    assert!(head.contains("content-type: image/jpeg"), "{head}");
    image::load_from_memory(&body).unwrap().into_rgb8()
}

/// Number that a frame of one grey encodes.
fn level(picture: &RgbImage) -> u32 {
    assert_eq!(picture.dimensions(), (64, 24));
    u32::from(picture.get_pixel(30, 12)[1])
}

#[test]
fn a_watcher_sees_the_newest_in_order_and_the_end() {
    let mut server = server(&["left", "right"]);
    let (address, screens) = (server.address(), server.screens().clone());
    let first = moment(address, None);
    assert_eq!((&first["title"], &first["moment"]), (&"my <room>".into(), &Value::Null));
    assert_eq!(first["cameras"][1], serde_json::json!({ "name": "right", "picture": null }));
    let run = std::thread::spawn(move || {
        for frame in 1..=200 {
            screens.show([painted(0, frame), painted(1, frame)]);
            std::thread::sleep(Duration::from_millis(2));
        }
        server.announce_end();
        server
    });
    let (mut number, mut frames) = (first["number"].as_u64().unwrap(), Vec::new());
    loop {
        let now = moment(address, Some(number));
        number = now["number"].as_u64().unwrap();
        let frame = now["moment"]["frame"].as_u64().unwrap() as u32;
        assert_eq!(now["moment"]["time_s"], f64::from(frame) / 25.0);
        // Never an older one than announced.
        assert!([0, 1].iter().all(|camera| level(&picture(address, *camera)) + 1 >= frame));
        if now["has_ended"].as_bool().unwrap() {
            assert_eq!(frame, 200);
            break;
        }
        assert_ne!(frames.last(), Some(&frame), "no news");
        frames.push(frame);
    }
    assert!(frames.len() > 3 && frames.is_sorted_by(|a, b| a < b), "{frames:?}");
    // Viewers who know the end may still request the last pictures.
    let server = run.join().unwrap();
    assert!(level(&picture(address, 0)).abs_diff(200) <= 1);
    drop(server);
    assert!(TcpStream::connect(address).is_err(), "it still listens");
}

#[test]
fn a_question_is_answered_when_there_is_news() {
    let server = server(&["a"]);
    let (address, screens) = (server.address(), server.screens().clone());
    assert!(!screens.is_awaited());
    let asked = std::thread::spawn(move || (moment(address, Some(1)), Instant::now()));
    let started = Instant::now();
    while !screens.is_awaited() {
        assert!(started.elapsed() < Duration::from_secs(20), "nobody waits");
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(200));
    let shown = Instant::now();
    screens.show([painted(0, 9)]);
    let (now, answered) = asked.join().unwrap();
    assert_eq!(now["moment"]["frame"], 9);
    assert!(answered > shown, "answered before there was anything");
    assert!(!screens.is_awaited(), "nobody waits any more");
    // A request with a number of another run is answered at once.
    let asked = Instant::now();
    assert_eq!(moment(address, Some(1_000_000)), now);
    assert!(asked.elapsed() < Duration::from_secs(5), "{:?}", asked.elapsed());
    // Another camera's late picture is shown, but the newest moment is announced.
    screens.show([painted(0, 8)]);
    let now = moment(address, None);
    assert_eq!((&now["moment"]["frame"], &now["cameras"][0]["picture"]), (&9.into(), &3.into()));
}

#[test]
fn a_client_that_does_not_read_blocks_no_other() {
    let server = server(&["a"]);
    let (address, screens) = (server.address(), server.screens().clone());
    // Noise, because its JPEG is large.
    let noise = RgbImage::from_fn(640, 240, |x, y| Rgb([(x * x * 7 + y * y * x * 13) as u8; 3]));
    let show = |frame| screens.show([Painted { picture: noise.clone(), ..painted(0, frame) }]);
    show(1);
    let mut deaf = TcpStream::connect(address).unwrap();
    let questions = format!("GET /camera/0.jpg HTTP/1.1\r\nHost: {address}\r\n\r\n").repeat(2000);
    deaf.set_write_timeout(Some(Duration::from_millis(500))).unwrap();
    // The client does not read all of it, on purpose.
    let _ = deaf.write_all(questions.as_bytes());
    let started = Instant::now();
    for frame in 2..=2000 {
        show(frame);
    }
    assert_eq!(moment(address, None)["moment"]["frame"], 2000);
    assert_eq!(picture_size(address), (640, 240));
    assert!(started.elapsed() < Duration::from_secs(5), "{:?}", started.elapsed());
    let ending = Instant::now();
    drop(server);
    assert!(ending.elapsed() < Duration::from_secs(5), "{:?}", ending.elapsed());
}

fn picture_size(address: SocketAddr) -> (u32, u32) {
    let (_, body) = get(address, "/camera/0.jpg");
    image::load_from_memory(&body).unwrap().into_rgb8().dimensions()
}

#[test]
fn a_run_that_nobody_watches_ends_at_once() {
    let server = server(&["a"]);
    let ending = Instant::now();
    drop(server);
    assert!(ending.elapsed() < Duration::from_millis(300), "{:?}", ending.elapsed());
}

#[test]
fn requests_that_are_not_the_pages_are_refused() {
    let server = server(&["a"]);
    let address = server.address();
    server.screens().show([painted(0, 1)]);
    let ask = |request: &str| exchange(address, request).0;
    for path in ["/", "/moment", "/moment?after=1", "/camera/0.jpg"] {
        for (host, status) in [
            ("localhost", 200),
            ("127.0.0.1:8081", 200),
            ("example.org", 403),
            ("localhost.example.org:8081", 403),
            ("", 403),
        ] {
            let head = ask(&format!("GET {path} HTTP/1.1\nHost: {host}\nConnection: close\n\n"));
            assert!(head.starts_with(&format!("HTTP/1.1 {status}")), "{path} of `{host}`: {head}");
            let head = head.to_lowercase();
            assert!(!head.contains("access-control-allow"), "{head}");
            // Not even embedded in another page.
            assert!(head.contains("cross-origin-resource-policy: same-origin"), "{head}");
            assert!(head.contains("cache-control: no-store"), "{head}");
        }
    }
    for path in ["/camera/1.jpg", "/camera/-1.jpg", "/camera/a.jpg", "/camera/", "/scene.toml", "//", "/%2e"]
    {
        assert!(get(address, path).0.starts_with("HTTP/1.1 404"), "{path}");
    }
    let head = ask("POST /moment HTTP/1.1\nHost: localhost\nConnection: close\nContent-Length: 0\n\n");
    assert!(head.starts_with("HTTP/1.1 405") && head.contains("allow: GET, HEAD"), "{head}");
}

#[test]
fn a_port_in_use_is_named_and_the_usual_one_replaced() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let error = Server::bind(LOOPBACK, Some(taken.local_addr().unwrap().port()), PORT_OPTION)
        .unwrap_err()
        .to_string();
    assert!(error.contains("in use") && error.contains("view_port 0"), "{error}");
    // Either this test uses the port or another program does.
    let _usual = TcpListener::bind("127.0.0.1:8081");
    let other = Server::bind(LOOPBACK, None, PORT_OPTION).unwrap().address();
    assert!(other.ip().is_loopback() && other.port() != 8081, "{other}");
}

fn stage() -> PreparedRoom {
    let camera = |name: &str| RoomCamera {
        name: name.into(),
        camera: Camera {
            intrinsics: Intrinsics::from_horizontal_fov(64, 48, 70.0),
            camera_from_world: Isometry3::translation(0.0, 0.0, 3.0),
        },
        reference: None,
    };
    let room = Room { cameras: vec![camera("a"), camera("b")], ..Room::default() };
    PreparedRoom::prepare(&room, Path::new("."), &PreparationOptions::default()).unwrap()
}

#[test]
fn only_awaited_pictures_are_drawn() {
    let stage = stage();
    let screens = Screens::new(String::new(), ["a", "b"].into_iter());
    let options = FilmOptions::default();
    let drawer = LiveDrawer::start(&stage, &options, &screens, true);
    let shot =
        |level: u8| Shot { image: Some(RgbImage::from_pixel(480, 360, Rgb([level; 3])).into()), mask: None };
    let nothing = || -> Vec<Shot> { panic!("nobody asked for it") };
    for frame in 1..100 {
        drawer.offer(frame, 0.0, &[], nothing);
    }
    let mut somebody = screens.wait();
    for levels in [[10, 20], [90, 180]] {
        // One moment after the other: each is taken when the one before has been drawn.
        let taken = std::cell::Cell::new(false);
        let started = Instant::now();
        while !taken.get() || !somebody.has_changed().unwrap() {
            assert!(started.elapsed() < Duration::from_secs(20), "nothing was drawn");
            if !taken.get() {
                drawer.offer(100, 4.0, &[], || {
                    taken.set(true);
                    levels.map(shot).into()
                });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        somebody.mark_unchanged();
    }
    for (camera, level) in [(0, 90), (1, 180)] {
        let drawn = image::load_from_memory(&somebody.borrow().picture(camera).unwrap().jpeg());
        let drawn = drawn.unwrap().into_rgb8();
        let expected = Painter::new(&stage, camera, &options).paint(100, 4.0, &shot(level), &[]);
        assert_eq!(drawn.dimensions(), expected.dimensions());
        let pairs = drawn.as_raw().iter().zip(expected.as_raw());
        let off = pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / drawn.as_raw().len() as f64;
        assert!(off < 3.0, "camera {camera} is off by {off} levels");
    }
    // The end of a run waits for the moment in work.
    drawer.finish();
    drawer.offer(101, 4.1, &[], || [20, 40].map(shot).into());
    drawer.finish();
    drop(somebody);
    drawer.offer(102, 4.2, &[], nothing);
    let number = screens.look(|now| now.number);
    assert_eq!(number, 4, "three moments were drawn");
}
