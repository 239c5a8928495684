//! Errors of heights against their estimates.

use super::*;
use beamlet_core::numbers::{self, single};
use beamlet_core::random::Draws;

const EVEN: Features = Features {
    varies: true,
    rough: false,
    critical: Vec::new(),
    jumps: Vec::new(),
    creases: Vec::new(),
};
const LIMITS: Limits = Limits {
    error: 1e-4,
    lines: 1000,
    reach: 0.0,
    uneven: Uneven::Never,
    least: LEAST_OF_RAYS,
    thin: 1e-4,
    beside: 0.0,
};

impl Judged for Vec<f32> {
    fn judged(&self) -> JudgedLight<'_> {
        JudgedLight { values: Values { first: 0, values: self }, ..JudgedLight::default() }
    }
}

/// Lines with the light at each height.
fn lit<L: Judged + Clone>(
    mut light: impl FnMut(f64) -> L,
    features: &Features,
    limits: Limits,
) -> Heights<L> {
    let mut heights = Heights::new(features, limits);
    loop {
        let wanted: Vec<f64> = heights.wanted().collect();
        if wanted.is_empty() {
            return heights;
        }
        heights.add(wanted.into_iter().map(&mut light));
    }
}

/// Lines whose light is a function of z; a second value has less light.
fn lines(of: impl Fn(f64) -> f64, features: &Features, limits: Limits) -> Heights<Vec<f32>> {
    lit(|z| vec![single(0.5 * of(z)), single(of(z))], features, limits)
}

/// All light of a line in one window.
#[derive(Debug, Clone)]
struct InWindow {
    number: i64,
    light: [f32; 1],
}

impl Judged for InWindow {
    fn judged(&self) -> JudgedLight<'_> {
        let values = Values { first: self.number, values: &self.light };
        JudgedLight { values, ..JudgedLight::default() }
    }
}

/// Light that moves to any other window, however far away, moves at a height that is found.
#[test]
fn light_that_moves_to_another_window_is_a_jump() {
    for number in [-1, 5, 100] {
        let line = |z| InWindow { number: if z < 0.37 { 0 } else { number }, light: [0.2] };
        let heights = lit(line, &EVEN, LIMITS);
        let weights = heights.weights(sharp([0.0, 1.0]));
        let is_first = |line: &InWindow| f64::from(u8::from(line.number == 0));
        let share: f64 = heights.light().zip(weights).map(|(line, it)| it * is_first(line)).sum();
        assert!((0.2 * (share - 0.37)).abs() < 2.0 * LIMITS.error, "{number}: {share}");
    }
}

/// Integrals of falling and rising light over the part of an interval within a sharp window.
fn sharp(window: [f64; 2]) -> impl Fn([f64; 2]) -> [f64; 2] {
    move |[top, bottom]| {
        let [low, high] = [window[0].max(top), window[1].min(bottom)];
        let whole = (high - low).max(0.0);
        let rises = whole * (f64::midpoint(low, high) - top) / (bottom - top);
        [whole - rises, rises]
    }
}

fn received(heights: &Heights<Vec<f32>>, window: [f64; 2]) -> f64 {
    let weights = heights.weights(sharp(window));
    heights.light().zip(weights).map(|(light, weight)| weight * f64::from(light[1])).sum()
}

fn mean(heights: &Heights<Vec<f32>>) -> f64 {
    received(heights, [0.0, 1.0])
}

#[test]
fn light_that_changes_evenly_takes_few_lines_and_fills_windows_exactly() {
    let heights = lines(|z| 0.25 + 0.1 * z, &EVEN, LIMITS);
    assert!(heights.count() <= 9 && heights.error() < LIMITS.error);
    let little = lines(|z| 0.25 + 0.005 * z, &EVEN, LIMITS);
    assert_eq!(little.count(), 3);
    assert_eq!(little.nearest(1).map(f64::to_bits), [0.25_f64, 0.75].map(f64::to_bits));
    let mut draws = Draws::new(1, [0; 3], 0);
    for _ in 0..100 {
        let [a, b] = draws.pair();
        let [low, high] = [a.min(b), a.max(b)];
        let want = (high - low) * (0.25 + 0.05 * (low + high));
        let got = received(&heights, [low, high]);
        assert!((got - want).abs() < 1e-7, "{low} to {high}: {got} for {want}");
    }
    let upright = lines(|_| 0.3, &Features { varies: false, ..EVEN }, LIMITS);
    assert!(upright.count() == 1 && upright.error() <= 0.0);
    assert!((received(&upright, [0.2, 0.7]) - 0.15).abs() < 1e-7);
    assert_eq!(upright.nearest(0).map(f64::to_bits), [0.0_f64, 1.0].map(f64::to_bits));
}

