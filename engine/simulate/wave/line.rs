//! Places of the rays of lines.

use crate::lines::LinePlace;
use crate::sampling::Lattice;
use beamlet_interface::Ray;

/// Rays of lines that are traced together, counted from line to line.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineRays<'a> {
    pub lattice: &'a Lattice,
    pub lines: &'a [LinePlace],
    /// Rays of a line.
    pub each: usize,
    /// Their spacing, m.
    pub spacing: f64,
    /// Pose of the sample.
    pub pose: u32,
}

impl LineRays<'_> {
    /// Number of rays.
    pub(super) const fn count(&self) -> usize {
        self.lines.len() * self.each
    }

    /// Line of a ray.
    pub(super) const fn line_of(&self, ray: usize) -> usize {
        ray / self.each
    }

    /// x of a ray from the centre of its beamlet, m.
    pub(super) fn x(&self, ray: usize) -> f64 {
        ((ray % self.each) as f64 + 0.5 - 0.5 * self.each as f64) * self.spacing
    }

    /// A ray of the lattice at the height of the line of `ray`, at x from the centre of its beamlet (m).
    pub(super) fn ray(&self, ray: usize, x: f64) -> Ray {
        let line = &self.lines[self.line_of(ray)];
        self.lattice.ray(line.beamlet, x, line.row, self.pose)
    }
}
