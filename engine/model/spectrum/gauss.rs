//! Gauss quadrature for a discrete measure.
//!
//! `n` nodes and weights integrate every polynomial up to degree 2n - 1 against the measure exactly. The
//! recurrence of its orthogonal polynomials comes from the algorithm of Rutishauser, Kahan, Pal and
//! Walker in the form of Gragg and Harrod (Numer. Math. 44, 1984), which is stable up to one node per
//! point; nodes and weights are the eigenvalues and first eigenvector components of the Jacobi matrix
//! (Golub and Welsch, Math. Comp. 23, 1969).

/// Coefficients of the three-term recurrence of a measure: alpha, and beta with the total
/// weight first.
#[derive(Debug, Clone)]
pub(super) struct Recurrence {
    alpha: Vec<f64>,
    beta: Vec<f64>,
}

impl Recurrence {
    /// Recurrence of the measure with `weights` (> 0) at distinct `points`, for up to `most` nodes.
    pub(super) fn of(points: &[f64], weights: &[f64], most: usize) -> Self {
        let size = most.min(points.len());
        let mut alpha = points[..size].to_vec();
        let mut beta = vec![0.0; size];
        beta[0] = weights[0];
        for (index, (&point, &weight)) in points.iter().zip(weights).enumerate().skip(1) {
            let (mut pushed, mut gamma, mut sigma, mut t) = (weight, 1.0, 0.0, 0.0);
            for (alpha, beta) in alpha.iter_mut().zip(&mut beta).take(index + 1) {
                let rho = *beta + pushed;
                let (scaled, before) = (gamma * rho, sigma);
                (gamma, sigma) = if rho <= 0.0 { (1.0, 0.0) } else { (*beta / rho, pushed / rho) };
                let next = sigma * (*alpha - point) - gamma * t;
                *alpha -= next - t;
                t = next;
                pushed = if sigma <= 0.0 { before * *beta } else { t * t / sigma };
                *beta = scaled;
            }
        }
        Self { alpha, beta }
    }

    /// Most nodes that it can give.
    pub(super) fn most(&self) -> usize {
        self.alpha.len()
    }

    /// `count` nodes, ascending, with their weights, which sum to the measure's.
    pub(super) fn nodes(&self, count: usize) -> Vec<(f64, f64)> {
        let mut diagonal = self.alpha[..count].to_vec();
        let mut beside: Vec<f64> = self.beta[1..count].iter().map(|beta| beta.sqrt()).collect();
        beside.push(0.0);
        let first = first_components(&mut diagonal, &mut beside);
        let weight = |(node, first): (f64, f64)| (node, self.beta[0] * first * first);
        let mut nodes: Vec<_> = diagonal.into_iter().zip(first).map(weight).collect();
        nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
        nodes
    }
}

/// Eigenvalues (in `diagonal`) and first components of the eigenvectors of a symmetric
/// tridiagonal matrix, by QL with implicit shifts. `beside` holds the subdiagonal and a zero.
fn first_components(diagonal: &mut [f64], beside: &mut [f64]) -> Vec<f64> {
    let size = diagonal.len();
    let mut first = vec![0.0; size];
    first[0] = 1.0;
    for low in 0..size {
        // Converges in two or three; the bound keeps a broken input from looping.
        for _ in 0..60 {
            let split = |&at: &usize| {
                let near = diagonal[at].abs() + diagonal[at + 1].abs();
                beside[at].abs() <= f64::EPSILON * near
            };
            let high = (low..size - 1).find(split).unwrap_or(size - 1);
            if high == low {
                break;
            }
            let mut g = (diagonal[low + 1] - diagonal[low]) / (2.0 * beside[low]);
            let r = libm::hypot(g, 1.0);
            g = diagonal[high] - diagonal[low] + beside[low] / (g + r.copysign(g));
            let (mut s, mut c, mut p) = (1.0, 1.0, 0.0);
            for at in (low..high).rev() {
                let (f, b) = (s * beside[at], c * beside[at]);
                let r = libm::hypot(f, g);
                beside[at + 1] = r;
                (s, c) = if r > 0.0 { (f / r, g / r) } else { (0.0, 1.0) };
                g = diagonal[at + 1] - p;
                let r = (diagonal[at] - g) * s + 2.0 * c * b;
                p = s * r;
                diagonal[at + 1] = g + p;
                g = c * r - b;
                let f = first[at + 1];
                first[at + 1] = s * first[at] + c * f;
                first[at] = c * first[at] - s * f;
            }
            diagonal[low] -= p;
            beside[low] = g;
            beside[high] = 0.0;
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn n_nodes_are_exact_to_degree_two_n_minus_one() {
        let points: Vec<f64> = (0..200).map(|i| -1.0 + f64::from(i) / 99.5).collect();
        let weights: Vec<f64> = points.iter().map(|x| (3.0 * x).exp() + 0.1).collect();
        let recurrence = Recurrence::of(&points, &weights, 24);
        let total: f64 = weights.iter().sum();
        for count in [1, 2, 5, 12, 24] {
            let nodes = recurrence.nodes(count);
            assert_eq!(nodes.len(), count);
            for degree in 0..i32::try_from(2 * count).unwrap() {
                let exact: f64 = points.iter().zip(&weights).map(|(x, w)| w * x.powi(degree)).sum();
                let gauss: f64 = nodes.iter().map(|(x, w)| w * x.powi(degree)).sum();
                // Rounding only: 24 nodes accumulate a few hundred operations of 1e-16.
                assert!((gauss - exact).abs() < 1e-12 * total, "{count} nodes, degree {degree}");
            }
        }
    }

    #[test]
    fn as_many_nodes_as_points_are_the_points() {
        let (points, weights) = ([0.1, 0.7, 0.8, 2.0, 2.5], [1.0, 1e-3, 5.0, 0.2, 1e-9]);
        let nodes = Recurrence::of(&points, &weights, 99).nodes(5);
        for ((node, weight), (x, w)) in nodes.into_iter().zip(points.into_iter().zip(weights)) {
            assert!((node - x).abs() < 1e-12 && (weight - w).abs() < 1e-12, "{node} {weight}");
        }
    }

    #[test]
    fn legendre_nodes_come_out_of_many_even_points() {
        // 2 nodes of the even measure on [-1, 1] are +-1/sqrt 3, to 1/N^2 of N points.
        let points: Vec<f64> = (0..2000).map(|i| -1.0 + (f64::from(i) + 0.5) / 1000.0).collect();
        let nodes = Recurrence::of(&points, &[1.0; 2000], 2).nodes(2);
        assert!((nodes[1].0 - 3_f64.sqrt().recip()).abs() < 1e-6, "{nodes:?}");
    }
}
