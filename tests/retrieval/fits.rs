//! Fits on the device against least squares in f64 of the same numbers, and against what theory
//! says of counts.

use crate::reference::closed_form::ThinMasks;
use crate::reference::draws::Draws;
use crate::reference::fit::{self, Gaussian, gaussian};
use crate::stacks::even;
use crate::support::{Checked, Worst, amount, engine_of, engine_with};
use beamlet::Cancel;
use beamlet::internals::retrieve::{BackgroundTerm, Fitter, SlitCurve, ValueNoise};
use beamlet::retrieve::{Weights, flags};
use beamlet::{Engine, EngineOptions};
use ndarray::Array2;

const UM: f64 = 1e-6;
/// mu and sigma in sigmas, A and b in amplitudes.
const TOLERANCE: f64 = 1e-5;
/// The same where the condition number passes 100 and the pixel is flagged, up to 10,000: f32
/// parameters of a shallow optimum.
const ILL_TOLERANCE: f64 = 2e-5;

fn engine() -> Checked {
    engine_of(EngineOptions::default())
}

/// Fits curves, one per row, on the device.
fn on_device(
    engine: &Engine,
    offsets: &[f64],
    curves: &[Vec<f64>],
    weights: Weights,
) -> Vec<SlitCurve> {
    let noise = ValueNoise { weights, ..ValueNoise::default() };
    let fitter = Fitter::new(engine, offsets, noise, BackgroundTerm::Free).unwrap();
    let data = Array2::from_shape_fn((offsets.len(), curves.len()), |(s, c)| curves[c][s] as f32);
    fitter.fit(data.view(), &Cancel::default()).unwrap()
}

/// The deviation of a fit from the f64 optimum of the numbers that the device saw.
fn deviation(got: &SlitCurve, optimum: &Gaussian) -> [f64; 4] {
    let [a, mu, sigma, b] = *optimum;
    [
        (f64::from(got.amplitude) - a) / a,
        (f64::from(got.centre) - mu) / sigma,
        (f64::from(got.width) - sigma) / sigma,
        (f64::from(got.background) - b) / a,
    ]
}

/// Distance of the centre from the nearer end of the scan in sigmas, positive outside.
fn outside(offsets: &[f64], &[_, mu, sigma, _]: &Gaussian) -> f64 {
    let low = offsets.iter().copied().fold(f64::INFINITY, f64::min);
    let high = offsets.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (low - mu).max(mu - high) / sigma
}

fn rounded(curve: &[f64]) -> Vec<f64> {
    curve.iter().map(|y| f64::from(*y as f32)).collect()
}

/// Compares all curves whose conditioning is not flagged; those that are have ten times the room.
fn compare(
    what: &'static str,
    engine: &Engine,
    offsets: &[f64],
    curves: &[Vec<f64>],
    counts: bool,
) {
    let weights = if counts { Weights::Poisson } else { Weights::None };
    let got = on_device(engine, offsets, curves, weights);
    let mut worst = Worst::new(what, TOLERANCE);
    let (mut flagged, mut without, mut worst_ill) = (0, 0, 0.0_f64);
    for (i, curve) in curves.iter().enumerate() {
        let of = if counts { fit::fit_counts } else { fit::fit };
        let bits = got[i].flags;
        if bits & flags::NO_ANSWER != 0 {
            without += 1;
            continue;
        }
        let optimum = of(offsets, &rounded(curve));
        let beyond = outside(offsets, &optimum);
        if beyond.abs() > ILL_TOLERANCE {
            let is_flagged = bits & flags::OUTSIDE != 0;
            assert_eq!(is_flagged, beyond > 0.0, "{what}: curve {i}, {beyond} beyond the scan");
        }
        let off = deviation(&got[i], &optimum);
        if bits & flags::ILL_CONDITIONED != 0 {
            flagged += 1;
            if got[i].condition < 1e4 {
                worst_ill = off.iter().fold(worst_ill, |most, d| most.max(d.abs()));
            }
            continue;
        }
        for (k, d) in off.into_iter().enumerate() {
            worst.take(d, || {
                format!("curve {i}, unknown {k}, condition {}, {optimum:?}", got[i].condition)
            });
        }
    }
    println!(
        "{what}: {} curves, {flagged} ill-conditioned (to {worst_ill:.1e}), {without} without an \
         answer",
        curves.len()
    );
    assert!(worst_ill <= ILL_TOLERANCE, "{what}: {worst_ill:e} of the ill-conditioned");
    assert!(4 * (flagged + without) < 3 * curves.len(), "{what}: most curves went unchecked");
    worst.holds();
}

