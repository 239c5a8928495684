//! Single rays through the sample: their results, moments and crossings.

use super::Simulation;
use crate::trace::{CrossingFinder, Moments, Ray, RayResult, SurfaceCrossing};
use crate::{Error, Result};

impl Simulation<'_> {
    /// Traces rays and returns their results at the scene's energy (for a spectrum at the constants
    /// averaged over it), in the order of the rays.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Memory`]; [`Error::Argument`] for a view that is not there.
    pub fn trace(&self, rays: &[Ray]) -> Result<Vec<RayResult>> {
        self.check_views(rays)?;
        self.tracer(self.start.backend)?.trace(rays)
    }

    /// Traces rays and returns their results and first-order moments.
    ///
    /// # Errors
    /// As [`Simulation::trace`].
    pub fn moments(&self, rays: &[Ray]) -> Result<(Vec<RayResult>, Moments)> {
        self.check_views(rays)?;
        let (results, words) = self.tracer(self.start.backend)?.trace_with_moments(rays)?;
        Ok((results, Moments::new(words, self.on_device.materials)))
    }

    fn check_views(&self, rays: &[Ray]) -> Result<()> {
        let views = self.scene.scan.angles.len();
        match rays.iter().find(|r| r.view as usize >= views) {
            Some(ray) => {
                let found = ray.view;
                Err(Error::argument(
                    "rays",
                    format!("a ray of view {found}"),
                    format!("0 to {}", views - 1),
                ))
            }
            None => Ok(()),
        }
    }

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
