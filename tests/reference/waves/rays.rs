//! The same curves by rays: straight lines to the sample, displaced at the analyser by their angle.
//!
//! Slopes grow as d^(-1/2) towards a rim. Between two rims rays are so dense at both that the light of
//! a window converges: rays at every distance from a rim count, down to femtometres, and bend as the
//! formula of rays has it. A line of uniform rays omits the nearest ones and errs by 1e-4 of the light.

use super::super::closed_form::blurred_overlap;
use super::super::normal::cumulative;
use super::body::Body;
use super::light::Case;
use super::setup::{Setup, Window};
use std::f64::consts::PI;

/// Light of a window about `centre` (analyser, m) for a ray that reaches `x` (coordinates of the mask).
pub fn seen(setup: &Setup, window: &Window, centre: f64, x: f64) -> f64 {
    let m = setup.magnification();
    let shift = setup.source_shift();
    let part = |[weight, width]: [f64; 2]| {
        let by_spot = setup.spot.iter().map(|spot| {
            let from = x + spot.centre * shift - centre / m;
            let below = |edge: f64| cumulative((edge - from) / (spot.sigma * shift.abs()));
            spot.weight * (below(0.5 * width / m) - below(-0.5 * width / m))
        });
        if weight == 0.0 { 0.0 } else { weight * by_spot.sum::<f64>() }
    };
    window.boxes().map(part).iter().sum()
}

/// Exact light of a window about `centre` without a sample; bars that leak have no end.
pub fn flat(case: &Case<'_>, centre: f64, offset: f64) -> f64 {
    let (setup, m) = (case.setup, case.setup.magnification());
    let bars = case.slits.map_or(1.0, |slits| slits.bars.norm_sqr());
    let openings = case.slits.map_or(&[][..], |slits| &slits.openings);
    let box_of = |[weight, width]: [f64; 2]| {
        let opening = |[low, high]: &[f64; 2]| {
            let by_spot = setup.spot.iter().map(|spot| {
                let from = 0.5 * (low + high) + offset + spot.centre * setup.source_shift();
                let blur = spot.sigma * setup.source_shift().abs();
                spot.weight * blurred_overlap(from - centre / m, high - low, width / m, blur)
            });
            (1.0 - bars) * by_spot.sum::<f64>()
        };
        weight * (bars * width / m + openings.iter().map(opening).sum::<f64>())
    };
    case.window.boxes().map(box_of).iter().sum::<f64>() * m / case.window.pixel
}

/// Bodies by their low ends, for a walk along x.
struct Sorted {
    bodies: Vec<Body>,
    widest: f64,
}

impl Sorted {
    fn new(sample: &[Body]) -> Self {
        let mut bodies = sample.to_vec();
        let low = |body: &Body| body.outline.ends()[0];
        bodies.sort_by(|a, b| low(a).total_cmp(&low(b)));
        let width = |body: &Body| body.outline.ends()[1] - low(body);
        Self { widest: bodies.iter().map(width).fold(0.0, f64::max), bodies }
    }

    /// Bodies over `x`.
    fn over(&self, x: f64) -> Vec<Body> {
        let low = |body: &Body| body.outline.ends()[0];
        let first = self.bodies.partition_point(|body| low(body) < x - self.widest);
        let near = self.bodies[first..].iter().take_while(|body| low(body) < x);
        near.filter(|body| body.outline.ends()[1] > x).copied().collect()
    }
}

/// A ray, in coordinates of the mask (m).
struct Ray {
    /// Place in the mask.
    start: f64,
    /// Place at the analyser.
    end: f64,
    /// Its share of x times the transmission of the sample, m.
    weight: f64,
}

/// Places in −1..1 and weights (sum 2): x = sin(π/4 (3s − s³)), s at the middles of `count` parts.
fn nodes(count: u32) -> Vec<[f64; 2]> {
    let node = |i| {
        let s = (2.0 * f64::from(i) + 1.0) / f64::from(count) - 1.0;
        let (sin, cos) = (0.25 * PI * (3.0 * s - s * s * s)).sin_cos();
        [sin, cos * (1.0 - s * s)]
    };
    let nodes: Vec<[f64; 2]> = (0..count).map(node).collect();
    let total: f64 = nodes.iter().map(|node| node[1]).sum();
    nodes.iter().map(|[x, weight]| [*x, 2.0 * weight / total]).collect()
}