/// A line of eight samples that pass all of their light or none.
#[derive(Debug, Clone)]
struct OfSamples {
    values: [f32; 1],
    draws: super::Draws,
}

impl OfSamples {
    fn drawn(draws: &mut Draws) -> Self {
        let samples = [0; 8].map(|_| f64::from(u8::from(draws.uniform() < 0.5)));
        let mut all = super::Draws::default();
        for (at, passed) in samples.into_iter().enumerate() {
            let next = samples.get(at + 1);
            all.add(0.125, passed, next.map(|it| it - passed));
        }
        Self { values: [single(samples.iter().sum::<f64>() / 8.0)], draws: all }
    }
}

impl Judged for OfSamples {
    fn judged(&self) -> JudgedLight<'_> {
        let values = Values { first: 0, values: &self.values };
        JudgedLight { values, draws: Some(self.draws), ..JudgedLight::default() }
    }
}

/// Errors of 200 rows of random samples, root mean square, against their estimates: these are within a factor of 1.5,
/// which 200 rows show to 10 %.
#[test]
fn errors_of_random_samples_are_those_of_their_mean() {
    let features = Features { rough: true, ..EVEN };
    let mut draws = Draws::new(3, [0; 3], 0);
    for error in [0.02, 0.01] {
        let (mut squares, mut told) = (0.0, 0.0);
        for _ in 0..200 {
            let limits = Limits { error, ..LIMITS };
            let heights = lit(|_| OfSamples::drawn(&mut draws), &features, limits);
            let weights = heights.weights(sharp([0.0, 1.0]));
            let light = heights.light().map(|it| f64::from(it.values[0]));
            let mean: f64 = light.zip(weights).map(|(light, weight)| light * weight).sum();
            squares += (mean - 0.5).powi(2);
            told += heights.error().powi(2);
            assert!(heights.error() <= error && heights.count() < 1000);
        }
        let ratio = f64::sqrt(squares / told);
        assert!((0.67..1.5).contains(&ratio), "true over told {ratio} at {error}");
    }
}

/// Light of a shape, and its mean over a row; `at`: a place of the row, `width`: a part of it.
type Shape = fn(z: f64, at: f64, width: f64) -> f64;

/// Shapes with their means in closed form by an antiderivative that is 0 far above.
const SHAPES: [(&str, Shape, Shape); 5] = [
    ("jumps", |z, at, _| f64::from(u8::from(z > at)), |z, at, _| (z - at).max(0.0)),
    (
        "ramps",
        |z, at, w| ((z - at) / w).clamp(0.0, 1.0),
        |z, at, w| {
            let within = (z - at).clamp(0.0, w);
            0.5 * within * within / w + (z - at - w).max(0.0)
        },
    ),
    (
        "rims",
        |z, at, _| (z - at).max(0.0).sqrt(),
        |z, at, _| 2.0 / 3.0 * (z - at).max(0.0).powf(1.5),
    ),
    (
        "balls",
        |z, at, w| (w * w - (z - at) * (z - at)).max(0.0).sqrt(),
        |z, at, w| {
            let t = ((z - at) / w).clamp(-1.0, 1.0);
            0.5 * w * w * (t.asin() + t * (1.0 - t * t).max(0.0).sqrt())
        },
    ),
    (
        "edges",
        |z, at, w| 0.5 * (1.0 + libm::erf((z - at) / w)),
        |z, at, w| {
            let t = (z - at) / w;
            0.5 * w * (t * (1.0 + libm::erf(t)) + (-t * t).exp() / std::f64::consts::PI.sqrt())
        },
    ),
];

