//! Motion JPEG over HTTP: one answer of many parts, each a picture.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::thread;

use super::schedule::Fault;
use super::{CameraState, POLL};

/// Plays to one client until either side ends.
pub(super) fn stream(shared: &CameraState, mut client: TcpStream) -> std::io::Result<()> {
    let mut request = [0; 4096];
    // Any request is answered with the film.
    if client.read(&mut request)? == 0 {
        return Ok(());
    }
    while shared.fault() == Some(Fault::Unanswered) {
        if shared.has_ended() {
            return Ok(());
        }
        thread::sleep(POLL);
    }
    client.write_all(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n")?;
    let mut part = Vec::new();
    shared.play(|jpeg| {
        part.clear();
        let length = jpeg.len();
        write!(part, "--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {length}\r\n\r\n")?;
        part.extend_from_slice(jpeg);
        part.extend_from_slice(b"\r\n");
        client.write_all(&part)
    })
}
