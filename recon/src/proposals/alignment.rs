//! Similarities between two cameras' spaces on which many candidates agree, the best supported first: random triples
//! (RANSAC) and Horn's closed form, then again without the inliers.

use calib::{Intrinsics, absolute_orientation};
use nalgebra::{Point2, Point3, Similarity3};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::landmarks::Candidate;

/// Number of triples tried for each similarity.
const TRIES: usize = 20_000;
/// Largest factor between the ratios of the sides of a triple's two triangles.
const RATIO_OF_SIDES: f64 = 1.15;
/// Number of rounds of refitting to all inliers.
const ROUNDS: usize = 6;
/// Number of similarities searched: a repeated structure may have more support than the true one.
const MOST: usize = 6;

/// A similarity and the indices of the candidates that agree on it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CandidateAlignment {
    pub(super) first_from_second: Similarity3<f64>,
    pub(super) agreeing: Vec<usize>,
}

/// Reprojection distance of a candidate's points, the larger of both cameras', pixels; infinite behind one.
pub(super) fn miss_px(
    candidate: &Candidate,
    [first, second]: [&Intrinsics; 2],
    first_from_second: &Similarity3<f64>,
) -> f64 {
    let [a, b] = candidate;
    let off = |lens: &Intrinsics, position: Point3<f64>, pixel: Point2<f64>| {
        if position.z <= 0.0 {
            return f64::INFINITY;
        }
        lens.project(&position).map_or(f64::INFINITY, |p| (p - pixel).norm())
    };
    let here = off(first, first_from_second * b.position, a.pixel);
    here.max(off(second, first_from_second.inverse_transform_point(&a.position), b.pixel))
}

/// Similarities on which at least `least` candidates agree to within `tolerance_px`.
pub(super) fn find(
    candidates: &[Candidate],
    lenses: [&Intrinsics; 2],
    tolerance_px: f64,
    least: usize,
    rng: &mut Pcg64Mcg,
) -> Vec<CandidateAlignment> {
    let mut left: Vec<usize> = (0..candidates.len()).collect();
    let mut found = Vec::new();
    while found.len() < MOST && left.len() >= least.max(3) {
        let Some(best) = best_triple(candidates, &left, lenses, tolerance_px, rng) else { break };
        let (agreeing, similarity) = refitted(candidates, &left, lenses, tolerance_px, best);
        if agreeing.len() < least {
            break;
        }
        left.retain(|i| !agreeing.contains(i));
        found.push(CandidateAlignment { first_from_second: similarity, agreeing });
    }
    found
}

fn best_triple(
    candidates: &[Candidate],
    left: &[usize],
    lenses: [&Intrinsics; 2],
    tolerance_px: f64,
    rng: &mut Pcg64Mcg,
) -> Option<Similarity3<f64>> {
    let mut best: Option<(f64, Similarity3<f64>)> = None;
    for _ in 0..TRIES {
        let triple: [usize; 3] = std::array::from_fn(|_| left[rng.random_range(0..left.len())]);
        if !alike(triple.map(|i| &candidates[i])) {
            continue;
        }
        let Some(similarity) = fit(candidates, &triple) else { continue };
        let cost: f64 =
            left.iter().map(|i| miss_px(&candidates[*i], lenses, &similarity).min(tolerance_px)).sum();
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, similarity));
        }
    }
    best.map(|(_, similarity)| similarity)
}

/// Tells whether two triangles may be similar: a cheap test before the fit.
fn alike(triple: [&Candidate; 3]) -> bool {
    let ratio = |i: usize, j: usize| {
        let side = |camera: usize| (triple[i][camera].position - triple[j][camera].position).norm();
        side(0) / side(1)
    };
    let ratios = [ratio(0, 1), ratio(1, 2), ratio(2, 0)];
    let (least, most) = ratios.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), r| (l.min(*r), m.max(*r)));
    ratios.iter().all(|r| r.is_finite() && *r > 0.0) && most <= RATIO_OF_SIDES * least
}

