//! The film of each camera: what it saw with what the tracker believes, and beside it the simulated view.
//!
//! One worker a camera draws and encodes while tracking goes on ([`Film`]); a [`Painter`] draws one frame and is
//! what the report uses too. Left panel: the picture, each person's predicted silhouette (tinted where it is
//! predicted visible; dimmed and dashed where the room or somebody else hides it), id, visible share, trail. Right
//! panel: the room as its geometry says it looks, with the people in it, and around them the outline of the
//! foreground that was really seen: where both agree, the tracker explains the picture.

mod clay;
mod layers;
mod lens;
mod overlay;
mod painter;
mod simulated;
mod trails;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use calib::video::FilmWriter;
use image::{GrayImage, RgbImage};

use crate::stage::Stage;
use crate::{Error, PersonEstimate, Result};
pub use painter::Painter;

/// How the films look.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmOptions {
    /// How long a trail reaches back, seconds. Default 4.
    pub trail_s: f64,
    /// Panels narrower than this are enlarged by whole numbers, so that labels stay readable. Default 480.
    pub least_width_px: u32,
}

impl Default for FilmOptions {
    fn default() -> Self {
        Self { trail_s: 4.0, least_width_px: 480 }
    }
}

/// One camera's pictures of one moment.
#[derive(Debug, Clone, Default)]
pub struct Shot {
    /// As it was filmed, with distortion. Without one the mask is shown.
    pub image: Option<RgbImage>,
    /// The foreground, in the pinhole image.
    pub mask: Option<GrayImage>,
}

/// A moment as the painters need it.
#[derive(Debug, Clone)]
struct Scene {
    frame: u32,
    time_s: f64,
    shot: Shot,
    people: Vec<PersonEstimate>,
}

/// A frame as it is in a film.
#[derive(Debug, Clone)]
pub struct Painted {
    /// The camera's number in the stage.
    pub camera: usize,
    /// The moment's number, from 1.
    pub frame: u32,
    /// Its time, seconds.
    pub time_s: f64,
    /// How many people are followed.
    pub people: usize,
    /// Both panels.
    pub picture: RgbImage,
}

/// Who is given each frame once the film has it; called by the painters, which wait for it.
pub type Audience = Arc<dyn Fn(Painted) + Send + Sync>;

/// The films of a run, one a camera: `overlay/NAME.mp4`. A film without a frame is no file.
#[derive(Debug)]
pub struct Film {
    workers: Vec<Worker>,
}

#[derive(Debug)]
struct Worker {
    path: PathBuf,
    scenes: SyncSender<Scene>,
    thread: JoinHandle<Result<()>>,
}

/// Moments that may wait for a painter before the tracker has to.
const QUEUE: usize = 8;

impl Film {
    /// Starts the films of a run into `out/overlay`, at `rate` frames a second, which an audience may see meanwhile.
    ///
    /// # Errors
    /// When a folder cannot be made or no encoder opens: told here, not after an hour of tracking.
    pub fn start(
        out: &Path,
        stage: &Stage,
        rate: f64,
        options: &FilmOptions,
        audience: Option<&Audience>,
    ) -> Result<Self> {
        let workers = (0..stage.cameras.len()).map(|index| {
            let mut painter = Painter::new(stage, index, options);
            let path = out.join("overlay").join(format!("{}.mp4", stage.cameras[index].name));
            let (width, height) = painter.size();
            let mut writer = FilmWriter::create(&path, width, height, rate)?;
            let (scenes, received) = sync_channel::<Scene>(QUEUE);
            let audience = audience.cloned();
            let thread = std::thread::spawn(move || {
                let mut frames = 0_u64;
                for Scene { frame, time_s, shot, people } in received {
                    let picture = painter.paint(frame, time_s, &shot, &people);
                    writer.write(&picture)?;
                    frames += 1;
                    if let Some(show) = &audience {
                        show(Painted { camera: index, frame, time_s, people: people.len(), picture });
                    }
                }
                // No player opens a film of nothing; dropped, it leaves no file.
                if frames > 0 { Ok(writer.finish()?) } else { Ok(()) }
            });
            Ok(Worker { path, scenes, thread })
        });
        Ok(Self { workers: workers.collect::<Result<_>>()? })
    }

    /// Hands over one moment: a shot a camera, in the stage's order. Waits when a painter is far behind.
    ///
    /// # Errors
    /// When a painter has stopped; the reason is what [`Self::finish`] returns.
    pub fn push(
        &mut self,
        frame: u32,
        time_s: f64,
        shots: Vec<Shot>,
        people: &[PersonEstimate],
    ) -> Result<()> {
        for (worker, shot) in self.workers.iter().zip(shots) {
            let scene = Scene { frame, time_s, shot, people: people.to_vec() };
            if worker.scenes.send(scene).is_err() {
                return Err(Error::content(
                    &worker.path,
                    format!("frame {frame}"),
                    "the film could not be written; run with --no-film, or make room on the disk",
                ));
            }
        }
        Ok(())
    }

    /// Waits for the painters and gives the films their names.
    ///
    /// # Errors
    /// The first that any of them met.
    pub fn finish(mut self) -> Result<()> {
        self.wait()
    }

    fn wait(&mut self) -> Result<()> {
        let mut outcome = Ok(());
        for Worker { path, scenes, thread } in self.workers.drain(..) {
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
        // A program that ends before its painters leaves their files half-written. What failed has been told by whoever
        // gave the film up.
        let _ = self.wait();
    }
}

#[cfg(test)]
mod tests;