/// Eq. 1 with centres to the edge of the scan.
fn family(offsets: &[f64], draws: &mut Draws, amplitude: f64) -> Vec<Vec<f64>> {
    (0..60)
        .map(|i| {
            let mu = if i % 6 == 0 { 25.0 * UM } else { draws.between(-25.0, 25.0) * UM };
            let p = [
                amplitude * draws.between(0.5, 1.0),
                mu,
                draws.between(7.0, 12.0) * UM,
                amplitude * draws.between(-0.04, 0.1),
            ];
            offsets.iter().map(|x| gaussian(&p, *x).0).collect()
        })
        .collect()
}

#[test]
fn noise_free_gaussians_are_fitted_to_the_f64_optimum() {
    let engine = engine();
    let mut draws = Draws(1);
    for steps in [5, 6, 7, 11, 16, 25] {
        for amplitude in [0.17, 4e4] {
            let offsets = even(steps, 25.0 * UM);
            let curves = family(&offsets, &mut draws, amplitude);
            compare("eq. 1 without noise", &engine, &offsets, &curves, false);
        }
    }
}

#[test]
fn uneven_and_unsorted_offsets_are_fitted_to_the_f64_optimum() {
    let engine = engine();
    let mut draws = Draws(2);
    for steps in [6, 9, 14] {
        let mut offsets: Vec<f64> = even(steps, 25.0 * UM)
            .iter()
            .map(|x| x + draws.between(-0.3, 0.3) * 50.0 * UM / steps as f64)
            .collect();
        offsets.swap(0, 3);
        let curves = family(&offsets, &mut draws, 0.2);
        compare("uneven offsets", &engine, &offsets, &curves, false);
    }
}

#[test]
fn curves_of_masks_are_fitted_to_the_f64_optimum() {
    let engine = engine();
    let masks = ThinMasks {
        magnification: 1.5,
        sample: [20e-6, 100e-6],
        detector: [30e-6, 150e-6],
        sigma: 30e-6 * 0.424_660_9,
        leak: [6.4e-6; 2],
    };
    for (steps, half) in [(7, 30.0), (11, 25.0), (21, 40.0)] {
        let offsets = even(steps, half * UM);
        let curves: Vec<Vec<f64>> = (-12..=12)
            .map(|shift| {
                offsets.iter().map(|x| masks.intensity(x - f64::from(shift) * UM)).collect()
            })
            .collect();
        compare("curves of masks", &engine, &offsets, &curves, false);
    }
}

#[test]
fn counts_are_fitted_to_the_f64_optimum_with_and_without_weights() {
    let engine = engine();
    let mut draws = Draws(3);
    for steps in [5, 25] {
        for peak in [200.0, 1e3, 1e5] {
            let offsets = even(steps, 25.0 * UM);
            let curves: Vec<Vec<f64>> = (0..60)
                .map(|_| {
                    let p = [
                        peak,
                        draws.between(-12.0, 12.0) * UM,
                        draws.between(8.0, 11.0) * UM,
                        0.05 * peak,
                    ];
                    offsets.iter().map(|x| draws.poisson(gaussian(&p, *x).0)).collect()
                })
                .collect();
            compare("counts", &engine, &offsets, &curves, false);
            compare("counts, weighted", &engine, &offsets, &curves, true);
        }
    }
}

/// Bias (in standard deviations) and variance (over the Cramer-Rao bound) of A, mu, sigma, b; and
/// what share of the curves has no result.
struct Statistics {
    bias: [f64; 4],
    variance: [f64; 4],
    /// Mean reported variance of centre and width over the bound.
    reported: [f64; 2],
    without: f64,
}

