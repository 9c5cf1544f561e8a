//! Confidence of a seeing agent (Nakazawa et al., section 3.3, equations (1) and (2)).

use super::super::{Colour, Looks, Sighting, TargetId};
use super::PublishedOptions;
use super::colour_memory::ColourMemory;
use super::reference::Member;

/// Saturation below which a colour has no hue to compare.
const GREY: f32 = 0.15;

/// Change of a confidence over `dt_s` seconds by equation (2) without the term of crossings. The agents of an agency
/// and the mediator's list of confidences share it.
///
/// The paper prints the differences with the opposite sign. Its text says that a difference below its threshold raises
/// confidence, as implemented here.
pub(super) fn change<'a>(
    sighting: &Sighting,
    target: TargetId,
    others: impl Iterator<Item = &'a Member>,
    memory: &ColourMemory,
    dt_s: f64,
    options: &PublishedOptions,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for other in others {
        sum += eval_other_agent(sighting, other, options);
        count += 1.0;
    }
    let eval_other = if count > 0.0 { sum / count } else { 0.0 };
    let eval_knowledge =
        sighting.looks.map_or(0.0, |looks| memory.evaluate(target, &looks, options.frequent));
    // Equation (2): k { … } + k { … }.
    dt_s * options.rate_per_s * (eval_other + options.knowledge_weight * eval_knowledge)
}

/// `eval_other_agent` of equation (1): agreement of a sighting with an agent of another station.
fn eval_other_agent(sighting: &Sighting, other: &Member, options: &PublishedOptions) -> f64 {
    let distance_m = (sighting.position - other.position).norm();
    let hue_deg = sighting.looks.zip(other.looks).and_then(|(a, b)| hue_difference_deg(&a, &b));
    options.distance_weight * (options.distance_limit_m - distance_m)
        + hue_deg.map_or(0.0, |deg| options.hue_weight * (options.hue_limit_deg - deg))
}

/// Mean difference of hue between the colours of two people, degrees; `None` when no pair of colours has a hue.
fn hue_difference_deg(a: &Looks, b: &Looks) -> Option<f64> {
    let has_hue = |c: &Colour| c.saturation >= GREY;
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in a.colours.iter().zip(&b.colours).filter(|(a, b)| has_hue(a) && has_hue(b)) {
        let turn = (f64::from(a.hue_deg) - f64::from(b.hue_deg)).rem_euclid(360.0);
        sum += turn.min(360.0 - turn);
        count += 1.0;
    }
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Point2, Vector2, point};

    fn looks(hue_deg: f32) -> Looks {
        Looks { colours: [Colour { hue_deg, saturation: 0.8, value: 0.5 }; 3] }
    }

    fn sighting(hue_deg: f32) -> Sighting {
        Sighting {
            track: 0,
            position: point![0.0, 0.0],
            covariance: Matrix2::identity(),
            height_m: 1.7,
            looks: Some(looks(hue_deg)),
            is_crowded: false,
        }
    }

    fn member(position: Point2<f64>, hue_deg: f32) -> Member {
        Member {
            position,
            covariance: Matrix2::identity(),
            velocity: Vector2::zeros(),
            height_m: 1.7,
            looks: Some(looks(hue_deg)),
            confidence: 1.0,
            is_crowded: false,
        }
    }

    #[test]
    fn differences_below_their_thresholds_raise_confidence() {
        let options = PublishedOptions::default();
        let memory = ColourMemory::default();
        let by = |x: f64, hue: f32| {
            let other = member(point![x, 0.0], hue);
            change(&sighting(350.0), TargetId(1), [other].iter(), &memory, 0.1, &options)
        };
        // 0.01 a frame x (1 / m x (0.6 m - 0.2 m) + 0.01 / deg x (20 deg - 15 deg)); hues wrap.
        assert!((by(0.2, 5.0) - 0.01 * (0.4 + 0.05)).abs() < 1e-9);
        assert!((by(1.6, 350.0) - 0.01 * (-1.0 + 0.2)).abs() < 1e-9);
        // 1 m weighs as 100 degrees.
        assert!((by(1.0, 350.0) - by(0.0, 90.0)).abs() < 1e-9);
    }

    #[test]
    fn grey_clothes_are_compared_by_place_alone() {
        let options = PublishedOptions::default();
        let grey = Looks { colours: [Colour { hue_deg: 200.0, saturation: 0.05, value: 0.5 }; 3] };
        let other = Member { looks: Some(grey), ..member(point![0.1, 0.0], 0.0) };
        let found =
            change(&sighting(0.0), TargetId(1), [other].iter(), &ColourMemory::default(), 0.1, &options);
        assert!((found - 0.005).abs() < 1e-9);
    }

    #[test]
    fn several_members_count_as_their_mean() {
        let options = PublishedOptions::default();
        let near = member(point![0.0, 0.0], 0.0);
        let far = member(point![2.0, 0.0], 0.0);
        let by = |others: &[Member]| {
            change(&sighting(0.0), TargetId(1), others.iter(), &ColourMemory::default(), 1.0, &options)
        };
        assert!((by(&[near, far]) - 0.5 * (by(&[near]) + by(&[far]))).abs() < 1e-12);
        assert!(by(&[]).abs() < 1e-12);
    }
}
