//! State of a camera, as files of a run name it.

use serde::{Deserialize, Serialize};

/// State of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraState {
    /// It sends no pictures.
    Lost,
    /// It repeats the same picture.
    Frozen,
    /// Its picture is dark.
    Dark,
    /// It stands elsewhere than the room has it; or nearly its whole picture changed at once, as by switched lights.
    Moved,
    /// It can be used again.
    Back,
}
