//! Correspondence of tracks and people in each frame.
//!
//! K. Bernardin and R. Stiefelhagen, "Evaluating multiple object tracking performance: the CLEAR MOT metrics", EURASIP
//! J. Image and Video Processing 2008, section 2.3: a pair of the previous frame is kept as long as it is valid, the
//! rest is assigned for the greatest total similarity. Both are one assignment, as in TrackEval: keeping a pair
//! outweighs all gains in similarity. A frame without truth or without tracks leaves the pairs unchanged.

use super::assignment::best;
use super::grid::PairTable;
use super::instant::{Instant, RowMatch, SIMILARITY_TOLERANCE};

/// Weight of keeping a pair, in units of similarity: more than any frame's similarities together.
const KEPT: f64 = 1000.0;

/// Computes the matches of every instant.
pub(super) fn correspond(instants: &mut [Instant], people: usize, threshold: f64) {
    let mut previous: Vec<Option<usize>> = vec![None; people];
    for instant in instants {
        if instant.truth.is_empty() || instant.tracks.is_empty() {
            continue;
        }
        let weights = PairTable::from_fn(instant.truth.len(), instant.tracks.len(), |i, j| {
            let similarity = instant.similarity.at(i, j);
            if similarity < threshold - SIMILARITY_TOLERANCE {
                return 0.0;
            }
            let kept = previous[instant.truth[i]] == Some(instant.tracks[j]);
            similarity + if kept { KEPT } else { 0.0 }
        });
        instant.matches = best(&weights)
            .into_iter()
            .map(|(i, j)| RowMatch {
                person: instant.truth[i],
                track: instant.tracks[j],
                similarity: instant.similarity.at(i, j),
                distance: instant.distance.at(i, j),
            })
            .collect();
        previous.fill(None);
        for found in &instant.matches {
            previous[found.person] = Some(found.track);
        }
    }
}
