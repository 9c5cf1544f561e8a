//! Lens distortion: the one type through which everything else bends and straightens.
//!
//! Three of OpenCV's models map the normalised image plane (z = 1) to the picture's, each with its own numbers:
//!
//! * [`BrownConrady`] — `k1 k2 p1 p2 k3`: ordinary lenses.
//! * [`Rational`] — `k1 k2 p1 p2 k3 k4 k5 k6`: wide lenses, of which a polynomial folds too early.
//! * [`Fisheye`] — `k1 k2 k3 k4` of J. Kannala and S. Brandt: the radius in the picture grows with the angle from the axis.
//!
//! A point that lies farther than [`Distortion::max_radius`] from the axis has no image: there a polynomial folds back on
//! itself, and a fisheye's rays come too near to the plane of the lens to meet z = 1.

mod brown_conrady;
mod fisheye;
mod inverse;
mod model;
#[cfg(test)]
mod opencv_tests;
mod rational;
mod roots;

use nalgebra::{Matrix2, Matrix2xX, Vector2};
use serde::{Deserialize, Serialize};

pub use brown_conrady::BrownConrady;
pub use fisheye::Fisheye;
pub use model::LensModel;
pub use rational::Rational;

/// Lens distortion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Distortion {
    /// Five numbers: radial polynomial and tangential part. All zero: a pinhole.
    BrownConrady(BrownConrady),
    /// Eight numbers: quotient of two radial polynomials, and tangential part.
    Rational(Rational),
    /// Four numbers: polynomial of the angle from the axis.
    Fisheye(Fisheye),
}

/// Evaluates an expression with the numbers of whichever model it is.
macro_rules! of_model {
    ($distortion:expr, $model:ident => $value:expr) => {
        match $distortion {
            Distortion::BrownConrady($model) => $value,
            Distortion::Rational($model) => $value,
            Distortion::Fisheye($model) => $value,
        }
    };
}

impl Distortion {
    /// No distortion.
    pub const NONE: Self = Self::BrownConrady(BrownConrady::NONE);

    /// Distortion of a model with its coefficients in OpenCV's order.
    ///
    /// # Errors
    /// A line that names the numbers which the model has, where there are more or fewer.
    pub fn new(model: LensModel, coefficients: &[f64]) -> Result<Self, String> {
        let wrong = |_| model.count_defect(coefficients.len());
        Ok(match model {
            LensModel::BrownConrady => <[f64; 5]>::try_from(coefficients).map_err(wrong)?.into(),
            LensModel::Rational => Self::Rational(<[f64; 8]>::try_from(coefficients).map_err(wrong)?.into()),
            LensModel::Fisheye => Self::Fisheye(<[f64; 4]>::try_from(coefficients).map_err(wrong)?.into()),
        })
    }

