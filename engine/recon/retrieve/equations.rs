//! Normal equations of four unknowns: their solution, inverse and condition.

/// Matrix, and right side in the last column.
pub(super) type Equations = [[f64; 5]; 4];

/// Adds a value with these slopes by the N unknowns, its weight and its residual. M is N + 1.
pub(super) fn add<const N: usize, const M: usize>(
    n: &mut [[f64; M]; N],
    slope: [f64; N],
    weight: f64,
    rest: f64,
) {
    for (row, s) in n.iter_mut().zip(slope) {
        let s = weight * s;
        for (sum, other) in row.iter_mut().zip(slope) {
            *sum += s * other;
        }
        row[N] += s * rest;
    }
}

/// Scales that give the matrix a unit diagonal.
fn scales(n: &Equations) -> [f64; 4] {
    std::array::from_fn(|i| 1.0 / n[i][i].max(f64::MIN_POSITIVE).sqrt())
}

/// Solves the equations, scaled and damped; `None` where they are singular.
pub(super) fn solve(n: &Equations, damping: f64) -> Option<[f64; 4]> {
    let scale = scales(n);
    let mut a = *n;
    for i in 0..4 {
        for j in 0..4 {
            a[i][j] *= scale[i] * scale[j];
        }
        a[i][i] += damping;
        a[i][4] *= scale[i];
    }
    let x = eliminated(a, 1e-14)?;
    Some(std::array::from_fn(|i| x[i] * scale[i]))
}

/// Solves N equations by elimination; `None` where a pivot is below `least`. M is N + 1.
pub(super) fn eliminated<const N: usize, const M: usize>(
    mut a: [[f64; M]; N],
    least: f64,
) -> Option<[f64; N]> {
    for i in 0..N {
        let above = a[i];
        if above[i].abs() < least {
            return None;
        }
        for row in &mut a[i + 1..] {
            let factor = row[i] / above[i];
            for (value, from) in row.iter_mut().zip(above) {
                *value -= factor * from;
            }
        }
    }
    let mut x = [0.0; N];
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|k| a[i][k] * x[k]).sum();
        x[i] = (a[i][N] - known) / a[i][i];
    }
    Some(x)
}

/// Inverse of the matrix.
pub(super) fn inverse(n: &Equations) -> Option<[[f64; 4]; 4]> {
    let mut columns = [[0.0; 4]; 4];
    for (k, column) in columns.iter_mut().enumerate() {
        let mut unit = *n;
        for (i, row) in unit.iter_mut().enumerate() {
            row[4] = if i == k { 1.0 } else { 0.0 };
        }
        *column = solve(&unit, 0.0)?;
    }
    Some(columns)
}

/// Largest over smallest eigenvalue of the matrix scaled to a unit diagonal, by the power method.
pub(super) fn condition(n: &Equations, inverse: &[[f64; 4]; 4]) -> f64 {
    let scale = scales(n);
    let largest = |of: &dyn Fn(usize, usize) -> f64| {
        let (mut v, mut value) = ([0.5, 0.3, -0.6, 0.7], 0.0);
        for _ in 0..30 {
            let w: [f64; 4] = std::array::from_fn(|i| (0..4).map(|j| of(i, j) * v[j]).sum());
            value = w.iter().map(|w| w * w).sum::<f64>().sqrt();
            v = w.map(|w| w / value);
        }
        value
    };
    largest(&|i, j| n[i][j] * scale[i] * scale[j])
        * largest(&|i, j| inverse[i][j] / (scale[i] * scale[j]))
}

/// Covariance of unknowns fitted with other weights than their inverse variances: `inverse` of the
/// equations on either side of `noise`, the sum of products of slopes times squared weights and variances.
pub(super) fn covariance<const N: usize>(
    inverse: &[[f64; N]; N],
    noise: impl Fn(usize, usize) -> f64,
) -> [[f64; N]; N] {
    let product = |a: &[[f64; N]; N], at: &dyn Fn(usize, usize) -> f64| -> [[f64; N]; N] {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..N).map(|k| a[i][k] * at(k, j)).sum()))
    };
    let half = product(inverse, &noise);
    product(&half, &|k, j| inverse[k][j])
}
