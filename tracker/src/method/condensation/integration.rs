//! Integration of the cameras' weights into a weight in space (section 3): equations 4 to 7, and one by the room's
//! depth.
//!
//! A product has a narrow peak and nothing beside it, but one camera that does not see the head makes it zero; a sum
//! survives that, but is large along every ray. A sum of pairwise products needs two cameras that agree, whichever they
//! are. Two cameras collinear with the head agree all along the line, so their pair is left out.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Largest number of cameras.
pub const MOST_CAMERAS: usize = 32;

/// Method by which the cameras' weights become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integration {
    /// Equation 4: Π π.
    Product,
    /// Equation 5: Σ π.
    Sum,
    /// Equation 6: Σ π π over pairs.
    Pairs,
    /// Equation 7: the same over pairs whose rays are not collinear.
    PairsAngle,
    /// Π π over the cameras that see the place past the room's static depth: section 3 calls this correct where
    /// occlusion is known.
    Room,
}

/// Test of collinear rays (equation 7's T).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RayTest {
    /// Rays in the same or in opposite directions: |cos| ≥ β. Cameras that face each other are collinear, too.
    Line,
    /// The published test: cos ≥ β.
    Published,
}

/// Weight of a head in one camera.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CameraWeight {
    /// π, not negative.
    pub weight: f32,
    /// Unit vector from the camera to the head.
    pub ray: [f32; 3],
}

/// Weights of a head in all cameras that have the place in their image.
#[derive(Debug, Clone)]
pub struct CameraWeights {
    all: [CameraWeight; MOST_CAMERAS],
    count: usize,
}

impl Default for CameraWeights {
    fn default() -> Self {
        Self { all: [CameraWeight::default(); MOST_CAMERAS], count: 0 }
    }
}

impl CameraWeights {
    /// Removes all weights.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds one camera's weight; at most [`MOST_CAMERAS`] are stored.
    pub fn push(&mut self, look: CameraWeight) {
        if let Some(place) = self.all.get_mut(self.count) {
            *place = look;
            self.count += 1;
        }
    }

    /// All weights.
    pub fn all(&self) -> &[CameraWeight] {
        &self.all[..self.count]
    }

    /// Weight in space; 0 without any camera.
    pub fn integrate(&self, integration: Integration, rays: RayTest, beta: f32) -> f32 {
        match integration {
            Integration::Product | Integration::Room if self.count == 0 => 0.0,
            Integration::Product => self.all().iter().map(|l| l.weight).product(),
            // Hypotheses of one set may be seen by different numbers of cameras, so the weight is scaled to that of a
            // pair of mean cameras.
            Integration::Room => {
                let product: f32 = self.all().iter().map(|l| l.weight).product();
                product.powf(2.0 / self.count as f32)
            }
            Integration::Sum => self.all().iter().map(|l| l.weight).sum(),
            Integration::Pairs => {
                // (Σπ)² = Σπ² + 2 Σ over pairs.
                let sum: f32 = self.all().iter().map(|l| l.weight).sum();
                let squares: f32 = self.all().iter().map(|l| l.weight * l.weight).sum();
                0.5 * (sum * sum - squares).max(0.0)
            }
            Integration::PairsAngle => self.fold_pairs(rays, beta, 0.0, |sum, product| sum + product),
        }
    }

    /// Largest and mean product of two weights whose rays are not collinear; 0 where there is none.
    pub fn pairs(&self, rays: RayTest, beta: f32) -> (f32, f32) {
        let start = (0.0_f32, 0.0, 0_u32);
        let (best, sum, count) =
            self.fold_pairs(rays, beta, start, |(best, sum, count), p| (best.max(p), sum + p, count + 1));
        (best, sum / count.max(1) as f32)
    }

    fn fold_pairs<T>(&self, rays: RayTest, beta: f32, start: T, mut take: impl FnMut(T, f32) -> T) -> T {
        let mut folded = start;
        for (i, a) in self.all().iter().enumerate() {
            for b in &self.all()[i + 1..] {
                let cosine = a.ray[0] * b.ray[0] + a.ray[1] * b.ray[1] + a.ray[2] * b.ray[2];
                let line = if rays == RayTest::Line { cosine.abs() } else { cosine };
                if line < beta {
                    folded = take(folded, a.weight * b.weight);
                }
            }
        }
        folded
    }
}

