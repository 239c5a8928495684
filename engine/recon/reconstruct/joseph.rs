//! Tables of Joseph's projector, in f64: how the rays of each view cross the slices of a volume.

use super::geometry::ScanGeometry;
use super::grid::VolumeGrid;
use beamlet_core::numbers::{count, single};
use beamlet_core::{Error, Result};
use beamlet_interface::{Sheet, StepLaw};

/// A number as the sum of two f32.
pub(super) fn twofold(value: f64) -> [f32; 2] {
    let high = single(value);
    [high, single(value - f64::from(high))]
}

fn step_law(axes: [[f64; 3]; 3]) -> StepLaw {
    let part = |of: usize, n: usize| axes.map(|law| twofold(law[of])[n]);
    StepLaw {
        high: part(0, 0),
        low: part(0, 1),
        place_high: part(1, 0),
        place_low: part(1, 1),
        row_high: part(2, 0),
        row_low: part(2, 1),
    }
}

/// Rays through places on the detector, one for each, row and view.
#[derive(Debug)]
pub(super) struct Rays {
    pub(super) geometry: ScanGeometry,
    pub(super) grid: VolumeGrid,
    /// Places along the rows of the detector, m, ascending.
    pub(super) places: Vec<f64>,
}

impl Rays {
    /// Mean distance of the places.
    pub(super) fn pitch(&self) -> f64 {
        (self.places[self.places.len() - 1] - self.places[0]) / (self.places.len() - 1) as f64
    }

    pub(super) fn middle(&self) -> f64 {
        f64::midpoint(self.places[0], self.places[self.places.len() - 1])
    }

    /// Places in mean distances from the middle of the detector.
    pub(super) fn steps(&self) -> Vec<f64> {
        let (middle, pitch) = (self.middle(), self.pitch());
        self.places.iter().map(|place| (place - middle) / pitch).collect()
    }

    /// Height of the first row and distance of rows at the axis of rotation, and height of the first
    /// plane, in distances of planes.
    pub(super) fn heights(&self) -> [f64; 3] {
        let per = 1.0 / (self.geometry.magnification() * self.grid.voxel[2]);
        let rows = [self.geometry.rows[0], self.geometry.row_pitch()].map(|place| place * per);
        [rows[0], rows[1], self.grid.origin[2] / self.grid.voxel[2]]
    }

    /// Depth from slice to slice along the rays of a row of a view, m.
    pub(super) fn steps_of(&self, view: usize, row: usize) -> Vec<f64> {
        if self.geometry.motions.is_some() {
            return self.moved_steps(view, row);
        }
        let angle = self.geometry.angles[view];
        let turn = [libm::cos(angle), libm::sin(angle)];
        let scale = self.geometry.magnification();
        let step = |place: &f64| {
            let [along_x, along_y] = self.speeds(turn, place / scale);
            1.0 / along_x.max(along_y)
        };
        self.places.iter().map(step).collect()
    }

    /// Slices per depth that the rays of each view cross.
    pub(super) fn step_laws(&self) -> Vec<StepLaw> {
        let views = 0..self.geometry.angles.len();
        views.map(|view| step_law(self.speed_laws(view))).collect()
    }

    /// Slices per depth along x, y and z of the rays of a view: for (1, place, row).
    fn speed_laws(&self, view: usize) -> [[f64; 3]; 3] {
        if self.geometry.motions.is_some() {
            return self.moved_speeds(view);
        }
        let per = self.geometry.per_distance() / self.geometry.magnification();
        let (zero, by_place) = (self.middle() * per, self.pitch() * per);
        let angle = self.geometry.angles[view];
        let (cosine, sine) = (libm::cos(angle), libm::sin(angle));
        let [x, y, _] = self.grid.voxel;
        let along_x = [(zero * cosine - sine) / x, by_place * cosine / x, 0.0];
        [along_x, [(zero * sine + cosine) / y, by_place * sine / y, 0.0], [0.0; 3]]
    }

    /// Slices that a ray through `u` at the axis crosses per depth: those across x, those across y.
    fn speeds(&self, [cosine, sine]: [f64; 2], u: f64) -> [f64; 2] {
        let slope = u * self.geometry.per_distance();
        let [x, y, _] = self.grid.voxel;
        [(slope * cosine - sine).abs() / x, (slope * sine + cosine).abs() / y]
    }

    /// Two sheets of each view; the second may be empty.
    ///
    /// # Errors
    /// [`Error::Argument`] for a fan of 90° or more.
    pub(super) fn sheets(&self) -> Result<Vec<Sheet>> {
        let scale = self.geometry.magnification();
        let mut sheets = Vec::with_capacity(2 * self.geometry.angles.len());
        for angle in &self.geometry.angles {
            let turn = [libm::cos(*angle), libm::sin(*angle)];
            let is_x = |place: &f64| {
                let [x, y] = self.speeds(turn, place / scale);
                x > y
            };
            let first = is_x(&self.places[0]);
            let end = self.places.partition_point(|place| is_x(place) == first);
            if self.places[end..].iter().any(|place| is_x(place) == first) {
                let found = "a fan that crosses voxels three ways in a view";
                return Err(Error::argument("columns", found, "a fan of less than 90°"));
            }
            sheets.push(self.sheet(turn, first, [0, end]));
            sheets.push(self.sheet(turn, !first, [end, self.places.len()]));
        }
        Ok(sheets)
    }

    /// A point at depth t behind the axis on the ray through u lies u (1 + t/D) − a beside the axis. Where
    /// it meets the plane y = p (x = p), its other coordinate, 1 + t/D and t are quotients that are linear
    /// in p and u, all over the same one.
    fn sheet(&self, [cosine, sine]: [f64; 2], is_x: bool, [begin, end]: [usize; 2]) -> Sheet {
        let (axis, per) = (self.geometry.axis, self.geometry.per_distance());
        let (normal, other) = if is_x { (0, 1) } else { (1, 0) };
        let middle = |axis: usize| {
            let grid = &self.grid;
            grid.origin[axis] + grid.voxel[axis] * (grid.size[axis] as f64 - 1.0) / 2.0
        };
        let (slice, step) = (middle(normal), self.grid.voxel[normal]);
        let (centre, side) = (middle(other), self.grid.voxel[other]);
        // Sign of u, and what the plane contributes: to the other coordinate, the quotient and the depth.
        let (sign, plane, weight, turn) =
            if is_x { (-1.0, cosine, -sine, cosine) } else { (1.0, -sine, cosine, sine) };
        let by_u = if is_x { cosine * per } else { sine * per };
        let plane_by_u = if is_x { sine * per } else { cosine * per };
        let constant = -sign * axis - centre * weight + plane * slice;
        let linear = sign - centre * by_u + plane_by_u * slice;
        let scale = self.geometry.magnification();
        let (zero, pitch) = (self.middle() / scale, self.pitch() / scale);
        Sheet {
            cross: single((constant + linear * zero) / side),
            cross_by_slice: single((plane + plane_by_u * zero) * step / side),
            cross_by_place: single(linear * pitch / side),
            cross_by_both: single(plane_by_u * pitch * step / side),
            weight: single(weight + by_u * zero),
            weight_by_place: single(by_u * pitch),
            scale: single(weight + (slice + axis * turn) * per),
            scale_by_slice: single(step * per),
            depth: single(slice + (axis - zero) * turn),
            depth_by_slice: single(step),
            depth_by_place: single(-pitch * turn),
            begin: count(begin),
            end: count(end),
            is_x: is_x.into(),
        }
    }
}
