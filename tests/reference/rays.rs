//! Rays through bodies: every triangle tested in f64, Snell's law on n in the order of hits.

use super::surfaces::Body;
use super::vector::{Vector, add, cross, dot, scaled, sub, turned, unit};

/// Two hits nearer than this are at one place (coincident faces), m.
const SAME_PLACE: f64 = 1e-11;

/// Surfaces of several bodies that are nearer than this are one interface, m.
const CONTACT: f64 = 5e-9;

/// How a ray goes through the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Snell's law at every surface, from where the bent ray meets it.
    Exact,
    /// Direction changes along the straight ray, first order in delta.
    First,
}

/// Result of a traced ray.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// Attenuation exponent, relative to the surroundings.
    pub optical_depth: f64,
    /// Displacement in x and z on the analyser plane from the straight ray, m.
    pub displacement: [f64; 2],
    /// Change of the slopes dx/dy and dz/dy.
    pub slope: [f64; 2],
    /// Way through each body where no later body covers it, m.
    pub path: Vec<f64>,
    /// Totally reflected at least once.
    pub reflected: bool,
    /// Surfaces met.
    pub crossings: usize,
    /// Their triangles, in the order of bodies and meshes, and where each was met, y.
    pub met: Vec<(usize, f64)>,
    /// Least cosine between ray and normal over all surfaces that change the medium.
    pub grazing: f64,
    /// Entered and left every body equally often.
    pub balanced: bool,
}

#[derive(Debug, Clone, Copy)]
struct Triangle {
    corners: [Vector; 3],
    normal: Vector,
    body: usize,
}

#[derive(Debug, Clone, Copy)]
struct Hit {
    t: f64,
    triangle: usize,
}

/// Bodies in the frame of the beam of one view.
#[derive(Debug, Clone)]
pub struct Sample {
    triangles: Vec<Triangle>,
    /// mu and delta of each body, later bodies win.
    constants: Vec<[f64; 2]>,
    /// mu and delta outside.
    surroundings: [f64; 2],
    fan: Fan,
}

/// Triangles sorted by the directions in which the source's centre sees them: a projection
/// keeps triangles convex, so no triangle that a line meets is missed.
#[derive(Debug, Clone)]
struct Fan {
    source: f64,
    y: [f64; 2],
    low: [f64; 2],
    width: [f64; 2],
    count: [usize; 2],
    bins: Vec<Vec<u32>>,
}

/// The least and the largest of some numbers.
fn ends(all: impl Iterator<Item = f64>) -> [f64; 2] {
    all.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)])
}

