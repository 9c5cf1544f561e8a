//! Picks proposed for a person to confirm: points visible in two cameras' reference images.
//!
//! Cameras on a room's walls see the same things from sides too different for features to look alike, or for an
//! epipolar line to select the right match. But each camera's capture has become a surface: keypoints have positions in
//! space, and planes can be rectified ([`flat`], [`landmarks`]). A similarity between the two spaces on which many
//! keypoints agree ([`alignment`]), confirmed by both surfaces and pictures ([`evidence`]), selects the right matches;
//! those are refined to a fraction of a pixel, and the few that lie farthest apart are proposed ([`spread`]). Without
//! confirmation, nothing is proposed.

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
use alignment::CandidateAlignment;
use evidence::{ComparedView, SimilarityEvidence};
use guided::GuidedMatch;
use landmarks::{Candidate, Landmarks};
pub use picture::draw;
pub use table::to_toml;

/// Options of the proposals.
#[derive(Debug, Clone, PartialEq)]
pub struct ProposalOptions {
    /// Largest number of points proposed for a pair of cameras.
    pub points: usize,
    /// Largest error of a match under the similarity, as a share of the image's width: captures bend their space.
    pub tolerance: f64,
    /// Least number of agreeing matches; fewer may be chance.
    pub least_agreeing: usize,
    /// Largest share of one surface that obstructs the other camera's view.
    pub most_in_the_way: f64,
    /// Least median correlation of the pictures where surfaces coincide …
    pub least_correlation: f64,
    /// … and least number of places compared.
    pub least_compared: usize,
    /// Least correlation of a proposed point's own patches.
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
    fn tolerance_px(&self, seen: [&ComparedView<'_>; 2]) -> f64 {
        let [a, b] = seen.map(|s| s.surface.intrinsics.width);
        self.tolerance * f64::from(a.min(b))
    }
}

/// A point visible to two cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proposal {
    /// Indices of the cameras.
    pub cameras: [usize; 2],
    /// Pixels in their pinhole pictures.
    pub pixels: [Point2<f64>; 2],
    /// Correlation of both pictures there, with the surfaces' slant removed.
    pub correlation: f64,
}

/// Result for two cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPair {
    /// Indices of the cameras.
    pub cameras: [usize; 2],
    /// Correspondence of the two; `None` when nothing was confirmed.
    pub found: Option<Correspondence>,
}

/// Confirmed correspondence of two cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct Correspondence {
    /// Similarity from the second camera's space to the first's.
    pub first_from_second: Similarity3<f64>,
    /// Number of matched keypoints that agree on it.
    pub agreeing: usize,
    /// Number of matches guided by it.
    pub matches: usize,
    /// Median correlation of both pictures where the surfaces coincide.
    pub correlation: f64,
    /// Best matches.
    pub proposals: Vec<Proposal>,
}

/// Proposes picks for all pairs of cameras.
///
/// # Errors
/// [`crate::error::Error::Calib`] when OpenCV refuses.
pub fn propose(surfaces: &[&Surface], options: &ProposalOptions) -> Result<Vec<CameraPair>> {
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    let mut landmarks = Vec::with_capacity(surfaces.len());
    for surface in surfaces {
        landmarks.push(Landmarks::of(surface, &mut rng)?);
    }
    let seen: Vec<ComparedView<'_>> = surfaces
        .iter()
        .map(|surface| ComparedView { surface, intensity: Intensity::new(&surface.picture) })
        .collect();
    let mut pairs = Vec::new();
    for a in 0..surfaces.len() {
        for b in a + 1..surfaces.len() {
            let candidates = landmarks[a].candidates(&landmarks[b]);
            let found = compare([&seen[a], &seen[b]], [a, b], &candidates, options, &mut rng)?;
            pairs.push(CameraPair { cameras: [a, b], found });
        }
    }
    Ok(pairs)
}

/// Evidence of both surfaces and pictures for the relative pose `first_from_second`.
pub(crate) fn evidence_of(
    surfaces: [&Surface; 2],
    first_from_second: &Similarity3<f64>,
) -> SimilarityEvidence {
    let seen = surfaces.map(|surface| ComparedView { surface, intensity: Intensity::new(&surface.picture) });
    evidence::of([&seen[0], &seen[1]], first_from_second)
}

