//! A live stream that has broken off is opened again, in the background, until it is back.
//!
//! Meanwhile its frames go missing at the rate they would have come, so that the frames after it have the right times and
//! the other cameras are not held up.

use std::ops::RangeInclusive;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Weak};
use std::thread;
use std::time::{Duration, Instant};

use calib::video::FrameSource;

/// Between two attempts.
const EVERY: Duration = Duration::from_secs(1);
/// Of a stream that does not say so, or says its clock's instead (RTSP: 90,000), frames a second.
const USUAL_RATE_HZ: f64 = 25.0;
/// The rates that a camera may have.
const CAMERAS_RATES_HZ: RangeInclusive<f64> = 0.1..=240.0;

/// The attempts to open a stream again. They end when this is dropped.
#[derive(Debug)]
pub(super) struct Reconnection {
    opened: Receiver<FrameSource>,
    broken_off: Instant,
    missed: u32,
    frame_s: f64,
    /// Its end ends the attempts.
    _wanted: Arc<()>,
}

impl Reconnection {
    /// Starts to open the stream again.
    pub(super) fn start(lost: &FrameSource) -> Self {
        let (send, opened) = channel();
        let wanted = Arc::new(());
        let (spec, size, still_wanted) = (lost.name().to_owned(), lost.size(), Arc::downgrade(&wanted));
        thread::spawn(move || {
            if let Some(source) = open_again(&spec, size, &still_wanted) {
                // Nobody listens any more: the run has ended.
                let _ = send.send(source);
            }
        });
        let frame_s = lost.rate().filter(|hz| CAMERAS_RATES_HZ.contains(hz)).unwrap_or(USUAL_RATE_HZ).recip();
        Self { opened, broken_off: Instant::now(), missed: 0, frame_s, _wanted: wanted }
    }

    /// The stream, once it is back. Until then a frame goes missing, when it would have come.
    pub(super) fn next(&mut self) -> Option<FrameSource> {
        match self.opened.try_recv() {
            Ok(source) => Some(source),
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => {
                self.missed += 1;
                let due = Duration::from_secs_f64(self.frame_s * f64::from(self.missed));
                thread::sleep(due.saturating_sub(self.broken_off.elapsed()));
                None
            }
        }
    }
}

/// Tries until it succeeds or nobody wants it.
fn open_again(spec: &str, size: (u32, u32), wanted: &Weak<()>) -> Option<FrameSource> {
    let mut is_told = false;
    while wanted.strong_count() > 0 {
        match FrameSource::open(spec) {
            Ok(source) if source.size() == size => return Some(source),
            Ok(source) if !is_told => {
                let ((width, height), (w, h)) = (size, source.size());
                tracing::warn!(
                    "{spec}: is back with {w} × {h} pixels, it had {width} × {height}; set it back"
                );
                is_told = true;
            }
            Ok(_) => {}
            Err(error) => tracing::debug!("{error}"),
        }
        thread::sleep(EVERY);
    }
    None
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use image::RgbImage;

    use super::*;
    use crate::source::network_camera::film;
    use crate::source::{Footage, Next};

    #[test]
    fn a_stream_that_breaks_off_is_taken_up_again_and_its_frames_count_meanwhile() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/camera.mjpg", listener.local_addr().unwrap());
        let server = thread::spawn(move || {
            for level in [40, 200] {
                // Who looks at it may hang up before all is sent.
                let _ = film(&mut listener.accept().unwrap().0, level, 200);
            }
        });
        let source = FrameSource::open(&url).unwrap();
        assert!(source.is_live() && !source.is_recording());
        let mut footage = Footage::new(source);
        let (mut frame, mut reads) = (RgbImage::default(), 0);
        // The greys seen and, in between, `None`; each once.
        let mut course: Vec<Option<u8>> = Vec::new();
        while course.last() != Some(&Some(200)) && reads < 3000 {
            reads += 1;
            let seen = match footage.read(&mut frame).unwrap() {
                Next::Frame(_) if frame.get_pixel(30, 20)[0].abs_diff(40) < 5 => Some(40),
                Next::Frame(_) => Some(frame.get_pixel(30, 20)[0].div_ceil(10) * 10),
                Next::Missing => None,
                Next::End => panic!("a live stream has no end"),
            };
            if course.last() != Some(&seen) {
                course.push(seen);
            }
        }
        assert_eq!(course, [Some(40), None, Some(200)]);
        assert_eq!(footage.delivered(), reads);
        server.join().unwrap();
        // The next time it is away for longer than anybody asks.
        assert!((0..400).any(|_| footage.read(&mut frame).unwrap() == Next::Missing));
        assert!(footage.skip());
    }
}
