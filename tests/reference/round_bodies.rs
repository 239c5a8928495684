//! Ellipsoids and cylinders without facets, behind sheets that let no light through: straight rays,
//! refraction to first order at every surface, and lines across the detector that are cut in two wherever
//! masks, pixels or bodies change, down to 0.02 nm. Rays whose grazing angle is below the critical one
//! reflect, which this neglects: they fill 1e-10 m of a rim.

use super::vector::{Vector, dot, sub};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;

/// A body about its centre, its axes turned.
#[derive(Debug, Clone, Copy)]
pub enum Form {
    /// Semi-axes, m.
    Ellipsoid(Vector),
    /// Radius and half height along z, m.
    Cylinder(f64, f64),
}

/// A body; where bodies overlap the later one counts.
#[derive(Debug, Clone, Copy)]
pub struct Solid {
    pub form: Form,
    /// Its axes in the beam frame.
    pub axes: [Vector; 3],
    pub centre: Vector,
    /// Attenuation coefficient, 1/m.
    pub mu: f64,
    pub delta: f64,
}

/// Source, masks and detector; lengths in m.
#[derive(Debug, Clone)]
pub struct Beam {
    pub source_distance: f64,
    pub detector_distance: f64,
    pub pixels: [u32; 2],
    pub pitch: f64,
    /// Standard deviation of the spot along x and z.
    pub spot: [f64; 2],
    /// Distance of the sample mask.
    pub sample_mask: Option<f64>,
    pub has_detector_mask: bool,
    /// Width of an aperture on the detector.
    pub aperture: f64,
    pub offsets: Vec<f64>,
}

/// A place where a ray crosses a surface: distance along y from the source, and outward normal.
type Crossing = (f64, Vector);

impl Solid {
    /// Where a ray enters and leaves it.
    fn crossings(&self, origin: Vector, direction: Vector) -> Option<[Crossing; 2]> {
        let from = sub(origin, self.centre);
        let start: Vector = self.axes.map(|axis| dot(axis, from));
        let along: Vector = self.axes.map(|axis| dot(axis, direction));
        let out = |own: Vector| -> Vector {
            std::array::from_fn(|i| (0..3).map(|k| own[k] * self.axes[k][i]).sum())
        };
        let roots = |square: f64, half: f64, rest: f64| {
            let root = half * half - square * rest;
            (root > 0.0).then(|| [-1.0, 1.0].map(|sign| (sign * root.sqrt() - half) / square))
        };
        match self.form {
            Form::Ellipsoid(semi) => {
                let [p, d] = [start, along].map(|v| std::array::from_fn(|i| v[i] / semi[i]));
                let at = roots(dot(d, d), dot(p, d), dot(p, p) - 1.0)?;
                Some(at.map(|t| {
                    let own = std::array::from_fn(|i| (p[i] + t * d[i]) / semi[i]);
                    (t, out(own))
                }))
            }
            Form::Cylinder(radius, half) => {
                let [a, b] = [along[0], along[1]];
                let [x, y] = [start[0], start[1]];
                let side = roots(a * a + b * b, a * x + b * y, x * x + y * y - radius * radius)?;
                let mut caps = [-half, half].map(|z| (z - start[2]) / along[2]);
                caps.sort_by(f64::total_cmp);
                let end = |k: usize| {
                    let first = if k == 0 { caps[0] > side[0] } else { caps[1] < side[1] };
                    if first {
                        let up = f64::from(u8::from((k == 1) == (along[2] > 0.0)));
                        (caps[k], out([0.0, 0.0, 2.0 * up - 1.0]))
                    } else {
                        let t = side[k];
                        (t, out([x + t * a, y + t * b, 0.0]))
                    }
                };
                let ends = [end(0), end(1)];
                (ends[0].0 < ends[1].0).then_some(ends)
            }
        }
    }
}

/// A ray: where it lands, what passes, and what it met on its way.
#[derive(Debug, Clone, Copy)]
struct Landed {
    passed: f64,
    at: [f64; 2],
    slope_x: f64,
    hits: u64,
}

