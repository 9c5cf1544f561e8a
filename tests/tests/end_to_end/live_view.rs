//! `tracker run --view` as a browser sees it: pages and pictures during the run, and the run unchanged by it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};

use calib::video::FrameSource;
use image::RgbImage;
use synthetic::{RoomOptions, SequenceOptions, WalkerOptions};
use tests::data::{office, program};

use crate::folder::Folder;
use crate::refusal::refused;

/// Number of the office's frames that are followed: in the last of them there are people.
const FRAMES: u64 = 100;

/// Head and body of the answer for a path; `None` once the server has ended.
fn get(address: SocketAddr, path: &str) -> Option<(String, Vec<u8>)> {
    let mut stream = TcpStream::connect(address).ok()?;
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").ok()?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).ok()?;
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n")?;
    Some((String::from_utf8_lossy(&answer[..end]).into_owned(), answer[end + 4..].to_vec()))
}

/// Frames and pictures seen by a viewer of a run.
#[derive(Default)]
struct Watched {
    /// Frames whose people were sent.
    frames: Vec<u64>,
    /// Frames whose pictures were announced: few where the run leaves no time for drawing.
    drawn: Vec<u64>,
    /// The newest picture of each camera.
    pictures: Vec<RgbImage>,
    has_ended: bool,
}

impl Watched {
    /// Watches until the end, as the page does.
    fn of(address: SocketAddr) -> Self {
        let (head, page) = get(address, "/").unwrap();
        assert!(head.starts_with("HTTP/1.1 200") && page.starts_with(b"<!doctype html>"), "{head}");
        let mut watched = Self::default();
        let mut question = "/moment".to_owned();
        while let Some((_, body)) = get(address, &question) {
            let now: serde_json::Value = serde_json::from_slice(&body).unwrap();
            watched.drawn.extend(now["moment"]["frame"].as_u64());
            let cameras = now["cameras"].as_array().unwrap();
            if cameras.iter().all(|camera| camera["picture"].is_u64()) {
                let picture = |camera| Some(get(address, &format!("/camera/{camera}.jpg"))?.1);
                let jpegs: Option<Vec<_>> = (0..cameras.len()).map(picture).collect();
                let Some(jpegs) = jpegs else { break };
                let decoded = |jpeg: &Vec<u8>| image::load_from_memory(jpeg).unwrap().into_rgb8();
                watched.pictures = jpegs.iter().map(decoded).collect();
            }
            watched.has_ended = now["has_ended"].as_bool().unwrap();
            if watched.has_ended {
                break;
            }
            question = format!("/moment?after={}", now["number"]);
        }
        watched.frames = frames(address);
        watched
    }
}

/// Frames that the server has of a run that has ended, or is about to.
fn frames(address: SocketAddr) -> Vec<u64> {
    let (mut frames, mut question) = (Vec::new(), "/frames".to_owned());
    while let Some((_, body)) = get(address, &question) {
        let news: serde_json::Value = serde_json::from_slice(&body).unwrap();
        frames.extend(news["frames"].as_array().unwrap().iter().filter_map(|frame| frame["frame"].as_u64()));
        if news["has_ended"].as_bool().unwrap() {
            break;
        }
        question = format!("/frames?after={}", news["number"]);
    }
    frames
}

/// Runs a program while a viewer watches at the address in its log.
fn run_watched(command: &mut Command) -> Watched {
    let mut run = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(run.stderr.take().unwrap());
    let (mut text, mut address) = (String::new(), None);
    while address.is_none() {
        let from = text.len();
        assert!(said.read_line(&mut text).unwrap() > 0, "no address is told: {text}");
        let told = text[from..].split_once("http://").and_then(|(_, rest)| rest.split('/').next());
        address = told.map(|told| told.parse().unwrap());
    }
    let watcher = std::thread::spawn(move || Watched::of(address.unwrap()));
    // A viewer that sends one request and never reads.
    let mut deaf = TcpStream::connect(address.unwrap()).unwrap();
    deaf.write_all(b"GET /moment?after=1 HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    said.read_to_string(&mut text).unwrap();
    assert!(run.wait().unwrap().success(), "{text}");
    assert!(TcpStream::connect(address.unwrap()).is_err(), "it still listens");
    watcher.join().unwrap()
}

fn tracks(out: &Path) -> [Vec<u8>; 2] {
    ["tracks.txt", "tracks.jsonl"].map(|file| std::fs::read(out.join(file)).unwrap())
}

/// Asserts that all frames came, and pictures in order, then the end, and a picture of this size for each camera.
fn saw(watched: &Watched, size: (u32, u32), cameras: usize, frames: u64) {
    assert_eq!(watched.frames, (1..=frames).collect::<Vec<_>>());
    let drawn = &watched.drawn;
    assert!(watched.has_ended && !drawn.is_empty() && drawn.is_sorted(), "{drawn:?}");
    assert!(drawn.iter().all(|frame| (1..=frames).contains(frame)), "{drawn:?}");
    assert_eq!(watched.pictures.len(), cameras);
    for picture in &watched.pictures {
        assert_eq!(picture.dimensions(), size);
        let first = picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|p| p[0].abs_diff(first[0]) > 40), "an empty picture");
    }
}

