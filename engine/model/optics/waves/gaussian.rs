//! Variance of the Gaussian that fits light at some offsets.

/// Sections of the search for the width, each of which leaves two thirds.
const SECTIONS: u32 = 80;
/// Least width over the distance from the centre to the farthest offset, and greatest.
const WIDTHS: [f64; 2] = [0.05, 5.0];

/// Variance, m², of the Gaussian about a centre (m) that fits values at offsets (m) best, with a background
/// if there are more than three; `None` with fewer than three.
#[must_use]
pub(super) fn fitted_variance(
    offsets: &[f64],
    centre: f64,
    value: impl Fn(f64) -> f64,
) -> Option<f64> {
    if offsets.len() < 3 {
        return None;
    }
    let points: Vec<[f64; 2]> = offsets.iter().map(|it| [it - centre, value(*it)]).collect();
    let farthest = points.iter().map(|[x, _]| x.abs()).fold(0.0, f64::max);
    let with_background = offsets.len() > 3;
    // Part of the variance of the values that a Gaussian explains.
    let explained = |sigma: f64| {
        let [mut gg, mut gy, mut g, mut y] = [0.0; 4];
        for [x, value] in &points {
            let gaussian = libm::exp(-0.5 * (x / sigma).powi(2));
            gg += gaussian * gaussian;
            gy += gaussian * value;
            g += gaussian;
            y += value;
        }
        let count = points.len() as f64;
        match with_background {
            true => (gy - g * y / count).powi(2) / (gg - g * g / count),
            false => gy * gy / gg,
        }
    };
    let [mut low, mut high] = WIDTHS.map(|width| width * farthest);
    for _ in 0..SECTIONS {
        let third = (high - low) / 3.0;
        match explained(low + third) < explained(high - third) {
            true => low += third,
            false => high -= third,
        }
    }
    let sigma = f64::midpoint(low, high);
    (sigma.is_finite() && sigma < 0.99 * WIDTHS[1] * farthest).then_some(sigma * sigma)
}