    /// Distortion as files have it: `lens`, the model, beside `distortion`, its numbers. Without numbers a lens without a
    /// name is a pinhole.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_file(lens: LensModel, numbers: Option<&[f64]>) -> Result<Self, String> {
        match numbers {
            None if lens.is_default() => Ok(Self::NONE),
            numbers => Self::new(lens, numbers.unwrap_or(&[])),
        }
    }

    /// The model.
    pub fn model(&self) -> LensModel {
        match self {
            Self::BrownConrady(_) => LensModel::BrownConrady,
            Self::Rational(_) => LensModel::Rational,
            Self::Fisheye(_) => LensModel::Fisheye,
        }
    }

    /// Coefficients in OpenCV's order, named by [`LensModel::coefficient_names`].
    pub fn coefficients(&self) -> Vec<f64> {
        of_model!(self, model => model.coefficients().to_vec())
    }

    /// Tells whether the camera is a plain pinhole. A fisheye never is, whatever its numbers.
    pub fn is_none(&self) -> bool {
        match self {
            Self::BrownConrady(model) => *model == BrownConrady::NONE,
            Self::Rational(model) => model.coefficients().iter().all(|number| *number == 0.0),
            Self::Fisheye(_) => false,
        }
    }

    /// Tells whether every coefficient is a finite number.
    pub fn is_finite(&self) -> bool {
        self.coefficients().iter().all(|c| c.is_finite())
    }

    /// Maps normalised pinhole coordinates to normalised distorted coordinates.
    pub fn distort(&self, p: Vector2<f64>) -> Vector2<f64> {
        of_model!(self, model => model.distort(p))
    }

    /// Derivative of [`Self::distort`] with respect to its argument.
    pub fn jacobian(&self, p: Vector2<f64>) -> Matrix2<f64> {
        of_model!(self, model => model.jacobian(p))
    }

    /// Derivative of [`Self::distort`] with respect to the coefficients, a column each.
    pub fn coefficient_jacobian(&self, p: Vector2<f64>) -> Matrix2xX<f64> {
        of_model!(self, model => Matrix2xX::from_columns(&model.coefficient_jacobian(p)))
    }

    /// Maps normalised distorted coordinates to normalised pinhole coordinates.
    ///
    /// `None` where no pinhole point within [`Self::max_radius`] has this image.
    pub fn undistort(&self, distorted: Vector2<f64>) -> Option<Vector2<f64>> {
        of_model!(self, model => model.undistort(distorted))
    }

    /// Normalised radius up to which images are unique; infinite for a lens without a fold.
    pub fn max_radius(&self) -> f64 {
        of_model!(self, model => model.max_radius())
    }

    /// Normalised radius at which the model folds back on itself; `None` for a lens that does not. A fisheye ends without a
    /// fold where rays are no longer computed.
    pub fn fold_radius(&self) -> Option<f64> {
        let radius = self.max_radius();
        let is_fold = match self {
            Self::Fisheye(model) => model.folds(),
            _ => radius.is_finite(),
        };
        is_fold.then_some(radius)
    }

    /// The two coefficients of lowest order, which bend a lens most: `k1` and `k2` of every model.
    pub fn leading(&self) -> [f64; 2] {
        of_model!(self, model => [model.coefficients()[0], model.coefficients()[1]])
    }

    /// The lens with its [leading](Self::leading) coefficients changed by `by`.
    #[must_use]
    pub fn bent(&self, by: [f64; 2]) -> Self {
        fn add<const N: usize>(mut numbers: [f64; N], by: [f64; 2]) -> [f64; N] {
            numbers.iter_mut().zip(by).for_each(|(number, by)| *number += by);
            numbers
        }
        match self {
            Self::BrownConrady(model) => Self::BrownConrady(add(model.coefficients(), by).into()),
            Self::Rational(model) => Self::Rational(add(model.coefficients(), by).into()),
            Self::Fisheye(model) => Self::Fisheye(add(model.coefficients(), by).into()),
        }
    }

    /// Factors `a` and `b` by which the [leading](Self::leading) coefficients move a point's image: the derivative of
    /// [`Self::distort`] is `p a` by the first, and `p a b` by the second.
    pub fn leading_factors(&self, p: Vector2<f64>) -> [f64; 2] {
        match self {
            Self::BrownConrady(_) => BrownConrady::leading_factors(p),
            Self::Rational(model) => model.leading_factors(p),
            Self::Fisheye(_) => Fisheye::leading_factors(p),
        }
    }
}

impl Default for Distortion {
    fn default() -> Self {
        Self::NONE
    }
}

/// OpenCV's five numbers `[k1, k2, p1, p2, k3]`.
impl From<[f64; 5]> for Distortion {
    fn from(numbers: [f64; 5]) -> Self {
        Self::BrownConrady(numbers.into())
    }
}

impl From<BrownConrady> for Distortion {
    fn from(model: BrownConrady) -> Self {
        Self::BrownConrady(model)
    }
}

impl From<Rational> for Distortion {
    fn from(model: Rational) -> Self {
        Self::Rational(model)
    }
}

impl From<Fisheye> for Distortion {
    fn from(model: Fisheye) -> Self {
        Self::Fisheye(model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_leading_coefficients_bend_as_their_factors_say() {
        let lenses: [Distortion; 3] = [
            [-0.1, 0.03, 1e-3, -2e-3, 0.01].into(),
            Rational::from([0.2, 0.1, 1e-3, -2e-3, 0.01, 0.4, 0.1, 0.02]).into(),
            Fisheye::from([-0.02, 0.005, -0.001, 0.0002]).into(),
        ];
        for (lens, p) in
            lenses.iter().zip([Vector2::new(0.4, -0.7), Vector2::new(-1.1, 0.3), Vector2::new(2.0, 1.5)])
        {
            let columns = lens.coefficient_jacobian(p);
            let [a, b] = lens.leading_factors(p);
            assert!(
                (columns.column(0) - p * a).norm() < 1e-14
                    && (columns.column(1) - p * (a * b)).norm() < 1e-14
            );
            let [k1, k2] = lens.leading();
            let bent = lens.bent([0.01, -0.02]);
            assert_eq!((bent.leading(), bent.model()), ([k1 + 0.01, k2 - 0.02], lens.model()));
            assert_eq!(bent.coefficients()[2..], lens.coefficients()[2..]);
        }
    }
}
