//! Lengths in a built room against true ones: distances between surface points in one reference image. None of these
//! lengths gave the room its metres.

use calib::Intrinsics;
use nalgebra::{Point2, Vector3};

/// Ratios of the lengths in the built room to the true ones.
#[derive(Debug, Clone, Copy)]
pub struct LengthAgreement {
    /// Number of lengths compared.
    pub count: usize,
    /// Median ratio of built to true.
    pub median: f64,
    /// Relative error that nine in ten lengths stay below.
    pub ninety_off: f64,
}

/// Compares lengths of half a metre and more between pixels of the upper and of the lower half of the image, by two
/// depth images in millimetres along z; edges are left out, since there a hundredth of a pixel decides which surface is
/// seen. `None` when the sizes differ or no pixel has both depths.
pub fn lengths(lens: &Intrinsics, built_mm: &[u16], truth_mm: &[u16]) -> Option<LengthAgreement> {
    const STRIDE: usize = 8;
    const SHORTEST_MM: f64 = 500.0;
    let (width, height) = (lens.width as usize, lens.height as usize);
    if built_mm.len() != width * height || truth_mm.len() != width * height {
        return None;
    }
    let seen = |u: usize, v: usize| -> Option<[Vector3<f64>; 2]> {
        let i = v * width + u;
        let is_smooth = [i - 1, i + 1, i - width, i + width]
            .iter()
            .all(|j| truth_mm[*j].abs_diff(truth_mm[i]) <= truth_mm[i] / 100);
        let ray = lens.unproject(&Point2::new(u as f64, v as f64))?;
        let both = built_mm[i] > 0 && truth_mm[i] > 0 && is_smooth;
        both.then(|| [ray * f64::from(built_mm[i]), ray * f64::from(truth_mm[i])])
    };
    let mut points = Vec::new();
    for v in (1..height.saturating_sub(1)).step_by(STRIDE) {
        points.extend((1..width.saturating_sub(1)).step_by(STRIDE).filter_map(|u| seen(u, v)));
    }
    let half = points.len() / 2;
    let pairs = points.iter().zip(points.iter().skip(half));
    let mut ratios: Vec<f64> = pairs
        .map(|(a, b)| [(a[0] - b[0]).norm(), (a[1] - b[1]).norm()])
        .filter(|[_, truth]| *truth >= SHORTEST_MM)
        .map(|[built, truth]| built / truth)
        .collect();
    ratios.sort_by(f64::total_cmp);
    let median = *ratios.get(ratios.len() / 2)?;
    let mut off: Vec<f64> = ratios.iter().map(|r| (r - 1.0).abs()).collect();
    off.sort_by(f64::total_cmp);
    Some(LengthAgreement { count: ratios.len(), median, ninety_off: off[off.len() * 9 / 10] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_a_hundredth_too_large_has_lengths_a_hundredth_too_long() {
        let lens = Intrinsics::from_horizontal_fov(160, 120, 70.0);
        let truth: Vec<u16> = (0..160 * 120).map(|i| 3000 + 10 * (i % 160) as u16).collect();
        let built: Vec<u16> = truth.iter().map(|t| (f64::from(*t) * 1.01).round() as u16).collect();
        let agreement = lengths(&lens, &built, &truth).unwrap();
        assert!((agreement.median - 1.01).abs() < 5e-4 && agreement.ninety_off < 0.012, "{agreement:?}");
        assert!(agreement.count > 50);
        assert!(lengths(&lens, &built[1..], &truth).is_none());
        assert!(lengths(&lens, &vec![0; built.len()], &truth).is_none());
    }
}
