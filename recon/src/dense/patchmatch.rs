//! PatchMatch multi-view stereo: a random plane for each pixel, and propagation of good planes to neighbours.
//!
//! After M. Bleyer, C. Rhemann, C. Rother, "PatchMatch stereo" (BMVC 2011: slanted supports), S. Galliani, K. Lasinger,
//! K. Schindler, "Massively parallel multiview stereopsis by surface normal diffusion" (ICCV 2015: red-black
//! propagation, best-K views) and Q. Xu, W. Tao, "Multi-scale geometric consistency guided multi-view stereo" (CVPR
//! 2019: propagation of the best hypothesis of each region; geometric consistency across views). Half of the pixels,
//! like a chessboard's white squares, are improved from the other half, which stays unchanged meanwhile: rows go in
//! parallel, and the result does not depend on the threads. Each pixel draws from its own random numbers.

use rayon::prelude::*;

use super::level::{PyramidLevel, ViewMapping};
use super::ncc::WORST;
use super::patch::{StereoPatch, Weights};
use super::support::{Support, SupportMap};

/// A view in which hypotheses are evaluated.
pub(super) struct Source<'a> {
    pub(super) image: &'a PyramidLevel,
    pub(super) pair: ViewMapping,
    /// Depth of the source, once it has been estimated.
    pub(super) guide: Option<Guide<'a>>,
}

impl Source<'_> {
    /// Cost of a hypothesis in one view, geometric disagreement included where the view has depth.
    fn cost(&self, patch: &StereoPatch, x: usize, y: usize, support: &Support) -> f32 {
        self.cost_from(self.least_cost(x, y, support), patch, support)
    }

    /// Lower bound of a hypothesis's cost: the geometric disagreement alone, 0 where the view has no depth.
    fn least_cost(&self, x: usize, y: usize, support: &Support) -> f32 {
        let Some(guide) = &self.guide else { return 0.0 };
        let error = guide.return_error_px(&self.pair, x as f32, y as f32, support.w);
        GEOMETRIC_WEIGHT * error.unwrap_or(GEOMETRIC_CAP_PX).min(GEOMETRIC_CAP_PX)
    }

    /// [`Self::cost`] for a known lower bound.
    fn cost_from(&self, least: f32, patch: &StereoPatch, support: &Support) -> f32 {
        (patch.cost(support, self.image, &self.pair) + least).min(WORST)
    }
}

/// A source's depth map, for geometric consistency.
pub(super) struct Guide<'a> {
    pub(super) map: &'a SupportMap,
    /// Pixels of `map` a pixel of the source image.
    pub(super) scale: f32,
    /// Mapping from pixels of `map` back into the reference image.
    pub(super) back: ViewMapping,
}

impl Guide<'_> {
    /// Distance between (u, v) and the reprojection of the source's own surface, in reference pixels, looked up at the
    /// image of the point at inverse depth `w`. `None` where the source has no depth.
    pub(super) fn return_error_px(&self, pair: &ViewMapping, u: f32, v: f32, w: f32) -> Option<f32> {
        let [hx, hy, hz] = pair.map(u, v, w);
        if hz <= 1e-6 {
            return None;
        }
        let inverse = 1.0 / hz;
        let x = (hx * inverse + 0.5) * self.scale - 0.5;
        let y = (hy * inverse + 0.5) * self.scale - 0.5;
        let (last_x, last_y) = (self.map.width as f32 - 1.0, self.map.height as f32 - 1.0);
        if !(x >= 0.0 && y >= 0.0 && x <= last_x && y <= last_y) {
            return None;
        }
        let (px, py) = ((x + 0.5) as usize, (y + 0.5) as usize);
        let support = self.map.supports[py * self.map.width + px];
        let seen = support.moved(x - px as f32, y - py as f32);
        let [bx, by, bz] = self.back.map(x, y, seen.w);
        if bz <= 1e-6 {
            return None;
        }
        let (du, dv) = (bx / bz - u, by / bz - v);
        Some((du * du + dv * dv).sqrt())
    }
}

