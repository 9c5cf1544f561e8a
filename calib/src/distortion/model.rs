//! The models of lenses by name.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// One of OpenCV's lens models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LensModel {
    /// Radial polynomial and tangential part: the model of a lens without a name.
    #[default]
    BrownConrady,
    /// Quotient of two radial polynomials, and tangential part.
    Rational,
    /// Polynomial of the angle from the axis.
    Fisheye,
}

impl LensModel {
    /// All models.
    pub const ALL: [Self; 3] = [Self::BrownConrady, Self::Rational, Self::Fisheye];

    /// Name in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::BrownConrady => "brown-conrady",
            Self::Rational => "rational",
            Self::Fisheye => "fisheye",
        }
    }

    /// Whether it is the model of a lens without a name, which files leave out.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Name that ROS and Foxglove give to the model, with the same order of its coefficients.
    pub const fn ros_name(self) -> &'static str {
        match self {
            Self::BrownConrady => "plumb_bob",
            Self::Rational => "rational_polynomial",
            Self::Fisheye => "kannala_brandt",
        }
    }

    /// Names of the coefficients, in OpenCV's order.
    pub const fn coefficient_names(self) -> &'static [&'static str] {
        match self {
            Self::BrownConrady => &["k1", "k2", "p1", "p2", "k3"],
            Self::Rational => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
            Self::Fisheye => &["k1", "k2", "k3", "k4"],
        }
    }

    /// Defect of a number of coefficients that is not the model's, with the mend.
    pub(super) fn count_defect(self, given: usize) -> String {
        let numbers = if given == 1 { "number" } else { "numbers" };
        let names = self.coefficient_names();
        let other = Self::ALL.into_iter().find(|other| other.coefficient_names().len() == given);
        let mend = other.filter(|other| *other != self).map_or(String::new(), |other| match other {
            Self::BrownConrady => ", or leave `lens` out".to_owned(),
            _ => format!(", or add `lens = \"{}\"`", other.name()),
        });
        format!(
            "{given} {numbers} of distortion; a lens of the model {} has {}: {}{mend}",
            self.name(),
            names.len(),
            names.join(", ")
        )
    }
}

impl fmt::Display for LensModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for LensModel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|model| model.name() == text).ok_or_else(|| {
            format!("`{text}` is no lens model; give {}", Self::ALL.map(Self::name).join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Distortion;

    #[test]
    fn a_wrong_count_of_numbers_names_the_models_own_and_the_model_that_has_it() {
        let said = |model, count| Distortion::new(model, &vec![0.0; count]).unwrap_err();
        let line = said(LensModel::BrownConrady, 8);
        assert!(
            line.contains("8 numbers") && line.contains("has 5") && line.contains("\"rational\""),
            "{line}"
        );
        let line = said(LensModel::Fisheye, 5);
        assert!(line.contains("has 4: k1, k2, k3, k4") && line.contains("leave `lens` out"), "{line}");
        let line = said(LensModel::Rational, 3);
        assert!(line.contains("has 8") && !line.contains(", or"), "{line}");
    }

    #[test]
    fn a_model_is_read_by_its_name_and_made_of_its_numbers() {
        for model in LensModel::ALL {
            assert_eq!(model.name().parse(), Ok(model));
            let numbers: Vec<f64> = (1..=model.coefficient_names().len()).map(|i| 1e-3 * i as f64).collect();
            let lens = Distortion::new(model, &numbers).unwrap();
            assert_eq!((lens.model(), lens.coefficients()), (model, numbers));
        }
        assert!("pinhole".parse::<LensModel>().unwrap_err().contains("fisheye"));
    }
}