fn ray(solids: &[Solid], beam: &Beam, slopes: [f64; 2]) -> Landed {
    let origin = [0.0, -beam.source_distance, 0.0];
    let direction = [slopes[0], 1.0, slopes[1]];
    let mut events: Vec<(f64, Vector, usize)> = Vec::new();
    let mut ranges: Vec<Option<[f64; 2]>> = Vec::new();
    let mut hits = 0;
    for (index, solid) in solids.iter().enumerate() {
        let found = solid.crossings(origin, direction);
        ranges.push(found.map(|ends| ends.map(|end| end.0)));
        if let Some(ends) = found {
            hits |= 1 << index;
            events.extend(ends.map(|(t, normal)| (t, normal, index)));
        }
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let far = beam.detector_distance;
    let mut landed = Landed { passed: 1.0, at: slopes.map(|s| s * far), slope_x: slopes[0], hits };
    let (mut before, mut depth) = ([0.0; 2], 0.0);
    for (k, (t, normal, index)) in events.iter().enumerate() {
        hits = hits * 7 + *index as u64 + 1;
        let next = events.get(k + 1).map_or(f64::INFINITY, |event| event.0);
        let middle = if next.is_finite() { 0.5 * (t + next) } else { t + 1.0 };
        let inside = |it: &usize| ranges[*it].is_some_and(|[a, b]| a < middle && middle < b);
        let own = (0..solids.len()).rev().find(inside);
        let after = own.map_or([0.0; 2], |it| [solids[it].mu, solids[it].delta]);
        if next.is_finite() {
            depth += after[0] * (next - t);
        }
        let bend = (before[1] - after[1]) / dot(*normal, direction) * (far - t);
        landed.at[0] += bend * normal[0];
        landed.at[1] += bend * normal[2];
        before = after;
    }
    landed.hits = hits;
    landed.passed = (-depth).exp();
    landed
}

/// Share of a Gaussian about `at` within [low, high]; `sigma` may be 0.
fn share(at: f64, [low, high]: [f64; 2], sigma: f64) -> f64 {
    if sigma == 0.0 {
        return f64::from(u8::from(low <= at && at < high));
    }
    0.5 * (libm::erfc((at - high) / sigma / SQRT_2) - libm::erfc((at - low) / sigma / SQRT_2))
}

/// Light behind bodies, from `lines` lines to a row.
#[derive(Debug)]
pub struct Walk<'a> {
    pub solids: &'a [Solid],
    pub beam: &'a Beam,
    pub lines: u32,
}

/// Rows and columns beside the detector whose light counts.
const BESIDE: i64 = 3;
/// Width of an interval to begin with, and the least, m in the plane of the sample.
const COARSE: f64 = 0.5e-6;
const LEAST: f64 = 2e-11;

