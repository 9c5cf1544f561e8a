//! The doubtful rims of near things. A patch beside an edge is matched by the near side's texture, so near surfaces
//! come out fatter than they are by up to the patch's radius. Those rims are forgotten; the picture's own edges
//! then decide whose they are.

use super::PlaneOptions;
use crate::surface::Surface;

/// Forgets the near side of depth edges, but never all of something thin.
pub(super) fn forget(surface: &mut Surface, options: &PlaneOptions) {
    let (width, height) = (surface.width(), surface.height());
    let radius = options.rim_px as isize;
    let disc: Vec<(isize, isize)> = (-radius..=radius)
        .flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy)))
        .filter(|(dx, dy)| dx * dx + dy * dy <= radius * radius)
        .collect();
    let inside = |x: isize, y: isize| x >= 0 && y >= 0 && x < width as isize && y < height as isize;
    let depth = surface.depth.clone();
    let on_rim = |i: usize| -> bool {
        let (x, y) = ((i % width) as isize, (i / width) as isize);
        disc.iter().any(|(dx, dy)| {
            let (nx, ny) = (x + dx, y + dy);
            inside(nx, ny) && {
                let other = depth[ny as usize * width + nx as usize];
                other > depth[i] * (1.0 + slope_allowance(options.edge, *dx, *dy))
            }
        })
    };
    let rim: Vec<bool> = (0..depth.len()).map(|i| depth[i] > 0.0 && on_rim(i)).collect();
    // What no unrimmed pixel of the same depth is near to is thin: it stays as it is.
    let has_core = |i: usize| -> bool {
        let (x, y) = ((i % width) as isize, (i / width) as isize);
        disc.iter().any(|(dx, dy)| {
            let (nx, ny) = (x + dx, y + dy);
            inside(nx, ny) && {
                let j = ny as usize * width + nx as usize;
                depth[j] > 0.0 && !rim[j] && (depth[j] / depth[i] - 1.0).abs() < options.edge
            }
        })
    };
    let doubtful: Vec<usize> = (0..depth.len()).filter(|i| rim[*i] && has_core(*i)).collect();
    for i in doubtful {
        surface.forget(i);
    }
}

/// A slanted surface gets farther, too: more is allowed the farther away the neighbour is.
fn slope_allowance(edge: f32, dx: isize, dy: isize) -> f32 {
    edge + 0.01 * ((dx * dx + dy * dy) as f32).sqrt()
}