/// True errors of 300 lights of each shape, against their estimates. Estimates are at most the limit, so errors
/// beyond it are rare, and told.
#[test]
fn errors_of_random_light_are_within_the_estimate() {
    for (kind, (name, of, whole)) in (0..).zip(SHAPES) {
        let mut draws = Draws::new(2, [kind, 0, 0], 0);
        let (mut squares, mut estimates, mut count, mut most) = (0.0, 0.0, 0, 0.0_f64);
        for _ in 0..300 {
            let [at, width] = draws.pair();
            // Balls are half a row high or more: `height` has to tell of smaller ones.
            let octaves = if name == "balls" { 2.0 } else { 8.0 };
            let (at, width) = (1.2 * at - 0.1, (-octaves * width).exp2());
            let amplitude = 10.0_f64.powf(-1.0 - 3.0 * draws.uniform());
            let light = |z: f64| 0.1 + amplitude * of(z, at, width);
            let heights = lines(light, &EVEN, LIMITS);
            let want = 0.1 + amplitude * (whole(1.0, at, width) - whole(0.0, at, width));
            let (error, estimate) = ((mean(&heights) - want).abs(), heights.error());
            assert!(heights.count() < 26, "{name} {at} {width}: {} lines", heights.count());
            assert!(estimate < 1.01 * LIMITS.error, "{name} {at} {width}: {estimate:e}");
            most = most.max(error);
            squares += error * error;
            estimates += estimate * estimate;
            count += heights.count();
        }
        let [root, told] = [squares, estimates].map(|sum: f64| (sum / 300.0).sqrt());
        let lines = f64::from(numbers::count(count)) / 300.0;
        println!("{name}: {root:.1e}, {most:.1e} of {told:.1e}, {lines:.1} lines");
        assert!(root < 1.1 * told && most < 4.0 * LIMITS.error, "{name}: {root:e} {told:e}");
        assert!(lines < 13.0, "{name}: {lines}");
    }
}

/// An edge that crosses the aperture at a slant of 2 degrees or less: light is another before, between and after,
/// and before and after hardly differ.
#[test]
fn light_of_edges_that_cross_an_aperture_within_little_height_is_found() {
    let mut draws = Draws::new(5, [0; 3], 0);
    let mut squares = 0.0;
    for _ in 0..300 {
        let [at, width] = draws.pair();
        let width = 0.01 * width;
        let of = |z: f64| match (z - at) / width {
            t if t < 0.0 => 0.15,
            t if t < 1.0 => 0.15 - 0.05 * (std::f64::consts::PI * t).sin() - 0.002 * t,
            _ => 0.148,
        };
        let features = Features { critical: vec![at, at + width], ..EVEN };
        let heights = lines(of, &features, LIMITS);
        let steps = 20_000;
        let want = (0..steps).map(|it| of((f64::from(it) + 0.5) / f64::from(steps)));
        let error = (mean(&heights) - want.sum::<f64>() / f64::from(steps)).abs();
        assert!(error < 4.0 * LIMITS.error && heights.count() < 40, "{at} {width}: {error:e}");
        squares += error * error;
    }
    let root = (squares / 300.0_f64).sqrt();
    assert!(root < LIMITS.error, "{root:e}");
}

/// Light that ends at a height which is known, in a row or at its borders, within the rounding of its place, and
/// with a slope before it.
#[test]
fn jumps_at_known_heights_take_two_lines() {
    let mut draws = Draws::new(3, [0; 3], 0);
    for case in 0..200 {
        let end = if case < 6 { f64::from(case % 2) } else { draws.uniform() };
        for off in [0.0, 1e-5, -1e-5] {
            let mut features = EVEN;
            features.jumps.push([end; 2]);
            let of = |z: f64| if z < end + off { 0.2 + 0.01 * z } else { 0.1 };
            let heights = lines(of, &features, LIMITS);
            let to = (end + off).clamp(0.0, 1.0);
            let want = to * (0.2 + 0.005 * to) + 0.1 * (1.0 - to);
            let (error, count) = ((mean(&heights) - want).abs(), heights.count());
            assert!(error < 3e-6 && count <= 8, "{end} {off:e}: {error:e}, {count} lines");
        }
    }
}

