//! Shift and plane of the refraction angle of empty beam.

use crate::retrieve::equations::Equations;
use crate::retrieve::misfit::median;

/// Standard deviations above which a pixel is an outlier.
const OUTLIER: f64 = 4.0;
/// Rounds in which outliers are left out.
const ROUNDS: usize = 4;
/// Scatter of a normal distribution over its median absolute deviation.
const SIGMA_PER_DEVIATION: f64 = 1.4826;

/// A refraction angle `value + x slope_x + z slope_z`, each with its one-sigma uncertainty.
#[derive(Debug, Clone, Copy)]
pub(super) struct FittedPlane {
    /// rad, at the origin.
    pub(crate) value: [f64; 2],
    /// rad/m along x and z; (0, 0) where they are not fitted.
    pub(crate) slopes: [[f64; 2]; 2],
}

/// Which slopes are fitted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slopes {
    pub(super) x: bool,
    pub(super) z: bool,
}

impl FittedPlane {
    /// Through points (x, z, angle), without outliers; `None` where the points do not determine it.
    pub(super) fn through(points: &[[f64; 3]], slopes: Slopes) -> Option<Self> {
        let unknowns = 1 + usize::from(slopes.x) + usize::from(slopes.z);
        // Lengths in units of their range, so that equations of slopes that nothing determines are singular.
        let range = |of: usize| {
            let ends = points.iter().map(|point| point[of]);
            let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
                [low.min(at), high.max(at)]
            });
            [f64::midpoint(low, high), (high - low) / 2.0]
        };
        let places = [range(0), range(1)];
        for (place, fitted) in places.iter().zip([slopes.x, slopes.z]) {
            if fitted && (place[1].is_nan() || place[1] <= 0.0) {
                return None;
            }
        }
        let basis = |point: &[f64; 3]| {
            let of = |at: usize, fitted: bool| {
                if fitted { (point[at] - places[at][0]) / places[at][1] } else { 0.0 }
            };
            [1.0, of(0, slopes.x), of(1, slopes.z), 0.0, 0.0, 0.0, 0.0]
        };
        let middle = median(points.iter().map(|point| point[2]).collect())?;
        let held = [false, !slopes.x, !slopes.z, true, true, true, true];
        let mut found = [middle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut result = None;
        for _ in 0..ROUNDS {
            let left = |point: &[f64; 3]| {
                let expected: f64 = basis(point).iter().zip(found).map(|(b, f)| b * f).sum();
                point[2] - expected
            };
            let scatter =
                SIGMA_PER_DEVIATION * median(points.iter().map(|p| left(p).abs()).collect())?;
            let near: Vec<&[f64; 3]> =
                points.iter().filter(|point| left(point).abs() <= OUTLIER * scatter).collect();
            if near.len() < unknowns + 2 {
                return None;
            }
            let mut equations = Equations::new(&held);
            for point in &near {
                equations.add(&basis(point), 1.0, point[2]);
            }
            found = equations.solve(0.0)?;
            let rest = |point: &&[f64; 3]| {
                let expected: f64 = basis(point).iter().zip(found).map(|(b, f)| b * f).sum();
                (point[2] - expected).powi(2)
            };
            let variance = near.iter().map(rest).sum::<f64>() / (near.len() - unknowns) as f64;
            result = Some((equations.inverse()?, variance));
        }
        let (inverse, variance) = result?;
        // From the middle of the points to the origin.
        let shift = basis(&[0.0; 3]);
        let value: f64 = shift.iter().zip(found).map(|(s, f)| s * f).sum();
        let rows = shift.iter().zip(inverse);
        let of_value: f64 =
            rows.map(|(s, row)| s * row.iter().zip(shift).map(|(of, s)| of * s).sum::<f64>()).sum();
        let slope = |at: usize, fitted: bool| match fitted {
            true => {
                let half = places[at - 1][1];
                [found[at] / half, (variance * inverse[at][at]).max(0.0).sqrt() / half]
            }
            false => [0.0, 0.0],
        };
        Some(Self {
            value: [value, (variance * of_value).max(0.0).sqrt()],
            slopes: [slope(1, slopes.x), slope(2, slopes.z)],
        })
    }

    /// The angle at a place.
    pub(super) fn at(&self, x: f64, z: f64) -> f64 {
        let [of_x, of_z] = self.slopes.map(|[slope, _]| slope);
        libm::fma(of_x, x, libm::fma(of_z, z, self.value[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_found_beside_outliers_with_their_uncertainty() {
        let mut noise = beamlet_core::random::Draws::new(3, [0, 0, 0], 0x7f);
        let mut deviations = Vec::new();
        for _ in 0..200 {
            let mut points: Vec<[f64; 3]> = Vec::new();
            for column in 0..12 {
                for row in 0..10 {
                    let [x, z] = [f64::from(column) * 1e-4 + 2e-3, f64::from(row) * 1e-4 - 1e-3];
                    let angle = libm::fma(2e-4, x, libm::fma(-3e-4, z, 1e-7));
                    points.push([x, z, libm::fma(1e-8, noise.normal(), angle)]);
                }
            }
            points[17][2] += 1e-6;
            let plane = FittedPlane::through(&points, Slopes { x: true, z: true }).unwrap();
            let found = [plane.value, plane.slopes[0], plane.slopes[1]];
            for ([value, sigma], expected) in found.into_iter().zip([1e-7, 2e-4, -3e-4]) {
                deviations.push((value - expected) / sigma);
            }
        }
        // 600 deviations of variance 1, within 4 of their own deviations of 6 %.
        let mean = deviations.iter().map(|d| d * d).sum::<f64>() / deviations.len() as f64;
        assert!((mean - 1.0).abs() < 0.24, "{mean}");
    }

    #[test]
    fn what_points_do_not_determine_is_none() {
        let column: Vec<[f64; 3]> = (0..20).map(|row| [1e-3, f64::from(row), 1e-7]).collect();
        assert!(FittedPlane::through(&column, Slopes { x: true, z: true }).is_none());
        assert!(FittedPlane::through(&column, Slopes { x: false, z: true }).is_some());
        assert!(FittedPlane::through(&column[..2], Slopes { x: false, z: false }).is_none());
    }
}
