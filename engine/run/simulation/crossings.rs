//! Crossings of single rays, for pictures.

use super::Simulation;
use crate::Result;
use crate::trace::{CrossingFinder, Ray, SurfaceCrossing};

impl Simulation<'_> {
    /// Calls `visit` with the index of every ray, in order, and its first crossings with the
    /// sample, front to back and at most `most` of them.
    ///
    /// # Errors
    /// As [`Simulation::trace`].
    pub fn crossings(
        &self,
        rays: &[Ray],
        most: u32,
        visit: impl FnMut(usize, &[SurfaceCrossing]),
    ) -> Result<()> {
        self.check_views(rays)?;
        CrossingFinder::new(self.device(), &self.on_device, most)?.find(rays, visit)
    }
}
