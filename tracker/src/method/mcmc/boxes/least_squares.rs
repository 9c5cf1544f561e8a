//! Least-squares fit of one person to the boxes of all cameras.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use super::Boxes;
use super::detector::{Noise, residuals};
use super::in_camera::InCamera;
use crate::silhouette::Body;

/// Number of Gauss–Newton steps of a fit.
const FIT_STEPS: usize = 4;
/// Step of the numerical derivatives, metres.
const DERIVATIVE_STEP_M: f64 = 0.01;
/// Least ratio of a box's density as the person's to that as a false one, for the box to take part in a fit.
const LEAST_DENSITY: f64 = 1.0;

/// Prior of a person before the boxes are observed: x, y, radius, height.
pub(super) struct Prior {
    pub(super) mean: Vector4<f64>,
    /// Precisions of radius and height, 1/m²; those of the place are in `place_precision`.
    pub(super) precision: Vector4<f64>,
    pub(super) place_precision: Matrix2<f64>,
}

impl Prior {
    fn matrix(&self) -> Matrix4<f64> {
        let mut matrix = Matrix4::from_diagonal(&self.precision);
        matrix.fixed_view_mut::<2, 2>(0, 0).copy_from(&self.place_precision);
        matrix
    }
}

/// Body of a state, with its size limited to a person's.
pub(super) fn body(state: &Vector4<f64>) -> Body {
    Body {
        x_m: state[0],
        y_m: state[1],
        radius_m: state[2].clamp(0.12, 0.5),
        height_m: state[3].clamp(1.0, 2.2),
    }
}

/// Result of a fit: x, y, radius, height, metres.
pub(super) struct Fitted {
    pub(super) state: Vector4<f64>,
    pub(super) covariance: Matrix4<f64>,
}

impl Fitted {
    pub(super) fn place(&self) -> Vector2<f64> {
        self.state.fixed_rows::<2>(0).into()
    }

    pub(super) fn place_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0).into()
    }

    /// Standard deviation of a value of the state, metres.
    pub(super) fn sigma(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }
}

/// Fits a person by Gauss–Newton with robust weights from `start`. In each camera the best box takes part, where a
/// box's density is weighted by the probability `free(camera, box)` that it is not another person's. `None` if the
/// normal equations cannot be solved.
pub(super) fn fit(
    boxes: &Boxes,
    prior: &Prior,
    start: &Body,
    free: impl Fn(usize, usize) -> f64,
) -> Option<Fitted> {
    let precision = prior.matrix();
    let mut state = Vector4::new(start.x_m, start.y_m, start.radius_m, start.height_m);
    let mut information = precision;
    for _ in 0..FIT_STEPS {
        information = precision;
        let mut pull = precision * (prior.mean - state);
        for (number, camera) in boxes.cameras.iter().enumerate().filter(|(_, camera)| camera.in_use) {
            let presence = camera.presence(&body(&state), &boxes.detector);
            let weighed = |(b, density): &(u32, f64)| (*b as usize, density * free(number, *b as usize));
            let best = presence.candidates().iter().map(weighed).max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((b, _)) = best.filter(|(_, density)| *density > LEAST_DENSITY) else { continue };
            add_box(camera, &state, &presence.noise, b, (&mut information, &mut pull));
        }
        state += information.cholesky()?.solve(&pull);
        let is_finite = state.iter().all(|value| value.is_finite());
        if !is_finite {
            return None;
        }
    }
    Some(Fitted { state, covariance: information.try_inverse()? })
}

/// Adds a box of one camera to the normal equations.
fn add_box(
    camera: &InCamera,
    state: &Vector4<f64>,
    noise: &Noise,
    b: usize,
    (information, pull): (&mut Matrix4<f64>, &mut Vector4<f64>),
) {
    let Some(expected) = camera.camera.expected(&body(state)) else { return };
    let (beyond, detected) = (camera.beyond_border(&expected), &camera.boxes[b]);
    let censored: [bool; 4] = std::array::from_fn(|i| detected.cut[i] && beyond[i]);
    let difference = residuals(&expected, detected, censored);
    let weight = Noise::robust_weight(noise.squared_sigmas(&difference));
    let mut derivatives = Matrix4::zeros();
    for i in 0..4 {
        let mut moved = *state;
        moved[i] += DERIVATIVE_STEP_M;
        let Some(there) = camera.camera.expected(&body(&moved)) else { return };
        let change = residuals(&there, detected, censored);
        for row in 0..4 {
            derivatives[(row, i)] = (difference[row] - change[row]) / DERIVATIVE_STEP_M;
        }
    }
    let weights = Vector4::from(noise.weights) * weight;
    let weighted = derivatives.transpose() * Matrix4::from_diagonal(&weights);
    *information += weighted * derivatives;
    *pull += weighted * Vector4::from(difference);
}
