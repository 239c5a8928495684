//! Least squares in f64, independent of the engine: eq. 1 by Levenberg-Marquardt on normal
//! equations, for counts by weights from the fit.

/// A, mu, sigma, b of A exp(-(x - mu)^2 / (2 sigma^2)) + b.
pub type Gaussian = [f64; 4];

/// Value and slopes by A, mu, sigma, b.
pub fn gaussian(p: &Gaussian, x: f64) -> (f64, [f64; 4]) {
    let t = (x - p[1]) / p[2];
    let e = (-0.5 * t * t).exp();
    (p[0] * e + p[3], [e, p[0] * e * t / p[2], p[0] * e * t * t / p[2], 1.0])
}

/// The Gaussian that fits best, all values alike; from `start`, lengths in units of `unit`.
pub fn fit(offsets: &[f64], curve: &[f64]) -> Gaussian {
    fit_weighted(offsets, curve, |_, _| 1.0, 400)
}

/// The same with weights of counts from the fit: the maximum of the Poisson likelihood, where
/// no fitted value is below a thousandth of the amplitude.
pub fn fit_counts(offsets: &[f64], curve: &[f64]) -> Gaussian {
    fit_weighted(offsets, curve, |p, f| 1.0 / f.max(1e-3 * p[0].abs()), 400)
}

fn fit_weighted(
    offsets: &[f64],
    curve: &[f64],
    weight: impl Fn(&Gaussian, f64) -> f64,
    rounds: usize,
) -> Gaussian {
    let low = offsets.iter().copied().fold(f64::INFINITY, f64::min);
    let high = offsets.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (middle, unit) = ((low + high) / 2.0, (high - low) / 2.0);
    let x: Vec<f64> = offsets.iter().map(|f| (f - middle) / unit).collect();
    let peak = curve.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = curve.iter().copied().fold(f64::INFINITY, f64::min);
    let at = (0..x.len()).max_by(|&i, &j| curve[i].total_cmp(&curve[j])).unwrap_or(0);
    // The best of several starts, for no start finds every optimum.
    let best = [0.2, 0.4, 0.8]
        .map(|width| {
            let start = [peak - least, x[at], width, least];
            let p = descend(&x, curve, start, &|_, _| 1.0, rounds);
            (cost(&x, curve, &p, &|_, _| 1.0), p)
        })
        .into_iter()
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or([f64::NAN; 4], |(_, p)| p);
    let mut p = best;
    for _ in 0..200 {
        let held = p;
        let next = descend(&x, curve, held, &|_, x| weight(&held, gaussian(&held, x).0), 30);
        let moved = (0..4).map(|i| (next[i] - p[i]).abs()).fold(0.0, f64::max);
        p = next;
        if moved < 1e-13 * peak.abs().max(1.0) {
            break;
        }
    }
    [p[0], middle + p[1] * unit, p[2].abs() * unit, p[3]]
}

type Weight<'a> = dyn Fn(&Gaussian, f64) -> f64 + 'a;

fn cost(x: &[f64], curve: &[f64], p: &Gaussian, weight: &Weight<'_>) -> f64 {
    x.iter().zip(curve).map(|(x, y)| weight(p, *x) * (gaussian(p, *x).0 - y).powi(2)).sum()
}

fn descend(
    x: &[f64],
    curve: &[f64],
    start: Gaussian,
    weight: &Weight<'_>,
    rounds: usize,
) -> Gaussian {
    let mut p = start;
    let mut damping = 1e-3;
    for _ in 0..rounds {
        let mut normal = [[0.0; 5]; 4];
        for (x, y) in x.iter().zip(curve) {
            let (value, slope) = gaussian(&p, *x);
            let w = weight(&p, *x);
            for i in 0..4 {
                for j in 0..4 {
                    normal[i][j] += w * slope[i] * slope[j];
                }
                normal[i][4] += w * slope[i] * (y - value);
            }
        }
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] *= 1.0 + damping;
        }
        let step = solve(normal);
        let next: Gaussian = std::array::from_fn(|i| p[i] + step[i]);
        if cost(x, curve, &next, weight) <= cost(x, curve, &p, weight) {
            p = next;
            damping = (damping * 0.1_f64).max(1e-14);
        } else {
            damping *= 10.0;
        }
    }
    p
}

/// Variances of A, mu, sigma, b of counts drawn from eq. 1 (Cramer-Rao): the inverse of the
/// Fisher information.
pub fn cramer_rao(offsets: &[f64], p: &Gaussian) -> [f64; 4] {
    let unit = p[2];
    let mut information = [[0.0; 4]; 4];
    for x in offsets {
        let (value, slope) = gaussian(p, *x);
        let slope = [slope[0] * p[0], slope[1] * unit, slope[2] * unit, p[0]];
        for i in 0..4 {
            for j in 0..4 {
                information[i][j] += slope[i] * slope[j] / value;
            }
        }
    }
    std::array::from_fn(|k| {
        let rows: [[f64; 5]; 4] =
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    if j < 4 { information[i][j] } else { f64::from(u8::from(i == k)) }
                })
            });
        let scale = [p[0], unit, unit, p[0]][k];
        solve(rows)[k] * scale * scale
    })
}

/// Gaussian elimination of four equations, the right side in the last column.
pub fn solve(mut a: [[f64; 5]; 4]) -> [f64; 4] {
    for i in 0..4 {
        let pivot = (i..4).max_by(|&j, &k| a[j][i].abs().total_cmp(&a[k][i].abs())).unwrap_or(i);
        a.swap(i, pivot);
        let above = a[i];
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
    x
}