#[test]
fn lines_are_within_their_number_and_the_estimate_exceeds_the_limit() {
    for lines_at_most in [3, 9] {
        let limits = Limits { lines: lines_at_most, ..LIMITS };
        let of = |count: u32| (1..count).map(move |it| f64::from(it) / f64::from(count));
        let many = Features { jumps: vec![[0.3; 2], [0.6; 2]], critical: of(50).collect(), ..EVEN };
        let round = Features { jumps: of(20).map(|z| [z, z + 0.2]).collect(), ..EVEN };
        for features in [EVEN, many, round] {
            let heights = lines(|z| (20.0 * z).sin(), &features, limits);
            assert!(heights.count() <= lines_at_most && heights.error() > 0.01);
        }
    }
}

/// Bodies of any height whose ends are known are met, alone and among others: each takes light that grows to its middle.
#[test]
fn bodies_between_known_heights_are_met() {
    let mut draws = Draws::new(4, [0; 3], 0);
    for case in 0..200 {
        let body = |_| {
            let [at, height] = draws.pair();
            let half = 10.0_f64.powf(-3.0 + 2.0 * height);
            [half + (1.0 - 2.0 * half) * at, half]
        };
        let bodies: Vec<[f64; 2]> = (0..1 + case % 20).map(body).collect();
        let ends = bodies.iter().flat_map(|[at, half]| [at - half, at + half]);
        let features = Features { critical: ends.collect(), ..EVEN };
        let tent = |z: f64| move |[at, half]: &[f64; 2]| (1.0 - (z - at).abs() / half).max(0.0);
        let of = |z: f64| 0.5 - 0.02 * bodies.iter().map(tent(z)).sum::<f64>();
        let heights = lines(of, &features, LIMITS);
        let want = 0.5 - 0.02 * bodies.iter().map(|[_, half]| half).sum::<f64>();
        let error = (mean(&heights) - want).abs();
        assert!(error < 3.0 * LIMITS.error, "{case}: {error:e}");
    }
}

/// Heights beyond the number of first lines are told: the error of many bodies without lines is within three times the
/// estimate.
#[test]
fn heights_that_are_left_out_count_in_the_estimate() {
    let mut draws = Draws::new(6, [0; 3], 0);
    let (mut squares, mut told) = (0.0, 0.0);
    for _ in 0..50 {
        let places: Vec<f64> = (0..400).map(|_| draws.uniform()).collect();
        let ends = places.iter().flat_map(|z| [*z, z + 2e-4]).collect();
        let features = Features { critical: ends, ..EVEN };
        let of = |z: f64| if places.iter().any(|it| z > *it && z < it + 2e-4) { 0.1 } else { 0.0 };
        let heights = lines(of, &features, Limits { lines: 100, ..LIMITS });
        let steps = 100_000;
        let want = (0..steps).map(|it| of((f64::from(it) + 0.5) / f64::from(steps))).sum::<f64>();
        squares += (mean(&heights) - want / f64::from(steps)).powi(2);
        told += heights.error().powi(2);
    }
    let ratio = f64::sqrt(squares / told);
    assert!(ratio < 3.0 && told > 0.0, "true over told {ratio}");
}

/// A ridge of two creases and a top between two lines is found and told.
#[test]
fn isolated_creases_are_found() {
    let mut draws = Draws::new(7, [0; 3], 0);
    for _ in 0..200 {
        let [at, width] = draws.pair();
        let (at, width) = (0.02 + 0.9 * at, 1e-3 + 0.03 * width);
        let slope = 2.0;
        let of = |z: f64| 0.1 - 0.1 * slope * (width - (z - at).abs()).max(0.0);
        let crease = |z: f64, weight: f64| Crease { z, weight };
        let creases =
            vec![crease(at - width, slope), crease(at, 2.0 * slope), crease(at + width, slope)];
        let heights = lines(of, &Features { creases, ..EVEN }, LIMITS);
        let want = 0.1 - 0.1 * slope * width * width;
        let [low, high] = [at - width, at + width];
        if low > 0.0 && high < 1.0 {
            let error = (mean(&heights) - want).abs();
            assert!(error < 2.0 * LIMITS.error, "{at} {width}: {error:e}");
        }
    }
}
