//! Events of a run: who came, went, entered and left places, and crossed lines.

mod event;

pub use event::{CameraState, Direction, Event, EventKind};
