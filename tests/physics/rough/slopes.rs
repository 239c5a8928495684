//! Slopes that rays get at a rough face and at the one behind it, which stands across them: their law
//! against the closed form of the first order, and against Snell's law on normals that are drawn here.

#![allow(clippy::float_cmp, reason = "angles of a list; draws are equal to the bit")]

use super::face;
use crate::detector::z_test::Scores;
use crate::reference::normal::{cumulative, quantile};
use crate::reference::rough::{Gauss, passed};
use crate::reference::surfaces::Random;
use crate::support::{CARBON, amount, backends, engine};
use beamlet::Backend;
use beamlet::internals::trace::{Ray, trace};

/// Rays of a case: a fifth, which finds a width that is 2.5 % off; all with `BEAMLET_ALL`.
fn draws() -> u32 {
    amount(200_000, 1_000_000)
}

/// Slopes of rays that differ by what they draw alone, over delta: in the plane of incidence and
/// across it.
fn slopes(backend: Backend, sigma: f64, incidence: f64, draws: u32) -> [Vec<f64>; 2] {
    let scene = face(sigma, incidence, CARBON);
    let engine = engine(backend);
    let simulation = engine.prepare(&scene).expect("a sample");
    let ray = |key| Ray { x: 1e-6, z: 2e-6, slope_x: 0.0, slope_z: 0.0, pose: 0, key };
    let rays: Vec<Ray> = (1..=draws).map(ray).collect();
    let results = trace(&simulation, &rays).expect("results");
    assert!(results.iter().all(|result| result.flags & !0xff00_0007 == 0), "flags");
    let of = |f: fn(&beamlet::internals::trace::RayResult) -> f32| {
        results.iter().map(|result| f64::from(f(result)) / CARBON[1]).collect()
    };
    [of(|result| result.slope_x), of(|result| result.slope_z)]
}

fn degrees(angle: f64) -> f64 {
    angle * std::f64::consts::PI / 180.0
}

/// Kolmogorov's test of values that are spread evenly over [0, 1) if a claim holds, as a score.
fn kolmogorov(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    let off = |(i, value): (usize, &f64)| (value - i as f64 / n).max((i as f64 + 1.0) / n - value);
    let most = values.iter().enumerate().map(off).fold(0.0, f64::max);
    score_of(most * n.sqrt())
}

/// The same of two samples of one law.
fn kolmogorov_of_two(mut a: Vec<f64>, mut b: Vec<f64>) -> f64 {
    a.sort_by(f64::total_cmp);
    b.sort_by(f64::total_cmp);
    let (n, m) = (a.len() as f64, b.len() as f64);
    let (mut i, mut j, mut most) = (0, 0, 0.0_f64);
    while i < a.len() && j < b.len() {
        if a[i] <= b[j] {
            i += 1
        } else {
            j += 1
        }
        most = most.max((i as f64 / n - j as f64 / m).abs());
    }
    score_of(most * (n * m / (n + m)).sqrt())
}

/// The standard normal score as likely as a value of Kolmogorov's statistic.
fn score_of(statistic: f64) -> f64 {
    let term = |k: i32| {
        let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
        2.0 * sign * (-2.0 * f64::from(k * k) * statistic * statistic).exp()
    };
    let chance = if statistic < 0.3 { 1.0 } else { (1..40).map(term).sum::<f64>() };
    -quantile(0.5 * chance.clamp(1e-300, 1.0))
}

/// Slopes over delta to first order: in the plane of incidence (tan - s1) / (1 + s1 tan), across it
/// s2 / (cos + s1 sin), and those of the face behind, the other way.
fn first_order(sigma: f64, incidence: f64, draws: u32) -> [Vec<f64>; 2] {
    let mut gauss = Gauss(Random::new(5));
    let (sin, cos) = incidence.sin_cos();
    let mut slopes = [Vec::new(), Vec::new()];
    for _ in 0..draws {
        let [[s1, s2], [back1, back2]] = [gauss.pair(sigma), gauss.pair(sigma)];
        slopes[0].push((sin - s1 * cos) / (cos + s1 * sin) + back1);
        slopes[1].push(s2 / (cos + s1 * sin) + back2);
    }
    slopes
}

/// Slopes over delta by Snell's law.
fn drawn(sigma: f64, incidence: f64, delta: f64, draws: u32) -> [Vec<f64>; 2] {
    let mut gauss = Gauss(Random::new(7));
    let (sin, cos) = incidence.sin_cos();
    let mut slopes = [Vec::new(), Vec::new()];
    for _ in 0..draws {
        let (within, entered) =
            passed(&mut gauss, sigma, [-sin, cos, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0 - delta]);
        let (ray, left) = passed(&mut gauss, sigma, [0.0, 1.0, 0.0], within, [1.0 - delta, 1.0]);
        assert!(entered && left, "reflected off the face");
        slopes[0].push(ray[0] / ray[1] / delta);
        slopes[1].push(ray[2] / ray[1] / delta);
    }
    slopes
}

/// Mean and variance.
fn spread(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    [mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n]
}

