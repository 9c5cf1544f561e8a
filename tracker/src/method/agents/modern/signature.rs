//! Looks as vectors whose squared distance is twice a difference of log-likelihood.

use super::super::Looks;
use super::ModernOptions;

/// Dimensions of a look: chroma (2) and brightness of each of three colours, and the height.
const DIMENSIONS: usize = 10;
/// Squared distance from the mean above which the step towards a look is limited: part of it is of another person.
const OUTLIER: f64 = 25.0;
/// Largest weight of learnt looks, in looks; the limit lets the mean follow changes of light.
const LARGEST_WEIGHT: f64 = 600.0;

/// Look with each component in standard deviations of its measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Signature([f64; DIMENSIONS]);

impl Signature {
    /// Scales looks and height, metres, to standard deviations.
    pub(super) fn new(looks: &Looks, height_m: f64, options: &ModernOptions) -> Self {
        // Three colours with `independent_colours` independent errors count as that many.
        let share = (options.independent_colours / 3.0).sqrt();
        let chroma_scale = share / options.hue_noise_deg.to_radians();
        let value_scale = share / options.value_noise;
        let mut numbers = [0.0; DIMENSIONS];
        for (colour, number) in looks.colours.iter().zip(numbers.chunks_exact_mut(3)) {
            let (sin, cos) = f64::from(colour.hue_deg).to_radians().sin_cos();
            let saturation = f64::from(colour.saturation);
            number[0] = saturation * cos * chroma_scale;
            number[1] = saturation * sin * chroma_scale;
            number[2] = f64::from(colour.value) * value_scale;
        }
        numbers[DIMENSIONS - 1] = height_m / options.height_noise_m;
        Self(numbers)
    }

    /// Squared distance to another look.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        self.0.iter().zip(&other.0).map(|(a, b)| (a - b) * (a - b)).sum()
    }
}

/// Weighted mean of looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MeanLook {
    /// Mean look.
    mean: Signature,
    /// Number of independent looks in the mean.
    pub(super) weight: f64,
}

impl MeanLook {
    /// Creates a mean without looks.
    pub(super) fn none() -> Self {
        Self { mean: Signature([0.0; DIMENSIONS]), weight: 0.0 }
    }

    /// Adds a look that counts as `weight` independent ones.
    pub(super) fn add(&mut self, look: &Signature, weight: f64) {
        let distance = look.distance(&self.mean);
        let drawn = if self.weight >= 5.0 && distance > OUTLIER { (OUTLIER / distance).sqrt() } else { 1.0 };
        self.weight += weight;
        for (mean, number) in self.mean.0.iter_mut().zip(&look.0) {
            *mean += (number - *mean) * drawn * weight / self.weight;
        }
        self.weight = self.weight.min(LARGEST_WEIGHT);
    }

    /// Adds other looks of the same person.
    pub(super) fn merge(&mut self, other: &Self) {
        if other.weight > 0.0 {
            self.weight += other.weight;
            for (mean, number) in self.mean.0.iter_mut().zip(&other.mean.0) {
                *mean += (number - *mean) * other.weight / self.weight;
            }
            self.weight = self.weight.min(LARGEST_WEIGHT);
        }
    }

    /// Multiplies the weight by `kept`, 0 to 1.
    pub(super) fn fade(&mut self, kept: f64) {
        self.weight *= kept;
    }

    /// Squared distance of a look, with errors larger by `factor`, from this mean.
    pub(super) fn distance(&self, look: &Signature, factor: f64) -> f64 {
        look.distance(&self.mean) / (factor * factor + 1.0 / self.weight)
    }

    /// Squared distance of two means.
    pub(super) fn mean_distance(&self, other: &Self) -> f64 {
        self.mean.distance(&other.mean)
    }

    /// Log-likelihood of the looks `self` of a person whose learnt looks are `learnt`, up to a constant, nats.
    pub(super) fn log_likelihood(&self, learnt: &Self) -> f64 {
        -0.5 * self.mean.distance(&learnt.mean) / (1.0 / self.weight + 1.0 / learnt.weight)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Colour;
    use super::*;

    fn look(hue_deg: f32, saturation: f32) -> Looks {
        Looks { colours: [Colour { hue_deg, saturation, value: 0.5 }; 3] }
    }

    #[test]
    fn one_standard_deviation_of_hue_is_one() {
        let options = ModernOptions::simulation();
        let of = |hue: f64| Signature::new(&look(hue as f32, 1.0), 1.7, &options);
        let distance = of(100.0).distance(&of(100.0 + options.hue_noise_deg));
        assert!((distance - 1.0).abs() < 0.01, "{distance}");
    }

    #[test]
    fn grey_ignores_hue_and_hue_wraps() {
        let options = ModernOptions::simulation();
        let of = |hue: f32, saturation: f32| Signature::new(&look(hue, saturation), 1.7, &options);
        assert!(of(0.0, 0.0).distance(&of(180.0, 0.0)) < 1e-9);
        assert!(of(359.0, 1.0).distance(&of(1.0, 1.0)) < 0.03);
    }

    #[test]
    fn merged_means_are_the_mean_of_all() {
        let options = ModernOptions::simulation();
        let (mut first, mut second, mut all) = (MeanLook::none(), MeanLook::none(), MeanLook::none());
        for i in 0..20 {
            let signature = Signature::new(&look(100.0 + i as f32, 1.0), 1.7, &options);
            if i < 8 { &mut first } else { &mut second }.add(&signature, 1.0);
            all.add(&signature, 1.0);
        }
        first.merge(&second);
        assert!(first.mean.distance(&all.mean) < 1e-12);
        assert!((first.weight - 20.0).abs() < 1e-9);
    }
}