/// Estimation problem of one depth map.
pub(super) struct DepthProblem<'a> {
    pub(super) reference: &'a PyramidLevel,
    pub(super) sources: Vec<Source<'a>>,
    /// Smallest and largest inverse depth.
    pub(super) range: (f32, f32),
    /// Change of inverse depth that shifts a pixel by one in the source with the largest shift.
    pub(super) step: f32,
    /// Number of sources, the best ones, that decide a hypothesis's cost.
    pub(super) best_views: usize,
    /// Excess of a hypothesis's cost in the most informative views above which the others are skipped.
    pub(super) catching_up: f32,
    /// Difference in grey levels at which a neighbour's weight in a patch falls to 1/e.
    pub(super) color_sigma: f32,
    /// Whether patches alone decide, the other views' depths being unknown: hypotheses then also come from far regions and at random.
    pub(super) is_photometric: bool,
    pub(super) iterations: usize,
    pub(super) seed: u64,
}

/// Cost of a pixel of geometric disagreement, and the disagreement at which it stops growing.
const GEOMETRIC_WEIGHT: f32 = 0.15;
const GEOMETRIC_CAP_PX: f32 = 3.0;

impl DepthProblem<'_> {
    /// Estimates the map, from random hypotheses or from `start`.
    pub(super) fn solve(&self, start: Option<SupportMap>) -> SupportMap {
        let (width, height) = (self.reference.width, self.reference.height);
        let table = Weights::new(self.color_sigma);
        let mut map = start.unwrap_or_else(|| {
            let supports = (0..width * height).map(|i| self.draw(i)).collect();
            SupportMap { width, height, supports, costs: Vec::new() }
        });
        let mut known: Vec<Costs> = (0..height)
            .into_par_iter()
            .flat_map_iter(|y| {
                let (map, table) = (&map, &table);
                (0..width).map(move |x| {
                    let patch = StereoPatch::new(self.reference, x, y, table);
                    self.choose_views(&patch, x, y, &[(map.supports[y * width + x], None)]).1[0]
                })
            })
            .collect();
        map.costs = known.iter().map(|costs| costs.mean).collect();
        for iteration in 0..self.iterations {
            for colour in 0..2 {
                let rows: Vec<Vec<(Support, Costs)>> = (0..height)
                    .into_par_iter()
                    .map(|y| {
                        ((y + colour) % 2..width)
                            .step_by(2)
                            .map(|x| self.improve(&map, &known[y * width + x], x, y, iteration, &table))
                            .collect()
                    })
                    .collect();
                for (y, row) in rows.into_iter().enumerate() {
                    for (x, (support, costs)) in ((y + colour) % 2..width).step_by(2).zip(row) {
                        map.supports[y * width + x] = support;
                        map.costs[y * width + x] = costs.mean;
                        known[y * width + x] = costs;
                    }
                }
            }
        }
        map
    }

    fn draw(&self, pixel: usize) -> Support {
        let mut random = PixelRandom::new(self.seed, pixel, usize::MAX);
        let (x, y) = (pixel % self.reference.width, pixel / self.reference.width);
        let ray = self.reference.camera.ray(x as f32, y as f32);
        let w = self.range.0 + random.unit() * (self.range.1 - self.range.0);
        let normal = random.normal_towards(ray);
        Support::from_normal(w, normal, ray, &self.reference.camera).unwrap_or(Support {
            w,
            gu: 0.0,
            gv: 0.0,
        })
    }

    /// Chooses the views in which at least one of `hypotheses` has the least cost, and returns the cost of each
    /// hypothesis over them. Known costs of a hypothesis in a view are not computed again.
    ///
    /// Fewer than wanted where the image's border leaves fewer views, but at least two.
    fn choose_views<const N: usize>(
        &self,
        patch: &StereoPatch,
        x: usize,
        y: usize,
        hypotheses: &[(Support, Option<&Costs>); N],
    ) -> (ChosenViews, [Costs; N]) {
        let mut all = [([WORST; N], WORST, 0); MOST_VIEWS];
        let count = self.sources.len().min(MOST_VIEWS);
        let mut each = [Costs::UNKNOWN; N];
        for (i, (slot, source)) in all.iter_mut().zip(&self.sources).enumerate() {
            let costs = hypotheses.map(|(support, known)| {
                let known = known.map(|costs| costs.in_view[i]).filter(|cost| !cost.is_nan());
                known.unwrap_or_else(|| source.cost(patch, x, y, &support))
            });
            for (of, cost) in each.iter_mut().zip(costs) {
                of.in_view[i] = cost;
            }
            *slot = (costs, costs.iter().copied().fold(WORST, f32::min), i);
        }
        let all = &mut all[..count];
        all.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.2.cmp(&b.2)));
        let seen = all.iter().filter(|view| view.1 < WORST).count();
        let wanted = self.best_views.min(seen.max(LEAST_VIEWS)).min(count);
        let mut views = ChosenViews { indices: [0; MOST_VIEWS], count: wanted };
        for (k, (costs, _, view)) in all[..wanted].iter().enumerate() {
            views.indices[k] = *view;
            for (of, cost) in each.iter_mut().zip(costs) {
                of.mean += cost / wanted.max(1) as f32;
            }
        }
        (views, each)
    }

    /// Cost of a hypothesis in the views, if it is below `least`: most cost more, which one or two views reveal.
    fn cost_below(
        &self,
        least: &Costs,
        views: &ChosenViews,
        patch: &StereoPatch,
        x: usize,
        y: usize,
        support: &Support,
    ) -> Option<Costs> {
        let indices = &views.indices[..views.count];
        let mut in_views = [0.0; MOST_VIEWS];
        for (cost, i) in in_views.iter_mut().zip(indices) {
            *cost = self.sources[*i].least_cost(x, y, support);
        }
        let mean = |in_views: &[f32]| in_views[..views.count].iter().sum::<f32>() / views.count.max(1) as f32;
        // Sum over the views so far; the most informative come first.
        let mut behind = 0.0;
        for (k, i) in indices.iter().enumerate() {
            if behind > self.catching_up || mean(&in_views) >= least.mean {
                return None;
            }
            in_views[k] = self.sources[*i].cost_from(in_views[k], patch, support);
            behind += in_views[k] - least.in_view[*i];
        }
        let mut costs = Costs { mean: mean(&in_views), ..Costs::UNKNOWN };
        for (cost, i) in in_views.iter().zip(indices) {
            costs.in_view[*i] = *cost;
        }
        (costs.mean < least.mean).then_some(costs)
    }

    fn improve(
        &self,
        map: &SupportMap,
        known: &Costs,
        x: usize,
        y: usize,
        iteration: usize,
        table: &Weights,
    ) -> (Support, Costs) {
        let width = self.reference.width;
        let pixel = y * width + x;
        let patch = StereoPatch::new(self.reference, x, y, table);
        let current = map.supports[pixel];
        let regions = if self.is_photometric { &REGIONS[..] } else { &REGIONS[..NEAR_REGIONS] };
        let offered = &mut [(current, f32::MAX); REGIONS.len()][..regions.len()];
        for (offer, region) in offered.iter_mut().zip(regions) {
            for &(dx, dy) in *region {
                let (nx, ny) = (x as i32 + dx, y as i32 + dy);
                if nx < 0 || ny < 0 || nx >= width as i32 || ny >= self.reference.height as i32 {
                    continue;
                }
                let neighbour = ny as usize * width + nx as usize;
                if map.costs[neighbour] < offer.1 {
                    *offer = (map.supports[neighbour].moved(-dx as f32, -dy as f32), map.costs[neighbour]);
                }
            }
        }
        // The best neighbour helps to choose the views: the pixel's own hypothesis may still be random.
        let allowed = |c: &Support| c.w >= self.range.0 && c.w <= self.range.1 && self.is_seen(c, x, y);
        let first = (0..offered.len())
            .filter(|i| allowed(&offered[*i].0))
            .min_by(|a, b| offered[*a].1.total_cmp(&offered[*b].1));
        let favourite = first.map_or(current, |i| offered[i].0);
        let (views, [own, other]) =
            self.choose_views(&patch, x, y, &[(current, Some(known)), (favourite, None)]);
        let mut best = if other.mean < own.mean { (favourite, other) } else { (current, own) };
        let consider = |best: &mut (Support, Costs), candidate: Support| {
            if !allowed(&candidate) || self.is_same(&candidate, &best.0) {
                return;
            }
            if let Some(cost) = self.cost_below(&best.1, &views, &patch, x, y, &candidate) {
                *best = (candidate, cost);
            }
        };
        for (i, (candidate, _)) in offered.iter().enumerate() {
            if Some(i) != first {
                consider(&mut best, *candidate);
            }
        }
        let mut random = PixelRandom::new(self.seed, pixel, iteration);
        let (u, v) = (x as f32, y as f32);
        let camera = &self.reference.camera;
        let ray = camera.ray(u, v);
        let reach = 0.5f32.powi(iteration as i32);
        let with_normal = |best: &mut (Support, Costs), w: f32, normal| {
            if let Some(candidate) = Support::from_normal(w, normal, ray, camera) {
                consider(best, candidate);
            }
        };
        // A random hypothesis; then ever smaller perturbations of the best one.
        if self.is_photometric {
            let drawn = self.range.0 + random.unit() * (self.range.1 - self.range.0);
            let normal = best.0.normal(u, v, camera);
            with_normal(&mut best, drawn, normal);
            let w = best.0.w;
            with_normal(&mut best, w, random.normal_towards(ray));
        }
        for shrink in [2.0, 0.5] {
            let w = best.0.w + shrink * reach * self.step * random.signed();
            let normal = best.0.normal(u, v, camera);
            with_normal(&mut best, w, normal);
            let tilt = glam::Vec3::new(random.signed(), random.signed(), random.signed());
            let normal = (best.0.normal(u, v, camera) + 0.4 * shrink * reach * tilt).normalize_or_zero();
            let w = best.0.w + 0.3 * shrink * reach * self.step * random.signed();
            with_normal(&mut best, w, normal);
        }
        best
    }

    /// Tells whether two planes differ by less than a hundredth of a pixel over a patch, so that one of them can be
    /// skipped.
    fn is_same(&self, a: &Support, b: &Support) -> bool {
        let slope = (a.gu - b.gu).abs().max((a.gv - b.gv).abs());
        (a.w - b.w).abs() + 5.0 * slope < 0.02 * self.step
    }

    /// Tells whether a plane is visible and not seen edge-on; propagated planes must satisfy this, too.
    fn is_seen(&self, support: &Support, x: usize, y: usize) -> bool {
        let (u, v) = (x as f32, y as f32);
        let ray = self.reference.camera.ray(u, v);
        support.normal(u, v, &self.reference.camera).dot(ray) < -Support::LEAST_COSINE * ray.length()
    }
}