impl Integration {
    /// All integrations, in the order of the paper's figures 5 to 8.
    pub const ALL: [Self; 5] = [Self::Product, Self::Sum, Self::Pairs, Self::PairsAngle, Self::Room];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Product => "product",
            Self::Sum => "sum",
            Self::Pairs => "pairs",
            Self::PairsAngle => "pairs-angle",
            Self::Room => "room",
        }
    }
}

impl fmt::Display for Integration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Integration {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|i| i.name() == text)
            .ok_or_else(|| format!("`{text}` is none of {}", names()))
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // zeros and ones that are set, not computed
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn weights_by_camera(of: &[(f32, [f32; 3])]) -> CameraWeights {
        let mut weights_by_camera = CameraWeights::default();
        for (weight, ray) in of {
            weights_by_camera.push(CameraWeight { weight: *weight, ray: *ray });
        }
        weights_by_camera
    }

    const EAST: [f32; 3] = [1.0, 0.0, 0.0];
    const WEST: [f32; 3] = [-1.0, 0.0, 0.0];
    const NORTH: [f32; 3] = [0.0, 1.0, 0.0];

    fn all_of(weights_by_camera: &CameraWeights) -> [f32; 5] {
        Integration::ALL.map(|i| weights_by_camera.integrate(i, RayTest::Line, 0.94))
    }

    #[test]
    fn the_equations_by_hand() {
        let three = weights_by_camera(&[(0.5, EAST), (0.4, NORTH), (0.2, WEST)]);
        // 0.5·0.4 + 0.5·0.2 + 0.4·0.2; east and west are collinear.
        let [product, sum, pairs, angle, room] = all_of(&three);
        assert_relative_eq!(product, 0.04, epsilon = 1e-6);
        assert_relative_eq!(sum, 1.1, epsilon = 1e-6);
        assert_relative_eq!(pairs, 0.38, epsilon = 1e-6);
        assert_relative_eq!(angle, 0.28, epsilon = 1e-6);
        assert_relative_eq!(room, 0.04_f32.powf(2.0 / 3.0), epsilon = 1e-6);
        let published = three.integrate(Integration::PairsAngle, RayTest::Published, 0.94);
        assert_relative_eq!(published, 0.38, epsilon = 1e-6);
        let (best, mean) = three.pairs(RayTest::Line, 0.94);
        assert_relative_eq!(best, 0.2, epsilon = 1e-6);
        assert_relative_eq!(mean, 0.14, epsilon = 1e-6);
    }

    #[test]
    fn no_camera_one_camera_and_more_than_fit() {
        assert_eq!(all_of(&CameraWeights::default()), [0.0; 5]);
        let [product, sum, pairs, angle, _] = all_of(&weights_by_camera(&[(0.5, EAST)]));
        assert_eq!((product, sum, pairs, angle), (0.5, 0.5, 0.0, 0.0));
        let many = weights_by_camera(&[(1.0, NORTH); MOST_CAMERAS + 3]);
        assert_eq!(many.all().len(), MOST_CAMERAS);
        assert_eq!(many.integrate(Integration::PairsAngle, RayTest::Line, 0.94), 0.0, "all on one line");
    }

    proptest! {
        /// Section 3's requirement: one hidden camera ruins a product, and leaves the others' pairs unchanged.
        #[test]
        fn a_hidden_camera_only_spoils_the_product(weights in prop::collection::vec(0.1_f32..1.0, 2..8)) {
            let rays: Vec<[f32; 3]> = (0..weights.len())
                .map(|i| {
                    let a = i as f32 * std::f32::consts::PI / weights.len() as f32;
                    [a.cos(), a.sin(), 0.0]
                })
                .collect();
            let seen: Vec<_> = weights.iter().copied().zip(rays.iter().copied()).collect();
            let mut hidden = seen.clone();
            hidden.push((0.0, [0.0, 0.0, 1.0]));
            let (before, after) = (all_of(&weights_by_camera(&seen)), all_of(&weights_by_camera(&hidden)));
            prop_assert_eq!(after[0], 0.0);
            for k in 1..4 {
                prop_assert!((before[k] - after[k]).abs() < 1e-5);
            }
            prop_assert!(after[3] <= after[2] + 1e-5);
        }
    }

    #[test]
    fn names_are_read_back() {
        for integration in Integration::ALL {
            assert_eq!(integration.name().parse::<Integration>(), Ok(integration));
        }
        assert!("pair".parse::<Integration>().unwrap_err().contains("pairs-angle"));
    }
}
