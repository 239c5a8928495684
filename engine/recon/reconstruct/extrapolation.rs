//! Rows of a body that is wider than the detector, continued.

/// Value at an end of a row, as a share of its largest, from which on the body goes on beyond it.
const CUT: f64 = 0.05;
/// Part of a row at either end that the continuation is fitted to: one over this.
const FITTED: usize = 5;

/// A row with `beyond` values added at either end: those of the ellipse that fits the ends. Integrals
/// through an ellipse are roots of a parabola. Ends where nothing is cut are continued by zeros.
pub(super) fn extended(row: &[f64], beyond: usize) -> Vec<f64> {
    let last = row.len() - 1;
    let few = (row.len() / 50).max(1);
    let most = row.iter().copied().fold(0.0, f64::max);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let ends = [mean(&row[..few]), mean(&row[row.len() - few..])];
    let is_cut = ends.map(|end| end > CUT * most && most > 0.0);
    let fitted = (row.len() / FITTED).max(3).min(row.len() / 2);
    let squares = |at: usize| [at as f64 - last as f64 / 2.0, row[at].max(0.0).powi(2)];
    let mut points: Vec<[f64; 2]> = Vec::new();
    if is_cut[0] {
        points.extend((0..fitted).map(squares));
    }
    if is_cut[1] {
        points.extend((row.len() - fitted..row.len()).map(squares));
    }
    // Where one end is whole the body ends there.
    let border = row.iter().position(|value| *value > CUT * most).unwrap_or(0);
    let other = row.iter().rposition(|value| *value > CUT * most).unwrap_or(last);
    match is_cut {
        [true, false] => points.extend((other.saturating_sub(fitted)..=other).map(squares)),
        [false, true] => points.extend((border..(border + fitted).min(row.len())).map(squares)),
        _ => {}
    }
    let parabola = parabola(&points);
    let mut all = vec![0.0; row.len() + 2 * beyond];
    all[beyond..beyond + row.len()].copy_from_slice(row);
    for (side, end) in ends.into_iter().enumerate().filter(|(side, _)| is_cut[*side]) {
        for n in 1..=beyond {
            let way = last as f64 / 2.0 + n as f64;
            let [x, border] =
                if side == 0 { [-way, n as f64 - way] } else { [way, way - n as f64] };
            let at = |x: f64| parabola[0] + x * (parabola[1] + x * parabola[2]);
            let value = if parabola[2] < 0.0 && at(border) > 0.0 {
                end * (at(x).max(0.0) / at(border)).sqrt()
            } else {
                // No ellipse: down to zero within half a row.
                end * (1.0 - 2.0 * n as f64 / row.len() as f64).max(0.0)
            };
            all[if side == 0 { beyond - n } else { beyond + last + n }] = value;
        }
    }
    all
}

/// Least squares of c0 + c1 x + c2 x²; zeros where the points do not settle it.
fn parabola(points: &[[f64; 2]]) -> [f64; 3] {
    let mut sums = [0.0; 5];
    let mut right = [0.0; 3];
    for [x, y] in points {
        let mut power = 1.0;
        for (n, sum) in sums.iter_mut().enumerate() {
            *sum += power;
            if let Some(right) = right.get_mut(n) {
                *right += y * power;
            }
            power *= x;
        }
    }
    let matrix = glam::DMat3::from_cols_array(&[
        sums[0], sums[1], sums[2], sums[1], sums[2], sums[3], sums[2], sums[3], sums[4],
    ]);
    let scale = sums[0] * sums[2] * sums[4];
    if points.len() < 3 || matrix.determinant().abs() <= 1e-12 * scale {
        return [0.0; 3];
    }
    (matrix.inverse() * glam::DVec3::from_array(right)).to_array()
}
