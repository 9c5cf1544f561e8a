//! Thinning of clouds to a bounded number of points: one point a voxel, in a grid that grows coarser as it fills. What is
//! kept is bounded, however many points come.

use std::collections::HashMap;

use super::scan_vertex::ScanVertex;

/// Side of a voxel to begin with, metres…
const FINEST_M: f64 = 0.004;
/// …and by what it grows when there are too many: surfaces then keep half of their voxels.
const GROWTH: f64 = 1.4;

/// Voxels with the mean of the points in each.
#[derive(Debug)]
pub(crate) struct VoxelGrid {
    side_m: f64,
    most: usize,
    voxels: HashMap<[i64; 3], Voxel>,
    added: u64,
}

/// Sums over the points of a voxel.
#[derive(Debug, Clone, Copy)]
struct Voxel {
    /// Number of the first point, by which voxels are put in order.
    first: u64,
    count: f64,
    position: [f64; 3],
    normal: [f32; 3],
    color: [f64; 3],
    filled: f64,
    confidence: f64,
}

impl Voxel {
    fn of(vertex: &ScanVertex, first: u64) -> Self {
        Self {
            first,
            count: 1.0,
            position: vertex.position,
            normal: vertex.normal,
            color: vertex.color.map(f64::from),
            filled: f64::from(u8::from(vertex.filled)),
            confidence: f64::from(vertex.confidence),
        }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        for axis in 0..3 {
            self.position[axis] += other.position[axis];
            self.color[axis] += other.color[axis];
        }
        let sum: [f32; 3] = std::array::from_fn(|axis| self.normal[axis] + other.normal[axis]);
        // Two sides of a thin wall cancel each other: the first one stays.
        if sum.iter().any(|n| n.abs() > 0.1) {
            self.normal = sum;
        }
        self.filled += other.filled;
        self.confidence += other.confidence;
    }

    fn mean(&self) -> [f64; 3] {
        self.position.map(|sum| sum / self.count)
    }

    fn vertex(&self) -> ScanVertex {
        ScanVertex {
            position: self.mean(),
            normal: self.normal,
            color: self.color.map(|sum| (sum / self.count) as f32),
            radius: 0.0,
            filled: 2.0 * self.filled > self.count,
            confidence: (self.confidence / self.count) as f32,
        }
    }
}

impl VoxelGrid {
    /// A grid that keeps at most so many points, at least one.
    pub(crate) fn new(most: usize) -> Self {
        Self { side_m: FINEST_M, most: most.max(1), voxels: HashMap::new(), added: 0 }
    }

    /// Side of a voxel, metres.
    pub(crate) fn side_m(&self) -> f64 {
        self.side_m
    }

    /// Adds a placed point; one that is not finite is left out.
    pub(crate) fn add(&mut self, vertex: &ScanVertex) {
        if !vertex.position.iter().all(|value| value.is_finite()) {
            return;
        }
        self.put(&Voxel::of(vertex, self.added));
        self.added += 1;
        while self.voxels.len() > self.most {
            self.coarsen();
        }
    }

    fn put(&mut self, voxel: &Voxel) {
        let key = voxel.mean().map(|value| (value / self.side_m).floor() as i64);
        self.voxels.entry(key).and_modify(|there| there.add(voxel)).or_insert(*voxel);
    }

    fn coarsen(&mut self) {
        self.side_m *= GROWTH;
        for voxel in in_order(std::mem::take(&mut self.voxels)) {
            self.put(&voxel);
        }
    }

    /// The means of the voxels, in the order of their first points.
    pub(crate) fn into_vertices(self) -> Vec<ScanVertex> {
        in_order(self.voxels).iter().map(Voxel::vertex).collect()
    }
}

/// Voxels by their first points: sums then have one order, and the same cloud the same result.
fn in_order(voxels: HashMap<[i64; 3], Voxel>) -> Vec<Voxel> {
    let mut voxels: Vec<Voxel> = voxels.into_values().collect();
    voxels.sort_unstable_by_key(|voxel| voxel.first);
    voxels
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // numbers that are only copied stay as they are
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn any_number_of_points_is_thinned_evenly_below_the_bound() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut grid = VoxelGrid::new(2000);
        // A floor of 4 × 3 m, half of it sampled ten times as densely.
        for i in 0..60_000 {
            let x = if i % 11 == 0 { 2.0 + 2.0 * rng.random::<f64>() } else { 2.0 * rng.random::<f64>() };
            let position = [x, 3.0 * rng.random::<f64>(), 0.0];
            grid.add(&ScanVertex { position, normal: [0.0, 0.0, 1.0], ..ScanVertex::default() });
            assert!(grid.voxels.len() <= 2000);
        }
        let side_m = grid.side_m();
        let thinned = grid.into_vertices();
        assert!((800..=2000).contains(&thinned.len()), "{} at {side_m} m", thinned.len());
        let near = thinned.iter().filter(|vertex| vertex.position[0] < 2.0).count();
        assert!((0.4..0.6).contains(&(near as f64 / thinned.len() as f64)), "{near} of {}", thinned.len());
        assert!(thinned.iter().all(|vertex| vertex.normal[2] > 0.0 && vertex.color == [180.0; 3]));
        // Every place of the floor keeps a point nearby.
        for _ in 0..200 {
            let place = [4.0 * rng.random::<f64>(), 3.0 * rng.random::<f64>()];
            let nearest = thinned
                .iter()
                .map(|v| (v.position[0] - place[0]).hypot(v.position[1] - place[1]))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 2.0 * side_m, "{nearest} m at {side_m} m");
        }
    }

    #[test]
    fn two_sides_of_a_wall_and_wild_points_leave_what_can_be_used() {
        let mut grid = VoxelGrid::new(10);
        for x in [1.0, -1.0] {
            grid.add(&ScanVertex {
                position: [1e-4, 0.0, 0.0],
                normal: [x, 0.0, 0.0],
                ..ScanVertex::default()
            });
        }
        grid.add(&ScanVertex { position: [f64::NAN; 3], ..ScanVertex::default() });
        let [only] = grid.into_vertices()[..] else { panic!("one voxel") };
        assert_eq!(only.normal, [1.0, 0.0, 0.0]);
    }
}
