//! Work that takes minutes, on threads of its own: the captures' pictures and surfaces, proposals, and the build; and its
//! progress.

use std::io::Cursor;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use image::{ImageFormat, RgbImage};
use nalgebra::Point2;
use serde::Serialize;

use super::session::Session;
use crate::Result;
use crate::capture::CaptureFile;
use crate::pipeline::{self, BuildReport, BuildStep, ReferenceView};
use crate::project::ProjectCamera;
use crate::proposals::{self, ProposalOptions};
use crate::surface::Surface;
use crate::verdict::Verdict;

/// Interval at which a build looks whether the captures are finished.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// State of one piece of work.
#[derive(Debug, Clone, Default, Serialize)]
#[serde(tag = "state", rename_all = "lowercase")]
pub(super) enum Progress {
    /// Not begun.
    #[default]
    Idle,
    /// Under way: number of the step, from 0, of how many, and its activity.
    Running { number: usize, of: usize, what: String },
    /// Finished.
    Done,
    /// Ended by a problem, in one line.
    Failed { problem: String },
}

impl Progress {
    pub(super) fn is_running(&self) -> bool {
        matches!(self, Self::Running { .. })
    }

    fn step(step: &BuildStep) -> Self {
        Self::Running { number: step.number, of: step.of, what: step.what.clone() }
    }
}

/// A point that the program proposes.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ProposedPoint {
    /// Names of the two cameras.
    cameras: [String; 2],
    /// Filmed pixels.
    pixels: [Point2<f64>; 2],
    /// Correlation of both pictures there.
    correlation: f64,
}

#[cfg(test)]
impl ProposedPoint {
    pub(super) fn new(cameras: [&str; 2], pixels: [Point2<f64>; 2], correlation: f64) -> Self {
        Self { cameras: cameras.map(str::to_owned), pixels, correlation }
    }
}

/// Reference views of all cameras, and what was found between them.
pub(super) struct Views {
    pub(super) views: Vec<ReferenceView>,
    pub(super) pairs: Vec<proposals::CameraPair>,
}

/// Reference picture of a camera, as PNG.
pub(super) struct ReferencePicture {
    pub(super) png: Vec<u8>,
    pub(super) size: (u32, u32),
}

impl ReferencePicture {
    pub(super) fn read(camera: &ProjectCamera) -> Result<Self> {
        let ProjectCamera { name, capture, reference, intrinsics } = camera.clone();
        let picture = CaptureFile::open(&name, &capture, reference, intrinsics)?.reference_picture()?;
        Ok(Self { size: picture.dimensions(), png: png(&picture)? })
    }
}

fn png(picture: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|e| crate::Error::Room(format!("the picture cannot be shown ({e})")))?;
    Ok(bytes.into_inner())
}

/// A finished build.
#[derive(Debug, Clone)]
pub(super) struct Built {
    pub(super) room: PathBuf,
    pub(super) verdict: Verdict,
    /// Names of the cameras that have a preview.
    pub(super) cameras: Vec<String>,
}

impl From<BuildReport> for Built {
    fn from(report: BuildReport) -> Self {
        let cameras = report.cameras.into_iter().map(|camera| camera.name).collect();
        Self { room: report.room, verdict: report.verdict, cameras }
    }
}

/// Starts to read and process the captures.
pub(super) fn start_captures(session: &Arc<Session>) {
    let session = Arc::clone(session);
    session.update(|state| {
        state.captures = Progress::Running { number: 0, of: 1, what: "the reference pictures".into() };
    });
    std::thread::spawn(move || {
        let done = captures(&session);
        session.update(|state| {
            state.captures = match done {
                Ok(()) => Progress::Done,
                Err(problem) => Progress::Failed { problem: problem.to_string() },
            };
        });
    });
}

fn captures(session: &Session) -> Result<()> {
    for (index, camera) in session.cameras().iter().enumerate() {
        let picture = Arc::new(ReferencePicture::read(camera)?);
        session.update(|state| state.pictures[index] = Some(picture));
    }
    let (room, options) = (session.room(), session.options());
    let views = pipeline::reference_views(session.cameras(), Some(room), options, &mut |step| {
        session.update(|state| state.captures = Progress::step(step));
    })?;
    let of = session.cameras().len();
    let what = "points that both see".to_owned();
    session.update(|state| state.captures = Progress::Running { number: of, of, what });
    let surfaces: Vec<&Surface> = views.iter().map(|view| &view.surface).collect();
    let how = ProposalOptions { seed: options.seed, ..ProposalOptions::default() };
    let pairs = proposals::propose(&surfaces, &how)?;
    let found = pairs.iter().filter_map(|pair| pair.found.as_ref());
    let proposed = found.flat_map(|found| &found.proposals).filter_map(|proposal| {
        let [a, b] = proposal.cameras.map(|camera| &views[camera]);
        let pixels = [a.filmed(&proposal.pixels[0])?, b.filmed(&proposal.pixels[1])?];
        let cameras = [a, b].map(|view| view.name.clone());
        Some(ProposedPoint { cameras, pixels, correlation: proposal.correlation })
    });
    let proposed = proposed.collect();
    session.update(|state| {
        state.proposals = proposed;
        state.views = Some(Arc::new(Views { views, pairs }));
    });
    Ok(())
}

/// Starts a build of the project as it is on disk; one that is running goes on. It begins when the captures are finished:
/// it takes their results over.
pub(super) fn start_build(session: &Arc<Session>) {
    let is_new = session.update(|state| {
        let is_new = !state.build.is_running();
        if is_new {
            state.build = Progress::Running { number: 0, of: 1, what: "waiting for the captures".into() };
        }
        is_new
    });
    if !is_new {
        return;
    }
    let session = Arc::clone(session);
    std::thread::spawn(move || {
        while session.update(|state| state.captures.is_running()) {
            std::thread::sleep(LOOK_EVERY);
        }
        let done = build(&session);
        session.update(|state| {
            state.build = match done {
                Ok(report) => {
                    state.built = Some(report.into());
                    state.builds += 1;
                    Progress::Done
                }
                Err(problem) => Progress::Failed { problem: problem.to_string() },
            };
        });
    });
}

fn build(session: &Session) -> Result<BuildReport> {
    let _lock = pipeline::lock_room(session.room(), "recon picks --page")?;
    pipeline::build(session.project(), session.room(), session.options(), &mut |step| {
        session.update(|state| state.build = Progress::step(step));
    })
}
