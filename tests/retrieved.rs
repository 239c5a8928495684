//! What users retrieve from the stacks: transmission and refraction angle by a Gaussian fit,
//! on the engine's stacks and on closed forms of the same geometry. The fit's own bias is the
//! same on both, so that only the stacks differ.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod reference;
mod support;

use reference::closed_form::ThinMasks;
use reference::masks::Bars;
use reference::rays::{Order, Sample};
use reference::scenes;
use reference::stack::Setup;
use reference::surfaces::{Body, body, cuboid, wedge};
use support::{CARBON, Worst, backends, engine};

/// 11 steps over +-25 um.
fn offsets() -> Vec<f64> {
    (0..11).map(|i| -25e-6 + 5e-6 * f64::from(i)).collect()
}

/// Amplitude, mean, width and offset of the Gaussian that fits best (eq. 1), f64, by
/// Levenberg-Marquardt; x in units of 10 um.
fn fit(offsets: &[f64], curve: &[f64]) -> [f64; 4] {
    let x: Vec<f64> = offsets.iter().map(|f| f / 1e-5).collect();
    let model = |p: &[f64; 4], x: f64| {
        let t = (x - p[1]) / p[2];
        let e = (-0.5 * t * t).exp();
        (p[0] * e + p[3], [e, p[0] * e * t / p[2], p[0] * e * t * t / p[2], 1.0])
    };
    let cost = |p: &[f64; 4]| -> f64 {
        x.iter().zip(curve).map(|(x, y)| (model(p, *x).0 - y).powi(2)).sum()
    };
    let peak = curve.iter().copied().fold(0.0, f64::max);
    let mut p = [peak, 0.0, 1.0, 0.0];
    let mut damping = 1e-3;
    for _ in 0..400 {
        let mut normal = [[0.0; 5]; 4];
        for (x, y) in x.iter().zip(curve) {
            let (value, slope) = model(&p, *x);
            for i in 0..4 {
                for j in 0..4 {
                    normal[i][j] += slope[i] * slope[j];
                }
                normal[i][4] += slope[i] * (y - value);
            }
        }
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] *= 1.0 + damping;
        }
        let step = solve(normal);
        let next: [f64; 4] = std::array::from_fn(|i| p[i] + step[i]);
        if cost(&next) <= cost(&p) {
            p = next;
            damping = (damping * 0.1_f64).max(1e-14);
        } else {
            damping *= 10.0;
        }
    }
    [p[0], p[1] * 1e-5, p[2] * 1e-5, p[3]]
}

/// Gaussian elimination of four equations, the right side in the last column.
fn solve(mut a: [[f64; 5]; 4]) -> [f64; 4] {
    for i in 0..4 {
        let pivot = (i..4).max_by(|&j, &k| a[j][i].abs().total_cmp(&a[k][i].abs())).unwrap();
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

/// Transmission and refraction angle (M = 1.5, z = 0.59 m) of a pixel.
fn retrieve(flat: &[f64], sample: &[f64]) -> [f64; 2] {
    let [f, s] = [flat, sample].map(|curve| fit(&offsets(), curve));
    [s[0] * s[2] / (f[0] * f[2]), -1.5 / 0.59 * (s[1] - f[1])]
}

/// Thin masks of the paper and their closed form.
fn set_up() -> (Setup, ThinMasks) {
    let setup = Setup::paper([32, 1]).with_bars(Bars::Sheet { transmission: 0.0 });
    let masks = ThinMasks {
        magnification: 1.5,
        sample: [20e-6, 100e-6],
        detector: [30e-6, 150e-6],
        sigma: setup.sigma()[0],
        leak: [0.0; 2],
    };
    (setup, masks)
}

/// Compares what is retrieved in columns 8 to 23 with the closed form: light of a column is
/// dimmed by the optical depth and displaced by what the f64 reference says of its central ray.
fn compare(of: &Body, transmission: &mut Worst, refraction: &mut Worst) {
    let (setup, masks) = set_up();
    let sample = Sample::new(std::slice::from_ref(of), 1.21, 0.0);
    let flat: Vec<f64> = offsets().iter().map(|f| masks.intensity(*f)).collect();
    for backend in backends() {
        let scene = scenes::scene(&setup, std::slice::from_ref(of), &offsets());
        let stacks = engine(backend).simulate(&scene).unwrap();
        for column in 8..24_u32 {
            let ray = setup.trace(&sample, [0.0; 2], setup.centre(column, 0), Order::Exact);
            let curve: Vec<f64> = offsets()
                .iter()
                .map(|f| {
                    (-ray.optical_depth).exp() * masks.intensity(f + ray.displacement[0] / 1.5)
                })
                .collect();
            let c = column as usize;
            let got = |stack: ndarray::ArrayView3<'_, f32>| -> Vec<f64> {
                (0..11).map(|s| f64::from(stack[[s, 0, c]])).collect()
            };
            let [t, a] = retrieve(
                &got(stacks.flat.view()),
                &got(stacks.sample.index_axis(ndarray::Axis(0), 0)),
            );
            let [t_true, a_true] = retrieve(&flat, &curve);
            transmission.take(t - t_true, || format!("{backend}, column {column}"));
            refraction.take(a - a_true, || format!("{backend}, column {column}"));
        }
    }
}

#[test]
fn refraction_angle_of_a_wedge_is_retrieved_to_1e_9() {
    // f32 stacks hold 1e-7 of a peak of 0.17; over a width of 10 um that is about 1e-11 rad. The
    // design asks for 1e-9; the curve of a wedge without absorption is a closed form.
    let mut transmission = Worst::new("retrieved, wedge, transmission", 1e-5);
    let mut refraction = Worst::new("retrieved, wedge, refraction angle (rad)", 1e-10);
    let wedge = wedge(2.4e-3, 0.8, 6e-3).moved([-1.2e-3, -1.2e-3, 0.0]).rounded();
    compare(&body(wedge, 0.0, CARBON[1]), &mut transmission, &mut refraction);
}

#[test]
fn transmission_of_a_slab_is_retrieved_to_1e_4() {
    let mut transmission = Worst::new("retrieved, slab, transmission", 1e-5);
    let mut refraction = Worst::new("retrieved, slab, refraction angle (rad)", 1e-10);
    let slab = cuboid([6e-3, 4e-3, 6e-3]).rounded();
    compare(&body(slab, CARBON[0], CARBON[1]), &mut transmission, &mut refraction);
}

#[test]
fn fit_finds_a_gaussian_and_tells_a_changed_point() {
    let curve: Vec<f64> =
        offsets().iter().map(|f| 0.3 * (-0.5 * ((f - 2e-6) / 9e-6).powi(2)).exp() + 0.01).collect();
    let [a, mean, width, offset] = fit(&offsets(), &curve);
    assert!((a - 0.3).abs() < 1e-10 && (offset - 0.01).abs() < 1e-10);
    assert!((mean - 2e-6).abs() < 1e-15 && (width - 9e-6).abs() < 1e-15);
    let mut changed = curve.clone();
    changed[7] *= 1.001;
    assert!((retrieve(&curve, &changed)[1]).abs() > 1e-9);
}
