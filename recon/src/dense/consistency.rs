//! Reliability of depths: agreement with the depth maps of several key frames, which are matched independently.

use rayon::prelude::*;

use super::DenseOptions;
use super::patchmatch::DepthProblem;
use super::support::SupportMap;

/// Number of sources whose own depth map agrees with each pixel; 0 where too few agree or the patch does not correlate.
pub(super) fn agreeing(problem: &DepthProblem<'_>, map: &SupportMap, options: &DenseOptions) -> Vec<u8> {
    (0..map.supports.len())
        .into_par_iter()
        .map(|i| {
            if map.costs[i] > options.largest_cost {
                return 0;
            }
            let (u, v) = ((i % map.width) as f32, (i / map.width) as f32);
            let agree = problem
                .sources
                .iter()
                .filter_map(|s| s.guide.as_ref()?.return_error_px(&s.pair, u, v, map.supports[i].w))
                .filter(|error| *error < options.agreement_px)
                .count();
            if agree < options.least_agreeing { 0 } else { agree.min(u8::MAX as usize) as u8 }
        })
        .collect()
}