/// Rays between neighbouring `ends` (sorted), `count` to a piece.
fn trace(setup: &Setup, sample: &[Body], ends: &[f64], count: u32) -> Vec<Ray> {
    assert!(setup.sample >= setup.mask, "rays are named by their place in the mask");
    let lever = (setup.analyser - setup.sample) / setup.magnification();
    let (sorted, nodes) = (Sorted::new(sample), nodes(count));
    let mut rays = Vec::with_capacity(ends.len() * nodes.len());
    for piece in ends.windows(2) {
        let (middle, half) = (0.5 * (piece[0] + piece[1]), 0.5 * (piece[1] - piece[0]));
        let over = sorted.over(setup.in_sample(middle, 0.0));
        for [place, weight] in &nodes {
            let start = middle + half * place;
            let x = setup.in_sample(start, 0.0);
            let (mut depth, mut angle) = (0.0, 0.0);
            for body in &over {
                let [length, slope] = body.outline.path(x);
                depth += body.mu * length;
                angle -= body.delta * slope;
            }
            let weight = half * weight * (-depth).exp();
            rays.push(Ray { start, end: start + lever * angle, weight });
        }
    }
    rays
}

/// Light of windows about `centres` (analyser, m) at each offset of the mask, `[offset][centre]`, by
/// `count` rays between any two rims or edges. Rays start within `reach` of 0 in the mask.
pub fn curves(
    case: &Case<'_>,
    reach: f64,
    count: u32,
    centres: &[f64],
    offsets: &[f64],
) -> Vec<Vec<f64>> {
    let setup = case.setup;
    let openings = case.slits.map_or(&[][..], |slits| &slits.openings);
    let bars = case.slits.map_or(1.0, |slits| slits.bars.norm_sqr());
    let edges = || offsets.iter().flat_map(|f| openings.iter().flatten().map(move |edge| edge + f));
    let (mut low, mut high) = (-reach, reach);
    if bars == 0.0 {
        low = edges().fold(high, f64::min).max(low);
        high = edges().fold(-reach, f64::max).min(high);
    }
    let narrow = setup.spot.iter().map(|spot| spot.sigma).fold(f64::INFINITY, f64::min);
    let longest = 4.0 * narrow * setup.source_shift().abs();
    let even = ((high - low) / longest).ceil() as u32;
    let evenly = (0..=even).map(|i| low + (high - low) * f64::from(i) / f64::from(even));
    let rims = case.sample.iter().flat_map(|body| body.outline.ends());
    let rims = rims.map(|x| setup.in_mask(x, 0.0)).chain(edges());
    let mut ends: Vec<f64> = rims.filter(|x| (low..high).contains(x)).chain(evenly).collect();
    ends.sort_by(f64::total_cmp);

    let mut sums = vec![vec![0.0; centres.len()]; offsets.len()];
    for ray in trace(setup, case.sample, &ends, count) {
        let light: Vec<f64> = centres
            .iter()
            .map(|&centre| ray.weight * seen(setup, &case.window, centre, ray.end))
            .collect();
        for (row, offset) in sums.iter_mut().zip(offsets) {
            let at = ray.start - offset;
            let inside = openings.iter().any(|[low, high]| (*low..*high).contains(&at));
            let share = if inside { 1.0 } else { bars };
            row.iter_mut().zip(&light).for_each(|(sum, light)| *sum += share * light);
        }
    }
    let open = case.window.pixel / setup.magnification();
    sums.iter().map(|row| row.iter().map(|sum| sum / open).collect()).collect()
}

/// Curve of a window about 0.
pub fn curve(case: &Case<'_>, reach: f64, count: u32, offsets: &[f64]) -> Vec<f64> {
    curves(case, reach, count, &[0.0], offsets).into_iter().flatten().collect()
}
