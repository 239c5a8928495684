//! The backend of a run: as requested, as the device can, or the faster one on the scene.

use super::Simulation;
use crate::accel::Backend;
use crate::gpu::DeviceDescription;
use crate::interface::Ray;
use crate::numbers;
use crate::sampling::ProjectedBounds;
use crate::{Error, Result};

/// Rays of a calibration.
const CALIBRATION_RAYS: usize = 1 << 13;
/// Places they are at.
const CALIBRATION_PATCHES: usize = 16;

/// Refuses a backend that the device does not have.
pub(super) fn check(wanted: Option<Backend>, device: &DeviceDescription) -> Result<()> {
    if wanted == Some(Backend::RayQuery) && !device.ray_query {
        return Err(Error::device(
            "the backend ray-query",
            format!("{} does not have VK_KHR_ray_query", device.name),
            "use the backend bvh, or a driver with ray query",
        ));
    }
    Ok(())
}

impl Simulation<'_> {
    /// By what the caller wants, what the device can, and a short calibration on the scene.
    pub(super) fn choose_backend(&mut self, wanted: Option<Backend>) -> Result<()> {
        let (backend, reason) = if let Some(backend) = wanted {
            (backend, "requested".to_owned())
        } else if !self.on_device.has_acceleration() {
            let reason = if self.sample.is_empty() {
                "nothing to trace"
            } else {
                "the device has no ray query"
            };
            (Backend::Bvh, reason.to_owned())
        } else {
            let rays = self.calibration_rays();
            for backend in [Backend::Bvh, Backend::RayQuery] {
                let tracer = self.tracer(backend)?;
                let n = rays.len().min(tracer.capacity() as usize);
                tracer.rays().write(0, &rays[..n])?;
                let n = numbers::count(n);
                tracer.trace_on_device(n)?; // the first dispatch pays for compilation
                let time = tracer.trace_on_device(n)?;
                let rate = f64::from(n) / time.as_secs_f64().max(1e-9) / 1e6;
                self.start.calibration.insert(backend.to_string(), rate);
            }
            let rate = |b: Backend| self.start.calibration[&b.to_string()];
            let best = if rate(Backend::RayQuery) > rate(Backend::Bvh) {
                Backend::RayQuery
            } else {
                Backend::Bvh
            };
            (best, "faster in calibration on this scene".to_owned())
        };
        log::info!("backend {backend}: {reason}");
        self.start.backend = backend;
        self.start.backend_reason = reason;
        Ok(())
    }

    /// Rays over the shadow of the sample in the first view, side by side in lines as in a run:
    /// how fast a backend is depends on their order.
    fn calibration_rays(&self) -> Vec<Ray> {
        let projected_bounds = self.projected_bounds(0);
        let span = |f: fn(&ProjectedBounds) -> [f64; 2]| {
            projected_bounds
                .iter()
                .map(f)
                .fold([f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
        };
        let (x, rows) = (span(|s| s.x), span(|s| s.rows));
        let at = |share: f64, range: [f64; 2]| range[0] + (range[1] - range[0]) * share;
        let places: Vec<f64> = (0..=2 * self.lattice.cells)
            .map(|i| self.lattice.period * (f64::from(i) / f64::from(2 * self.lattice.cells) - 0.5))
            .collect();
        let lines = CALIBRATION_RAYS / places.len() / CALIBRATION_PATCHES + 1;
        let mut rays = Vec::with_capacity(CALIBRATION_PATCHES * lines * places.len());
        for patch in 0..CALIBRATION_PATCHES {
            // Spread over width and height by the golden ratio.
            let share = (patch as f64 + 0.5) / CALIBRATION_PATCHES as f64;
            let beamlet = self.lattice.beamlet_at(at(share, x));
            let row = at((share * 1.618 * CALIBRATION_PATCHES as f64).fract(), rows);
            for line in 0..lines {
                let row = row + 0.5 * line as f64;
                rays.extend(places.iter().map(|&x| self.lattice.ray(beamlet, x, row, 0)));
            }
        }
        rays
    }
}
