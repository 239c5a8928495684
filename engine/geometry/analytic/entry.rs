//! Where lines enter shapes.

use super::{AnalyticShape, Form, Frustum, Tube};
use glam::DVec3;

/// The first place of a line on a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// Of the start, in lengths of the direction; negative before it.
    pub distance: f64,
    /// Away from the material, of any length.
    pub normal: DVec3,
}

/// A line in the frame of a shape.
#[derive(Debug, Clone, Copy)]
struct Line {
    start: DVec3,
    along: DVec3,
}

impl Line {
    fn at(&self, distance: f64) -> DVec3 {
        self.start + distance * self.along
    }

    /// Places on both ends of a shape of this half height.
    fn ends(&self, half_height: f64) -> impl Iterator<Item = Entry> {
        [-half_height, half_height].into_iter().filter_map(move |z| {
            let distance = (z - self.start.z) / self.along.z;
            distance.is_finite().then_some(Entry { distance, normal: DVec3::Z * z })
        })
    }

    /// Places on the side of a frustum, extended without end on both sides of its tip.
    fn sides(&self, of: Frustum) -> impl Iterator<Item = Entry> {
        let Self { start, along } = *self;
        let (flat, flat_along) = (start.truncate(), along.truncate());
        let (radius, rise) = (of.radius_at(start.z), of.widening * along.z);
        let square = flat_along.length_squared() - rise * rise;
        let half = flat.dot(flat_along) - radius * rise;
        let rest = flat.length_squared() - radius * radius;
        roots(square, half, rest).into_iter().map(move |distance| {
            let at = self.at(distance);
            let normal = at.truncate().extend(-of.widening * of.radius_at(at.z));
            Entry { distance, normal }
        })
    }
}

/// Roots of a x² + 2 h x + c that are finite.
fn roots(a: f64, h: f64, c: f64) -> impl IntoIterator<Item = f64> {
    let root = (h * h - a * c).sqrt();
    // Without a difference of nearly equal numbers; not a number where there is no root.
    let sum = -(h + root.copysign(h));
    [sum / a, c / sum].into_iter().filter(|it| it.is_finite())
}

impl AnalyticShape {
    /// Where a line of the own frame enters the shape, coming from without end; `None` where it misses it.
    pub(crate) fn entry(self, start: DVec3, along: DVec3) -> Option<Entry> {
        let line = Line { start, along };
        let first = |all: &mut dyn Iterator<Item = Entry>| {
            all.min_by(|a, b| a.distance.total_cmp(&b.distance))
        };
        let flat = |entry: &Entry| line.at(entry.distance).truncate().length();
        match self.form() {
            Form::Frustum(of) => {
                let on_side = |it: &Entry| line.at(it.distance).z.abs() <= of.half_height;
                let on_end = |it: &Entry| flat(it) <= of.radius_at(line.at(it.distance).z);
                let (sides, ends) = (line.sides(of), line.ends(of.half_height));
                first(&mut sides.filter(on_side).chain(ends.filter(on_end)))
            }
            Form::Ellipsoid(axes) => {
                let (start, along) = (start / axes, along / axes);
                let rest = start.length_squared() - 1.0;
                let places = roots(along.length_squared(), start.dot(along), rest);
                let normal = |distance: f64| (start + distance * along) / axes;
                let places = places.into_iter();
                first(&mut places.map(|distance| Entry { distance, normal: normal(distance) }))
            }
            Form::Tube(Tube { outer, inner, half_height }) => {
                let wall = |radius: f64| Frustum { radius, half_height, widening: 0.0 };
                let bore = line.sides(wall(inner)).map(|it| Entry { normal: -it.normal, ..it });
                let on_wall = |it: &Entry| line.at(it.distance).z.abs() <= half_height;
                let on_end = |it: &Entry| (inner..=outer).contains(&flat(it));
                let walls = line.sides(wall(outer)).chain(bore).filter(on_wall);
                first(&mut walls.chain(line.ends(half_height).filter(on_end)))
            }
        }
    }
}
