//! Where a line crosses a shape, in f64: by the same ways as `shaders/walk/shape.glsl`.

use arrayvec::ArrayVec;
use glam::DVec3;

use super::{AnalyticShape, Form, Frustum, Tube};

/// A crossing of a line with a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShapeCrossing {
    /// The place is origin + t direction.
    pub(crate) t: f64,
    /// Unit, outward.
    pub(crate) normal: DVec3,
    /// Whether the line goes into the shape as t grows.
    pub(crate) entering: bool,
}

/// 0, 2 or 4 crossings, in order.
pub(crate) type Crossings = ArrayVec<ShapeCrossing, 4>;

impl AnalyticShape {
    /// All crossings of a line, in order: none, an entry and an exit, or two of each. A line that
    /// touches the surface within rounding may cross it twice or not.
    pub(crate) fn crossings(self, origin: DVec3, direction: DVec3) -> Crossings {
        let found: ArrayVec<(f64, DVec3), 4> = match self.form() {
            Form::Frustum(frustum) => frustum_crossings(frustum, origin, direction),
            Form::Ellipsoid(axes) => ellipsoid_crossings(axes, origin, direction),
            Form::Tube(tube) => tube_crossings(tube, origin, direction),
        };
        let crossing = |(at, (t, gradient)): (usize, (f64, DVec3))| ShapeCrossing {
            t,
            normal: gradient.normalize_or(DVec3::Z),
            entering: at % 2 == 0,
        };
        found.into_iter().enumerate().map(crossing).collect()
    }
}

/// Roots of a x² + 2 b x + c, the lesser first; `None` for none or one.
fn quadratic(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 {
        return None;
    }
    let sum = -(b + discriminant.sqrt().copysign(b));
    let (first, second) = (sum / a, c / sum);
    Some([first.min(second), first.max(second)])
}

fn ellipsoid_crossings(axes: DVec3, origin: DVec3, direction: DVec3) -> ArrayVec<(f64, DVec3), 4> {
    let (o, d) = (origin / axes, direction / axes);
    // From the place next to the centre.
    let base = -o.dot(d) / d.length_squared();
    let nearest = o + base * d;
    let c = nearest.length_squared() - 1.0;
    let Some(roots) = quadratic(d.length_squared(), nearest.dot(d), c) else {
        return ArrayVec::new();
    };
    roots.into_iter().map(|root| (base + root, (nearest + root * d) / axes)).collect()
}

fn frustum_crossings(it: Frustum, origin: DVec3, direction: DVec3) -> ArrayVec<(f64, DVec3), 4> {
    let along = if direction.z == 0.0 { f64::MIN_POSITIVE } else { direction.z };
    let caps = [-it.half_height, it.half_height].map(|z| (z - origin.z) / along);
    let slab = [caps[0].min(caps[1]), caps[0].max(caps[1])];
    let [o, d] = [origin.truncate(), direction.truncate()];
    let slope = it.widening * direction.z;
    let least = 1e-24 * direction.length_squared();
    let a = d.length_squared() - slope * slope;
    let a = if a.abs() < least { least.copysign(a) } else { a };
    // From the place next to the axis, or the end of the slab that is.
    let base = (-(o.dot(d) - it.radius_at(origin.z) * slope) / a).clamp(slab[0], slab[1]);
    let nearest = origin + base * direction;
    let radius = it.radius_at(nearest.z);
    let flat = nearest.truncate();
    let b = flat.dot(d) - radius * slope;
    let roots = quadratic(a, b, flat.length_squared() - radius * radius);
    // Of a line that is steeper than the cone, one half of the cone alone is there.
    let [low, high] = match (roots, a > 0.0, slope > 0.0) {
        (None, true, _) => return ArrayVec::new(),
        (Some([low, high]), true, _) => [base + low, base + high],
        (roots, false, true) => [base + roots.map_or(-b / a, |it| it[1]), f64::INFINITY],
        (roots, false, false) => [f64::NEG_INFINITY, base + roots.map_or(-b / a, |it| it[0])],
    };
    let [enter, leave] = [low.max(slab[0]), high.min(slab[1])];
    if enter.partial_cmp(&leave) != Some(std::cmp::Ordering::Less) {
        return ArrayVec::new();
    }
    let side = |t: f64| {
        let point = origin + t * direction;
        DVec3::new(point.x, point.y, -it.widening * it.radius_at(point.z))
    };
    let cap = DVec3::Z * along.signum();
    let entry = if low > slab[0] { side(enter) } else { -cap };
    let exit = if high < slab[1] { side(leave) } else { cap };
    [(enter, entry), (leave, exit)].into_iter().collect()
}

/// The chord of the outer cylinder of a tube without the chord of its bore.
fn tube_crossings(it: Tube, origin: DVec3, direction: DVec3) -> ArrayVec<(f64, DVec3), 4> {
    let within = |radius: f64| {
        let frustum = Frustum { radius, half_height: it.half_height, widening: 0.0 };
        frustum_crossings(frustum, origin, direction)
    };
    let (outer, bore) = (within(it.outer), within(it.inner));
    let ([enter, leave], [from, to]) = match (&outer[..], &bore[..]) {
        ([enter, leave], [from, to]) => ([*enter, *leave], [*from, *to]),
        _ => return outer,
    };
    let wall = |(t, normal): (f64, DVec3)| (t, -normal);
    let mut found = ArrayVec::new();
    if from.0 > enter.0 {
        found.extend([enter, wall(from)]);
    }
    if to.0 < leave.0 {
        found.extend([wall(to), leave]);
    }
    found
}
