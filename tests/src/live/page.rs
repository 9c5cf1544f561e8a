//! Client of a run's page (`--view`): reads which pictures, by their stamps, belong to one moment.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::chain::StepResult;
use crate::network_camera::stamp;

/// Time without an answer after which the page counts as gone.
const PATIENCE: Duration = Duration::from_secs(20);
/// Interval at which a page that does not answer is asked again.
const AGAIN: Duration = Duration::from_millis(100);

/// The pictures of one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// The moment's number, from 1.
    pub frame: u32,
    /// The moment's time, seconds.
    pub time_s: f64,
    /// The number painted into each camera's picture, in the page's order; `None` where there is none.
    pub stamps: Vec<Option<u32>>,
    /// Time at which it was seen.
    pub seen: Instant,
}

/// Head and body of the answer to a request.
///
/// # Errors
/// The connection fails, or the answer is not HTTP.
pub fn get(address: SocketAddr, path: &str) -> StepResult<(String, Vec<u8>)> {
    let request = || -> std::io::Result<Vec<u8>> {
        let mut stream = TcpStream::connect_timeout(&address, PATIENCE)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n")?;
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer)?;
        Ok(answer)
    };
    let answer = request().map_err(|e| format!("http://{address}{path}: {e}"))?;
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
    let end = end.ok_or_else(|| format!("http://{address}{path}: no HTTP"))?;
    Ok((String::from_utf8_lossy(&answer[..end]).into_owned(), answer[end + 4..].to_vec()))
}

fn moment(address: SocketAddr, query: &str) -> StepResult<Value> {
    let (_, body) = get(address, &format!("/moment{query}"))?;
    serde_json::from_slice(&body).map_err(|e| e.to_string())
}

/// Numbers of the changes that brought the cameras' pictures; `None` while a camera has none.
fn pictures(now: &Value) -> Option<Vec<u64>> {
    now["cameras"].as_array()?.iter().map(|camera| camera["picture"].as_u64()).collect()
}

/// Watches the page until a time, and returns every moment that it shows complete. A page that does not exist yet, or
/// shows nothing new, is asked again.
pub fn watch(address: SocketAddr, until: Instant) -> Vec<Sighting> {
    let (mut sightings, mut latest) = (Vec::new(), String::new());
    while Instant::now() < until {
        match look(address, &latest) {
            Ok((number, sighting)) => {
                latest = format!("?after={number}");
                sightings.extend(sighting);
            }
            Err(_) => thread::sleep(AGAIN),
        }
    }
    sightings
}

/// Number of the newest change after `latest`, and its moment if its pictures were not replaced while they were
/// fetched.
fn look(address: SocketAddr, latest: &str) -> StepResult<(u64, Option<Sighting>)> {
    let now = moment(address, latest)?;
    let number = now["number"].as_u64().ok_or("a moment without a number")?;
    let (Some(before), Some(frame), Some(time_s)) =
        (pictures(&now), now["moment"]["frame"].as_u64(), now["moment"]["time_s"].as_f64())
    else {
        thread::sleep(AGAIN);
        return Ok((number, None));
    };
    let seen = Instant::now();
    let jpegs = (0..before.len()).map(|camera| get(address, &format!("/camera/{camera}.jpg")));
    let jpegs = jpegs.collect::<StepResult<Vec<_>>>()?;
    if pictures(&moment(address, "")?) != Some(before) {
        return Ok((number, None));
    }
    // The left one of two panels is the camera's picture.
    let read = |jpeg: &[u8]| {
        let picture = image::load_from_memory(jpeg).ok()?.into_rgb8();
        stamp::read(&picture, picture.width() / 2)
    };
    let stamps = jpegs.iter().map(|(_, jpeg)| read(jpeg)).collect();
    Ok((number, Some(Sighting { frame: frame as u32, time_s, stamps, seen })))
}
