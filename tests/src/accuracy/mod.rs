//! How far a result is from the truth.

mod depth;
mod motion;
mod room;
mod route;

pub use depth::{DepthAgreement, depth};
pub use motion::{MotionError, capture_truth, installed_truth, motion};
pub use room::{CameraError, RelativePoseError, camera_against_floor, relative_pose};
pub use route::{ALONE, ROUTE, RouteError, office_route, places, route};
