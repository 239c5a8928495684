//! Normal equations of the free unknowns of a fit: their solution, inverse and condition.

/// Number of unknowns of a curve, in this order: light, centre x and z, variances xx and zz and covariance xz of the blur,
/// and background. Slits have no z, zz and xz.
pub(super) const UNKNOWNS: usize = 7;
/// A number for each unknown.
pub(super) type Unknowns = [f64; UNKNOWNS];
/// Value of a curve and its slopes by the unknowns.
pub(super) type Valued = [f64; 1 + UNKNOWNS];
/// A symmetric matrix of the unknowns.
pub(super) type Matrix = [Unknowns; UNKNOWNS];
/// Pivot of a matrix with unit diagonal below which it is singular.
const SINGULAR: f64 = 1e-14;

/// Sums of products of slopes, and their products with residuals, in the order of the free unknowns.
#[derive(Debug, Clone)]
pub(super) struct Equations {
    /// Indices of the free unknowns; the first `count` have a meaning.
    free: [usize; UNKNOWNS],
    count: usize,
    /// Lower half.
    matrix: Matrix,
    right: Unknowns,
}

impl Equations {
    /// No values yet. `held`: unknowns that keep their value.
    pub(super) fn new(held: &[bool; UNKNOWNS]) -> Self {
        let (mut free, mut count) = ([0; UNKNOWNS], 0);
        for (at, _) in held.iter().enumerate().filter(|(_, held)| !**held) {
            free[count] = at;
            count += 1;
        }
        Self { free, count, matrix: [[0.0; UNKNOWNS]; UNKNOWNS], right: [0.0; UNKNOWNS] }
    }

    /// The equations where another unknown keeps its value.
    pub(super) fn without(&self, unknown: usize) -> Self {
        let mut held = [true; UNKNOWNS];
        self.free[..self.count].iter().for_each(|at| held[*at] = *at == unknown);
        let (all, mut less) = (self.matrix(), Self::new(&held));
        for i in 0..less.count {
            less.matrix[i] = less.free.map(|at| all[less.free[i]][at]);
            less.right[i] = self.right[i + usize::from(less.free[i] > unknown)];
        }
        less
    }

    /// Number of free unknowns.
    pub(super) const fn count(&self) -> usize {
        self.count
    }

    /// Adds a value with these slopes by all unknowns, its weight and its residual.
    pub(super) fn add(&mut self, slopes: &Unknowns, weight: f64, rest: f64) {
        let own = self.free.map(|at| slopes[at]);
        for (i, by_i) in own[..self.count].iter().enumerate() {
            let weighted = weight * by_i;
            for (sum, by_j) in self.matrix[i][..=i].iter_mut().zip(own) {
                *sum += weighted * by_j;
            }
            self.right[i] += weighted * rest;
        }
    }

    /// Matrix of all unknowns; 0 for those that keep their value.
    pub(super) fn matrix(&self) -> Matrix {
        let mut all = [[0.0; UNKNOWNS]; UNKNOWNS];
        for i in 0..self.count {
            for j in 0..self.count {
                all[self.free[i]][self.free[j]] = self.matrix[i.max(j)][i.min(j)];
            }
        }
        all
    }

    /// Scales that give the matrix a unit diagonal.
    fn scales(&self) -> Unknowns {
        std::array::from_fn(|i| 1.0 / self.matrix[i][i].max(f64::MIN_POSITIVE).sqrt())
    }

