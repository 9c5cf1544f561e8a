//! Streams over HTTP, from a camera on this machine.

use std::io::{Cursor, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use image::{ImageFormat, RgbImage};

use super::films::smooth;
use crate::video::FrameSource;

/// Starts a camera that serves one viewer; returns its URL and its thread.
pub(super) fn camera(
    scheme: &str,
    serve: impl FnOnce(TcpStream) -> std::io::Result<()> + Send + 'static,
) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("{scheme}://{}/camera", listener.local_addr().unwrap());
    let serving = std::thread::spawn(move || {
        let (viewer, _) = listener.accept().unwrap();
        // An error here is a viewer that hangs up.
        let _ = serve(viewer);
    });
    (url, serving)
}

/// Sends motion JPEG as network cameras do.
fn send(viewer: &mut TcpStream, pictures: &[RgbImage]) -> std::io::Result<()> {
    let _ = viewer.read(&mut [0; 4096])?;
    write!(viewer, "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n")?;
    for picture in pictures {
        let mut jpeg = Cursor::new(Vec::new());
        picture.write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
        let jpeg = jpeg.into_inner();
        write!(viewer, "--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len())?;
        viewer.write_all(&jpeg)?;
        viewer.write_all(b"\r\n")?;
    }
    Ok(())
}

#[test]
fn a_live_camera_may_change_its_size_and_has_no_clock() {
    let pictures: Vec<RgbImage> =
        [(96, 64), (96, 64), (64, 48), (64, 48), (96, 64)].map(|(w, h)| smooth(w, h, 1)).into();
    let expected: Vec<(u32, u32)> = pictures.iter().map(RgbImage::dimensions).collect();
    let (url, serving) = camera("http", move |mut viewer| send(&mut viewer, &pictures));
    let mut source = FrameSource::open(&url).unwrap();
    assert!(source.is_live() && !source.is_recording());
    let (mut sizes, mut picture) = (Vec::new(), RgbImage::new(48, 32));
    while source.advance().unwrap() {
        source.picture(&mut picture).unwrap();
        sizes.push(source.frame_size());
        assert_eq!((source.stamp().presentation_s, source.stamp().sender_s), (None, None));
    }
    assert_eq!(sizes, expected);
    serving.join().unwrap();
}

#[test]
fn a_camera_that_falls_silent_ends_within_the_time_allowed() {
    let (ready, silence) = std::sync::mpsc::channel::<()>();
    let (url, serving) = camera("http", move |mut viewer| {
        let pictures: Vec<RgbImage> = (0..4).map(|k| smooth(64, 48, k)).collect();
        send(&mut viewer, &pictures)?;
        let _ = silence.recv();
        Ok(())
    });
    let started = Instant::now();
    let mut source = FrameSource::open(&url).unwrap();
    let mut frames = 0;
    while source.advance().unwrap() {
        assert!(source.stamp().arrival >= started && source.stamp().arrival <= Instant::now());
        frames += 1;
    }
    assert!((3..=4).contains(&frames), "{frames}");
    assert!(started.elapsed() < Duration::from_secs(20), "{:?}", started.elapsed());
    drop(ready);
    serving.join().unwrap();
}
