//! One camera's work, alone: source → picture with its capture time → mask → observation.

mod seen;

pub use seen::{Event, PictureDemand, Pictures, Seen};
