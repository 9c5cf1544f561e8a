//! Essential matrices from five pairs of rays.
//!
//! D. Nistér, "An efficient solution to the five-point relative pose problem" (PAMI 2004), solved as in H. Stewénius,
//! C. Engels, D. Nistér, "Recent developments on direct relative orientation" (ISPRS 2006): the ten cubic constraints
//! on `E = xX + yY + zZ + W` (det E = 0 and `2 E Eᵀ E − tr(E Eᵀ) E = 0`) are reduced by Gauss–Jordan to a Gröbner
//! basis, and x, y, z read off the eigenvectors of multiplication by x in the quotient ring.

use nalgebra::{Matrix3, SMatrix, SVector, Schur, Vector3};

/// Exponents of (x, y, z) in the graded order the reduction needs; the last ten are the quotient ring's basis.
const CUBIC: [[u8; 3]; 20] = [
    [3, 0, 0],
    [2, 1, 0],
    [1, 2, 0],
    [0, 3, 0],
    [2, 0, 1],
    [1, 1, 1],
    [0, 2, 1],
    [1, 0, 2],
    [0, 1, 2],
    [0, 0, 3],
    [2, 0, 0],
    [1, 1, 0],
    [0, 2, 0],
    [1, 0, 1],
    [0, 1, 1],
    [0, 0, 2],
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [0, 0, 0],
];

/// A polynomial of degree three at most, in the order of [`CUBIC`].
#[derive(Clone, Copy)]
struct Polynomial([f64; 20]);

/// Index of the product of two monomials; unused (20) beyond degree three.
const PRODUCT: [[usize; 20]; 20] = product_table();

const fn product_table() -> [[usize; 20]; 20] {
    let mut table = [[20; 20]; 20];
    let mut a = 0;
    while a < 20 {
        let mut b = 0;
        while b < 20 {
            let mut c = 0;
            while c < 20 {
                let sum = [CUBIC[a][0] + CUBIC[b][0], CUBIC[a][1] + CUBIC[b][1], CUBIC[a][2] + CUBIC[b][2]];
                if sum[0] == CUBIC[c][0] && sum[1] == CUBIC[c][1] && sum[2] == CUBIC[c][2] {
                    table[a][b] = c;
                }
                c += 1;
            }
            b += 1;
        }
        a += 1;
    }
    table
}

impl Polynomial {
    const ZERO: Self = Self([0.0; 20]);

    fn linear(x: f64, y: f64, z: f64, one: f64) -> Self {
        let mut p = Self::ZERO;
        (p.0[16], p.0[17], p.0[18], p.0[19]) = (x, y, z, one);
        p
    }

    fn plus(mut self, other: &Self, factor: f64) -> Self {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a += factor * b);
        self
    }

    /// The product; degrees must add up to three at most.
    fn times(&self, other: &Self) -> Self {
        let mut product = Self::ZERO;
        for (a, x) in self.0.iter().enumerate().filter(|(_, x)| **x != 0.0) {
            for (b, y) in other.0.iter().enumerate().filter(|(_, y)| **y != 0.0) {
                product.0[PRODUCT[a][b]] += x * y;
            }
        }
        product
    }
}

/// All real essential matrices with `bᵀ E a = 0` for the five pairs of rays (z = 1 or any length).
pub(crate) fn essential_matrices(a: &[Vector3<f64>; 5], b: &[Vector3<f64>; 5]) -> Vec<Matrix3<f64>> {
    let Some(basis) = null_space(a, b) else { return Vec::new() };
    let Some(reduced) = reduced_constraints(&basis) else { return Vec::new() };
    // Multiplication by x of (x², xy, y², xz, yz, z², x, y, z, 1).
    let mut action = SMatrix::<f64, 10, 10>::zeros();
    for (row, leading) in [0, 1, 2, 4, 5, 7].into_iter().enumerate() {
        action.set_row(row, &(-reduced.row(leading)));
    }
    for (row, column) in [(6, 0), (7, 1), (8, 3), (9, 6)] {
        action[(row, column)] = 1.0;
    }
    let Some(schur) = Schur::try_new(action, 1e-13, 300) else { return Vec::new() };
    schur
        .complex_eigenvalues()
        .iter()
        .filter(|value| value.im.abs() < 1e-7 * (1.0 + value.re.abs()))
        .filter_map(|value| {
            let v = eigenvector(&action, value.re)?;
            let [x, y, z] = [v[6] / v[9], v[7] / v[9], v[8] / v[9]];
            let e = basis[0] * x + basis[1] * y + basis[2] * z + basis[3];
            let norm = e.norm();
            (norm.is_finite() && norm > 0.0).then(|| e / norm)
        })
        .collect()
}

/// Four matrices that span all `E` with `bᵀ E a = 0` for the five pairs.
fn null_space(a: &[Vector3<f64>; 5], b: &[Vector3<f64>; 5]) -> Option<[Matrix3<f64>; 4]> {
    let mut system = SMatrix::<f64, 9, 9>::zeros();
    for (row, (a, b)) in a.iter().zip(b).enumerate() {
        for i in 0..3 {
            for j in 0..3 {
                system[(row, 3 * i + j)] = b[i] * a[j];
            }
        }
    }
    let eigen = nalgebra::SymmetricEigen::try_new(system.transpose() * system, 1e-15, 300)?;
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
    Some(std::array::from_fn(|k| Matrix3::from_row_slice(eigen.eigenvectors.column(order[k]).as_slice())))
}

