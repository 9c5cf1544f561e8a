//! Random bodies for tests.

use nalgebra::Point3;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use crate::silhouette::Body;

/// Random body in a room of 6 × 5 m or slightly outside, one time in six close to the camera.
pub(super) fn random_body(eye: &Point3<f64>, rng: &mut Pcg64Mcg) -> Body {
    let near = rng.random::<f32>() < 0.17;
    let (x, y) =
        if near { (eye.x - 0.4..eye.x + 0.4, eye.y - 0.4..eye.y + 0.4) } else { (-0.5..6.5, -0.5..5.5) };
    Body {
        x_m: rng.random_range(x),
        y_m: rng.random_range(y),
        radius_m: rng.random_range(0.12..0.5),
        height_m: rng.random_range(0.9..2.2),
    }
}
