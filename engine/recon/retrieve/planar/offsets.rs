//! Lists of mask offsets in two directions, and the contrasts that they determine.

use super::super::equations::{Equations, UNKNOWNS};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result};

/// Part of a term that the others leave, below which offsets do not determine it.
const LEAST: f64 = 1e-3;

/// Terms of a curve near its peak to second order, and what follows from each.
const TERMS: [(&str, &str); 6] = [
    ("a constant", "the transmission"),
    ("x", "refraction along x"),
    ("z", "refraction along z"),
    ("x^2", "the dark field along x"),
    ("z^2", "the dark field along z"),
    ("x z", "the dark field xz"),
];

/// Refuses offsets that do not determine a curve in two directions, and names the contrasts without an answer.
///
/// # Errors
/// [`Error::Scene`] with the terms that they lack.
pub(super) fn check(pairs: &[[f64; 2]], least: usize) -> Result<()> {
    let mut different = pairs.to_vec();
    different.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    different.dedup();
    let refused =
        |found: String, allowed: String| Err(Error::scene("scan.mask_offsets", found, allowed));
    if pairs.iter().flatten().any(|offset| !offset.is_finite()) {
        return refused("an offset that is not finite".into(), "finite lengths".into());
    }
    let lacking = lacking(&different);
    let allowed = format!(
        "{least} or more different pairs, three or more offsets along each axis, and pairs off both axes, as a grid \
         of 3 x 3 has"
    );
    if lacking.is_empty() && different.len() < least {
        return refused(format!("{} different pairs of offsets", different.len()), allowed);
    }
    if lacking.is_empty() {
        return Ok(());
    }
    let contrasts: Vec<&str> = lacking.iter().map(|term| TERMS[*term].1).collect();
    let ranges = [0, 1].map(|axis| {
        let all = different.iter().map(|pair| pair[axis]);
        all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
    });
    let found = format!(
        "{} different pairs of offsets over {} along x and {} along z, which do not determine {}",
        different.len(),
        Length.rounded(ranges[0]),
        Length.rounded(ranges[1]),
        contrasts.join(", ")
    );
    refused(found, allowed)
}

/// Terms that the others explain at all offsets.
fn lacking(pairs: &[[f64; 2]]) -> Vec<usize> {
    let middle = [0, 1].map(|axis| mean(pairs.iter().map(|pair| pair[axis])));
    let spread = [0, 1].map(|axis| {
        let squares = pairs.iter().map(|pair| (pair[axis] - middle[axis]).powi(2));
        mean(squares).sqrt().max(f64::MIN_POSITIVE)
    });
    // An axis without a spread beside the other's has no steps.
    let most = spread[0].max(spread[1]);
    let unit = spread.map(|own| if own < 1e-9 * most { most } else { own });
    let terms = |pair: &[f64; 2]| {
        let [x, z] = [0, 1].map(|axis| (pair[axis] - middle[axis]) / unit[axis]);
        [1.0, x, z, x * x, z * z, x * z, 0.0]
    };
    let count = pairs.len() as f64;
    // In the order of the terms: a term counts as lacking if those before it explain it, but for a part of its unit.
    let (mut held, mut lacking) = ([true; UNKNOWNS], Vec::new());
    for term in 0..TERMS.len() {
        held[term] = false;
        let mut equations = Equations::new(&held);
        pairs.iter().for_each(|pair| equations.add(&terms(pair), 1.0, 0.0));
        let inverse = equations.inverse();
        held[term] = inverse.is_none_or(|it| it[term][term] * LEAST * LEAST * count > 1.0);
        if held[term] {
            lacking.push(term);
        }
    }
    lacking
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(pairs: &[[f64; 2]]) -> String {
        check(pairs, 8).unwrap_err().to_string()
    }

    #[test]
    fn offsets_that_lack_a_direction_are_refused_with_its_name() {
        let grid = |xs: &[f64], zs: &[f64]| -> Vec<[f64; 2]> {
            zs.iter().flat_map(|z| xs.iter().map(move |x| [*x * 1e-6, *z * 1e-6])).collect()
        };
        let nine: Vec<f64> = (-4..=4).map(f64::from).collect();
        assert!(check(&grid(&[-5.0, 0.0, 5.0], &[-5.0, 0.0, 5.0]), 8).is_ok());
        let along_x = message(&grid(&nine, &[0.0]));
        assert!(along_x.contains("refraction along z") && !along_x.contains("refraction along x"));
        let two_heights = message(&grid(&nine, &[0.0, 5.0]));
        assert!(two_heights.contains("dark field along z"), "{two_heights}");
        assert!(!two_heights.contains("dark field xz"), "{two_heights}");
        let cross: Vec<[f64; 2]> =
            grid(&nine, &[0.0]).into_iter().chain(grid(&[0.0], &nine)).collect();
        // Offsets that an encoder read are off the axes by a nanometre.
        let read = |at: usize, [x, z]: [f64; 2]| {
            let jitter = |by: f64| 1e-9 * (by * (at + 1) as f64).sin();
            [x + jitter(3.1), z + jitter(5.7)]
        };
        let read = cross.iter().enumerate().map(|(at, pair)| read(at, *pair)).collect::<Vec<_>>();
        for cross in [cross, read] {
            let cross = message(&cross);
            assert!(cross.contains("determine the dark field xz;"), "{cross}");
        }
        let diagonal: Vec<[f64; 2]> = nine.iter().map(|t| [t * 1e-6, t * 2e-6]).collect();
        assert!(message(&diagonal).contains("refraction along z"));
        let seven: Vec<[f64; 2]> = grid(&[-5.0, 0.0, 5.0], &[-5.0, 0.0, 5.0])[..7].to_vec();
        assert!(message(&seven).contains("7 different pairs"), "{}", message(&seven));
    }
}
