//! Linear support vector machine whose weights start from given ones.
//!
//! C.-J. Hsieh, K.-W. Chang, C.-J. Lin, S. S. Keerthi and S. Sundararajan, "A dual coordinate descent method for
//! large-scale linear SVM", ICML 2008, algorithm 1 with hinge loss. The weights are regularised towards given ones
//! instead of zero: with w = prior + Σ αᵢ yᵢ xᵢ the same algorithm minimises ½‖w − prior‖² + C Σ max(0, 1 − yᵢ w·xᵢ). A
//! few hundred crops of one camera therefore refine a general detector and do not replace it.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

/// A labelled feature vector.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSample {
    /// Features, without the bias.
    pub features: Vec<f32>,
    /// Whether the sample is a person.
    pub is_person: bool,
}

/// Options of the training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SvmOptions {
    /// Cost C of a sample on the wrong side.
    pub cost: f64,
    /// Largest number of passes over all samples.
    pub max_passes: usize,
    /// Largest violation of the optimality conditions at which the training ends.
    pub tolerance: f64,
    /// Seed of the order in which samples are visited.
    pub seed: u64,
}

impl Default for SvmOptions {
    fn default() -> Self {
        Self { cost: 0.01, max_passes: 200, tolerance: 1e-3, seed: 1 }
    }
}

/// Weights, bias last, that separate people from the rest near `prior`.
pub fn train(samples: &[TrainingSample], prior: &[f32], options: &SvmOptions) -> Vec<f32> {
    let mut weights: Vec<f64> = prior.iter().map(|w| f64::from(*w)).collect();
    // The bias is the weight of a feature that is always 1.
    let square = |s: &TrainingSample| 1.0 + s.features.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
    let squares: Vec<f64> = samples.iter().map(square).collect();
    let mut alphas = vec![0.0; samples.len()];
    let mut order: Vec<usize> = (0..samples.len()).collect();
    let mut random = Pcg64Mcg::seed_from_u64(options.seed);
    for _ in 0..options.max_passes {
        order.shuffle(&mut random);
        let mut greatest = 0f64;
        for &i in &order {
            let sign = if samples[i].is_person { 1.0 } else { -1.0 };
            let gradient = sign * margin(&weights, &samples[i].features) - 1.0;
            let projected = match alphas[i] {
                a if a <= 0.0 => gradient.min(0.0),
                a if a >= options.cost => gradient.max(0.0),
                _ => gradient,
            };
            greatest = greatest.max(projected.abs());
            if projected != 0.0 {
                let new = (alphas[i] - gradient / squares[i]).clamp(0.0, options.cost);
                let step = (new - alphas[i]) * sign;
                alphas[i] = new;
                for (w, v) in weights.iter_mut().zip(samples[i].features.iter().chain(&[1.0])) {
                    *w += step * f64::from(*v);
                }
            }
        }
        if greatest < options.tolerance {
            break;
        }
    }
    weights.into_iter().map(|w| w as f32).collect()
}

/// Signed distance of features from the boundary, in the weights' units.
fn margin(weights: &[f64], features: &[f32]) -> f64 {
    let sum: f64 = weights.iter().zip(features).map(|(w, v)| w * f64::from(*v)).sum();
    sum + weights.get(features.len()).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(x: f32, y: f32, is_person: bool) -> TrainingSample {
        TrainingSample { features: vec![x, y], is_person }
    }

    fn loss(weights: &[f32], prior: &[f32], samples: &[TrainingSample], cost: f64) -> f64 {
        let w: Vec<f64> = weights.iter().map(|w| f64::from(*w)).collect();
        let distance: f64 = w.iter().zip(prior).map(|(w, p)| (w - f64::from(*p)).powi(2)).sum();
        let hinge = |s: &TrainingSample| {
            let sign = if s.is_person { 1.0 } else { -1.0 };
            (1.0 - sign * margin(&w, &s.features)).max(0.0)
        };
        0.5 * distance + cost * samples.iter().map(hinge).sum::<f64>()
    }

    #[test]
    fn nothing_near_the_trained_weights_has_a_lower_loss() {
        let samples: Vec<TrainingSample> = (0..40)
            .map(|i| {
                let (a, b) = ((i * 7 % 13) as f32 / 6.0 - 1.0, (i * 5 % 11) as f32 / 5.0 - 1.0);
                sample(a, b, a + 0.5 * b + 0.2 * (i % 3) as f32 > 0.3)
            })
            .collect();
        for prior in [[0.0, 0.0, 0.0], [2.0, -1.0, 0.5]] {
            let options = SvmOptions { cost: 0.7, max_passes: 5000, tolerance: 1e-7, seed: 3 };
            let weights = train(&samples, &prior, &options);
            let best = loss(&weights, &prior, &samples, 0.7);
            for axis in 0..3 {
                for step in [-0.01f32, 0.01] {
                    let mut moved = weights.clone();
                    moved[axis] += step;
                    assert!(loss(&moved, &prior, &samples, 0.7) > best - 1e-7, "{axis} {step}");
                }
            }
        }
    }

    #[test]
    fn two_points_are_parted_in_the_middle_and_no_samples_leave_the_prior() {
        let samples = [sample(2.0, 0.0, true), sample(-2.0, 0.0, false)];
        let options = SvmOptions { cost: 10.0, ..SvmOptions::default() };
        let weights = train(&samples, &[0.0; 3], &options);
        assert!((weights[0] - 0.5).abs() < 1e-3 && weights[1].abs() < 1e-6 && weights[2].abs() < 1e-3);
        assert_eq!(train(&[], &[1.0, 2.0, 3.0], &options), [1.0, 2.0, 3.0]);
    }
}
