//! Rays through solids in f64: sums of the first order, and Snell's law from surface to surface.

use super::solids::{Hit, Solid};
use crate::reference::vector::{Vector, add, dot, scaled, sub, turned, unit};
use beamlet::internals::trace::Ray;

/// Rotation centre to analyser, m.
pub(super) const LEVER: f64 = 0.59;

/// Passage of a ray through one solid of constants mu and delta.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Passage {
    pub(super) path: f64,
    pub(super) slope: [f64; 2],
    pub(super) displacement: [f64; 2],
    pub(super) crossings: usize,
    pub(super) reflected: bool,
    /// Least cosine of incidence.
    pub(super) grazing: f64,
}

impl Passage {
    /// Slope and displacement.
    pub(super) fn values(&self) -> [f64; 4] {
        [self.slope[0], self.slope[1], self.displacement[0], self.displacement[1]]
    }
}

/// The line of a ray moved by a hair, in the frame of the beam: o + y d.
pub(super) fn line(ray: &Ray, by: [f64; 2]) -> [Vector; 2] {
    let o = [f64::from(ray.x) + by[0], 0.0, f64::from(ray.z) + by[1]];
    [o, [f64::from(ray.slope_x), 1.0, f64::from(ray.slope_z)]]
}

/// Crossings of a ray in a view, as the beam sees them.
pub(super) fn hits(solid: &Solid, ray: &Ray, by: [f64; 2], angle: f64) -> Vec<Hit> {
    let up = [0.0, 0.0, 1.0];
    let [o, d] = line(ray, by).map(|v| turned(v, up, angle));
    let seen = |hit: Hit| Hit { normal: turned(hit.normal, up, -angle), ..hit };
    solid.hits(o, d).into_iter().map(seen).collect()
}

/// A hair to either side along x and z, and none.
pub(super) fn beside(hair: f64) -> [[f64; 2]; 5] {
    [[0.0, 0.0], [hair, 0.0], [-hair, 0.0], [0.0, hair], [0.0, -hair]]
}

/// Change of slope and displacement at the analyser of a ray that was at `place` going along
/// `before`, and goes along `after`.
pub(super) fn bend(passage: &mut Passage, before: Vector, after: Vector, y: f64) {
    for (k, axis) in [0, 2].into_iter().enumerate() {
        // As differences of the two: no digits go.
        let change = sub(after, before);
        let slope = (change[axis] - change[1] * before[axis] / before[1]) / after[1];
        passage.slope[k] += slope;
        passage.displacement[k] += slope * (LEVER - y);
    }
}

/// The direction of a ray behind a surface, by Snell's law, and whether it is totally reflected. `along`: the
/// normal, ahead; deltas of the media before and behind.
pub(super) fn refracted(d: Vector, along: Vector, [from, to]: [f64; 2]) -> (Vector, bool) {
    let cosine = dot(along, d);
    let ratio = (1.0 - from) / (1.0 - to);
    let tangent = sub(d, scaled(along, cosine));
    // 1 - ratio² sin², without loss of digits.
    let square = cosine * cosine - (ratio - 1.0) * (ratio + 1.0) * dot(tangent, tangent);
    if square < 0.0 {
        (sub(d, scaled(along, 2.0 * cosine)), true)
    } else {
        (add(scaled(tangent, ratio), scaled(along, square.sqrt())), false)
    }
}

/// Error of a value that was got, against the value of a ray, the first of `near`, and of rays beside it: 0
/// where these differ by `alike` or more; `None` where it is farther than `room` and their difference from all.
pub(super) fn error_among(near: &[f64], got: f64, room: f64, alike: f64) -> Option<f64> {
    let low = near.iter().copied().fold(f64::MAX, f64::min);
    let high = near.iter().copied().fold(f64::MIN, f64::max);
    let room = room + (high - low);
    let error = if high - low < alike { (got - near[0]).abs() } else { 0.0 };
    (low - room..=high + room).contains(&got).then_some(error)
}

/// A ray beside another, rounded to f32.
pub(super) fn moved(ray: &Ray, by: [f64; 2]) -> Ray {
    let to = |x: f32, by: f64| (f64::from(x) + by) as f32;
    Ray { x: to(ray.x, by[0]), z: to(ray.z, by[1]), ..*ray }
}

/// To first order in delta, along the straight line.
pub(super) fn first_order(
    solid: &Solid,
    delta: f64,
    ray: &Ray,
    by: [f64; 2],
    angle: f64,
) -> Passage {
    let d = line(ray, by)[1];
    let stretch = dot(d, d).sqrt();
    let mut passage = Passage { grazing: 1.0, ..Passage::default() };
    for hit in hits(solid, ray, by, angle) {
        let sign = if hit.entering { -1.0 } else { 1.0 };
        passage.path += sign * hit.t * stretch;
        passage.crossings += 1;
        let along = dot(hit.normal, d);
        passage.grazing = passage.grazing.min(along.abs() / stretch);
        // Snell's law for n = 1 - delta: the direction changes across the surface by
        // (delta - delta') (n / (n d) - d) of d of length 1.
        for (k, axis) in [0, 2].into_iter().enumerate() {
            let tangent = (hit.normal[axis] - hit.normal[1] * d[axis]) / along;
            let slope = sign * delta * stretch * stretch * tangent;
            passage.slope[k] += slope;
            passage.displacement[k] += slope * (LEVER - hit.t);
        }
    }
    passage
}

/// Passage by Snell's law at one surface after the other, where the bent ray meets them; total reflection
/// where there is no refracted ray. `None`: it does not get out.
pub(super) fn snell(solid: &Solid, delta: f64, ray: &Ray, by: [f64; 2]) -> Option<Passage> {
    let [mut o, d] = line(ray, by);
    let mut d = unit(d);
    o = sub(o, scaled(d, 1.0));
    let mut passage = Passage { grazing: 1.0, ..Passage::default() };
    let mut inside = false;
    for _ in 0..100 {
        let next = solid.hits(o, d).into_iter().find(|hit| hit.t > 1e-11 && hit.entering != inside);
        let Some(hit) = next else {
            return (!inside).then_some(passage);
        };
        o = add(o, scaled(d, hit.t));
        passage.path += if inside { hit.t } else { 0.0 };
        passage.crossings += 1;
        let along = if inside { hit.normal } else { scaled(hit.normal, -1.0) };
        passage.grazing = passage.grazing.min(dot(along, d));
        let deltas = if inside { [delta, 0.0] } else { [0.0, delta] };
        let (after, reflected) = refracted(d, along, deltas);
        passage.reflected |= reflected;
        inside ^= !reflected;
        bend(&mut passage, d, after, o[1]);
        d = unit(after);
    }
    None
}
