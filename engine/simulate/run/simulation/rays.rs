//! Single rays through the sample: their results, moments and crossings.

use super::Simulation;
use crate::trace::{CrossingFinder, Moments, Ray, RayResult, SurfaceCrossing};
use beamlet_core::{Cancel, Error, Result, numbers};
use beamlet_interface as interface;
use beamlet_model::media::MaterialTable;

/// Traces rays and returns their results at the scene's energy (for a spectrum at the constants
/// averaged over it), in the order of the rays.
///
/// # Errors
/// [`Error::Device`], [`Error::Memory`]; [`Error::Argument`] for a pose that is not there.
pub fn trace(simulation: &Simulation, rays: &[interface::Ray]) -> Result<Vec<RayResult>> {
    simulation.check_poses(rays.iter().map(|ray| ray.pose))?;
    simulation.tracer(&Cancel::default())?.trace(rays)
}

/// Traces rays and returns their results and first-order moments.
///
/// # Errors
/// As [`trace`].
pub fn moments(
    simulation: &Simulation,
    rays: &[interface::Ray],
) -> Result<(Vec<RayResult>, Moments)> {
    simulation.check_poses(rays.iter().map(|ray| ray.pose))?;
    let mut tracer = simulation.tracer(&Cancel::default())?;
    let (results, words) = tracer.trace_with_moments(rays)?;
    Ok((results, Moments::new(words, simulation.on_device.materials, tracer.moment_words())))
}

impl Simulation {
    /// Materials of the sample.
    #[doc(hidden)]
    pub const fn media(&self) -> &MaterialTable {
        &self.media
    }

    fn check_poses(&self, mut poses: impl Iterator<Item = u32>) -> Result<()> {
        let count = self.scene.scan.poses();
        match poses.find(|pose| *pose as usize >= count) {
            Some(pose) => Err(Error::argument(
                "rays",
                format!("a ray of pose {pose}"),
                format!("0 to {}", count - 1),
            )),
            None => Ok(()),
        }
    }

    /// Calls `visit` with the index of every ray, in order, and its first crossings with the
    /// sample, front to back and at most `most` of them. Where exact shapes or instances overlap, surfaces
    /// covered by an object listed later are among them; [`uncovered`](crate::trace::uncovered) leaves them out.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Memory`]; [`Error::Argument`] for a pose that is not there.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::{Engine, EngineOptions, Ray, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let simulation = engine.prepare(&Scene::load("scene.toml")?)?;
    /// // Parallel to the optical axis, 1 mm beside it.
    /// let rays = [Ray::new(0, [1e-3, 0.0], [0.0, 0.0])];
    /// simulation.crossings(&rays, 8, |ray, crossings| {
    ///     println!("ray {ray} meets {} surfaces", crossings.len());
    /// })?;
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn crossings(
        &self,
        rays: &[Ray],
        most: u32,
        visit: impl FnMut(usize, &[SurfaceCrossing]),
    ) -> Result<()> {
        self.check_poses(rays.iter().map(|ray| ray.pose))?;
        self.finder(most, rays.len())?.find(rays, visit)
    }

    /// A finder of up to `most` crossings of each of some rays.
    pub(super) fn finder(&self, most: u32, rays: usize) -> Result<CrossingFinder> {
        let (kernels, room) = (self.simulator.trace_kernels(), numbers::at_most(rays));
        CrossingFinder::new(self.device(), kernels, &self.on_device, most, room)
    }
}