/// The ten constraints with the ten cubic monomials eliminated: row i means `monomial i = −row · basis`.
fn reduced_constraints(basis: &[Matrix3<f64>; 4]) -> Option<SMatrix<f64, 10, 10>> {
    let entry = |i: usize, j: usize| {
        Polynomial::linear(basis[0][(i, j)], basis[1][(i, j)], basis[2][(i, j)], basis[3][(i, j)])
    };
    let e: [[Polynomial; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
    let minor =
        |i: usize, j: usize, k: usize, l: usize| e[i][k].times(&e[j][l]).plus(&e[i][l].times(&e[j][k]), -1.0);
    let determinant = e[0][0]
        .times(&minor(1, 2, 1, 2))
        .plus(&e[0][1].times(&minor(1, 2, 0, 2)), -1.0)
        .plus(&e[0][2].times(&minor(1, 2, 0, 1)), 1.0);
    let eet: [[Polynomial; 3]; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            (0..3).fold(Polynomial::ZERO, |sum, k| sum.plus(&e[i][k].times(&e[j][k]), 1.0))
        })
    });
    let trace = eet[0][0].plus(&eet[1][1], 1.0).plus(&eet[2][2], 1.0);
    let mut rows = SMatrix::<f64, 10, 20>::zeros();
    rows.set_row(0, &SVector::<f64, 20>::from(determinant.0).transpose());
    for i in 0..3 {
        for (j, entry) in e[i].iter().enumerate() {
            let product = (0..3).fold(Polynomial::ZERO, |sum, k| sum.plus(&eet[i][k].times(&e[k][j]), 2.0));
            let constraint = product.plus(&trace.times(entry), -1.0);
            rows.set_row(1 + 3 * i + j, &SVector::<f64, 20>::from(constraint.0).transpose());
        }
    }
    let cubic: SMatrix<f64, 10, 10> = rows.fixed_columns::<10>(0).into();
    let rest: SMatrix<f64, 10, 10> = rows.fixed_columns::<10>(10).into();
    cubic.full_piv_lu().solve(&rest)
}

/// Eigenvector of a known eigenvalue, by inverse iteration.
fn eigenvector(matrix: &SMatrix<f64, 10, 10>, value: f64) -> Option<SVector<f64, 10>> {
    let nudge = 1e-10 * (1.0 + value.abs());
    let lu = (matrix - SMatrix::identity() * (value + nudge)).lu();
    let mut v = SVector::<f64, 10>::from_element(1.0);
    for _ in 0..3 {
        v = lu.solve(&v)?.normalize();
    }
    (v[9].abs() > 1e-12).then_some(v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_true_matrix_is_among_the_solutions(
            turn in prop::array::uniform3(-0.6..0.6), shift in prop::array::uniform3(-1.0..1.0),
            sides in prop::array::uniform5((-1.0..1.0, -1.0..1.0, 2.0..7.0)),
        ) {
            let shift = Vector3::from(shift);
            prop_assume!(shift.norm() > 0.2);
            let motion = Isometry3::new(shift, Vector3::from(turn));
            let points = sides.map(|(x, y, z)| nalgebra::Point3::new(x * z * 0.5, y * z * 0.5, z));
            let rays: [Vector3<f64>; 5] = points.map(|p| p.coords / p.z);
            let spread = |i: usize, j: usize| (rays[i] - rays[j]).norm();
            prop_assume!((0..5).all(|i| (0..i).all(|j| spread(i, j) > 0.1)));
            let a = points.map(|p| p.coords / p.z);
            let b = points.map(|p| { let q = motion * p; q.coords / q.z });
            let truth: Matrix3<f64> = shift.cross_matrix() * motion.rotation.to_rotation_matrix().matrix();
            let truth: Matrix3<f64> = truth / truth.norm();
            let found = essential_matrices(&a, &b);
            for e in &found {
                prop_assert!(a.iter().zip(&b).all(|(a, b)| b.dot(&(e * a)).abs() < 1e-6));
            }
            let closest = found.iter().map(|e: &Matrix3<f64>| (e - truth).norm().min((e + truth).norm())).fold(f64::INFINITY, f64::min);
            prop_assert!(closest < 1e-4, "{closest} of {} solutions", found.len());
        }
    }

    /// Five pairs, well apart first, that move together until they are five times the same.
    #[test]
    fn pairs_that_run_together_give_finite_matrices_and_pairs_apart_the_true_one() {
        let shift = Vector3::new(0.3, 0.1, -0.2);
        let motion = Isometry3::new(shift, Vector3::new(0.05, -0.1, 0.02));
        let truth = shift.cross_matrix() * motion.rotation.to_rotation_matrix().matrix();
        let truth = truth / truth.norm();
        let apart =
            [[0.0, 0.0, 0.0], [0.5, 0.1, 1.0], [-0.3, 0.4, -0.5], [0.15, -0.5, 0.4], [-0.45, -0.25, -1.0]];
        for spread in (0..17).map(|k| 10f64.powi(-k)).chain([0.0]) {
            let points = apart.map(|[x, y, z]| {
                nalgebra::Point3::new(0.1 + spread * x, 0.2 + spread * y, 1.0) * (4.0 + spread * z)
            });
            let a = points.map(|p| p.coords / p.z);
            let b = points.map(|p| (motion * p).coords).map(|q| q / q.z);
            let found = essential_matrices(&a, &b);
            for e in &found {
                assert!(e.iter().all(|v| v.is_finite()), "{spread}: {e}");
                assert!(a.iter().zip(&b).all(|(a, b)| b.dot(&(e * a)).abs() < 1e-6), "{spread}: {e}");
            }
            if spread > 0.5 {
                let off = |e: &Matrix3<f64>| (e - truth).norm().min((e + truth).norm());
                assert!(found.iter().any(|e| off(e) < 1e-6), "{found:?}");
            }
        }
    }
}
