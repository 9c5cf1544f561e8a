//! Errors of results against the truth.

mod coverage;
mod depth;
mod hidden;
mod lengths;
mod matched;
mod motion;
mod room;
mod route;

pub use coverage::coverage;
pub use depth::{DepthAgreement, depth};
pub use hidden::{HiddenPeople, hidden_people};
pub use lengths::{LengthAgreement, lengths};
pub use matched::{Matched, matched};
pub use motion::{MotionError, capture_truth, installed_truth, motion};
pub use room::{CameraError, RelativePoseError, camera_against_floor, relative_pose};
pub use route::{ALONE, ROUTE, RouteError, office_route, places, route};
