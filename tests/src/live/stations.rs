//! Stations, one process for each camera: their traffic on the network, and whether the tracks are the same.

use std::io::Read;
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::chain::StepResult;
use crate::data::program;
use crate::live::Figure;
use crate::live::capacity::track_bytes;
use crate::live::office::{self, CAMERAS, RATE_HZ};
use crate::live::proxy::Proxy;
use crate::live::run::{LiveRun, Scratch, error_line, free_address, videos};
use crate::network_camera::CameraOptions;

/// Time within which a station must listen.
const READY: Duration = Duration::from_secs(20);
/// Longest time that a run may take.
const LONGEST: Duration = Duration::from_mins(5);
/// Frames of the office, from 0, with all three people inside.
const THREE_INSIDE: std::ops::Range<usize> = 225..265;

/// Process of `tracker station` for one camera.
struct StationProcess {
    child: Child,
    address: SocketAddr,
}

impl StationProcess {
    fn start(room: &Path, camera: &str, video: &str) -> StepResult<Self> {
        let address = free_address()?;
        let mut command = program("tracker");
        command.arg("station").arg(room).args(["--camera", camera, "--video", video]);
        command.args(["--listen", &format!("tcp/{address}")]);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
        let mut station = Self { child: child.map_err(|e| e.to_string())?, address };
        let started = Instant::now();
        while TcpStream::connect(address).is_err() {
            if !matches!(station.child.try_wait(), Ok(None)) {
                return Err(station.failure());
            }
            if started.elapsed() > READY {
                return Err("the station does not listen".into());
            }
            thread::sleep(Duration::from_millis(50));
        }
        Ok(station)
    }

    fn failure(&mut self) -> String {
        let mut text = String::new();
        if let Some(errors) = &mut self.child.stderr {
            // Output that cannot be read is left out.
            let _ = errors.read_to_string(&mut text);
        }
        error_line(&text.lines().collect::<Vec<_>>())
    }
}

impl Drop for StationProcess {
    fn drop(&mut self) {
        // An error means that the process has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// `--stations` for these addresses.
fn stations_argument(addresses: &[SocketAddr]) -> [String; 2] {
    let endpoints: Vec<String> = addresses.iter().map(|address| format!("tcp/{address}")).collect();
    ["--stations".to_owned(), endpoints.join(",")]
}

/// Bytes a second that the first of two stations sends in `measured_s` seconds with three people in its picture.
fn bytes_per_s(measured_s: f64) -> StepResult<f64> {
    const START_S: f64 = 15.0;
    let pictures = |seconds: f64| (seconds * RATE_HZ) as usize;
    let inside = office::to_and_fro(THREE_INSIDE).take(pictures(START_S + measured_s));
    let order: Vec<usize> =
        office::empty(pictures(8.0)).chain(office::FRAMES - 100..225).chain(inside).collect();
    let options = CameraOptions::default();
    let (cameras, epoch) = office::cameras(&order, false, [options.clone(), options])?;
    let (room, scratch) = (office::room(), Scratch::new()?);
    let station = |camera: usize| StationProcess::start(&room, CAMERAS[camera], &cameras[camera].url());
    let stations = [station(0)?, station(1)?];
    let proxy = Proxy::start(stations[0].address)?;
    let mut given = stations_argument(&[proxy.address, stations[1].address]).to_vec();
    given.push("--no-film".to_owned());
    let mut run = LiveRun::start(&room, &scratch.path("out"), &given)?;
    run.wait_until(epoch + Duration::from_secs_f64(START_S))?;
    let before = proxy.bytes();
    run.wait_until(epoch + Duration::from_secs_f64(START_S + measured_s))?;
    let sent = proxy.bytes() - before;
    run.interrupt()?;
    Ok(sent as f64 / measured_s)
}

/// Whether two stations on the office's recordings give the tracks of one process, to the byte.
fn equal_tracks() -> StepResult<bool> {
    let (room, scratch) = (office::room(), Scratch::new()?);
    let specs = CAMERAS.map(|name| office::video(name).display().to_string());
    let until = Instant::now() + LONGEST;
    let mut given = videos(CAMERAS.into_iter().zip(specs.clone()));
    given.push("--no-film".to_owned());
    LiveRun::start(&room, &scratch.path("one"), &given)?.finish(until)?;
    let stations = [
        StationProcess::start(&room, CAMERAS[0], &specs[0])?,
        StationProcess::start(&room, CAMERAS[1], &specs[1])?,
    ];
    let mut given = stations_argument(&[stations[0].address, stations[1].address]).to_vec();
    given.push("--no-film".to_owned());
    LiveRun::start(&room, &scratch.path("two"), &given)?.finish(until)?;
    Ok(track_bytes(&scratch.path("one"))? == track_bytes(&scratch.path("two"))?)
}

/// Figures of stations: traffic in kB/s, and whether their tracks equal those of one process.
pub fn stations(measured_s: f64) -> Vec<Figure> {
    let cost = "a station with three people, 640 × 480, 12/s";
    let same = "two stations on recordings: the tracks of one process, to the byte";
    vec![
        match bytes_per_s(measured_s) {
            Ok(rate) => Figure::new(cost, rate / 1e3, "kB/s", "<= 40"),
            Err(why) => Figure::unavailable(cost, why, "<= 40"),
        },
        match equal_tracks() {
            Ok(equal) => Figure::new(same, f64::from(u8::from(equal)), "", "1"),
            Err(why) => Figure::unavailable(same, why, "1"),
        },
    ]
}
