//! Depths measured at picks that belong to another surface than the pick.
//!
//! A place that is seen between the legs of a chair is measured at the legs, with confidence. A few such depths do no harm; where
//! they are many, their camera's scale becomes a mean of right and wrong ones, and the rays of the picks meet all the same. Depths that
//! agree on a scale are then tried alone, each group of them, and the one is taken with which far more of the surfaces coincide with
//! pictures that are alike.

use super::{LiftedPick, MergeOptions, MergeReport, Merged, pairs, refine};
use crate::project::LEAST_SHARED_POINTS;
use crate::proposals;
use crate::surface::Surface;

/// Largest ratio of the scales on which the depths of a group agree.
const AGREEMENT: f64 = 1.02;
/// Share of a camera's depths that are enough, where they agree, for the others to be outliers that do no harm.
const MOST: f64 = 0.67;
/// Most groups that are tried.
const MOST_TRIED: usize = 20;
/// Factor by which another group of depths must be better supported.
const CLEARLY: f64 = 2.0;

/// The same cameras; or, where the depths of one do not agree on its scale, those by the group of them that the surfaces support. One
/// camera after the other, in their order: each is tried beside the others as they then stand.
pub(super) fn leave_out(
    picks: &[LiftedPick],
    (merged, report): (Merged, MergeReport),
    surfaces: &[Surface],
    options: &MergeOptions,
) -> (Merged, MergeReport) {
    let mut taken = (merged, report);
    for camera in 0..surfaces.len() {
        let groups = groups(picks, &taken.0, camera);
        if groups.is_empty() {
            continue;
        }
        let mut most = CLEARLY * support(camera, &taken.0, surfaces);
        let so_far = taken.clone();
        for foreign in groups {
            let mut foreign_depths = so_far.1.foreign_depths.clone();
            foreign_depths.extend(foreign.into_iter().map(|point| (point, camera)));
            let mut others = picks.to_vec();
            for pick in &mut others {
                pick.forget_foreign_depth(&foreign_depths);
            }
            let start = &so_far.0.common_from_camera;
            let (merged, report) = refine::refine(&others, start, surfaces, options);
            let supported = support(camera, &merged, surfaces);
            if supported > most {
                most = supported;
                taken = (merged, MergeReport { foreign_depths, ..report });
            }
        }
    }
    taken
}

impl LiftedPick {
    /// Forgets its depth if that belongs to another surface; `foreign` has numbers of points, from 1, and indices of cameras.
    pub(super) fn forget_foreign_depth(&mut self, foreign: &[(usize, usize)]) {
        if foreign.contains(&(self.point + 1, self.camera)) {
            (self.seen, self.depth) = (None, None);
            self.frames.clear();
        }
    }
}

/// Support of the place of a camera by its surface and picture beside those of the others.
fn support(camera: usize, merged: &Merged, surfaces: &[Surface]) -> f64 {
    let of_pair = |[a, b]: [usize; 2]| {
        let first_from_second = merged.common_from_camera[a].inverse() * merged.common_from_camera[b];
        proposals::support([&surfaces[a], &surfaces[b]], &first_from_second)
    };
    pairs(surfaces.len()).filter(|pair| pair.contains(&camera)).map(of_pair).sum()
}

/// Groups of a camera's depths that agree on its scale, the largest first; they may overlap. Of each the numbers of the points whose
/// depths are not in it. None where most of the depths agree.
fn groups(picks: &[LiftedPick], merged: &Merged, camera: usize) -> Vec<Vec<usize>> {
    let camera_from_common = merged.common_from_camera[camera].inverse();
    let stretch = |pick: &LiftedPick| {
        let stretch = (camera_from_common * merged.points[pick.point]?).z / pick.seen?.z;
        (stretch > 0.0 && stretch.is_finite()).then_some((stretch, pick.point + 1))
    };
    let mut stretches: Vec<(f64, usize)> =
        picks.iter().filter(|pick| pick.camera == camera).filter_map(stretch).collect();
    stretches.sort_by(|a, b| a.0.total_cmp(&b.0));
    let agreeing = |first: usize| {
        let most = AGREEMENT * stretches[first].0;
        stretches[first..].iter().take_while(|(stretch, _)| *stretch <= most).count()
    };
    let mut ranges: Vec<(usize, usize)> =
        (0..stretches.len()).map(|first| (first, agreeing(first))).collect();
    ranges.sort_by_key(|(first, count)| (std::cmp::Reverse(*count), *first));
    let enough = MOST * stretches.len() as f64;
    if ranges.first().is_some_and(|(_, count)| *count as f64 >= enough) {
        return Vec::new();
    }
    let ranges = ranges.into_iter().filter(|(_, count)| *count >= LEAST_SHARED_POINTS);
    let others = |(first, count): (usize, usize)| {
        let others = stretches[..first].iter().chain(&stretches[first + count..]);
        others.map(|(_, number)| *number).collect()
    };
    ranges.take(MOST_TRIED).map(others).collect()
}
