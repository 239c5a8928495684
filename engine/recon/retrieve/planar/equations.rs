//! Normal equations of the unknowns of a fit in two directions.

use super::shape::UNKNOWNS;

/// A symmetric matrix of the unknowns.
pub(super) type Matrix = [[f64; UNKNOWNS]; UNKNOWNS];
/// Pivot of a matrix with unit diagonal below which it is singular.
const SINGULAR: f64 = 1e-13;

/// Sums of products of slopes, and their products with residuals.
#[derive(Debug, Clone)]
pub(super) struct Equations {
    pub(super) matrix: Matrix,
    pub(super) right: [f64; UNKNOWNS],
}

impl Equations {
    /// No values yet. `held`: unknowns that keep their value have an equation of their own.
    pub(super) fn new(held: &[bool; UNKNOWNS]) -> Self {
        let mut matrix = [[0.0; UNKNOWNS]; UNKNOWNS];
        for (k, held) in held.iter().enumerate() {
            matrix[k][k] = f64::from(u8::from(*held));
        }
        Self { matrix, right: [0.0; UNKNOWNS] }
    }

    /// Adds a value with these slopes, its weight and its residual.
    pub(super) fn add(&mut self, slopes: &[f64; UNKNOWNS], weight: f64, rest: f64) {
        for (i, by_i) in slopes.iter().enumerate() {
            let weighted = weight * by_i;
            for (sum, by_j) in self.matrix[i][..=i].iter_mut().zip(slopes) {
                *sum += weighted * by_j;
            }
            self.right[i] += weighted * rest;
        }
    }

    /// Copies the lower half to the upper.
    pub(super) fn complete(&mut self) {
        for i in 0..UNKNOWNS {
            for j in i + 1..UNKNOWNS {
                self.matrix[i][j] = self.matrix[j][i];
            }
        }
    }

    /// Scales that give the matrix a unit diagonal.
    fn scales(&self) -> [f64; UNKNOWNS] {
        std::array::from_fn(|i| 1.0 / self.matrix[i][i].max(f64::MIN_POSITIVE).sqrt())
    }

    /// Cholesky factor of the scaled and damped matrix; `None` if it is singular.
    fn factor(&self, scale: &[f64; UNKNOWNS], damping: f64) -> Option<Matrix> {
        let mut factor = [[0.0; UNKNOWNS]; UNKNOWNS];
        for i in 0..UNKNOWNS {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                let own = self.matrix[i][j] * scale[i] * scale[j];
                let left = own + if i == j { damping } else { 0.0 } - known;
                if i == j {
                    if left.is_nan() || left < SINGULAR {
                        return None;
                    }
                    factor[i][i] = left.sqrt();
                } else {
                    factor[i][j] = left / factor[j][j];
                }
            }
        }
        Some(factor)
    }

    /// Solves the damped equations; `None` if they are singular.
    pub(super) fn solve(&self, damping: f64) -> Option<[f64; UNKNOWNS]> {
        let scale = self.scales();
        Some(solved(&self.factor(&scale, damping)?, &scale, &self.right))
    }

    /// Inverse of the matrix; `None` if it is singular.
    pub(super) fn inverse(&self) -> Option<Matrix> {
        let scale = self.scales();
        let factor = self.factor(&scale, 0.0)?;
        Some(std::array::from_fn(|i| {
            let unit = std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 });
            solved(&factor, &scale, &unit)
        }))
    }

    /// Largest factor by which the other unknowns raise the variance of one: 1 for unknowns that are independent.
    pub(super) fn inflation(&self, inverse: &Matrix) -> f64 {
        (0..UNKNOWNS).map(|i| self.matrix[i][i] * inverse[i][i]).fold(1.0, f64::max)
    }
}

/// Solves with a factor.
fn solved(factor: &Matrix, scale: &[f64; UNKNOWNS], right: &[f64; UNKNOWNS]) -> [f64; UNKNOWNS] {
    let mut x = [0.0; UNKNOWNS];
    for i in 0..UNKNOWNS {
        let known: f64 = (0..i).map(|k| factor[i][k] * x[k]).sum();
        x[i] = (right[i] * scale[i] - known) / factor[i][i];
    }
    for i in (0..UNKNOWNS).rev() {
        let known: f64 = (i + 1..UNKNOWNS).map(|k| factor[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / factor[i][i];
    }
    std::array::from_fn(|i| x[i] * scale[i])
}
