//! Removal of small isolated patches of depth: usually mistakes, and in free space they would hide people.

use super::PlaneOptions;
use crate::surface::Surface;

/// Discards patches of continuous depth that are too small.
pub(super) fn remove(surface: &mut Surface, options: &PlaneOptions) {
    let (width, height) = (surface.width(), surface.height());
    let least = (options.speckle_share * (width * height) as f32) as usize;
    let mut visited = vec![false; width * height];
    let mut patch = Vec::new();
    for start in 0..width * height {
        if visited[start] || surface.depth[start] <= 0.0 {
            continue;
        }
        visited[start] = true;
        patch.clear();
        patch.push(start);
        let mut next = 0;
        while let Some(&i) = patch.get(next) {
            next += 1;
            for j in neighbours(i, width, height) {
                let continuous = surface.depth[j] > 0.0
                    && (surface.depth[j] / surface.depth[i] - 1.0).abs() < 0.5 * options.edge;
                if !visited[j] && continuous {
                    visited[j] = true;
                    patch.push(j);
                }
            }
        }
        if patch.len() < least {
            for i in &patch {
                surface.forget(*i);
            }
        }
    }
}

/// Pixels left, right, above and below.
pub(super) fn neighbours(i: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (i % width, i / width);
    [
        (x > 0).then(|| i - 1),
        (x + 1 < width).then_some(i + 1),
        (y > 0).then(|| i - width),
        (y + 1 < height).then_some(i + width),
    ]
    .into_iter()
    .flatten()
}
