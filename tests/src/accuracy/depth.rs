//! Static depth against true depth: 16-bit millimetres along the camera's z, 0 = nothing.

/// Agreement of an estimated depth image with the truth.
#[derive(Debug, Clone, Copy)]
pub struct DepthAgreement {
    /// Fraction of the pixels with true depth whose estimate is within the tolerance.
    pub within: f64,
    /// Fraction of the pixels with true depth that have an estimate.
    pub covered: f64,
}

/// Compares pixel by pixel; `None` when the sizes differ or the truth is empty.
pub fn depth(estimated_mm: &[u16], truth_mm: &[u16], tolerance_mm: u16) -> Option<DepthAgreement> {
    let seen = truth_mm.iter().filter(|t| **t > 0).count();
    if estimated_mm.len() != truth_mm.len() || seen == 0 {
        return None;
    }
    let pairs = || estimated_mm.iter().zip(truth_mm).filter(|(e, t)| **e > 0 && **t > 0);
    let within = pairs().filter(|(e, t)| e.abs_diff(**t) <= tolerance_mm).count();
    Some(DepthAgreement {
        within: within as f64 / seen as f64,
        covered: pairs().count() as f64 / seen as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_count_against_an_estimate_and_unknown_truth_does_not() {
        let truth = [1000, 1000, 1000, 1000, 0];
        let agreement = depth(&[1050, 1051, 0, 1000, 7], &truth, 50).unwrap();
        assert!((agreement.within - 0.5).abs() < 1e-12 && (agreement.covered - 0.75).abs() < 1e-12);
        assert!(depth(&[1], &truth, 50).is_none() && depth(&[0], &[0], 50).is_none());
    }
}
