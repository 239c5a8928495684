//! Light of apertures behind a correlated Gaussian, integrated over pixels by quadrature.

use super::PIXEL;
use ndarray::Array3;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Transmission, refraction x and z (rad), dark field xx, zz and xz (rad^2).
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Contrasts(pub(in super::super) [f64; 6]);

impl Contrasts {
    pub(super) const EMPTY: Self = Self([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);

    /// Sizes that errors are compared with: angles with the larger one, dark fields with their mean.
    pub(super) fn scale(&self) -> [f64; 6] {
        let [t, x, z, xx, zz, xz] = self.0;
        let angle = x.abs().max(z.abs());
        let dark = (xx + zz) / 2.0;
        [t, angle, angle, dark, dark, dark.max(xz.abs())]
    }
}

/// Points of an aperture with their shares, and the covariance of the blur, m^2.
#[derive(Debug, Clone)]
pub(in super::super) struct Blurred {
    /// Light of all of it, value times m^2.
    light: f64,
    points: Vec<([f64; 2], f64)>,
    covariance: [f64; 3],
}

/// Nodes and weights of Gauss and Legendre on -1..1, of five points.
const NODES: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189),
    (-0.538_469_310_105_683, 0.478_628_670_499_366),
    (0.0, 0.568_888_888_888_889),
    (0.538_469_310_105_683, 0.478_628_670_499_366),
    (0.906_179_845_938_664, 0.236_926_885_056_189),
];

impl Blurred {
    /// A Gaussian of a peak of about 1.
    pub(super) fn gaussian(covariance: [f64; 3]) -> Self {
        let [xx, zz, xz] = covariance;
        let light = TAU * (xx * zz - xz * xz).sqrt();
        Self { light, points: vec![([0.0; 2], 1.0)], covariance }
    }

    /// A rectangle behind a Gaussian.
    pub(super) fn rectangle([width, height]: [f64; 2], covariance: [f64; 3]) -> Self {
        let halves = [-1.0, 1.0_f64];
        let line: Vec<(f64, f64)> = halves
            .iter()
            .flat_map(|half| NODES.map(|(x, weight)| ((x + half) / 4.0, weight / 4.0)))
            .collect();
        let across = |(z, by_z): &(f64, f64)| {
            let (z, by_z) = (*z, *by_z);
            line.iter()
                .map(move |(x, by_x)| ([x * width, z * height], by_x * by_z))
                .collect::<Vec<_>>()
        };
        let points = line.iter().flat_map(across).collect();
        Self { light: width * height, points, covariance }
    }

    /// Two rectangles, one convolved with the other, behind a Gaussian.
    pub(super) fn rectangles(sizes: [[f64; 2]; 2], covariance: [f64; 3]) -> Self {
        let [first, second] = sizes.map(|size| Self::rectangle(size, covariance));
        let both = |(a, by_a): &([f64; 2], f64)| {
            let (a, by_a) = (*a, *by_a);
            let moved =
                move |(b, by_b): &([f64; 2], f64)| ([a[0] + b[0], a[1] + b[1]], by_a * by_b);
            second.points.iter().map(moved).collect::<Vec<_>>()
        };
        let points = first.points.iter().flat_map(both).collect();
        Self { light: first.light * second.light * 1e10, points, covariance }
    }

    /// A disk behind a Gaussian: rings of points.
    pub(super) fn disk(diameter: f64, covariance: [f64; 3]) -> Self {
        let ring = |(node, weight): (f64, f64)| {
            // Light over r^2 is even.
            let radius = diameter / 2.0 * ((node + 1.0) / 2.0).sqrt();
            (0..24).map(move |k| {
                let (sin, cos) = (TAU * f64::from(k) / 24.0).sin_cos();
                ([radius * cos, radius * sin], weight / 48.0)
            })
        };
        let points = NODES.into_iter().flat_map(ring).collect();
        Self { light: TAU / 8.0 * diameter * diameter, points, covariance }
    }

    /// The same light behind an object, and a way beyond it.
    pub(super) fn behind(&self, of: &Contrasts, arm: f64) -> Self {
        let [t, _, _, xx, zz, xz] = of.0;
        let mut behind = self.clone();
        behind.light *= t;
        for (own, scatter) in behind.covariance.iter_mut().zip([xx, zz, xz]) {
            *own += scatter * arm * arm;
        }
        behind
    }

    /// Distance from a centre where there is no light, m.
    pub(super) fn reach(&self) -> f64 {
        let own = self.points.iter().map(|([x, z], _)| x.hypot(*z)).fold(0.0, f64::max);
        own + 7.5 * self.covariance[0].max(self.covariance[1]).sqrt()
    }

    /// Density at a place from the centre, 1/m^2.
    pub(super) fn density(&self, [x, z]: [f64; 2]) -> f64 {
        let [xx, zz, xz] = self.covariance;
        let det = xx * zz - xz * xz;
        let of = |([px, pz], share): &([f64; 2], f64)| {
            let [u, w] = [x - px, z - pz];
            let square = (zz * u * u - 2.0 * xz * u * w + xx * w * w) / det;
            share * (-0.5 * square).exp() / (TAU * det.sqrt())
        };
        self.light * self.points.iter().map(of).sum::<f64>()
    }

    /// Adds the light of a centre to the means over pixels: exact along z, five points twice along x.
    pub(super) fn add(&self, frame: &mut Array3<f64>, centre: [f64; 2]) {
        let [xx, zz, xz] = self.covariance;
        let (sigma_x, slope) = (xx.sqrt(), xz / xx);
        let free = (zz - xz * slope).sqrt();
        let (_, rows, columns) = frame.dim();
        let reach = self.reach();
        let nodes: Vec<(f64, f64)> = [-0.5, 0.5]
            .into_iter()
            .flat_map(|half| NODES.map(|(node, weight)| ((node / 2.0 + half) / 2.0, weight / 4.0)))
            .collect();
        for column in 0..columns {
            let x = (column as f64 + 0.5 - columns as f64 / 2.0) * PIXEL;
            if (x - centre[0]).abs() > reach + PIXEL {
                continue;
            }
            for row in 0..rows {
                let z = (rows as f64 / 2.0 - 0.5 - row as f64) * PIXEL;
                if (z - centre[1]).abs() > reach + PIXEL {
                    continue;
                }
                let mut sum = 0.0;
                for ([px, pz], share) in &self.points {
                    for (node, weight) in &nodes {
                        let u = x + node * PIXEL - centre[0] - px;
                        let density = (-0.5 * (u / sigma_x).powi(2)).exp() / (sigma_x * TAU.sqrt());
                        let below = |edge: f64| {
                            let w = edge - centre[1] - pz - slope * u;
                            0.5 * libm::erfc(-w / free * FRAC_1_SQRT_2)
                        };
                        let part = below(z + PIXEL / 2.0) - below(z - PIXEL / 2.0);
                        sum += share * weight * density * part;
                    }
                }
                frame[[0, row, column]] += self.light * sum / PIXEL;
            }
        }
    }
}
