//! Exact shapes in the image from the source: ends of the body, of its bore and of its caps, in closed form.

use super::mesh::is_steep;
use super::{Change, Collector, ImagePoint, PatchChange, Patches, SampleImage};
use crate::lines::by_shapes::{ShapeInBeam, roots};
use beamlet_geometry::{AnalyticForm, AnalyticShape, Placed};
use beamlet_model::optics::ends;
use glam::{DMat3, DVec3};

/// Circle about an axis, m in the beam frame.
struct Circle {
    centre: DVec3,
    /// Unit vector.
    axis: DVec3,
    radius: f64,
}

/// Centred solid whose image ends where a plane through the source touches it.
enum Round {
    Circle(Circle),
    /// Ellipsoid: semi-axes as columns.
    Ellipsoid {
        centre: DVec3,
        axes: DMat3,
    },
}

impl Patches<'_> {
    /// Changes by an exact shape in its place.
    pub(super) fn changes_of_shape(
        &self,
        shape: AnalyticShape,
        placed: &Placed,
    ) -> Vec<PatchChange> {
        let rotation = self.image.motion.rotation();
        let centre = self.image.motion.at(placed.place.position);
        let in_beam = ShapeInBeam::new(shape, placed, &rotation, centre);
        if !self.touch(self.image.rows_around(&in_beam)) {
            return Vec::new();
        }
        let turned = rotation * DMat3::from_quat(placed.place.rotation);
        let scales = placed.place.scales();
        let disc = |z: f64, radius: f64| {
            let centre = centre + turned * (DVec3::Z * z * scales.z);
            Circle { centre, axis: turned.z_axis, radius: radius * scales.x }
        };
        self.collect(|collector| {
            collector.add_crossings_of(&in_beam);
            match shape.form() {
                AnalyticForm::Ellipsoid(axes) => {
                    let axes = turned * DMat3::from_diagonal(scales * axes);
                    collector.add_round(&Round::Ellipsoid { centre, axes });
                }
                AnalyticForm::Frustum(it) => {
                    for z in [-it.half_height, it.half_height] {
                        collector.add_cap(disc(z, it.radius + it.widening * z));
                    }
                }
                AnalyticForm::Tube(it) => {
                    for z in [-it.half_height, it.half_height] {
                        collector.add_cap(disc(z, it.outer));
                        collector.add_round(&Round::Circle(disc(z, it.inner)));
                    }
                }
            }
        })
    }
}

impl SampleImage<'_> {
    /// Row coordinates within which a shape lies.
    fn rows_around(&self, shape: &ShapeInBeam) -> [f64; 2] {
        let [low, high] = shape.slopes_around(self.lattice.source());
        // Rows go downwards.
        [high, low].map(|slope| self.lattice.row_of_slope(slope))
    }
}

impl Collector<'_> {
    /// Adds heights at which the vertical borders of beamlets begin and end to cut a shape, its bore or a cap.
    fn add_crossings_of(&mut self, shape: &ShapeInBeam) {
        let image = self.patches.image;
        let (lattice, source) = (image.lattice, image.lattice.source());
        for (beamlet, borders) in image.beamlets(shape.x_around(source, lattice.plane)) {
            for border in borders {
                for slope in shape.ends_along_z(source, border / lattice.plane) {
                    self.add(beamlet, Change::Critical(lattice.row_of_slope(slope)));
                }
            }
        }
    }

    /// Adds the least and the greatest row coordinate of a body, and gives them.
    fn add_round(&mut self, body: &Round) -> Vec<f64> {
        let image = self.patches.image;
        let ends = body.ends(image.lattice.source()).into_iter();
        let add = |point: DVec3| {
            let ImagePoint { x, row, .. } = image.project_from_beam(point);
            self.add_to_beamlets([x; 2], Change::Critical(row));
            row
        };
        ends.map(add).collect()
    }

    /// Adds the ends of a cap, and a jump where it is seen from the side.
    fn add_cap(&mut self, cap: Circle) {
        let image = self.patches.image;
        let across = cap.axis.any_orthonormal_vector() * cap.radius;
        let beside = cap.axis.cross(across);
        let at = |off: DVec3| image.project_from_beam(cap.centre + off);
        let corners = [DVec3::ZERO, across, beside].map(at);
        let is_jump = cap.radius > 0.0 && is_steep(corners, image.rows_per_metre());
        // The square around the cap: of one that is seen from the side its rows are those of the cap, nearly.
        let x = ends(&[across, beside, -across, -beside].map(|it| at(it).x));
        let rows = ends(&self.add_round(&Round::Circle(cap)));
        if is_jump && (0.0..1.0).contains(&(rows[1] - rows[0])) {
            self.add_to_beamlets(x, Change::Jump(rows));
        }
    }
}

impl Round {
    /// Points at which planes through the source and the direction of x touch the body; `source`: distance of the source
    /// before the rotation centre, m.
    fn ends(&self, source: f64) -> Vec<DVec3> {
        let (centre, size) = match self {
            Self::Circle(it) if it.radius <= 0.0 => return vec![it.centre],
            Self::Circle(it) => (it.centre, it.radius),
            Self::Ellipsoid { centre, axes } => {
                (*centre, axes.x_axis.length().max(axes.y_axis.length()).max(axes.z_axis.length()))
            }
        };
        let from_source = centre + DVec3::Y * source;
        let unit = size / from_source.y;
        let middle = from_source.z / from_source.y;
        let normal = |u: f64| DVec3::new(0.0, -(middle + u * unit), 1.0);
        // Vector from the centre to the point farthest along a normal, and the square of its reach.
        let farthest = |normal: DVec3| match self {
            Self::Circle(it) => {
                let within = normal - it.axis * normal.dot(it.axis);
                (
                    within.normalize_or_zero() * it.radius,
                    within.length_squared() * it.radius * it.radius,
                )
            }
            Self::Ellipsoid { axes, .. } => {
                let own = axes.transpose() * normal;
                (*axes * own.normalize_or_zero(), own.length_squared())
            }
        };
        let value = |u: f64| {
            let normal = normal(u);
            normal.dot(from_source).powi(2) - farthest(normal).1
        };
        let touching = roots([value(-1.0), value(0.0), value(1.0)]).into_iter().flatten();
        let point = |u: f64| {
            let normal = normal(u);
            centre - farthest(normal).0 * normal.dot(from_source).signum()
        };
        touching.map(point).collect()
    }
}
