//! Weights of the values of a curve in its integral over mask offsets.

/// Offsets closer than this share of the mean distance count as one: a spline through two noisy values
/// at nearly one place would multiply their noise by the quotient of distances. With a quarter the
/// noise of 21 random offsets stays within 1.5 times the noise of trapezoids.
const CLOSE: f64 = 0.25;

/// Weights of the trapezoid rule, in the unit of the offsets: half the distances to the neighbours, shared
/// by equal offsets; 1 without two different offsets.
pub(super) fn trapezoids(offsets: &[f64]) -> Vec<f64> {
    let mut sorted = offsets.to_vec();
    sorted.sort_by(f64::total_cmp);
    let share = |offset: &f64| {
        let below = sorted.iter().rev().find(|other| *other < offset);
        let above = sorted.iter().find(|other| *other > offset);
        let same = sorted.iter().filter(|other| other.total_cmp(offset).is_eq()).count() as f64;
        let gaps = [below, above].into_iter().flatten().map(|other| (other - offset).abs());
        match gaps.sum::<f64>() {
            both if both > 0.0 => 0.5 * both / same,
            _ => 1.0,
        }
    };
    offsets.iter().map(share).collect()
}

/// Weights of the values at these offsets, in the unit of the offsets: the integral of the cubic spline
/// through the values with a slope of zero at both ends. At even offsets they are the weights of the
/// trapezoid rule; at uneven ones the error is of the fourth order in the distances instead of the
/// second. All zero without two different offsets.
pub(super) fn weights(offsets: &[f64]) -> Vec<f64> {
    let groups = groups(offsets);
    let mean =
        |group: &Vec<usize>| group.iter().map(|at| offsets[*at]).sum::<f64>() / group.len() as f64;
    let knots: Vec<f64> = groups.iter().map(mean).collect();
    let mut weights = vec![0.0; offsets.len()];
    for (group, weight) in groups.iter().zip(of_knots(&knots)) {
        for at in group {
            weights[*at] = weight / group.len() as f64;
        }
    }
    weights
}

/// Indices of offsets by place, ascending; close offsets form one group.
fn groups(offsets: &[f64]) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..offsets.len()).collect();
    order.sort_by(|a, b| offsets[*a].total_cmp(&offsets[*b]));
    let (Some(first), Some(last)) = (order.first(), order.last()) else { return Vec::new() };
    let intervals = order.windows(2).filter(|pair| offsets[pair[0]] < offsets[pair[1]]).count();
    let close = CLOSE * (offsets[*last] - offsets[*first]) / intervals.max(1) as f64;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for at in order {
        match groups.last_mut() {
            Some(group) if offsets[at] - offsets[group[0]] <= close => group.push(at),
            _ => groups.push(vec![at]),
        }
    }
    groups
}

/// Weights of the spline at ascending knots. With gaps h and second derivatives m the integral is
/// Σ h (y₀ + y₁)/2 − h³ (m₀ + m₁)/24, and m solves A m = B y with symmetric tridiagonal A and B; so the
/// weights are the trapezoids' less B A⁻¹ times the factors of m.
fn of_knots(knots: &[f64]) -> Vec<f64> {
    let n = knots.len();
    if n < 2 {
        return vec![0.0; n];
    }
    let gaps: Vec<f64> = knots.windows(2).map(|pair| pair[1] - pair[0]).collect();
    // Sum, at each knot, of what the gaps on both sides contribute.
    let at_knots = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let side = |gap: Option<&f64>| gap.map_or(0.0, |gap| of(*gap));
        (0..n)
            .map(|i| side(i.checked_sub(1).and_then(|i| gaps.get(i))) + side(gaps.get(i)))
            .collect()
    };
    let bends = solved(&at_knots(&|gap| 2.0 * gap), &gaps, at_knots(&|gap| gap.powi(3) / 24.0));
    let mut weights = at_knots(&|gap| gap / 2.0);
    for (i, gap) in gaps.iter().enumerate() {
        let change = 6.0 * (bends[i + 1] - bends[i]) / gap;
        weights[i] -= change;
        weights[i + 1] += change;
    }
    weights
}

/// Solution of a symmetric tridiagonal system that its diagonal dominates.
fn solved(diagonal: &[f64], beside: &[f64], mut right: Vec<f64>) -> Vec<f64> {
    let mut pivots = diagonal.to_vec();
    for i in 1..pivots.len() {
        let factor = beside[i - 1] / pivots[i - 1];
        pivots[i] -= factor * beside[i - 1];
        right[i] -= factor * right[i - 1];
    }
    for i in (0..pivots.len()).rev() {
        let above = if i + 1 < pivots.len() { beside[i] * right[i + 1] } else { 0.0 };
        right[i] = (right[i] - above) / pivots[i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_offsets_have_trapezoids_and_close_ones_share_a_weight() {
        let even: Vec<f64> = (0..9).map(|k| 5.0 * f64::from(k)).collect();
        let found = weights(&even);
        for (k, weight) in found.iter().enumerate() {
            let trapezoid = if k % 8 == 0 { 2.5 } else { 5.0 };
            assert!((weight - trapezoid).abs() < 1e-12, "{k}: {weight}");
        }
        // Any order; a value twice, and one that is nearly there.
        let found = weights(&[40.0, 0.0, 0.0, 10.0, 20.0, 20.5, 30.0]);
        assert_eq!(found[1].to_bits(), found[2].to_bits());
        assert_eq!(found[4].to_bits(), found[5].to_bits());
        assert!((found.iter().sum::<f64>() - 40.0).abs() < 1e-12, "{found:?}");
        assert_eq!(weights(&[1.0, 1.0]), [0.0, 0.0]);
    }

    #[test]
    fn cubic_pieces_with_flat_ends_are_integrated_exactly() {
        // 3 t^2 - 2 t^3 of t = x / 7 is its own spline, whatever the knots; its integral is 3.5.
        let offsets = [0.0, 0.9, 2.0, 4.5, 5.0, 7.0];
        let value = |x: f64| (x / 7.0).powi(2) * (3.0 - 2.0 * x / 7.0);
        let found: f64 = weights(&offsets).iter().zip(offsets).map(|(w, x)| w * value(x)).sum();
        assert!((found - 3.5).abs() < 1e-12, "{found}");
    }
}