/// Along x, the ends of those parts of the edges of a triangle that lie in a band along z.
fn parts_within(corners: [[f64; 2]; 3], [low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    (0..3).flat_map(move |i| {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        let (a, b) = if a[1] <= b[1] { (a, b) } else { (b, a) };
        let at = |z: f64| a[0] + (b[0] - a[0]) * ((z - a[1]) / (b[1] - a[1]));
        let from = if a[1] >= low { a[0] } else { at(low) };
        let to = if b[1] <= high { b[0] } else { at(high) };
        let within = b[1] >= low && a[1] <= high;
        [from, to].into_iter().take(if within { 2 } else { 0 })
    })
}

impl Fan {
    /// Bins along x and z; one of each tests every triangle.
    fn new(triangles: &[Triangle], source: f64, count: [usize; 2]) -> Self {
        let seen = |v: Vector| [v[0] / (v[1] + source), v[2] / (v[1] + source)];
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        let mut y = [f64::MAX, f64::MIN];
        for v in triangles.iter().flat_map(|t| t.corners) {
            assert!(v[1] > -source, "the sample lies behind the source");
            y = [y[0].min(v[1]), y[1].max(v[1])];
            for k in 0..2 {
                low[k] = low[k].min(seen(v)[k]);
                high[k] = high[k].max(seen(v)[k]);
            }
        }
        let width = [0, 1].map(|k| ((high[k] - low[k]) / count[k] as f64).max(1e-12));
        let mut fan =
            Self { source, y, low, width, count, bins: vec![vec![]; count[0] * count[1]] };
        for (index, triangle) in triangles.iter().enumerate() {
            let s = triangle.corners.map(seen);
            let [low, high] = ends(s.iter().map(|corner| corner[1]));
            for row in fan.range(1, low, high) {
                let [low, high] = ends(parts_within(s, fan.band(row)));
                for column in fan.range(0, low, high) {
                    fan.bins[row * count[0] + column].push(index as u32);
                }
            }
        }
        fan
    }

    /// Directions along z of a row of bins, with room for rounding. The outer rows have no end.
    fn band(&self, row: usize) -> [f64; 2] {
        let at = |row: f64| self.low[1] + row * self.width[1];
        [
            if row == 0 { f64::MIN } else { at(row as f64 - 1e-6) },
            if row + 1 == self.count[1] { f64::MAX } else { at(row as f64 + 1.0 + 1e-6) },
        ]
    }

    fn range(&self, k: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        let at = |s: f64| (s - self.low[k]) / self.width[k];
        let (from, to) = ((at(low) - 1e-6).floor(), (at(high) + 1e-6).floor());
        let most = self.count[k] as f64 - 1.0;
        if to < 0.0 || from > most {
            // Directions on the rim of the last bin round either way.
            return 0..0;
        }
        from.clamp(0.0, most) as usize..to.clamp(0.0, most) as usize + 1
    }

    /// Calls `each` with every triangle that the line onward from `o` could meet.
    fn each(&self, o: Vector, d: Vector, mut each: impl FnMut(usize)) {
        assert!(d[1] > 0.0, "rays run towards the detector");
        let from = o[1].max(self.y[0] - 1e-9);
        if from > self.y[1] + 1e-9 {
            return;
        }
        let seen = |y: f64, k: usize| (o[k] + d[k] / d[1] * (y - o[1])) / (y + self.source);
        let range = |bin: usize, k: usize| {
            let (a, b) = (seen(from, k), seen(self.y[1], k));
            self.range(bin, a.min(b), a.max(b))
        };
        let columns = range(0, 0);
        for row in range(1, 2) {
            for column in columns.clone() {
                for &t in &self.bins[row * self.count[0] + column] {
                    each(t as usize);
                }
            }
        }
    }
}

impl Sample {
    /// Bodies seen in a view: source, masks and detector turn by +angle, the sample by -angle.
    pub fn new(bodies: &[Body], source_distance: f64, angle: f64) -> Self {
        let count: usize = bodies.iter().map(|b| b.mesh.triangles.len()).sum();
        let bins = ((count as f64 / 2.0).sqrt() as usize).clamp(1, 400);
        Self::with_bins(bodies, source_distance, angle, [(4 * bins).min(2000), bins.min(100)])
    }

    /// As [`Sample::new`], testing every triangle against every ray.
    pub fn brute_force(bodies: &[Body], source_distance: f64, angle: f64) -> Self {
        Self::with_bins(bodies, source_distance, angle, [1, 1])
    }

    fn with_bins(bodies: &[Body], source_distance: f64, angle: f64, bins: [usize; 2]) -> Self {
        let seen = |v: Vector| if angle == 0.0 { v } else { turned(v, [0.0, 0.0, 1.0], -angle) };
        let mut triangles = Vec::new();
        for (index, body) in bodies.iter().enumerate() {
            for i in 0..body.mesh.triangles.len() {
                let corners = body.mesh.corners(i).map(seen);
                let normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
                if dot(normal, normal) > 0.0 {
                    triangles.push(Triangle { corners, normal: unit(normal), body: index });
                }
            }
        }
        let fan = Fan::new(&triangles, source_distance, bins);
        let constants = bodies.iter().map(|b| [b.mu, b.delta]).collect();
        Self { triangles, constants, surroundings: [0.0; 2], fan }
    }

    /// Constants outside all bodies.
    pub fn within(mut self, mu: f64, delta: f64) -> Self {
        self.surroundings = [mu, delta];
        self
    }

    /// Traces a ray to the plane y = `analyser`.
    pub fn trace(&self, source: Vector, direction: Vector, analyser: f64, order: Order) -> Trace {
        match order {
            Order::Exact => self.exact(source, unit(direction), analyser),
            Order::First => self.first(source, unit(direction), analyser),
        }
    }

    /// Distance to a triangle along a unit direction, where the ray goes through it. Edges are
    /// judged by signed volumes that neighbours see with exactly opposite signs.
    fn meet(&self, index: usize, o: Vector, d: Vector) -> Option<f64> {
        let triangle = &self.triangles[index];
        let [a, b, c] = triangle.corners;
        let side = |p: Vector, q: Vector| {
            let volume = dot(d, cross(sub(p, o), sub(q, o)));
            if volume == 0.0 { p < q } else { volume > 0.0 }
        };
        let first = side(a, b);
        if first != side(b, c) || first != side(c, a) {
            return None;
        }
        let across = dot(d, triangle.normal);
        (across != 0.0).then(|| dot(sub(a, o), triangle.normal) / across)
    }

    /// The medium inside the given set of bodies: the one listed last.
    fn medium(&self, depth: &[i32]) -> Option<usize> {
        depth.iter().rposition(|&n| n > 0)
    }

    fn constants(&self, medium: Option<usize>) -> [f64; 2] {
        medium.map_or(self.surroundings, |m| self.constants[m])
    }

    /// Counts a crossing of body `b`; gives the media before and after.
    fn cross(&self, depth: &mut [i32], b: usize, entering: bool) -> [Option<usize>; 2] {
        let before = self.medium(depth);
        depth[b] += if entering { 1 } else { -1 };
        [before, self.medium(depth)]
    }

    fn leaves(&self, hit: Hit, d: Vector) -> bool {
        dot(self.triangles[hit.triangle].normal, d) > 0.0
    }

    /// Triangles of one interface with the one that is met at `o`: bodies are left and others
    /// entered within [`CONTACT`]. Until that is so no body is met twice.
    fn interface(&self, o: Vector, d: Vector, first: Hit, here: &[usize]) -> Vec<usize> {
        if self.constants.len() == 1 {
            return vec![first.triangle];
        }
        let mut hits = Vec::new();
        self.fan.each(o, d, |triangle| {
            if let Some(t) = self.meet(triangle, o, d)
                && (-SAME_PLACE..1e-2).contains(&t)
                && !here.contains(&triangle)
            {
                hits.push(Hit { t, triangle });
            }
        });
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        hits.dedup_by_key(|hit| hit.triangle);
        let cosine = |hit: Hit| dot(self.triangles[hit.triangle].normal, d).abs();
        let (mut group, mut mixed) = (vec![first.triangle], false);
        for hit in hits {
            let body = |triangle: usize| self.triangles[triangle].body;
            let repeated = group.iter().any(|met| body(*met) == body(hit.triangle));
            let apart = hit.t * cosine(hit).max(cosine(first)).max(1e-4);
            if (repeated && !mixed) || apart > CONTACT {
                break;
            }
            mixed |= self.leaves(hit, d) != self.leaves(first, d);
            group.push(hit.triangle);
        }
        group.truncate(if mixed { group.len() } else { 1 });
        group
    }

    fn first(&self, source: Vector, d: Vector, analyser: f64) -> Trace {
        let mut hits = Vec::new();
        self.fan.each(source, d, |triangle| {
            if let Some(t) = self.meet(triangle, source, d) {
                hits.push(Hit { t, triangle });
            }
        });
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        hits.dedup_by_key(|h| h.triangle);
        let mut out = self.blank();
        let mut depth = vec![0; self.constants.len()];
        let mut last = 0.0;
        for hit in hits {
            let triangle = &self.triangles[hit.triangle];
            let facing = dot(triangle.normal, d);
            self.go(&mut out, self.medium(&depth), hit.t - last);
            last = hit.t;
            out.crossings += 1;
            out.met.push((hit.triangle, source[1] + hit.t * d[1]));
            let media = self.cross(&mut depth, triangle.body, facing < 0.0);
            let [before, after] = media.map(|m| self.constants(m));
            let difference = after[1] - before[1];
            if difference == 0.0 {
                continue;
            }
            out.grazing = out.grazing.min(facing.abs());
            // n / c is the same for either sense of the normal.
            let change = scaled(sub(d, scaled(triangle.normal, 1.0 / facing)), difference);
            let reach = analyser - (source[1] + hit.t * d[1]);
            for (k, axis) in [0, 2].into_iter().enumerate() {
                let slope = (change[axis] - change[1] * d[axis] / d[1]) / d[1];
                out.slope[k] += slope;
                out.displacement[k] += slope * reach;
            }
        }
        out.balanced = depth.iter().all(|&n| n == 0);
        out
    }

    fn exact(&self, source: Vector, straight: Vector, analyser: f64) -> Trace {
        let mut out = self.blank();
        let mut depth = vec![0; self.constants.len()];
        let (mut o, mut d) = (source, straight);
        let mut here: Vec<usize> = Vec::new();
        loop {
            let mut next: Option<Hit> = None;
            self.fan.each(o, d, |triangle| {
                let Some(t) = self.meet(triangle, o, d) else { return };
                if t < -SAME_PLACE || here.contains(&triangle) {
                    return;
                }
                let inside = depth[self.triangles[triangle].body] > 0;
                let leaving = dot(self.triangles[triangle].normal, d) > 0.0;
                if t < SAME_PLACE && inside != leaving {
                    return; // the other side of an edge just crossed
                }
                if next.is_none_or(|n| (t, triangle) < (n.t, n.triangle)) {
                    next = Some(Hit { t, triangle });
                }
            });
            let Some(hit) = next else { break };
            let t = hit.t.max(0.0);
            self.go(&mut out, self.medium(&depth), t);
            if t > SAME_PLACE {
                here.clear();
            }
            here.push(hit.triangle);
            o = add(o, scaled(d, t));
            out.crossings += 1;
            out.met.push((hit.triangle, o[1]));
            assert!(out.crossings < 1_000_000, "a ray does not get out");
            let leaving = self.leaves(hit, d);
            let old = depth.clone();
            let before = self.medium(&depth);
            for (number, met) in self.interface(o, d, hit, &here).into_iter().enumerate() {
                depth[self.triangles[met].body] +=
                    if dot(self.triangles[met].normal, d) < 0.0 { 1 } else { -1 };
                if number > 0 {
                    here.push(met);
                    out.crossings += 1;
                }
            }
            let triangle = &self.triangles[hit.triangle];
            let [before, after] = [before, self.medium(&depth)].map(|m| self.constants(m));
            if before[1] == after[1] {
                continue;
            }
            // Normal along the ray; Snell on n with the root of 1 - (n_i/n_r)^2 sin^2.
            let n = if leaving { triangle.normal } else { scaled(triangle.normal, -1.0) };
            let cosine = dot(n, d);
            out.grazing = out.grazing.min(cosine);
            let ratio = (1.0 - before[1]) / (1.0 - after[1]);
            let tangent = sub(d, scaled(n, cosine));
            let root = 1.0 - ratio * ratio * dot(tangent, tangent);
            if root < 0.0 {
                d = unit(sub(d, scaled(n, 2.0 * cosine)));
                depth = old;
                out.reflected = true;
            } else {
                d = unit(add(scaled(tangent, ratio), scaled(n, root.sqrt())));
            }
        }
        for (k, axis) in [0, 2].into_iter().enumerate() {
            let plain = straight[axis] / straight[1];
            let bent = d[axis] / d[1];
            out.slope[k] = bent - plain;
            let unbent = source[axis] + plain * (analyser - source[1]);
            out.displacement[k] = o[axis] + bent * (analyser - o[1]) - unbent;
        }
        out.balanced = depth.iter().all(|&n| n == 0);
        out
    }

    fn blank(&self) -> Trace {
        Trace { path: vec![0.0; self.constants.len()], grazing: 1.0, ..Trace::default() }
    }

    fn go(&self, out: &mut Trace, medium: Option<usize>, way: f64) {
        if let Some(m) = medium {
            out.path[m] += way;
            out.optical_depth += way * (self.constants[m][0] - self.surroundings[0]);
        }
    }
}
