//! A fake network camera on this machine: a film in real time as motion JPEG over HTTP, with the faults of real ones.
//!
//! * [`NetworkCamera`] — the server; start here.
//! * [`film`] — pictures encoded before the camera starts, so that playing them costs next to no CPU time.
//! * [`stamp`] — a picture's number painted into it, readable from a page or a film.
//! * [`schedule`] — times at which each picture is captured and sent, and the fault in force.
//!
//! Every random number depends on the seed and the picture's number alone: each client, and each run, sees the same
//! losses and the same jitter.

pub mod film;
mod http;
pub mod schedule;
pub mod stamp;
#[cfg(test)]
mod tests;

use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::chain::StepResult;
use film::Film;
pub use schedule::{AtEnd, CameraOptions, Fault, Outage};
use schedule::{Playback, PlaybackStep};

/// Interval at which the server looks for new clients, ends and faults.
const POLL: Duration = Duration::from_millis(10);

/// Camera that plays a film to every client, until it is dropped.
#[derive(Debug)]
pub struct NetworkCamera {
    address: SocketAddr,
    shared: Arc<CameraState>,
    server: Option<JoinHandle<()>>,
}

/// State that the server shares with its clients' threads.
#[derive(Debug)]
struct CameraState {
    film: Film,
    options: CameraOptions,
    epoch: Instant,
    has_ended: AtomicBool,
    connections: AtomicUsize,
}

impl NetworkCamera {
    /// Starts a camera at a free port of the loopback. Picture 0 is captured at `epoch`; cameras with the same epoch
    /// film the same scene.
    ///
    /// # Errors
    /// Options outside their ranges, a fault that needs pictures of a size that the film does not have, no free port.
    pub fn start(film: Film, options: CameraOptions, epoch: Instant) -> StepResult<Self> {
        options.validate()?;
        if let Some((w, h)) =
            options.faults.iter().filter_map(Outage::size).find(|size| !film.has_size(*size))
        {
            return Err(format!("the film has no pictures of {w} × {h}; encode it with that size"));
        }
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(|e| e.to_string())?;
        let address = listener.local_addr().map_err(|e| e.to_string())?;
        let (has_ended, connections) = (AtomicBool::new(false), AtomicUsize::new(0));
        let shared = Arc::new(CameraState { film, options, epoch, has_ended, connections });
        let own = Arc::clone(&shared);
        let server = thread::spawn(move || serve(&own, address, listener));
        Ok(Self { address, shared, server: Some(server) })
    }

    /// The URL to give to `--video`.
    pub fn url(&self) -> String {
        format!("http://{}/camera.mjpg", self.address)
    }

    /// Connections accepted so far.
    pub fn connections(&self) -> usize {
        self.shared.connections.load(Ordering::Relaxed)
    }

    /// Time from the epoch at which the picture of this number is captured, seconds: of the scene, not of this
    /// camera's clock, and before any jitter of the network.
    pub fn captured_at_s(&self, number: u64) -> f64 {
        self.shared.options.captured_at_s(number)
    }
}

impl Drop for NetworkCamera {
    fn drop(&mut self) {
        self.shared.has_ended.store(true, Ordering::Relaxed);
        if let Some(server) = self.server.take() {
            // A server that panicked has printed why.
            let _ = server.join();
        }
    }
}

impl CameraState {
    /// Time since the epoch, seconds; negative before it.
    fn now_s(&self) -> f64 {
        let now = Instant::now();
        match now.checked_duration_since(self.epoch) {
            Some(since) => since.as_secs_f64(),
            None => -self.epoch.duration_since(now).as_secs_f64(),
        }
    }

    fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Relaxed)
    }

    fn fault(&self) -> Option<Fault> {
        self.options.fault_at(self.now_s())
    }

    /// Whether the camera refuses connections now.
    fn is_away(&self) -> bool {
        self.fault() == Some(Fault::Refused) || self.options.is_closed_at(self.now_s(), self.film.len())
    }

    /// Sleeps until `time_s` seconds from the epoch; `false` if the camera ends, or breaks its connections off,
    /// before that time.
    fn sleep_until(&self, time_s: f64) -> bool {
        loop {
            let rest_s = time_s - self.now_s();
            if self.has_ended() || self.is_away() {
                return false;
            }
            if rest_s <= 0.0 {
                return true;
            }
            thread::sleep(Duration::from_secs_f64(rest_s).min(POLL));
        }
    }

    /// Plays the film from now on: calls `send` with each picture when it is due. Ends when the camera ends or breaks
    /// off. Faults of single pictures are chosen by the time at which the pictures are due, so that they are the same
    /// on a slow machine.
    fn play(&self, mut send: impl FnMut(&[u8]) -> std::io::Result<()>) -> std::io::Result<()> {
        let mut playback = Playback::new(&self.options, self.film.len(), self.now_s());
        loop {
            let PlaybackStep { shown, due_s } = playback.next();
            let asleep_from_s = self.now_s();
            // On a slow machine a whole refusal may pass in one sleep.
            if !self.sleep_until(due_s) || self.options.is_refusing_within(asleep_from_s, self.now_s()) {
                return Ok(());
            }
            // A client that reads too slowly makes the camera drop pictures, not fall behind.
            if self.now_s() > due_s + LATEST_S {
                playback.catch_up(self.now_s());
                continue;
            }
            let (torn, size) = match self.options.fault_at(due_s) {
                Some(Fault::Silent | Fault::Unanswered) => continue,
                Some(Fault::Torn) => (true, None),
                Some(Fault::Resized { width, height }) => (false, Some((width, height))),
                Some(Fault::Refused) | None => (false, None),
            };
            let Some(jpeg) = self.film.picture(shown, size) else { continue };
            let jpeg = if torn { &jpeg[..jpeg.len() / 2] } else { jpeg };
            send(jpeg)?;
        }
    }
}

/// Delay after which a picture is not sent any more, seconds.
const LATEST_S: f64 = 1.0;

/// Accepts clients until the camera ends. The port is closed while the camera refuses connections.
fn serve(shared: &Arc<CameraState>, address: SocketAddr, first: TcpListener) {
    let mut listener = Some(first);
    while !shared.has_ended() {
        if shared.is_away() {
            listener = None;
        } else if listener.is_none() {
            // Another program may hold the port for a moment: the next turn tries again.
            listener = TcpListener::bind(address).ok();
        }
        match listener.as_ref().map(accept) {
            Some(Some(client)) => {
                shared.connections.fetch_add(1, Ordering::Relaxed);
                let own = Arc::clone(shared);
                // A client that goes away, or is broken off, ends its thread.
                thread::spawn(move || http::stream(&own, client));
            }
            Some(None) | None => thread::sleep(POLL),
        }
    }
}

/// Accepts a client, if one is waiting.
fn accept(listener: &TcpListener) -> Option<TcpStream> {
    listener.set_nonblocking(true).ok()?;
    let (client, _) = listener.accept().ok()?;
    client.set_nonblocking(false).ok()?;
    client.set_nodelay(true).ok()?;
    Some(client)
}
