//! Distance of convex sets that are known by their support points alone (Gilbert, Johnson and
//! Keerthi 1988), in f64.

use glam::DVec3;

/// Steps at most; spheres of 1 mm that are 1 nm apart take about 40.
const STEPS: usize = 200;
/// A distance is found where it is known within this share of itself.
const FOUND: f64 = 1e-7;

/// A point of the difference of the sets, and its point of the first set.
#[derive(Debug, Clone, Copy, Default)]
struct Vertex {
    point: DVec3,
    first: DVec3,
}

/// Least distance of two convex sets, m, and the point of the first where it is least; `None` where they
/// intersect, or are too close to decide. Each set gives its point that is farthest along a direction. The
/// sets lie near the origin: at distances beyond their sizes digits
/// are lost.
pub(super) fn separation(
    first: impl Fn(DVec3) -> DVec3,
    second: impl Fn(DVec3) -> DVec3,
) -> Option<(f64, DVec3)> {
    let vertex = |along: DVec3| {
        let on_first = first(along);
        Vertex { point: on_first - second(-along), first: on_first }
    };
    let mut simplex = [Vertex::default(); 4];
    simplex[0] = vertex(DVec3::X);
    let (mut count, mut nearest, mut proven) = (1, simplex[0], 0.0_f64);
    for _ in 0..STEPS {
        let distance = nearest.point.length();
        if distance == 0.0 {
            return None;
        }
        let next = vertex(-nearest.point / distance);
        let bound = nearest.point.dot(next.point) / distance;
        proven = proven.max(bound);
        let known = simplex[..count].iter().any(|it| it.point == next.point);
        if known || distance - proven <= FOUND * distance {
            break;
        }
        simplex[count] = next;
        if count == 3 && proven <= 0.0 && holds_origin(&simplex) {
            return None;
        }
        let found = Nearest::of(&simplex, &[0, 1, 2, 3][..=count]);
        if !found.point.is_finite() || found.point.length() >= distance {
            break; // Rounding tells no more.
        }
        (count, nearest) = (0, Vertex { point: found.point, first: DVec3::ZERO });
        for (k, weight) in found.weights.into_iter().enumerate().filter(|it| it.1 > 0.0) {
            nearest.first += weight * simplex[k].first;
            simplex[count] = simplex[k];
            count += 1;
        }
    }
    let distance = nearest.point.length();
    // A bound that stays at 0 shows no plane between the sets.
    (proven > 0.0).then_some((distance, nearest.first))
}

/// The point of a simplex that is nearest to the origin: by the weights of its vertices, too.
#[derive(Clone, Copy)]
struct Nearest {
    point: DVec3,
    weights: [f64; 4],
}

impl Nearest {
    /// The nearer one.
    fn or(self, other: Self) -> Self {
        if other.point.length_squared() < self.point.length_squared() { other } else { self }
    }

    /// Nearest point of some vertices of a simplex.
    fn of(simplex: &[Vertex; 4], vertices: &[usize]) -> Self {
        let point = |k: usize| simplex[k].point;
        match *vertices {
            [i] => {
                let mut weights = [0.0; 4];
                weights[i] = 1.0;
                Self { point: point(i), weights }
            }
            [i, j] => {
                let (from, along) = (point(i), point(j) - point(i));
                let share = (-from.dot(along) / along.length_squared()).clamp(0.0, 1.0);
                let mut weights = [0.0; 4];
                (weights[i], weights[j]) = (1.0 - share, share);
                Self { point: from + share * along, weights }
            }
            [i, j, k] => Self::of_face(simplex, [i, j, k]).unwrap_or_else(|| {
                let sides = [[i, j], [j, k], [k, i]].map(|side| Self::of(simplex, &side));
                sides[0].or(sides[1]).or(sides[2])
            }),
            _ => {
                let faces = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
                let [a, b, c, d] = faces.map(|face| Self::of(simplex, &face));
                a.or(b).or(c).or(d)
            }
        }
    }

    /// Within a face, also a long thin one, for which products of its sides are inaccurate.
    fn of_face(simplex: &[Vertex; 4], face: [usize; 3]) -> Option<Self> {
        let [a, b, c] = face.map(|k| simplex[k].point);
        let [ab, bc, ca] = [b - a, c - b, a - c];
        let lengths = [ab, bc, ca].map(DVec3::length_squared);
        let longest = lengths.iter().fold(0.0_f64, |most, it| most.max(*it));
        // Of the two shorter sides.
        let normal = match lengths.iter().position(|it| *it >= longest) {
            Some(0) => bc.cross(ca),
            Some(1) => ca.cross(ab),
            _ => ab.cross(bc),
        };
        let of = [b.cross(bc), c.cross(ca), a.cross(ab)].map(|it| it.dot(normal));
        let size = normal.length_squared();
        if size == 0.0 || of.iter().any(|it| *it <= 0.0) {
            return None;
        }
        let nearer =
            |a: DVec3, b: DVec3| if b.length_squared() < a.length_squared() { b } else { a };
        let height = normal.dot(nearer(nearer(a, b), c));
        let mut weights = [0.0; 4];
        let sum: f64 = of.iter().sum();
        face.iter().zip(of).for_each(|(k, it)| weights[*k] = it / sum);
        Some(Self { point: normal * (height / size), weights })
    }
}

/// True if the origin lies in a tetrahedron.
fn holds_origin(simplex: &[Vertex; 4]) -> bool {
    let point = |k: usize| simplex[k].point;
    [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]].iter().all(|[i, j, k, apex]| {
        let from = point(*i);
        let normal = (point(*j) - from).cross(point(*k) - from);
        normal.dot(-from) * normal.dot(point(*apex) - from) > 0.0
    })
}