    /// Cholesky factor of the scaled and damped matrix; `None` if it is singular.
    fn factor(&self, scale: &Unknowns, damping: f64) -> Option<Matrix> {
        let mut factor = [[0.0; UNKNOWNS]; UNKNOWNS];
        for i in 0..self.count {
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

    /// Solves with a factor; unknowns that keep their value have 0.
    fn solved(&self, factor: &Matrix, scale: &Unknowns, right: &Unknowns) -> Unknowns {
        let (n, mut x, mut all) = (self.count, [0.0; UNKNOWNS], [0.0; UNKNOWNS]);
        for i in 0..n {
            let known: f64 = (0..i).map(|k| factor[i][k] * x[k]).sum();
            x[i] = (right[i] * scale[i] - known) / factor[i][i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| factor[k][i] * x[k]).sum();
            x[i] = (x[i] - known) / factor[i][i];
            all[self.free[i]] = x[i] * scale[i];
        }
        all
    }

    /// Solves the damped equations; `None` if they are singular.
    pub(super) fn solve(&self, damping: f64) -> Option<Unknowns> {
        let scale = self.scales();
        Some(self.solved(&self.factor(&scale, damping)?, &scale, &self.right))
    }

    /// Part of the squares by which a step of the damped equations is expected to lower them.
    pub(super) fn gain(&self, step: &Unknowns, damping: f64) -> f64 {
        let of = |i: usize| {
            let step = step[self.free[i]];
            step * (damping * self.matrix[i][i] * step + self.right[i])
        };
        (0..self.count).map(of).sum()
    }

    /// Inverse of the matrix; `None` if it is singular. Unknowns that keep their value have 0.
    pub(super) fn inverse(&self) -> Option<Matrix> {
        let scale = self.scales();
        let factor = self.factor(&scale, 0.0)?;
        let mut all = [[0.0; UNKNOWNS]; UNKNOWNS];
        for i in 0..self.count {
            let unit = std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 });
            all[self.free[i]] = self.solved(&factor, &scale, &unit);
        }
        Some(all)
    }

    /// `[i][j]`: change of fitted value i by measured value j, over the weight of j, of values with these slopes and
    /// weights beside those that were added; `None` where the fit is singular.
    pub(super) fn influence(&self, slopes: &[Unknowns], weights: &[f64]) -> Option<Vec<Vec<f64>>> {
        let mut equations = self.clone();
        slopes.iter().zip(weights).for_each(|(slope, weight)| equations.add(slope, *weight, 0.0));
        let inverse = equations.inverse()?;
        let row = |of: &Unknowns| -> Vec<f64> {
            let half: Unknowns =
                std::array::from_fn(|j| (0..UNKNOWNS).map(|i| of[i] * inverse[i][j]).sum());
            let times = |s: &Unknowns| half.iter().zip(s).map(|(half, s)| half * s).sum::<f64>();
            slopes.iter().map(times).collect()
        };
        Some(slopes.iter().map(row).collect())
    }

    /// Largest factor by which the other unknowns raise the variance of one: 1 for unknowns that are independent.
    pub(super) fn inflation(&self, inverse: &Matrix) -> f64 {
        let of = |i: usize| self.matrix[i][i] * inverse[self.free[i]][self.free[i]];
        (0..self.count).map(of).fold(1.0, f64::max)
    }

    /// Largest over smallest eigenvalue of the matrix scaled to a unit diagonal, by the power method.
    pub(super) fn condition(&self, inverse: &Matrix) -> f64 {
        let (n, scale) = (self.count, self.scales());
        let (mut own, mut other) = ([[0.0; UNKNOWNS]; UNKNOWNS], [[0.0; UNKNOWNS]; UNKNOWNS]);
        for i in 0..n {
            for j in 0..n {
                own[i][j] = self.matrix[i.max(j)][i.min(j)] * scale[i] * scale[j];
                other[i][j] = inverse[self.free[i]][self.free[j]] / (scale[i] * scale[j]);
            }
        }
        largest(&own, n) * largest(&other, n)
    }
}

/// Largest eigenvalue of a matrix of `n` rows, by the power method.
fn largest(of: &Matrix, n: usize) -> f64 {
    let (mut v, mut value) = ([0.5, 0.3, -0.6, 0.7, -0.4, 0.2, -0.8], 0.0);
    for _ in 0..30 {
        let mut w = [0.0; UNKNOWNS];
        for (w, row) in w[..n].iter_mut().zip(of) {
            *w = row[..n].iter().zip(v).map(|(of, v)| of * v).sum();
        }
        let last = value;
        value = w[..n].iter().map(|w| w * w).sum::<f64>().sqrt();
        if (value - last).abs() < 1e-7 * value {
            break;
        }
        let per_value = 1.0 / value;
        v = w.map(|w| w * per_value);
    }
    value
}

/// Covariance of unknowns fitted with other weights than their inverse variances: `inverse` of the
/// equations on either side of `noise`, the sum of products of slopes times squared weights and variances.
pub(super) fn covariance(inverse: &Matrix, noise: &Matrix) -> Matrix {
    let product = |a: &Matrix, b: &Matrix| -> Matrix {
        a.map(|row| std::array::from_fn(|j| (0..UNKNOWNS).map(|k| row[k] * b[k][j]).sum()))
    };
    product(&product(inverse, noise), inverse)
}
