//! Initial similarities: each pair's by Horn from its most consistent picks, chained along the best-joined pairs.

use calib::absolute_orientation;
use nalgebra::{Point3, Similarity3};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use super::LiftedPick;
use crate::project::{LEAST_SHARED_POINTS, Project, is_wide};
use crate::{Error, Result};

/// A similarity between two cameras and the number of picks that support it.
struct PairSimilarity {
    a: usize,
    b: usize,
    a_from_b: Similarity3<f64>,
    support: usize,
    /// Median distance of the supporting picks as a share of their depth.
    spread: f64,
}

/// Two cameras that share enough points but are not joined by them.
struct Failure {
    a: usize,
    b: usize,
    /// Number of points whose depth is known in both.
    usable: usize,
    why: FailureReason,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FailureReason {
    Disagree,
    /// They agree when one of the two spaces is mirrored.
    Mirrored,
    OnALine,
}

/// Largest distance between the positions of a point from two picks for them to agree, as a share of its depth.
const AGREEMENT: f64 = 0.06;
/// Number of triples tried for a pair; all of them up to 25 points.
const MOST_TRIPLES: usize = 2300;

/// Initial `common_from_camera` of each camera, the first the identity.
pub(super) fn chain(
    project: &Project,
    picks: &[LiftedPick],
    cameras: usize,
) -> Result<Vec<Similarity3<f64>>> {
    let mut edges = Vec::new();
    let mut failures = Vec::new();
    for a in 0..cameras {
        for b in a + 1..cameras {
            let shared = shared(picks, a, b);
            if project.shared(a, b).len() < LEAST_SHARED_POINTS {
                continue;
            }
            match pair(&shared) {
                Ok((a_from_b, support, spread)) => {
                    edges.push(PairSimilarity { a, b, a_from_b, support, spread });
                }
                Err(why) => failures.push(Failure { a, b, usable: shared.len(), why }),
            }
        }
    }
    // The strongest pairs first, as in Prim's algorithm: most agreeing picks, then the smallest spread.
    edges.sort_by(|x, y| y.support.cmp(&x.support).then(x.spread.total_cmp(&y.spread)));
    let mut placed: Vec<Option<Similarity3<f64>>> = vec![None; cameras];
    placed[0] = Some(Similarity3::identity());
    loop {
        let next = edges.iter().find_map(|e| match (placed[e.a], placed[e.b]) {
            (Some(from), None) => Some((e.b, from * e.a_from_b)),
            (None, Some(from)) => Some((e.a, from * e.a_from_b.inverse())),
            _ => None,
        });
        let Some((camera, pose)) = next else { break };
        placed[camera] = Some(pose);
    }
    placed
        .iter()
        .enumerate()
        .map(|(camera, pose)| pose.ok_or_else(|| not_joined_error(project, picks, &failures, camera)))
        .collect()
}

fn not_joined_error(project: &Project, picks: &[LiftedPick], failures: &[Failure], camera: usize) -> Error {
    let name = |i: usize| &project.cameras[i].name;
    let of_camera = failures.iter().find(|f| f.a == camera || f.b == camera);
    let Some(Failure { a, b, usable, why }) = of_camera else {
        let problem = format!("`{}` is joined to no other camera", name(camera));
        return Error::content(&project.path, "[[point]]", problem);
    };
    let picked = project.shared(*a, *b).len();
    if *usable < LEAST_SHARED_POINTS {
        let without = picks
            .iter()
            .find(|p| (p.camera == *a || p.camera == *b) && p.seen.is_none())
            .map_or(String::new(), |p| format!(" (none at [[point]] {}, {})", p.point + 1, name(p.camera)));
        let problem = format!(
            "`{}` and `{}` share {picked} points, but both have depth at only {usable} of them{without}; pick points \
             on textured things that the camera moved past",
            name(*a),
            name(*b)
        );
        return Error::content(&project.path, "[[point]]", problem);
    }
    if *why == FailureReason::OnALine {
        let problem = format!(
            "the points shared by `{}` and `{}` lie on a line, almost, which leaves a turn about it open; pick some well \
             beside it",
            name(*a),
            name(*b)
        );
        return Error::content(&project.path, "[[point]]", problem);
    }
    if *why == FailureReason::Mirrored {
        let problem = format!(
            "the points shared by `{}` and `{}` agree only when one of the two pictures is mirrored; film without mirroring",
            name(*a),
            name(*b)
        );
        return Error::content(&project.path, "[[point]]", problem);
    }
    let problem = format!(
        "no {LEAST_SHARED_POINTS} of the {usable} points shared by `{}` and `{}` agree with one another; check that \
         each is the same physical point in both images",
        name(*a),
        name(*b)
    );
    Error::content(&project.path, "[[point]]", problem)
}

/// Points with depth in both cameras: positions in `a` and in `b`.
fn shared(picks: &[LiftedPick], a: usize, b: usize) -> Vec<(Point3<f64>, Point3<f64>)> {
    picks
        .iter()
        .filter(|p| p.camera == a)
        .filter_map(|p| {
            let other = picks.iter().find(|q| q.camera == b && q.point == p.point)?;
            Some((p.seen?, other.seen?))
        })
        .collect()
}

/// Similarity on which most picks agree, from triples of them.
fn pair(
    shared: &[(Point3<f64>, Point3<f64>)],
) -> std::result::Result<(Similarity3<f64>, usize, f64), FailureReason> {
    let agreed = most_agreed(shared);
    if is_mirrored(shared, agreed.as_ref().map_or(0, |(_, inside)| inside.len())) {
        return Err(FailureReason::Mirrored);
    }
    let (similarity, inside) = agreed.ok_or(FailureReason::Disagree)?;
    // Fitted to all of them: where depths are bent, few agree yet.
    let (in_a, in_b): (Vec<_>, Vec<_>) = shared.iter().copied().unzip();
    if !is_wide(&in_a) && !is_wide(&in_b) {
        return Err(FailureReason::OnALine);
    }
    let mut spread: Vec<f64> = inside.iter().map(|i| distance(&shared[*i], &similarity)).collect();
    spread.sort_by(f64::total_cmp);
    let median = spread.get(spread.len() / 2).copied().ok_or(FailureReason::Disagree)?;
    Ok((similarity, inside.len(), median))
}

/// Tells whether clearly more picks agree once one of the two spaces is mirrored. Three always do as well as before: a
/// triangle is its mirror image, turned over.
fn is_mirrored(shared: &[(Point3<f64>, Point3<f64>)], agreeing: usize) -> bool {
    /// Number of picks beyond those that agree without.
    const CLEARLY: usize = 2;
    let mirrored: Vec<(Point3<f64>, Point3<f64>)> =
        shared.iter().map(|(a, b)| (*a, Point3::new(-b.x, b.y, b.z))).collect();
    let least = (agreeing + CLEARLY).max(LEAST_SHARED_POINTS + 1);
    shared.len() >= least && most_agreed(&mirrored).is_some_and(|(_, inside)| inside.len() >= least)
}

/// Similarity with the picks that agree with it; `None` if not even three do.
fn most_agreed(shared: &[(Point3<f64>, Point3<f64>)]) -> Option<(Similarity3<f64>, Vec<usize>)> {
    let mut best: Option<(f64, Vec<usize>)> = None;
    for triple in triples(shared.len()) {
        let Some(candidate) = fit(shared, &triple) else { continue };
        let distances: f64 = shared.iter().map(|points| distance(points, &candidate).min(AGREEMENT)).sum();
        if best.as_ref().is_none_or(|(least, _)| distances < *least) {
            best = Some((distances, agreeing(shared, &candidate)));
        }
    }
    let (_, mut inside) = best?;
    let mut similarity = None;
    // Refitting to all inliers of a triple enlarges their set.
    for _ in 0..3 {
        if inside.len() < LEAST_SHARED_POINTS {
            return None;
        }
        let refined = fit(shared, &inside)?;
        similarity = Some(refined);
        inside = agreeing(shared, &refined);
    }
    Some((similarity?, inside))
}

/// All triples of `n` points, or, where these are too many, random ones.
fn triples(n: usize) -> Vec<[usize; 3]> {
    if n < 3 {
        return Vec::new();
    }
    if n * (n - 1) * (n - 2) / 6 <= MOST_TRIPLES {
        return (0..n)
            .flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])))
            .collect();
    }
    let mut rng = Pcg64Mcg::seed_from_u64(0);
    (0..MOST_TRIPLES)
        .map(|_| {
            let drawn = rand::seq::index::sample(&mut rng, n, 3);
            [0, 1, 2].map(|k| drawn.index(k))
        })
        .collect()
}

