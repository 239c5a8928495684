//! Rays through solids in f64: interfaces, of which the object listed last decides, sums of the first order, and Snell's
//! law from interface to interface.

use super::solids::{Hit, Solid};
use crate::reference::vector::{Vector, add, dot, length, scaled, sub, turned, unit};
use beamlet::SurfaceCrossing;
use beamlet::internals::trace::Ray;

/// Rotation centre to analyser, m.
pub(super) const LEVER: f64 = 0.59;

/// Passage of a ray through solids.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Passage {
    /// Way within solids, m.
    pub(super) path: f64,
    pub(super) slope: [f64; 2],
    pub(super) displacement: [f64; 2],
    pub(super) crossings: usize,
    pub(super) reflected: bool,
    /// Least cosine of incidence.
    pub(super) grazing: f64,
    /// Least distance of two surfaces on the ray that do not coincide, m; followed by Snell's law alone.
    pub(super) nearest: f64,
    /// True if surfaces coincide on the ray.
    pub(super) coincide: bool,
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
fn bend(passage: &mut Passage, before: Vector, after: Vector, y: f64) {
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
fn refracted(d: Vector, along: Vector, [from, to]: [f64; 2]) -> (Vector, bool) {
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

/// An interface on a ray: y, and the object before and behind it.
#[derive(Debug)]
pub(super) struct Interface {
    y: f64,
    pub(super) media: [Option<usize>; 2],
    /// Normal of the surface that was crossed.
    pub(super) normal: Vector,
}

/// Interfaces of a line: between any two surfaces the object that is listed last of those around the
/// middle is there. Layers thinner than `least` are left out.
pub(super) fn interfaces(solids: &[Solid], [o, d]: [Vector; 2], least: f64) -> Vec<Interface> {
    let mut hits: Vec<_> = solids.iter().flat_map(|solid| solid.hits(o, d)).collect();
    hits.sort_by(|a, b| a.t.total_cmp(&b.t));
    let mut all: Vec<Interface> = Vec::new();
    let mut before = None;
    for (k, hit) in hits.iter().enumerate() {
        let next = hits.get(k + 1).map_or(hit.t + 1.0, |next| next.t);
        let middle = add(o, scaled(d, hit.t.midpoint(next)));
        let medium = solids.iter().rposition(|solid| solid.distance(middle) < 0.0);
        if medium != before {
            all.push(Interface { y: hit.t, media: [before, medium], normal: hit.normal });
        }
        before = medium;
    }
    thick(all, least)
}

/// Without layers thinner than `least`. Surfaces in a later object bound none.
fn thick(all: Vec<Interface>, least: f64) -> Vec<Interface> {
    let mut found: Vec<Interface> = Vec::new();
    let mut before = None;
    let mut ends = all.iter().skip(1).map(|it| it.y).collect::<Vec<f64>>().into_iter();
    for it in all {
        let thick = ends.next().is_none_or(|end| end - it.y >= least);
        if thick && it.media[1] != before {
            let media = [before, it.media[1]];
            before = it.media[1];
            found.push(Interface { media, ..it });
        }
    }
    found
}

/// Way of a ray through every solid where no later one covers it.
fn ways(solids: &[Solid], ray: &Ray) -> Vec<f64> {
    let mut ways = vec![0.0; solids.len()];
    let line = line(ray, [0.0; 2]);
    let stretch = length(line[1]);
    for pair in interfaces(solids, line, 0.0).windows(2) {
        if let Some(medium) = pair[0].media[1] {
            ways[medium] += (pair[1].y - pair[0].y) * stretch;
        }
    }
    ways
}

/// Interfaces of a list of crossings.
fn listed(met: &[SurfaceCrossing], objects: usize, least: f64) -> Vec<Interface> {
    let mut depth = vec![0; objects];
    let mut all: Vec<Interface> = Vec::new();
    let mut before = None;
    for it in met {
        depth[it.object as usize] += if it.entering { 1 } else { -1 };
        let medium = depth.iter().rposition(|count| *count > 0);
        if medium != before {
            let normal = it.normal.map(f64::from);
            all.push(Interface { y: it.y.into(), media: [before, medium], normal });
        }
        before = medium;
    }
    assert!(before.is_none() && depth.iter().all(|count| *count == 0), "{met:?}");
    thick(all, least)
}

/// The largest error of the ways of a ray, m, if rays beside it have equal ways (else 0), where surfaces err
/// by `error`, m. `Err` where the ways differ by more than a ray beside by twice this error may make.
pub(super) fn compared(
    solids: &[Solid],
    ray: &Ray,
    got: &[f64],
    crossings: u32,
    error: f64,
) -> Result<f64, String> {
    let near = beside(2.0 * error).map(|by| ways(solids, &moved(ray, by)));
    let room = f64::from(crossings.max(2)) * error;
    let mut worst = 0.0_f64;
    for k in 0..solids.len() {
        let Some(found) = error_among(&near.each_ref().map(|it| it[k]), got[k], room, error) else {
            return Err(format!("{ray:?}: {got:?} for {:?} in {solids:?}", near[0]));
        };
        worst = worst.max(found);
    }
    Ok(worst)
}

/// Interfaces whose media, places or normals are not those of f64, nor of a ray a hair beside.
pub(super) fn are_listed(solids: &[Solid], ray: &Ray, met: &[SurfaceCrossing], error: f64) -> bool {
    let least = 3.0 * error;
    let got = listed(met, solids.len(), least);
    // A layer about as thin as that may be listed or not: both surfaces err by `error` over the cosine of
    // incidence along the ray.
    [1.0, 0.8, 1.25, 0.5, 2.0]
        .into_iter()
        .any(|share| are_those(solids, ray, &got, share * least, error))
}

fn are_those(solids: &[Solid], ray: &Ray, got: &[Interface], least: f64, error: f64) -> bool {
    beside(4.0 * error).into_iter().any(|by| {
        let want = interfaces(solids, line(&moved(ray, by), [0.0; 2]), least);
        want.len() == got.len()
            && want.iter().zip(got).all(|(want, got)| {
                // Facets that are off by e stand sqrt(8 e / r) apart and lean by half of that.
                let lean = 0.05;
                let along = dot(want.normal, got.normal);
                let cosine = dot(want.normal, line(ray, [0.0; 2])[1]);
                let room = 6.0 * error / cosine.abs().max(1e-3);
                want.media == got.media && along.abs() > 1.0 - lean && (want.y - got.y).abs() < room
            })
    })
}

/// Decrement of a medium; that of vacuum is 0.
fn delta_of(deltas: &[f64], medium: Option<usize>) -> f64 {
    medium.map_or(0.0, |k| deltas[k])
}

/// To first order in delta, along the straight line moved by a hair.
pub(super) fn first_order(solids: &[Solid], deltas: &[f64], ray: &Ray, by: [f64; 2]) -> Passage {
    let line = line(ray, by);
    let d = line[1];
    let square = dot(d, d);
    let mut passage = Passage { grazing: 1.0, ..Passage::default() };
    for it in interfaces(solids, line, 0.0) {
        let share = f64::from(it.media[0].is_some()) - f64::from(it.media[1].is_some());
        passage.path += share * it.y * square.sqrt();
        passage.crossings += 1;
        let along = dot(it.normal, d);
        passage.grazing = passage.grazing.min(along.abs() / square.sqrt());
        // Snell's law for n = 1 - delta: the direction changes across the surface by
        // (delta - delta') (n / (n d) - d) of d of length 1.
        let step = delta_of(deltas, it.media[1]) - delta_of(deltas, it.media[0]);
        for (k, axis) in [0, 2].into_iter().enumerate() {
            let slope = -step * square * (it.normal[axis] - it.normal[1] * d[axis]) / along;
            passage.slope[k] += slope;
            passage.displacement[k] += slope * (LEVER - it.y);
        }
    }
    passage
}

/// Surfaces coincide on a ray, m: f64 holds crossings at 1 mrad to 1e-13 m.
const SAME: f64 = 1e-11;

/// Passage by Snell's law at one interface after the other, where the bent ray meets them; total reflection
/// where there is no refracted ray. `None`: it does not get out.
pub(super) fn snell(solids: &[Solid], deltas: &[f64], ray: &Ray, by: [f64; 2]) -> Option<Passage> {
    let [mut o, d] = line(ray, by);
    let mut d = unit(d);
    o = sub(o, scaled(d, 1.0));
    let mut passage = Passage { grazing: 1.0, nearest: 1.0, ..Passage::default() };
    let mut medium: Option<usize> = None;
    for _ in 0..200 {
        let mut hits: Vec<_> = solids.iter().flat_map(|it| it.hits(o, d)).collect();
        hits.retain(|hit| hit.t > SAME);
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        let behind = |k: usize| {
            let from = hits[k].t + SAME;
            let end = hits.iter().find(|it| it.t > from).map_or(from + 1.0, |it| it.t);
            let middle = add(o, scaled(d, hits[k].t.midpoint(end)));
            solids.iter().rposition(|it| it.distance(middle) < 0.0)
        };
        let Some(first) = (0..hits.len()).find(|k| behind(*k) != medium) else {
            return medium.is_none().then_some(passage);
        };
        for gap in hits.windows(2).map(|pair| pair[1].t - pair[0].t) {
            passage.coincide |= gap <= SAME;
            passage.nearest = if gap > SAME { passage.nearest.min(gap) } else { passage.nearest };
        }
        let (hit, after_medium) = (hits[first], behind(first));
        o = add(o, scaled(d, hit.t));
        passage.crossings += 1;
        let cosine = dot(hit.normal, d);
        let along = if cosine > 0.0 { hit.normal } else { scaled(hit.normal, -1.0) };
        passage.grazing = passage.grazing.min(cosine.abs());
        let both = [medium, after_medium].map(|it| delta_of(deltas, it));
        let (after, reflected) = refracted(d, along, both);
        passage.reflected |= reflected;
        medium = if reflected { medium } else { after_medium };
        bend(&mut passage, d, after, o[1]);
        d = unit(after);
    }
    None
}
