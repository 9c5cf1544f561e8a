//! First similarities: every pair's by Horn from its most consistent picks, chained along the best-joined pairs.

use calib::absolute_orientation;
use nalgebra::{Point3, Similarity3};

use super::Pick;
use crate::project::{LEAST_SHARED_POINTS, Project};
use crate::{Error, Result};

/// A similarity between two cameras and how many picks support it.
struct Edge {
    a: usize,
    b: usize,
    a_from_b: Similarity3<f64>,
    support: usize,
    /// Median distance of the supporting picks as a share of their depth.
    spread: f64,
}

/// Two picks of one point agree if they fall together to within this share of their depth.
const AGREEMENT: f64 = 0.06;
/// Triples tried for a pair; all of them up to 25 points.
const MOST_TRIPLES: usize = 2300;

/// `common_from_camera` of each camera, the first the identity.
pub(super) fn chain(project: &Project, picks: &[Pick], cameras: usize) -> Result<Vec<Similarity3<f64>>> {
    let mut edges = Vec::new();
    let mut failures = Vec::new();
    for a in 0..cameras {
        for b in a + 1..cameras {
            let shared = shared(picks, a, b);
            if project.shared(a, b).len() < LEAST_SHARED_POINTS {
                continue;
            }
            match pair(&shared) {
                Some((a_from_b, support, spread)) => edges.push(Edge { a, b, a_from_b, support, spread }),
                None => failures.push((a, b, shared.len())),
            }
        }
    }
    // The strongest pairs first, like Prim's tree: most agreeing picks, then the tightest.
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
        .map(|(camera, pose)| pose.ok_or_else(|| unjoined(project, picks, &failures, camera)))
        .collect()
}

fn unjoined(project: &Project, picks: &[Pick], failures: &[(usize, usize, usize)], camera: usize) -> Error {
    let name = |i: usize| &project.cameras[i].name;
    let Some((a, b, usable)) = failures.iter().find(|(a, b, _)| *a == camera || *b == camera) else {
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
    let problem = format!(
        "no {LEAST_SHARED_POINTS} of the {usable} points shared by `{}` and `{}` agree with one another; check that \
         each is the same physical point in both images",
        name(*a),
        name(*b)
    );
    Error::content(&project.path, "[[point]]", problem)
}

/// Points seen with depth by both: positions in `a` and in `b`.
fn shared(picks: &[Pick], a: usize, b: usize) -> Vec<(Point3<f64>, Point3<f64>)> {
    picks
        .iter()
        .filter(|p| p.camera == a)
        .filter_map(|p| {
            let other = picks.iter().find(|q| q.camera == b && q.point == p.point)?;
            Some((p.seen?, other.seen?))
        })
        .collect()
}

/// The similarity that most picks agree on, from all triples; `None` if not even three do.
fn pair(shared: &[(Point3<f64>, Point3<f64>)]) -> Option<(Similarity3<f64>, usize, f64)> {
    let n = shared.len();
    let mut best: Option<(usize, f64, Vec<usize>)> = None;
    let triples = (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])));
    for triple in triples.take(MOST_TRIPLES) {
        let Some(candidate) = fit(shared, &triple) else { continue };
        let inside = agreeing(shared, &candidate);
        let distances: f64 = (0..n).map(|i| distance(&shared[i], &candidate).min(AGREEMENT)).sum();
        if best.as_ref().is_none_or(|(_, least, _)| distances < *least) {
            best = Some((inside.len(), distances, inside));
        }
    }
    let (_, _, mut inside) = best?;
    let mut similarity = None;
    // The inliers of a triple are enlarged by refitting to all of them.
    for _ in 0..3 {
        if inside.len() < LEAST_SHARED_POINTS {
            return None;
        }
        let refined = fit(shared, &inside)?;
        similarity = Some(refined);
        inside = agreeing(shared, &refined);
    }
    let similarity = similarity?;
    let mut spread: Vec<f64> = inside.iter().map(|i| distance(&shared[*i], &similarity)).collect();
    spread.sort_by(f64::total_cmp);
    let median = spread.get(spread.len() / 2).copied()?;
    Some((similarity, inside.len(), median))
}

fn fit(shared: &[(Point3<f64>, Point3<f64>)], chosen: &[usize]) -> Option<Similarity3<f64>> {
    let (a, b): (Vec<_>, Vec<_>) = chosen.iter().map(|i| shared[*i]).unzip();
    absolute_orientation::similarity(&b, &a).ok()
}

fn agreeing(shared: &[(Point3<f64>, Point3<f64>)], a_from_b: &Similarity3<f64>) -> Vec<usize> {
    (0..shared.len()).filter(|i| distance(&shared[*i], a_from_b) < AGREEMENT).collect()
}

/// Distance as a share of depth; the larger of both directions' shares, so that scale cannot shrink it away.
fn distance((a, b): &(Point3<f64>, Point3<f64>), a_from_b: &Similarity3<f64>) -> f64 {
    let gap = (a_from_b * b - a).norm();
    let depth = a.coords.norm().min(b.coords.norm() * a_from_b.scaling());
    gap / depth.max(1e-12)
}