/// Indices of the pixels of one picture that are found in another, with their pixels there.
pub(crate) type FoundPixels = Vec<(usize, Point2<f64>)>;

/// Number of places at which two surfaces coincide, times the correlation of their pictures there; 0 where surfaces and pictures do
/// not confirm the relative pose `first_from_second`.
pub(crate) fn support(surfaces: [&Surface; 2], first_from_second: &Similarity3<f64>) -> f64 {
    let told = evidence_of(surfaces, first_from_second);
    if told.confirms(&ProposalOptions::default()) { told.compared as f64 * told.correlation } else { 0.0 }
}

/// Pixels of either picture searched in the other, with the relative pose `first_from_second`: for each picture the index of
/// each pixel that is found, and its pixel in the other picture. `None` without a search, where surfaces and pictures do not confirm
/// the pose.
///
/// # Errors
/// [`crate::error::Error::Calib`] when OpenCV refuses.
pub(crate) fn found_in_both(
    surfaces: [&Surface; 2],
    first_from_second: &Similarity3<f64>,
    pixels: [&[Point2<f64>]; 2],
) -> Result<Option<[FoundPixels; 2]>> {
    let options = ProposalOptions::default();
    let seen = surfaces.map(|surface| ComparedView { surface, intensity: Intensity::new(&surface.picture) });
    let seen = [&seen[0], &seen[1]];
    if confirmed(seen, first_from_second, &options).is_none() {
        return Ok(None);
    }
    let tolerance_px = options.tolerance_px(seen);
    let (similarity, matches) = guided::matches(seen, first_from_second, tolerance_px, &options)?;
    let mut off: Vec<f64> = matches.iter().map(|m| m.off_px).collect();
    off.sort_by(f64::total_cmp);
    let Some(worst) = off.last() else { return Ok(Some([Vec::new(), Vec::new()])) };
    let there = guided::followed(seen, &similarity, pixels[0], *worst, &options);
    let back = guided::followed([seen[1], seen[0]], &similarity.inverse(), pixels[1], *worst, &options);
    Ok(Some([there, back]))
}

/// Median correlation of both pictures under a similarity, if pictures and surfaces confirm it.
fn confirmed(
    seen: [&ComparedView<'_>; 2],
    first_from_second: &Similarity3<f64>,
    options: &ProposalOptions,
) -> Option<f64> {
    let told = evidence::of(seen, first_from_second);
    tracing::debug!("{told:?}");
    told.confirms(options).then_some(told.correlation)
}

impl SimilarityEvidence {
    fn confirms(&self, options: &ProposalOptions) -> bool {
        self.in_the_way <= options.most_in_the_way
            && self.correlation >= options.least_correlation
            && self.compared >= options.least_compared
    }
}

fn compare(
    seen: [&ComparedView<'_>; 2],
    cameras: [usize; 2],
    candidates: &[Candidate],
    options: &ProposalOptions,
    rng: &mut Pcg64Mcg,
) -> Result<Option<Correspondence>> {
    let lenses = seen.map(|s| &s.surface.intrinsics);
    let tolerance_px = options.tolerance_px(seen);
    let alignments = alignment::find(candidates, lenses, tolerance_px, options.least_agreeing, rng);
    tracing::debug!("{cameras:?}: {} candidates, {} alignments", candidates.len(), alignments.len());
    for CandidateAlignment { first_from_second, agreeing } in alignments {
        let Some(correlation) = confirmed(seen, &first_from_second, options) else { continue };
        let (first_from_second, matches) = guided::matches(seen, &first_from_second, tolerance_px, options)?;
        tracing::debug!("{cameras:?}: {} agree, {} corners are found", agreeing.len(), matches.len());
        let chosen = spread::choose(&matches, options.points);
        if spread::is_wide(&chosen) {
            let proposal =
                |m: &GuidedMatch| Proposal { cameras, pixels: m.pixels, correlation: m.correlation };
            return Ok(Some(Correspondence {
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

impl Correspondence {
    /// Distance of one camera's pick from its position by the other's depth, pixels of the pinhole pictures: the
    /// smaller of both directions, since a depth measured at an edge may belong to another surface. `None` where
    /// neither has a depth.
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
