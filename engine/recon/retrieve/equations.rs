//! Normal equations of four unknowns: their solution, inverse and condition.

/// Matrix, and right side in the last column.
pub(super) type Equations = [[f64; 5]; 4];

/// Adds a value with these slopes by the unknowns, its weight and its residual.
pub(super) fn add(n: &mut Equations, slope: [f64; 4], weight: f64, rest: f64) {
    for (row, s) in n.iter_mut().zip(slope) {
        let s = weight * s;
        for (sum, other) in row.iter_mut().zip(slope) {
            *sum += s * other;
        }
        row[4] += s * rest;
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
    for i in 0..4 {
        let above = a[i];
        if above[i].abs() < 1e-14 {
            return None;
        }
        for row in &mut a[i + 1..] {
            let factor = row[i] / above[i];
            for (value, from) in row.iter_mut().zip(above) {
                *value -= factor * from;
            }
        }
    }
    let mut x = [0.0; 4];
    for i in (0..4).rev() {
        let known: f64 = (i + 1..4).map(|k| a[i][k] * x[k]).sum();
        x[i] = (a[i][4] - known) / a[i][i];
    }
    Some(std::array::from_fn(|i| x[i] * scale[i]))
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
/// equations on either side of `noise`, the sum of products of slopes times variances.
pub(super) fn covariance(inverse: &[[f64; 4]; 4], noise: &Equations) -> [[f64; 4]; 4] {
    let product = |a: &[[f64; 4]; 4], at: &dyn Fn(usize, usize) -> f64| -> [[f64; 4]; 4] {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * at(k, j)).sum()))
    };
    let half = product(inverse, &|k, j| noise[k][j]);
    product(&half, &|k, j| inverse[k][j])
}
