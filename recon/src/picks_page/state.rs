//! State of a session that its threads change: how far the captures and the build are, and what they have found.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::PathBuf;
use std::sync::Arc;

use image::{ImageFormat, RgbImage};
use nalgebra::{Point2, Similarity3};
use serde::Serialize;

use crate::Result;
use crate::capture::CaptureFile;
use crate::pipeline::{BuildReport, BuildStep, ReferenceView};
use crate::project::ProjectCamera;
use crate::proposals;
use crate::verdict::Verdict;

/// State that threads change.
#[derive(Default)]
pub(super) struct State {
    pub(super) captures: Progress,
    pub(super) pictures: Vec<Option<Arc<ReferencePicture>>>,
    pub(super) views: Option<Arc<Views>>,
    pub(super) proposals: Vec<ProposedPoint>,
    /// Similarities by the picks that were last asked about, by the pair's cameras.
    pub(super) joined: HashMap<[usize; 2], Similarity3<f64>>,
    pub(super) build: Progress,
    pub(super) built: Option<Built>,
    /// Number of finished builds: pictures of another have another address.
    pub(super) builds: usize,
    /// Room directory and link of the zone editor that was started.
    pub(super) zones: Option<(PathBuf, String)>,
}

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

    pub(super) fn step(step: &BuildStep) -> Self {
        Self::Running { number: step.number, of: step.of, what: step.what.clone() }
    }
}

/// A point that the program proposes.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ProposedPoint {
    /// Names of the two cameras.
    pub(super) cameras: [String; 2],
    /// Filmed pixels.
    pub(super) pixels: [Point2<f64>; 2],
    /// Correlation of both pictures there.
    pub(super) correlation: f64,
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
