//! Picks proposed for a person to confirm: places that two cameras' reference images show.
//!
//! Cameras on a room's walls see the same things from sides too different for features to look alike, or for an epipolar
//! line to tell right from wrong. But each camera's capture has become a surface: keypoints have a place in space, and
//! flat things can be seen square on ([`flat`], [`landmarks`]). One similarity between the two spaces that many
//! keypoints agree on ([`alignment`]), which both surfaces and pictures bear out ([`evidence`]), tells which matches are
//! right; those are brought to a fraction of a pixel, and the few that lie farthest apart are proposed ([`spread`]).
//! Where nothing is borne out, nothing is proposed.

mod alignment;
mod evidence;
mod flat;
mod guided;
mod landmarks;
mod picture;
mod spread;
mod table;
#[cfg(test)]
mod tests;

use nalgebra::{Point2, Similarity3};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::Result;
use crate::features::Intensity;
use crate::surface::Surface;
use alignment::Alignment;
use evidence::Seen;
use guided::Match;
use landmarks::{Candidate, Landmarks};
pub use picture::draw;
pub use table::to_toml;

/// How picks are proposed.
#[derive(Debug, Clone, PartialEq)]
pub struct ProposalOptions {
    /// Points proposed a pair of cameras, at most.
    pub points: usize,
    /// How far a match may be off under the similarity, as a share of the image's width: captures bend their space.
    pub tolerance: f64,
    /// Fewer matches than this that agree are chance.
    pub least_agreeing: usize,
    /// More than this share of one surface standing in the way of the other speaks against a similarity.
    pub most_in_the_way: f64,
    /// Where surfaces meet, the pictures must correlate this well in the median …
    pub least_correlation: f64,
    /// … in this many places.
    pub least_compared: usize,
    /// A proposed point's own patches must correlate this well.
    pub point_correlation: f64,
    /// Half the side of these patches, pixels.
    pub patch_radius_px: i32,
    /// Seed of the random samples.
    pub seed: u64,
}

impl Default for ProposalOptions {
    fn default() -> Self {
        Self {
            points: 12,
            tolerance: 0.013,
            least_agreeing: 8,
            most_in_the_way: 0.2,
            least_correlation: 0.35,
            least_compared: 40,
            point_correlation: 0.75,
            patch_radius_px: 6,
            seed: 0,
        }
    }
}

impl ProposalOptions {
    fn tolerance_px(&self, seen: [&Seen<'_>; 2]) -> f64 {
        let [a, b] = seen.map(|s| s.surface.intrinsics.width);
        self.tolerance * f64::from(a.min(b))
    }
}

/// A place that two cameras see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proposal {
    /// Indices of the cameras.
    pub cameras: [usize; 2],
    /// In their pinhole pictures.
    pub pixels: [Point2<f64>; 2],
    /// Correlation of both pictures there, surfaces' slants undone.
    pub correlation: f64,
}

/// What is known of two cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Their indices.
    pub cameras: [usize; 2],
    /// `None` when nothing that both see was borne out.
    pub found: Option<Found>,
}

/// What two cameras have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// From the second camera's space to the first's.
    pub first_from_second: Similarity3<f64>,
    /// Keypoints that look alike and agree on it.
    pub agreeing: usize,
    /// Corners of one picture that it leads to in the other.
    pub matches: usize,
    /// Correlation of both pictures where the surfaces meet, in the median.
    pub correlation: f64,
    /// The best of them.
    pub proposals: Vec<Proposal>,
}

/// Proposes picks for all pairs of cameras.
///
/// # Errors
/// When OpenCV refuses.
pub fn propose(surfaces: &[&Surface], options: &ProposalOptions) -> Result<Vec<Pair>> {
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    let mut landmarks = Vec::with_capacity(surfaces.len());
    for surface in surfaces {
        landmarks.push(Landmarks::of(surface, &mut rng)?);
    }
    let seen: Vec<Seen<'_>> = surfaces
        .iter()
        .map(|surface| Seen { surface, intensity: Intensity::new(&surface.picture) })
        .collect();
    let mut pairs = Vec::new();
    for a in 0..surfaces.len() {
        for b in a + 1..surfaces.len() {
            let candidates = landmarks[a].candidates(&landmarks[b]);
            let found = compare([&seen[a], &seen[b]], [a, b], &candidates, options, &mut rng)?;
            pairs.push(Pair { cameras: [a, b], found });
        }
    }
    Ok(pairs)
}