/// Largest number of views; more bring no improvement.
pub(super) const MOST_VIEWS: usize = 8;
/// Least number of views in which a hypothesis must be visible.
const LEAST_VIEWS: usize = 2;

/// Costs of one hypothesis.
#[derive(Debug, Clone, Copy)]
struct Costs {
    /// Mean over the views in which it was evaluated, or for which it was chosen.
    mean: f32,
    /// Cost in each of the sources; NaN where it was not evaluated.
    in_view: [f32; MOST_VIEWS],
}

impl Costs {
    const UNKNOWN: Self = Self { mean: 0.0, in_view: [f32::NAN; MOST_VIEWS] };
}

/// The views chosen for one pixel.
struct ChosenViews {
    indices: [usize; MOST_VIEWS],
    count: usize,
}

/// Regions from which hypotheses are propagated: the best neighbour of each hands on its plane. All offsets are odd in
/// sum, so they lie on the other colour. The first [`NEAR_REGIONS`] are near.
const REGIONS: [&[(i32, i32)]; 8] = [
    &[(0, -1), (-1, -2), (1, -2), (-2, -3), (2, -3)],
    &[(0, 1), (-1, 2), (1, 2), (-2, 3), (2, 3)],
    &[(-1, 0), (-2, -1), (-2, 1), (-3, -2), (-3, 2)],
    &[(1, 0), (2, -1), (2, 1), (3, -2), (3, 2)],
    &[(0, -3), (0, -5), (0, -7), (0, -9), (0, -13), (0, -17), (0, -23)],
    &[(0, 3), (0, 5), (0, 7), (0, 9), (0, 13), (0, 17), (0, 23)],
    &[(-3, 0), (-5, 0), (-7, 0), (-9, 0), (-13, 0), (-17, 0), (-23, 0)],
    &[(3, 0), (5, 0), (7, 0), (9, 0), (13, 0), (17, 0), (23, 0)],
];

const NEAR_REGIONS: usize = 4;

/// A pixel's own random numbers: `SplitMix64` (Steele et al. 2014), started from seed, pixel and iteration.
struct PixelRandom(u64);

impl PixelRandom {
    fn new(seed: u64, pixel: usize, iteration: usize) -> Self {
        let mut random = Self(seed ^ (pixel as u64).wrapping_mul(0xd6e8_feb8_6659_fd93));
        random.0 = random.next().wrapping_add((iteration as u64).wrapping_mul(0x9e6c_63d0_876a_68de));
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Random number in 0 … 1.
    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Random number in −1 … 1.
    fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    /// A direction uniform over the hemisphere that faces against `ray`.
    fn normal_towards(&mut self, ray: glam::Vec3) -> glam::Vec3 {
        let z = self.signed();
        let angle = std::f32::consts::TAU * self.unit();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let direction = glam::Vec3::new(radius * angle.cos(), radius * angle.sin(), z);
        if direction.dot(ray) > 0.0 { -direction } else { direction }
    }
}