#[test]
fn the_office_is_watched_without_films_and_its_tracks_are_the_same() {
    let (office, scratch) = (office(), tempfile::tempdir().unwrap());
    for name in ["cam0", "cam1"] {
        let video = office.join(format!("video/{name}.mp4"));
        let mut video = FrameSource::open(video.to_str().unwrap()).unwrap();
        let folder = scratch.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        let mut picture = RgbImage::default();
        for frame in 1..=FRAMES {
            assert!(video.read(&mut picture).unwrap());
            picture.save(folder.join(format!("{frame:03}.jpg"))).unwrap();
        }
    }
    let run = |out: &Path| {
        let mut command = program("tracker");
        command.current_dir(scratch.path()).arg("run").arg(office.join("room")).args(["--rate", "12"]);
        command.args(["--video", "cam0=cam0", "--video", "cam1=cam1", "--no-film", "--out"]).arg(out);
        command
    };
    let (alone, seen) = (scratch.path().join("alone"), scratch.path().join("seen"));
    assert!(run(&alone).output().unwrap().status.success());
    let watched = run_watched(run(&seen).args(["--view", "--view-port", "0"]));
    let [rows, lines] = tracks(&alone);
    assert!(!rows.is_empty());
    saw(&watched, (2 * 480, 360), 2, FRAMES);
    assert!([rows, lines] == tracks(&seen), "the tracks of a run that is watched are others");
}

/// Two cameras' pictures of a room with people in it.
fn recorded(folder: &Path) {
    let made = RoomOptions { seed: 5, image_px: [160, 120], ..RoomOptions::default() }.build().unwrap();
    let walkers = made.walkers(&WalkerOptions { people: 2, first_s: 0.0, ..WalkerOptions::default() });
    let options = SequenceOptions { rate_hz: 10.0, frames: 60, ..SequenceOptions::default() };
    made.room.write(&folder.join("room")).unwrap();
    for frame in made.sequence(walkers, options).frames() {
        for (camera, seen) in frame.cameras.into_iter().enumerate() {
            let own = folder.join(format!("cam{camera}"));
            std::fs::create_dir_all(&own).unwrap();
            seen.image.unwrap().save(own.join(format!("{:03}.png", frame.frame))).unwrap();
        }
    }
}

#[test]
fn every_method_is_watched_with_films_and_without() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let run = |method: &str, out: &str| {
        let mut command = program("tracker");
        command.current_dir(folder.path()).args(["run", "room", "--video", "cam0=cam0", "--video"]);
        command.args(["cam1=cam1", "--rate", "10", "--method", method, "--out", out]);
        command
    };
    for method in ["mcmc", "condensation"] {
        let alone = format!("{method}-alone");
        assert!(run(method, &alone).arg("--no-film").output().unwrap().status.success());
        for more in [&[][..], &["--no-film"]] {
            let seen = format!("{method}-seen{}", more.len());
            let watched = run_watched(run(method, &seen).args(["--view", "--view-port", "0"]).args(more));
            // 160 pixels are enlarged to 480.
            saw(&watched, (2 * 480, 360), 2, 60);
            if more.is_empty() {
                // The last picture of the film was shown.
                assert_eq!(watched.drawn.last(), Some(&60));
                assert!(folder.path().join(&seen).join("overlay/cam1.mp4").is_file());
            }
            assert!(
                tracks(&folder.path().join(&alone)) == tracks(&folder.path().join(&seen)),
                "{method} {more:?}"
            );
        }
    }
}

#[test]
fn a_port_in_use_is_told_before_anything_is_written() {
    let (folder, scene) = (Folder::new(), office().join("room"));
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let scene = scene.to_str().unwrap();
    let run = |more: &[&str]| {
        let video = format!("cam0={}", office().join("video/cam0.mp4").display());
        folder.run_program("tracker", &[&["run", scene, "--video", &video, "--out", "out"], more].concat())
    };
    refused(&run(&["--view", "--view-port", &port]), &["127.0.0.1", &port, "in use", "--view-port 0"]);
    let alone = run(&["--view-port", "0"]);
    assert_eq!(alone.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&alone.stderr).contains("--view"));
    assert!(folder.files().is_empty(), "something was written");
}