/// Where two surfaces, which lie to each other as `first_from_second` says, show the same: both pixels, in the pinhole
/// pictures, of at most `count` places that lie far apart. None where surfaces and pictures do not bear that out.
///
/// # Errors
/// When OpenCV refuses.
pub(crate) fn in_common(
    surfaces: [&Surface; 2],
    first_from_second: &Similarity3<f64>,
    count: usize,
) -> Result<Vec<[Point2<f64>; 2]>> {
    let options = ProposalOptions::default();
    let seen = surfaces.map(|surface| Seen { surface, intensity: Intensity::new(&surface.picture) });
    let seen = [&seen[0], &seen[1]];
    if borne_out(seen, first_from_second, &options).is_none() {
        return Ok(Vec::new());
    }
    let (_, matches) = guided::matches(seen, first_from_second, options.tolerance_px(seen), &options)?;
    Ok(spread::choose(&matches, count).iter().map(|m| m.pixels).collect())
}

/// The correlation of both pictures under a similarity, in the median, where these and the surfaces bear it out.
fn borne_out(
    seen: [&Seen<'_>; 2],
    first_from_second: &Similarity3<f64>,
    options: &ProposalOptions,
) -> Option<f64> {
    let told = evidence::of(seen, first_from_second);
    tracing::debug!("{told:?}");
    let speaks_for_it = told.in_the_way <= options.most_in_the_way
        && told.correlation >= options.least_correlation
        && told.compared >= options.least_compared;
    speaks_for_it.then_some(told.correlation)
}

fn compare(
    seen: [&Seen<'_>; 2],
    cameras: [usize; 2],
    candidates: &[Candidate],
    options: &ProposalOptions,
    rng: &mut Pcg64Mcg,
) -> Result<Option<Found>> {
    let lenses = seen.map(|s| &s.surface.intrinsics);
    let tolerance_px = options.tolerance_px(seen);
    let alignments = alignment::find(candidates, lenses, tolerance_px, options.least_agreeing, rng);
    tracing::debug!("{cameras:?}: {} candidates, {} alignments", candidates.len(), alignments.len());
    for Alignment { first_from_second, agreeing } in alignments {
        let Some(correlation) = borne_out(seen, &first_from_second, options) else { continue };
        let (first_from_second, matches) = guided::matches(seen, &first_from_second, tolerance_px, options)?;
        tracing::debug!("{cameras:?}: {} agree, {} corners are found", agreeing.len(), matches.len());
        let chosen = spread::choose(&matches, options.points);
        if spread::is_wide(&chosen) {
            let proposal = |m: &Match| Proposal { cameras, pixels: m.pixels, correlation: m.correlation };
            return Ok(Some(Found {
                first_from_second,
                agreeing: agreeing.len(),
                matches: matches.len(),
                correlation,
                proposals: chosen.iter().map(proposal).collect(),
            }));
        }
    }
    Ok(None)
}

impl Found {
    /// How far one camera's pick is from where the other's depth puts it, pixels of the pinhole pictures: the smaller of both
    /// ways, since a depth read at an edge may be another surface's. `None` where neither has a depth.
    pub fn miss_px(&self, [a, b]: [&Surface; 2], [p, q]: [Point2<f64>; 2]) -> Option<f64> {
        let miss = |from: &Surface,
                    onto: &Surface,
                    onto_from: &Similarity3<f64>,
                    p: &Point2<f64>,
                    q: &Point2<f64>| {
            let there = onto_from * from.point_at(p)?;
            let pixel: Point2<f64> = onto.intrinsics.project(&there).filter(|_| there.z > 0.0)?;
            Some((pixel - q).norm())
        };
        let there = miss(a, b, &self.first_from_second.inverse(), &p, &q);
        let back = miss(b, a, &self.first_from_second, &q, &p);
        there.into_iter().chain(back).min_by(f64::total_cmp)
    }
}