fn statistics(engine: &Engine, p: &Gaussian, count: usize, weights: Weights) -> Statistics {
    let offsets = even(11, 25.0 * UM);
    let mut draws = Draws(p[0] as u64 + 7);
    let curves: Vec<Vec<f64>> = (0..count)
        .map(|_| offsets.iter().map(|x| draws.poisson(gaussian(p, *x).0)).collect())
        .collect();
    let got = on_device(engine, &offsets, &curves, weights);
    let bound = fit::cramer_rao(&offsets, p);
    let with: Vec<SlitCurve> =
        got.into_iter().filter(|got| got.flags & flags::NO_ANSWER == 0).collect();
    for got in &with {
        // Nothing diverges silently: what has a result lies where the offsets can tell it.
        assert!(got.width < 101e-6 && got.width > 1e-6, "width {}", got.width);
        let outside = got.centre.abs() > 25.1e-6;
        assert!(!outside || got.flags & flags::OUTSIDE != 0, "centre {}", got.centre);
        assert!(got.amplitude.is_finite() && got.background.is_finite());
    }
    let n = with.len() as f64;
    let moments = |of: fn(&SlitCurve) -> f32, truth: f64, bound: f64| {
        let off = || with.iter().map(|got| f64::from(of(got)) - truth);
        let mean = off().sum::<f64>() / n;
        let square = off().map(|off| (off - mean).powi(2)).sum::<f64>() / n;
        [mean / bound.sqrt(), square / bound]
    };
    let each = [
        moments(|got| got.amplitude, p[0], bound[0]),
        moments(|got| got.centre, p[1], bound[1]),
        moments(|got| got.width, p[2], bound[2]),
        moments(|got| got.background, p[3], bound[3]),
    ];
    let reported = |of: fn(&SlitCurve) -> f32, bound: f64| {
        with.iter().map(|got| f64::from(of(got)).powi(2)).sum::<f64>() / n / bound
    };
    Statistics {
        bias: each.map(|[bias, _]| bias),
        variance: each.map(|[_, variance]| variance),
        reported: [
            reported(|got| got.centre_sigma, bound[1]),
            reported(|got| got.width_sigma, bound[2]),
        ],
        without: 1.0 - n / count as f64,
    }
}

#[test]
fn weighted_fits_of_counts_reach_the_cramer_rao_bound_without_bias() {
    // 40,000 draws tell a variance to 0.7 %; the bound is asymptotic, and at 1000 counts at the
    // peak (50 below) the rest is below 3 %.
    let engine = engine();
    for peak in [1e3, 1e4] {
        let p = [peak, 2.0 * UM, 9.0 * UM, 0.05 * peak];
        let s = statistics(&engine, &p, 40_000, Weights::Poisson);
        println!("{peak}: bias {:?}, variance {:?}, reported {:?}", s.bias, s.variance, s.reported);
        for k in 0..4 {
            assert!(
                (s.variance[k] - 1.0).abs() < 0.05,
                "variance of unknown {k}: {:?}",
                s.variance
            );
            assert!(s.bias[k].abs() < 0.1, "bias of unknown {k}: {:?}", s.bias);
        }
        assert!(s.reported.iter().all(|r| (r - 1.0).abs() < 0.05), "reported {:?}", s.reported);
        assert!(s.without < 1e-4, "without a result: {}", s.without);
    }
}

#[test]
fn few_counts_are_flagged_or_stay_within_the_scan() {
    // With `BEAMLET_ALL` the table of docs/developers/validation/counts.csv.
    let (engine, draws) = (engine(), amount(2_000, 10_000));
    println!("peak | weights | bias A mu sigma b | variance A mu sigma b | without a result");
    for peak in [10.0, 30.0, 100.0, 300.0, 1e3, 1e4] {
        for weights in [Weights::None, Weights::Poisson] {
            let p = [peak, 2.0 * UM, 9.0 * UM, 0.05 * peak];
            let s = statistics(&engine, &p, draws, weights);
            let show = |v: [f64; 4]| v.map(|v| format!("{v:.2}")).join(" ");
            println!(
                "| {peak} | {weights:?} | {} | {} | {:.1} % |",
                show(s.bias),
                show(s.variance),
                100.0 * s.without
            );
            assert!(s.without < 0.9);
        }
    }
}

/// The fits of many views wait for no more than one dispatch each, on a device with memory of its own.
#[test]
fn a_fit_of_a_view_is_one_submission_and_makes_no_buffer() {
    let engine = engine_with(EngineOptions::default().with_staging(true));
    let offsets = [-20e-6, -10e-6, 0.0, 10e-6, 20e-6];
    let noise = ValueNoise::default();
    let fitter = Fitter::new(&engine, &offsets, noise, BackgroundTerm::Free).unwrap();
    let curve = |(step, column): (usize, usize)| {
        let u = (offsets[step] - 1e-8 * column as f64) / 9e-6;
        (0.1 + 0.9 * (-0.5 * u * u).exp()) as f32
    };
    let views = Array2::from_shape_fn((5, 4000), curve);
    let first = fitter.fit(views.view(), &Cancel::default()).unwrap();
    let before = engine.profile().traffic;
    for _ in 0..7 {
        let again = fitter.fit(views.view(), &Cancel::default()).unwrap();
        assert_eq!(again, first);
    }
    let found = engine.profile().traffic.since(before);
    assert_eq!([found.submissions, found.waits, found.buffers], [7, 7, 0], "{found:?}");
}
