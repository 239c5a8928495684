//! Exact shapes in the image from the source: ends of the body, of its bore and of its caps, in closed form.

use super::mesh::is_steep;
use super::{Change, PatchChange, Patches, SampleImage};
use crate::lines::by_shapes::{ShapeInBeam, roots};
use beamlet_geometry::{AnalyticForm, AnalyticShape, Placed};
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

impl SampleImage<'_> {
    /// Changes by an exact shape in its place.
    pub(super) fn changes_of_shape(
        &self,
        shape: AnalyticShape,
        placed: &Placed,
        patches: &Patches<'_>,
    ) -> Vec<PatchChange> {
        let mut all = Vec::new();
        let [x, y, z] = self.motion.rows();
        let rotation = DMat3::from_cols(x, y, z).transpose();
        let centre = self.motion.at(placed.place.position);
        let turned = rotation * DMat3::from_quat(placed.place.rotation);
        let in_beam = ShapeInBeam::new(shape, placed, &rotation, centre);
        if !patches.touch(self.rows_around(&in_beam)) {
            return all;
        }
        self.add_crossings_of(&in_beam, patches, &mut all);
        let scales = placed.place.scales();
        let disc = |z: f64, radius: f64| {
            let centre = centre + turned * (DVec3::Z * z * scales.z);
            Circle { centre, axis: turned.z_axis, radius: radius * scales.x }
        };
        let (discs, bore, half_height) = match shape.form() {
            AnalyticForm::Ellipsoid(axes) => {
                let axes = turned * DMat3::from_diagonal(scales * axes);
                self.add_ends(&Round::Ellipsoid { centre, axes }, patches, &mut all);
                return all;
            }
            AnalyticForm::Frustum(it) => (
                [-it.half_height, it.half_height].map(|z| disc(z, it.radius + it.widening * z)),
                0.0,
                it.half_height,
            ),
            AnalyticForm::Tube(it) => (
                [-it.half_height, it.half_height].map(|z| disc(z, it.outer)),
                it.inner,
                it.half_height,
            ),
        };
        for circle in discs {
            self.add_cap(&circle, patches, &mut all);
            self.add_ends(&Round::Circle(circle), patches, &mut all);
        }
        if bore > 0.0 {
            for z in [-half_height, half_height] {
                self.add_ends(&Round::Circle(disc(z, bore)), patches, &mut all);
            }
        }
        all
    }

    /// Row coordinates within which a shape lies.
    fn rows_around(&self, shape: &ShapeInBeam) -> [f64; 2] {
        let [low, high] = shape.slopes_around(self.lattice.source());
        // Rows go downwards.
        [high, low].map(|slope| self.lattice.row_of_slope(slope))
    }

    /// Heights at which the vertical borders of beamlets begin and end to cut a shape, its bore or a cap.
    fn add_crossings_of(
        &self,
        shape: &ShapeInBeam,
        patches: &Patches<'_>,
        all: &mut Vec<PatchChange>,
    ) {
        let source = self.lattice.source();
        for (beamlet, borders) in self.beamlets(shape.x_around(source, self.lattice.plane)) {
            for border in borders {
                let slope_x = border / self.lattice.plane;
                for slope in shape.ends_along_z(source, slope_x) {
                    let row = self.lattice.row_of_slope(slope);
                    patches.add(beamlet, Change::Critical(row), all);
                }
            }
        }
    }

    /// Least and greatest row coordinate of a body.
    fn add_ends(&self, body: &Round, patches: &Patches<'_>, all: &mut Vec<PatchChange>) {
        for point in body.ends(self.lattice.source()) {
            let [x, row] = self.lattice.project(point.x, point.y, point.z);
            for (beamlet, _) in self.beamlets([x; 2]) {
                patches.add(beamlet, Change::Critical(row), all);
            }
        }
    }

    /// Jump at a cap that is seen from the side.
    fn add_cap(&self, cap: &Circle, patches: &Patches<'_>, all: &mut Vec<PatchChange>) {
        let across = cap.axis.any_orthonormal_vector() * cap.radius;
        let beside = cap.axis.cross(across);
        let project = |it: DVec3| {
            let [x, row] = self.lattice.project(it.x, it.y, it.z);
            super::ImagePoint { x, row, depth: it.y }
        };
        let corners = [cap.centre, cap.centre + across, cap.centre + beside].map(project);
        if cap.radius <= 0.0 || !is_steep(corners, self.rows_per_metre()) {
            return;
        }
        // The square around the cap: of one that is seen from the side its rows are those of the cap, nearly.
        let square = [across, beside, -across, -beside].map(|it| project(cap.centre + it));
        let x = square.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], it| {
            [low.min(it.x), high.max(it.x)]
        });
        let ends = Round::Circle(Circle { ..*cap }).ends(self.lattice.source());
        let rows: Vec<f64> = ends.iter().map(|it| project(*it).row).collect();
        let [Some(top), Some(bottom)] =
            [rows.iter().copied().reduce(f64::min), rows.into_iter().reduce(f64::max)]
        else {
            return;
        };
        if bottom - top < 1.0 {
            for (beamlet, _) in self.beamlets(x) {
                patches.add(beamlet, Change::Jump([top, bottom]), all);
            }
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