impl Walk<'_> {
    fn sigma(&self, axis: usize) -> f64 {
        self.beam.spot[axis] * (self.beam.detector_distance / self.beam.source_distance - 1.0)
    }

    /// Share of the light at a slope that the sample mask passes at each step.
    fn opened(&self, slope: f64, step: usize) -> f64 {
        let Some(distance) = self.beam.sample_mask else { return 1.0 };
        let beam = self.beam;
        let scale = distance / beam.detector_distance;
        let (period, half) = (beam.pitch * scale, 0.5 * beam.aperture * scale);
        let odd = 0.5 - 0.5 * f64::from(beam.pixels[0]);
        let at = slope * distance - beam.offsets[step] - odd * period;
        let at = at - (at / period).round() * period;
        let soft = beam.spot[0] * (beam.source_distance - distance) / beam.source_distance;
        share(at, [-half, half], soft)
    }

    /// Column, and the place from its middle.
    fn column(&self, at: f64) -> (i64, f64) {
        let place = at / self.beam.pitch + 0.5 * f64::from(self.beam.pixels[0]);
        let column = place.floor();
        (column as i64, (place - column - 0.5) * self.beam.pitch)
    }

    /// Where masks, pixels or bodies differ between two rays.
    fn class(&self, landed: &Landed) -> (u64, i64, i64, u64) {
        let beam = self.beam;
        let half = 0.5 * if beam.has_detector_mask { beam.aperture } else { beam.pitch };
        let mut open = 0;
        if self.sigma(0) == 0.0 {
            for step in 0..beam.offsets.len() {
                open = 2 * open + u64::from(self.opened(landed.slope_x, step) > 0.5);
            }
        }
        let place = |at: f64| {
            // In parts of the blur.
            if self.sigma(0) > 0.0 {
                return (4.0 * at / self.sigma(0)).floor() as i64;
            }
            let (column, off) = self.column(at);
            2 * column + i64::from(off.abs() < half)
        };
        let straight = place(landed.slope_x * beam.detector_distance) as u64;
        let step = if self.sigma(1) == 0.0 { beam.pitch } else { 0.25 * self.sigma(1) };
        let row = (landed.at[1] / step).floor() as i64;
        (landed.hits, place(landed.at[0]), row, open + (straight << 8))
    }

    /// Adds the light of a ray, and takes away that of the same ray without bodies.
    fn deposit(&self, landed: &Landed, slopes: [f64; 2], weight: f64, values: &mut [f64]) {
        let open: Vec<f64> =
            (0..self.beam.offsets.len()).map(|step| self.opened(slopes[0], step)).collect();
        if open.iter().any(|open| *open > 0.0) {
            self.add(landed.at, &open, weight * landed.passed, values);
            let straight = slopes.map(|slope| slope * self.beam.detector_distance);
            self.add(straight, &open, -weight, values);
        }
    }

    fn add(&self, at: [f64; 2], open: &[f64], weight: f64, values: &mut [f64]) {
        let beam = self.beam;
        let [columns, rows] = beam.pixels.map(|n| n as usize);
        let half = 0.5 * if beam.has_detector_mask { beam.aperture } else { beam.pitch };
        let (column, off) = self.column(at[0]);
        let top = 0.5 * f64::from(beam.pixels[1]) - at[1] / beam.pitch;
        for row in 0..rows {
            let low = row as f64;
            let in_row = share(top, [low, low + 1.0], self.sigma(1) / beam.pitch);
            if in_row < 1e-12 {
                continue;
            }
            for k in -1..=1 {
                let Ok(at) = usize::try_from(column + k) else { continue };
                if at >= columns {
                    continue;
                }
                let in_window = share(off - k as f64 * beam.pitch, [-half, half], self.sigma(0));
                for (step, open) in open.iter().enumerate() {
                    values[(step * rows + row) * columns + at] +=
                        weight * in_row * in_window * open;
                }
            }
        }
    }

    /// Centre and radius of the shadow of each body in the plane of the rotation centre.
    fn shadows(&self) -> Vec<([f64; 2], f64)> {
        let near = self.beam.source_distance;
        let shadow = |solid: &Solid| {
            let radius = match solid.form {
                Form::Ellipsoid(semi) => semi.into_iter().fold(0.0, f64::max),
                Form::Cylinder(radius, half) => radius.hypot(half),
            };
            let scale = near / (near + solid.centre[1]);
            ([solid.centre[0] * scale, solid.centre[2] * scale], 1.01 * radius)
        };
        self.solids.iter().map(shadow).collect()
    }

    /// Change of the light by bodies in one line.
    fn line(&self, number: u32) -> Vec<f64> {
        let beam = self.beam;
        let count = beam.offsets.len() * (beam.pixels[0] * beam.pixels[1]) as usize;
        let mut values = vec![0.0; count];
        let (near, far) = (beam.source_distance, beam.detector_distance);
        let row = (f64::from(number) + 0.5) / f64::from(self.lines) - BESIDE as f64;
        let slope_z = (0.5 * f64::from(beam.pixels[1]) - row) * beam.pitch / far;
        let z = slope_z * near;
        let crossed = |(centre, radius): ([f64; 2], f64)| {
            let square = radius * radius - (z - centre[1]).powi(2);
            (square > 0.0).then(|| [centre[0] - square.sqrt(), centre[0] + square.sqrt()])
        };
        let ends = self.shadows().into_iter().filter_map(crossed);
        let Some([low, high]) = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]) else {
            return values;
        };
        let count = ((high - low) / COARSE).ceil();
        let at = |k: f64| low + (high - low) * k / count;
        let per_metre = far / near / beam.pitch / f64::from(self.lines);
        let trace = |x: f64| ray(self.solids, beam, [x / near, slope_z]);
        let mut first = (at(0.0), trace(at(0.0)));
        let mut stack = Vec::new();
        for k in 1..=count as u32 {
            let end = at(f64::from(k));
            stack.push((end, trace(end)));
            while let Some((x, landed)) = stack.last().copied() {
                let width = x - first.0;
                if width > LEAST && self.class(&landed) != self.class(&first.1) {
                    let middle = first.0 + 0.5 * width;
                    stack.push((middle, trace(middle)));
                    continue;
                }
                for (x, it) in [(first.0, &first.1), (x, &landed)] {
                    self.deposit(it, [x / near, slope_z], 0.5 * width * per_metre, &mut values);
                }
                first = (x, landed);
                stack.pop();
            }
        }
        values
    }

    /// Light without bodies, `[step][column]`.
    fn empty(&self) -> Vec<f64> {
        let beam = self.beam;
        let (far, pixels) = (beam.detector_distance, 600_000);
        let half = 0.5 * if beam.has_detector_mask { beam.aperture } else { beam.pitch };
        let of = |step: usize, column: u32| -> f64 {
            let middle = (f64::from(column) + 0.5 - 0.5 * f64::from(beam.pixels[0])) * beam.pitch;
            let light = |k: u32| {
                let at = 3.0 * beam.pitch * ((f64::from(k) + 0.5) / f64::from(pixels) - 0.5);
                share(at, [-half, half], self.sigma(0)) * self.opened((middle + at) / far, step)
            };
            3.0 / f64::from(pixels) * (0..pixels).map(light).sum::<f64>()
        };
        let steps = 0..beam.offsets.len();
        steps.flat_map(|step| (0..beam.pixels[0]).map(move |column| of(step, column))).collect()
    }

    /// Recorded values `[step][row][column]`, share of open beam.
    pub fn values(&self) -> Vec<f64> {
        let [columns, rows] = self.beam.pixels.map(|n| n as usize);
        let lines = self.lines * (self.beam.pixels[1] + 2 * BESIDE as u32);
        let changes: Vec<Vec<f64>> =
            (0..lines).into_par_iter().map(|line| self.line(line)).collect();
        let empty = self.empty();
        let value = |index: usize| {
            let change: f64 = changes.iter().map(|line| line[index]).sum();
            change + empty[index / (rows * columns) * columns + index % columns]
        };
        (0..self.beam.offsets.len() * rows * columns).map(value).collect()
    }
}
