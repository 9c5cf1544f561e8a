//! Film of each camera: its picture with the tracker's estimates, beside the simulated view.
//!
//! One worker a camera draws and encodes during tracking ([`Film`]); a [`Painter`] draws one frame and is also used by
//! the report. Left panel: the picture, each person's predicted silhouette (tinted where it is predicted visible;
//! dimmed and dashed where the room or another person hides it), id, visible share, trail. Right panel: the room's
//! geometry, with the people in it, and around them the outline of the observed foreground: where both agree, the
//! tracker explains the picture.

mod clay;
mod layers;
mod lens;
mod overlay;
mod painter;
mod simulated;
mod trails;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use calib::video::FilmWriter;
use image::RgbImage;

use crate::observation::Mask;
use crate::prepared_room::{PreparedCamera, PreparedRoom};
use crate::{Error, PersonEstimate, Result};
pub use painter::Painter;

/// Options of the films.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmOptions {
    /// Length of a trail, seconds. Default 4.
    pub trail_s: f64,
    /// Width of the film, both panels together, pixels. Default 960.
    pub width_px: u32,
    /// Whether frames that the painter cannot keep up with are left out (live input); the frame before is then shown
    /// for longer. Otherwise, the default, the tracker waits for the painter.
    pub is_live: bool,
}

impl Default for FilmOptions {
    fn default() -> Self {
        Self { trail_s: 4.0, width_px: 960, is_live: false }
    }
}

impl FilmOptions {
    /// Width and height of one panel for this camera, pixels: the size of the picture that a film takes. Even, as
    /// encoders require.
    pub fn panel_px(&self, camera: &PreparedCamera) -> (u32, u32) {
        let k = &camera.filmed.intrinsics;
        let width = (self.width_px / 4 * 2).max(2);
        let height = f64::from(width) * f64::from(k.height) / f64::from(k.width.max(1));
        (width, ((0.5 * height).round() as u32).max(1) * 2)
    }
}

/// Picture and mask of one camera at one moment.
#[derive(Debug, Clone, Default)]
pub struct Shot {
    /// Filmed picture, with distortion, at the [panel's size](FilmOptions::panel_px). Without one the mask is shown.
    pub image: Option<Arc<RgbImage>>,
    /// Foreground, in the pinhole image at the working size.
    pub mask: Option<Mask>,
}

/// Input of a painter for one moment.
#[derive(Debug, Clone)]
struct PaintJob {
    frame: u32,
    time_s: f64,
    shot: Shot,
    people: Vec<PersonEstimate>,
    /// Number of frames before it that were left out.
    left_out: u32,
}

/// A finished frame of a film.
#[derive(Debug, Clone)]
pub struct Painted {
    /// Index of the camera in the prepared room.
    pub camera: usize,
    /// Number of the moment, from 1.
    pub frame: u32,
    /// Time of the moment, seconds.
    pub time_s: f64,
    /// Number of tracked people.
    pub people: usize,
    /// Picture of both panels.
    pub picture: RgbImage,
}

/// Callback that receives each frame after it has been written to the film; the painters call it and wait for it.
pub type Audience = Arc<dyn Fn(Painted) + Send + Sync>;

/// Films of a run, one a camera: `overlay/NAME.mp4`. A film without a frame leaves no file.
#[derive(Debug)]
pub struct Film {
    workers: Vec<Worker>,
    is_live: bool,
}

#[derive(Debug)]
struct Worker {
    path: PathBuf,
    scenes: SyncSender<PaintJob>,
    thread: JoinHandle<Result<()>>,
    /// Number of frames that were left out since the last one.
    left_out: u32,
}

/// Number of moments that may wait for a painter before the tracker has to.
const QUEUE: usize = 8;

impl Film {
    /// Starts the films of a run in `out/overlay`, at `rate` frames a second, which `audience` receives as well.
    ///
    /// # Errors
    /// A folder that cannot be made or an encoder that cannot be opened: reported here, not after an hour of tracking.
    pub fn start(
        out: &Path,
        room: &PreparedRoom,
        rate: f64,
        options: &FilmOptions,
        audience: Option<&Audience>,
    ) -> Result<Self> {
        let is_live = options.is_live;
        let workers = (0..room.cameras.len()).map(|index| {
            let mut painter = Painter::new(room, index, options);
            let path = out.join("overlay").join(format!("{}.mp4", room.cameras[index].name));
            let (width, height) = painter.size();
            let mut writer = FilmWriter::create(&path, width, height, rate)?;
            let (scenes, received) = sync_channel::<PaintJob>(QUEUE);
            let audience = audience.cloned();
            let thread = std::thread::spawn(move || {
                let mut frames = 0_u64;
                let mut latest: Option<RgbImage> = None;
                for PaintJob { frame, time_s, shot, people, left_out } in received {
                    // Left-out frames keep their time in the film.
                    for _ in 0..left_out {
                        latest.as_ref().map_or(Ok(()), |latest| writer.write(latest))?;
                    }
                    let picture = painter.paint(frame, time_s, &shot, &people);
                    writer.write(&picture)?;
                    frames += 1;
                    if is_live {
                        latest = Some(picture.clone());
                    }
                    if let Some(show) = &audience {
                        show(Painted { camera: index, frame, time_s, people: people.len(), picture });
                    }
                }
                // Players cannot open a film without frames; dropping the writer leaves no file.
                if frames > 0 { Ok(writer.finish()?) } else { Ok(()) }
            });
            Ok(Worker { path, scenes, thread, left_out: 0 })
        });
        Ok(Self { workers: workers.collect::<Result<_>>()?, is_live })
    }

    /// Adds one moment: a shot a camera, in the room's order. When a painter is far behind, the frame is left out (live
    /// input) or waits for it.
    ///
    /// # Errors
    /// A painter that has stopped; [`Self::finish`] returns the reason.
    pub fn push(
        &mut self,
        frame: u32,
        time_s: f64,
        shots: Vec<Shot>,
        people: &[PersonEstimate],
    ) -> Result<()> {
        for (worker, shot) in self.workers.iter_mut().zip(shots) {
            let scene = PaintJob { frame, time_s, shot, people: people.to_vec(), left_out: worker.left_out };
            let has_stopped = if self.is_live {
                match worker.scenes.try_send(scene) {
                    Ok(()) => {
                        worker.left_out = 0;
                        false
                    }
                    Err(TrySendError::Full(_)) => {
                        worker.left_out += 1;
                        false
                    }
                    Err(TrySendError::Disconnected(_)) => true,
                }
            } else {
                worker.scenes.send(scene).is_err()
            };
            if has_stopped {
                return Err(Error::content(
                    &worker.path,
                    format!("frame {frame}"),
                    "the film could not be written; run with --no-film, or make room on the disk",
                ));
            }
        }
        Ok(())
    }

    /// Waits for the painters and completes the files.
    ///
    /// # Errors
    /// The first error of any painter.
    pub fn finish(mut self) -> Result<()> {
        self.wait()
    }

    fn wait(&mut self) -> Result<()> {
        let mut outcome = Ok(());
        for Worker { path, scenes, thread, .. } in self.workers.drain(..) {
            drop(scenes);
            let ended = thread.join().unwrap_or_else(|_| {
                Err(Error::content(&path, "whole film", "its painter failed; run with --no-film"))
            });
            outcome = outcome.and(ended);
        }
        outcome
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        // A program that ends before its painters would leave half-written files. An error was already reported where
        // the film was given up.
        let _ = self.wait();
    }
}

#[cfg(test)]
mod tests;