fn fit(shared: &[(Point3<f64>, Point3<f64>)], chosen: &[usize]) -> Option<Similarity3<f64>> {
    let (a, b): (Vec<_>, Vec<_>) = chosen.iter().map(|i| shared[*i]).unzip();
    absolute_orientation::similarity(&b, &a).ok()
}

fn agreeing(shared: &[(Point3<f64>, Point3<f64>)], a_from_b: &Similarity3<f64>) -> Vec<usize> {
    (0..shared.len()).filter(|i| distance(&shared[*i], a_from_b) < AGREEMENT).collect()
}

/// Distance as a share of depth; the larger of both directions' shares, so that a small scale does not shrink it.
fn distance((a, b): &(Point3<f64>, Point3<f64>), a_from_b: &Similarity3<f64>) -> f64 {
    let gap = (a_from_b * b - a).norm();
    let depth = a.coords.norm().min(b.coords.norm() * a_from_b.scaling());
    gap / depth.max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn the_first_of_many_points_may_be_wrong() {
        let a_from_b = Similarity3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.2, -0.9, 0.4), 1.7);
        let mut shared: Vec<(Point3<f64>, Point3<f64>)> = (0..90)
            .map(|i| {
                let turn = 2.4 * f64::from(i);
                let b = Point3::new(turn.cos(), (1.7 * turn).sin(), 3.0 + (0.3 * turn).sin());
                (a_from_b * b, b)
            })
            .collect();
        shared[0].0 += Vector3::new(1.0, 1.0, -1.0);
        let (found, inside) = most_agreed(&shared).unwrap();
        assert!((found.to_homogeneous() - a_from_b.to_homogeneous()).norm() < 1e-9, "{found}");
        assert_eq!(inside, (1..90).collect::<Vec<_>>());
    }

    #[test]
    fn a_mirrored_picture_is_told_from_wrong_picks() {
        let a_from_b = Similarity3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.2, -0.9, 0.4), 1.7);
        let place = |i: u32| {
            let turn = 2.4 * f64::from(i);
            Point3::new(turn.cos(), (1.7 * turn).sin(), 3.0 + (0.8 * turn).sin())
        };
        let right: Vec<(Point3<f64>, Point3<f64>)> =
            (0..7).map(|i| (a_from_b * place(i), place(i))).collect();
        let mirrored: Vec<_> = right.iter().map(|(a, b)| (*a, Point3::new(-b.x, b.y, b.z))).collect();
        let wrong: Vec<_> = right.iter().zip((0..7).rev()).map(|((a, _), i)| (*a, place(i))).collect();
        assert!(pair(&right).is_ok());
        assert_eq!(pair(&mirrored).err(), Some(FailureReason::Mirrored));
        assert_ne!(pair(&wrong).err(), Some(FailureReason::Mirrored));
    }

    #[test]
    fn few_points_are_tried_in_all_triples() {
        assert!(triples(0).is_empty() && triples(2).is_empty());
        assert_eq!(triples(4), [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]);
        assert_eq!((triples(25).len(), triples(26).len()), (2300, MOST_TRIPLES));
        assert!(triples(60).iter().all(|[i, j, k]| i != j && j != k && i != k));
    }
}
