//! Rank-three factorization of measurements with missing entries: `w_fp = M_f s_p + o_f`.
//!
//! C. Tomasi and T. Kanade, "Shape and motion from image streams under orthography: a factorization method" (IJCV
//! 1992): the points seen in every frame give motion by a singular value decomposition (section 3); the others follow
//! by intersection with that motion (section 5), and alternation refines both.

use nalgebra::{DMatrix, Matrix2x3, Matrix3, Matrix4, SMatrix, SymmetricEigen, Vector2, Vector3, Vector4};

/// Fewest complete points that start a factorization.
pub(crate) const MIN_COMPLETE: usize = 8;
const ALTERNATIONS: usize = 4;

/// Measurements of points (outer) in frames (inner); `None` where a point was not observed.
pub(crate) type Measurements = Vec<Vec<Option<Vector2<f64>>>>;

/// Affine motion and shape; the points' mean is the origin.
#[derive(Debug, Clone)]
pub(crate) struct Affine {
    pub(crate) motion: Vec<Matrix2x3<f64>>,
    /// Image of the origin in each frame.
    pub(crate) offset: Vec<Vector2<f64>>,
    pub(crate) points: Vec<Vector3<f64>>,
}

/// Factorizes; `None` when too few points are observed throughout or a point or frame is undetermined.
pub(crate) fn factorize(measured: &Measurements) -> Option<Affine> {
    let frames = measured.first()?.len();
    let complete: Vec<Vec<Vector2<f64>>> =
        measured.iter().filter_map(|point| point.iter().copied().collect::<Option<Vec<_>>>()).collect();
    if complete.len() < MIN_COMPLETE || frames < 2 {
        return None;
    }
    let offset: Vec<Vector2<f64>> = (0..frames)
        .map(|f| complete.iter().map(|p| p[f]).sum::<Vector2<f64>>() / complete.len() as f64)
        .collect();
    let registered = DMatrix::from_fn(2 * frames, complete.len(), |row, p| {
        complete[p][row / 2][row % 2] - offset[row / 2][row % 2]
    });
    // W = U Σ Vᵀ: the columns of U are the eigenvectors of W Wᵀ, which is small.
    let eigen = SymmetricEigen::try_new(&registered * registered.transpose(), 1e-14, 1000)?;
    let mut order: Vec<usize> = (0..2 * frames).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let motion = (0..frames)
        .map(|f| {
            Matrix2x3::from_fn(|r, c| {
                eigen.eigenvectors[(2 * f + r, order[c])] * eigen.eigenvalues[order[c]].max(0.0).powf(0.25)
            })
        })
        .collect();
    let mut affine = Affine { motion, offset, points: Vec::new() };
    affine.solve_points(measured)?;
    if complete.len() < measured.len() {
        for _ in 0..ALTERNATIONS {
            affine.solve_motion(measured)?;
            affine.solve_points(measured)?;
        }
    }
    affine.center();
    Some(affine)
}

impl Affine {
    /// Solves for each point from the frames that observed it.
    fn solve_points(&mut self, measured: &Measurements) -> Option<()> {
        let point = |seen: &Vec<Option<Vector2<f64>>>| -> Option<Vector3<f64>> {
            let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
            for (f, w) in seen.iter().enumerate() {
                let Some(w) = w else { continue };
                normal += self.motion[f].transpose() * self.motion[f];
                right += self.motion[f].transpose() * (w - self.offset[f]);
            }
            let floor = 1e-12 * normal.trace();
            Some((normal + Matrix3::identity() * floor).cholesky()?.solve(&right))
        };
        self.points = measured.iter().map(point).collect::<Option<_>>()?;
        Some(())
    }

    /// Solves for each frame's motion from its observed points.
    fn solve_motion(&mut self, measured: &Measurements) -> Option<()> {
        for f in 0..self.motion.len() {
            let (mut normal, mut right) = (Matrix4::zeros(), SMatrix::<f64, 4, 2>::zeros());
            for (s, seen) in self.points.iter().zip(measured) {
                let Some(w) = seen[f] else { continue };
                let row = Vector4::new(s.x, s.y, s.z, 1.0);
                normal += row * row.transpose();
                right += row * w.transpose();
            }
            let floor = 1e-12 * normal.trace();
            let solved = (normal + Matrix4::identity() * floor).cholesky()?.solve(&right);
            self.motion[f] = solved.fixed_rows::<3>(0).transpose();
            self.offset[f] = solved.row(3).transpose();
        }
        Some(())
    }

    /// Moves the origin to the points' mean.
    fn center(&mut self) {
        let mean = self.points.iter().sum::<Vector3<f64>>() / self.points.len() as f64;
        for (offset, motion) in self.offset.iter_mut().zip(&self.motion) {
            *offset += motion * mean;
        }
        self.points.iter_mut().for_each(|p| *p -= mean);
    }

    /// Root mean square distance between model and measurements.
    #[cfg(test)]
    pub(crate) fn residual(&self, measured: &Measurements) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (s, seen) in self.points.iter().zip(measured) {
            for (f, w) in seen.iter().enumerate().filter_map(|(f, w)| Some((f, (*w)?))) {
                sum += (self.motion[f] * s + self.offset[f] - w).norm_squared();
                count += 1;
            }
        }
        (sum / f64::from(count.max(1))).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(missing: bool) -> Measurements {
        let wave = |a: f64, b: f64| (a * 1.7 + b * 2.3).sin();
        (0..40)
            .map(|p| {
                let s =
                    Vector3::new(wave(f64::from(p), 0.0), wave(f64::from(p), 1.0), wave(f64::from(p), 2.0));
                (0..12)
                    .map(|f| {
                        let m = Matrix2x3::from_fn(|r, c| wave(0.1 * f64::from(f) + r as f64, c as f64));
                        let gone = missing && p >= 15 && (f + p) % 4 == 0;
                        (!gone).then(|| m * s + Vector2::new(0.1 * f64::from(f), -0.2))
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn exact_measurements_are_reproduced_with_and_without_gaps() {
        for missing in [false, true] {
            let measured = exact(missing);
            let affine = factorize(&measured).unwrap();
            assert!(affine.residual(&measured) < 1e-7, "{}", affine.residual(&measured));
            assert!(affine.points.iter().sum::<Vector3<f64>>().norm() < 1e-9);
        }
    }

    #[test]
    fn too_little_is_refused() {
        assert!(factorize(&Vec::new()).is_none());
        assert!(factorize(&exact(false)[..5].to_vec()).is_none());
        let gone = vec![vec![None; 4]; 20];
        assert!(factorize(&gone).is_none());
    }
}
