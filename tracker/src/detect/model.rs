//! The file of a camera's own weights.

use std::path::Path;

use calib::vision::PeopleClassifier;
use serde::{Deserialize, Serialize};

use super::{DetectOptions, Detector};
use crate::{Error, Result};

const FORMAT: u32 = 1;

/// Content of the file that `tracker detect train` writes.
#[derive(Debug, Serialize, Deserialize)]
struct ModelFile {
    format: u32,
    /// One weight for each feature of a 64 × 128 window, then the bias.
    weights: Vec<f32>,
}

impl Detector {
    /// General detector of people, with OpenCV's weights.
    ///
    /// # Errors
    /// Invalid options, or an error of OpenCV.
    pub fn general(options: DetectOptions) -> Result<Self> {
        Self::new(&PeopleClassifier::inria_weights()?, options)
    }

    /// A camera's own detector, from the file that [`write()`] made.
    ///
    /// # Errors
    /// Names the file and its defect.
    pub fn read(path: &Path, options: DetectOptions) -> Result<Self> {
        let file: ModelFile = serde_json::from_str(&calib::files::read_text(path)?).map_err(|e| {
            Error::content(path, format!("line {}, column {}", e.line(), e.column()), e.to_string())
        })?;
        if file.format != FORMAT {
            let problem =
                format!("is {}, this program reads {FORMAT}; train the detector again", file.format);
            return Err(Error::content(path, "format", problem));
        }
        if let Some(bad) = file.weights.iter().position(|w| !w.is_finite()) {
            return Err(Error::content(path, format!("weight {}", bad + 1), "is no finite number"));
        }
        options.check()?;
        Self::new(&file.weights, options).map_err(|e| Error::content(path, "weights", e.to_string()))
    }
}

/// Writes a camera's own weights, atomically.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, weights: &[f32]) -> Result<()> {
    let file = ModelFile { format: FORMAT, weights: weights.to_vec() };
    let text = serde_json::to_string(&file)
        .map_err(|e| Error::content(path, "whole file", format!("cannot be written ({e})")))?;
    Ok(calib::files::write_atomic(path, (text + "\n").as_bytes())?)
}