fn fit(candidates: &[Candidate], chosen: &[usize]) -> Option<Similarity3<f64>> {
    let (a, b): (Vec<_>, Vec<_>) =
        chosen.iter().map(|i| (candidates[*i][0].position, candidates[*i][1].position)).unzip();
    absolute_orientation::similarity(&b, &a).ok()
}

fn refitted(
    candidates: &[Candidate],
    left: &[usize],
    lenses: [&Intrinsics; 2],
    tolerance_px: f64,
    start: Similarity3<f64>,
) -> (Vec<usize>, Similarity3<f64>) {
    let agreeing = |similarity: &Similarity3<f64>| -> Vec<usize> {
        let near = |i: &&usize| miss_px(&candidates[**i], lenses, similarity) < tolerance_px;
        left.iter().filter(near).copied().collect()
    };
    let mut best = (agreeing(&start), start);
    for _ in 0..ROUNDS {
        let Some(similarity) = fit(candidates, &best.0) else { break };
        let again = agreeing(&similarity);
        if again.len() < best.0.len() {
            break;
        }
        best = (again, similarity);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::landmarks::Landmark;
    use super::*;
    use nalgebra::Vector3;
    use rand::SeedableRng;

    /// Candidates under a similarity, seen exactly.
    fn pairs(
        lens: &Intrinsics,
        similarity: &Similarity3<f64>,
        count: usize,
        rng: &mut Pcg64Mcg,
    ) -> Vec<Candidate> {
        let landmark = |position: Point3<f64>| {
            lens.project(&position).filter(|p| lens.contains(p)).map(|pixel| Landmark { pixel, position })
        };
        let mut pairs = Vec::new();
        while pairs.len() < count {
            let mut side = |from: f64, to: f64| rng.random_range(from..to);
            let there = Point3::new(side(-2.0, 2.0), side(-1.5, 1.5), side(2.0, 5.0));
            pairs.extend(landmark(similarity * there).zip(landmark(there)).map(|(a, b)| [a, b]));
        }
        pairs
    }

    #[test]
    fn similarities_are_found_among_wrong_candidates_the_best_supported_first() {
        let lens = Intrinsics::from_horizontal_fov(640, 480, 60.0);
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let turned =
            |x: f64, y: f64, scale| Similarity3::new(Vector3::new(x, 0.1, 0.3), Vector3::y() * y, scale);
        let (likeness, truth) = (turned(0.2, 0.3, 2.1), turned(-0.5, -0.2, 0.4));
        let mut candidates = pairs(&lens, &likeness, 40, &mut rng);
        candidates.extend(pairs(&lens, &truth, 20, &mut rng));
        let chance = pairs(&lens, &truth, 120, &mut rng);
        candidates.extend((0..120).map(|i| [chance[i][0], chance[(i + 7) % 120][1]]));
        let found = find(&candidates, [&lens, &lens], 2.0, 8, &mut rng);
        assert_eq!(found.len(), 2, "{found:?}");
        for (alignment, (expected, members)) in found.iter().zip([(&likeness, 0..40), (&truth, 40..60)]) {
            let off = alignment.first_from_second.to_homogeneous() - expected.to_homogeneous();
            assert!(off.norm() < 1e-6, "{off}");
            assert!(members.into_iter().all(|i| alignment.agreeing.contains(&i)));
        }
        assert_eq!(find(&candidates[60..], [&lens, &lens], 2.0, 8, &mut rng), []);
        assert_eq!(find(&[], [&lens, &lens], 2.0, 8, &mut rng), []);
    }

    #[test]
    fn points_behind_a_camera_do_not_match() {
        let lens = Intrinsics::from_horizontal_fov(640, 480, 60.0);
        let at = |z: f64| Landmark { pixel: Point2::new(319.5, 239.5), position: Point3::new(0.0, 0.0, z) };
        let same = Similarity3::identity();
        assert!(miss_px(&[at(2.0), at(3.0)], [&lens, &lens], &same) < 1e-9);
        assert!(miss_px(&[at(-2.0), at(3.0)], [&lens, &lens], &same).is_infinite());
    }
}
