//! A network camera for tests, on this machine.

use std::io::{Cursor, Read, Write};
use std::net::TcpStream;

use image::{ImageFormat, Rgb, RgbImage};

/// Sends pictures of one grey as motion JPEG over HTTP, as network cameras do, and hangs up.
pub(crate) fn film(camera: &mut TcpStream, level: u8, frames: usize) -> std::io::Result<()> {
    let mut request = [0; 4096];
    let _ = camera.read(&mut request)?;
    let mut jpeg = Cursor::new(Vec::new());
    RgbImage::from_pixel(64, 48, Rgb([level; 3])).write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
    let jpeg = jpeg.into_inner();
    write!(camera, "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n")?;
    for _ in 0..frames {
        let length = jpeg.len();
        write!(camera, "--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {length}\r\n\r\n")?;
        camera.write_all(&jpeg)?;
        camera.write_all(b"\r\n")?;
    }
    Ok(())
}