/// Far from grazing the first order is the law, and its widths are sigma / cos2 in the plane of incidence
/// and sigma / cos across it; those of the face behind add to them.
#[test]
fn slopes_have_the_law_of_the_first_order() {
    let mut scores = Scores::default();
    for sigma in [1e-3, 2e-3, 0.02] {
        for angle in [0.0, 45.0, 80.0] {
            if angle == 80.0 && sigma > 0.01 {
                continue; // below, by Snell's law
            }
            let what = |of: &str| format!("{sigma}, {angle} degrees, {of}");
            let got = slopes(Backend::Bvh, sigma, degrees(angle), draws());
            let cos = degrees(angle).cos();
            for (axis, (x, power)) in got.iter().zip([4, 2]).enumerate() {
                let [mean, variance] = spread(x);
                let wide = sigma * sigma * (cos.powi(-power) + 1.0);
                // Terms of the next order in sigma tan, and four deviations of a variance and more.
                let next = 30.0 * (sigma * degrees(angle).tan()).powi(2);
                let noise = 4.25 * (2.0 / f64::from(draws())).sqrt();
                assert!((variance / wide - 1.0).abs() < noise + next, "{variance} of {wide}");
                if angle == 0.0 {
                    // Gaussian.
                    let z: Vec<f64> = x.iter().map(|x| x / wide.sqrt()).collect();
                    scores.take_moments(&what("slopes"), &z, 3.0);
                    let even = z.iter().map(|z| cumulative(*z)).collect();
                    scores.take(what("shape"), kolmogorov(even));
                }
                let off: Vec<f64> = x.iter().map(|x| (x - mean) / variance.sqrt()).collect();
                let side = [&off[1..], &off[..off.len() - 1]];
                scores.take_covariance(
                    &what(&format!("keys side by side, {axis}")),
                    side[0],
                    side[1],
                );
            }
            let want = first_order(sigma, degrees(angle), draws());
            for (axis, (got, want)) in got.into_iter().zip(want).enumerate() {
                scores.take(what(&format!("law, {axis}")), kolmogorov_of_two(got, want));
            }
        }
    }
    scores.judge("slopes at a rough face against the first order");
}

/// Near grazing tails are heavy, normals turn away, and rays are totally reflected.
#[test]
fn slopes_near_grazing_follow_snells_law() {
    let mut scores = Scores::default();
    for (sigma, angle) in [(0.02, 80.0), (1e-3, 88.0), (2e-3, 88.0), (0.02, 88.0)] {
        let want = drawn(sigma, degrees(angle), CARBON[1], draws());
        let got = slopes(Backend::Bvh, sigma, degrees(angle), draws());
        for (axis, (got, want)) in got.into_iter().zip(want).enumerate() {
            let what = format!("{sigma}, {angle} degrees, axis {axis}");
            scores.take(what, kolmogorov_of_two(got, want));
        }
    }
    scores.judge("slopes near grazing against Snell's law in f64");
}

/// The tests find what is not so.
#[test]
fn another_law_is_found_out() {
    let [x, _] = slopes(Backend::Bvh, 2e-3, 0.0, 200_000);
    let even =
        |sigma: f64| x.iter().map(|x| cumulative(x / sigma / f64::sqrt(2.0))).collect::<Vec<_>>();
    assert!(kolmogorov(even(2e-3)).abs() < 4.5);
    assert!(kolmogorov(even(2.05e-3)) > 4.5);
    let want = drawn(2e-3, degrees(88.0), CARBON[1], 200_000);
    let other = drawn(2.1e-3, degrees(88.0), CARBON[1], 200_000);
    assert!(kolmogorov_of_two(want[0].clone(), other[0].clone()) > 4.5);
}

/// Draws of a ray depend on its key, the seed, the surface and the side alone.
#[test]
fn draws_belong_to_rays_and_seeds() {
    let [first, _] = slopes(Backend::Bvh, 2e-3, 0.0, 1000);
    let [same, _] = slopes(Backend::Bvh, 2e-3, 0.0, 500);
    assert_eq!(first[..500], same[..]);
    for backend in backends() {
        assert_eq!(slopes(backend, 2e-3, 0.0, 1000)[0], first, "{backend:?}");
        // Traced exactly.
        let [grazing, same] =
            [Backend::Bvh, backend].map(|it| slopes(it, 0.01, degrees(88.0), 20_000));
        assert_eq!(grazing, same, "{backend:?}");
    }
    let mut scene = face(2e-3, 0.0, CARBON);
    scene.sampling.seed = 2;
    let engine = engine(Backend::Bvh);
    let simulation = engine.prepare(&scene).expect("a sample");
    let ray = |key| Ray { x: 1e-6, z: 2e-6, slope_x: 0.0, slope_z: 0.0, pose: 0, key };
    let rays: Vec<Ray> = (1..=1000).map(ray).collect();
    let others = trace(&simulation, &rays).expect("results");
    let equal = others.iter().zip(&first).filter(|(a, b)| f64::from(a.slope_x) / CARBON[1] == **b);
    assert_eq!(equal.count(), 0);
}
