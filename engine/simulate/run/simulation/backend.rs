//! The backend of a run: as requested, as the device can, or by counts of the scene.

use super::Simulation;
use crate::sampling::ProjectedBounds;
use crate::trace::Ray;
use beamlet_core::{Error, Result};
use beamlet_files::SearchCounts;
use beamlet_gpu::{Backend, DeviceDescription, DeviceKind};

/// Rays whose crossings are counted.
const COUNTED_RAYS: usize = 1 << 10;
/// Places they are at.
const COUNTED_PATCHES: usize = 16;
/// Crossings of a ray that are counted.
const MOST_CROSSINGS: u32 = 64;
/// Leaves up to which a tree has two levels of eight: a driver's search saves nothing.
const FEW_LEAVES: u32 = 64;
/// Crossings of a ray above which candidates, which return to the shader one by one, are the work,
/// and not the search.
const MANY_CROSSINGS: f64 = 32.0;

/// The backend for a scene on a device that has both, and why. Results are the same.
#[must_use]
pub fn choose(kind: DeviceKind, counts: SearchCounts) -> (Backend, &'static str) {
    if let Some(chosen) = by_kind(kind) {
        chosen
    } else if counts.leaves <= FEW_LEAVES {
        (Backend::Bvh, "the sample has few leaves")
    } else if counts.crossings_per_ray > MANY_CROSSINGS {
        (Backend::Bvh, "rays cross many surfaces")
    } else {
        (Backend::RayQuery, "the device searches many leaves for few crossings")
    }
}

/// The backend if the kind of the device decides: then nothing is counted, and no structure of the driver
/// is built.
const fn by_kind(kind: DeviceKind) -> Option<(Backend, &'static str)> {
    match kind {
        DeviceKind::Cpu => {
            Some((Backend::Bvh, "the device is a CPU, where ray query runs in software, too"))
        }
        _ => None,
    }
}

/// True if a run may take ray query, so that the driver's structure is needed.
pub(super) fn may_query(wanted: Option<Backend>, device: &DeviceDescription) -> bool {
    device.ray_query
        && wanted.map_or_else(|| by_kind(device.kind).is_none(), |it| it == Backend::RayQuery)
}

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

impl Simulation {
    /// Chooses by the caller's choice, the abilities of the device, and counts of the scene.
    pub(super) fn choose_backend(&mut self, wanted: Option<Backend>) -> Result<()> {
        let (backend, reason) = if let Some(backend) = wanted {
            (backend, "requested".to_owned())
        } else if self.sample.is_empty() {
            (Backend::Bvh, "nothing to trace".to_owned())
        } else if !self.device().description().ray_query {
            (Backend::Bvh, "the device has no ray query".to_owned())
        } else if let Some((backend, reason)) = by_kind(self.device().description().kind) {
            (backend, reason.to_owned())
        } else {
            let counts = self.search_counts()?;
            let (backend, reason) = choose(self.device().description().kind, counts);
            self.start.search = Some(counts);
            (backend, reason.to_owned())
        };
        log::info!("backend {backend}: {reason}");
        self.start.backend = backend;
        self.start.backend_reason = reason;
        Ok(())
    }

    /// Leaves of the sample, and surfaces that rays through its shadow in the first view cross.
    ///
    /// # Errors
    /// As [`Engine::run`](crate::Engine::run) where the device fails.
    #[doc(hidden)]
    pub fn search_counts(&self) -> Result<SearchCounts> {
        let rays = self.counted_rays();
        let mut crossings = 0;
        self.finder(MOST_CROSSINGS, rays.len())?.find(&rays, |_, met| crossings += met.len())?;
        let mean = crossings as f64 / rays.len().max(1) as f64;
        Ok(SearchCounts::new(self.on_device.leaves, mean))
    }

    /// Rays over the shadow of the sample in the first view, side by side in lines as in a run.
    fn counted_rays(&self) -> Vec<Ray> {
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
        let lines = COUNTED_RAYS / places.len() / COUNTED_PATCHES + 1;
        let mut rays = Vec::with_capacity(COUNTED_PATCHES * lines * places.len());
        for patch in 0..COUNTED_PATCHES {
            // Spread over width and height by the golden ratio.
            let share = (patch as f64 + 0.5) / COUNTED_PATCHES as f64;
            let beamlet = self.lattice.beamlet_at(at(share, x));
            let row = at((share * 1.618 * COUNTED_PATCHES as f64).fract(), rows);
            for line in 0..lines {
                let row = row + 0.5 * line as f64;
                rays.extend(
                    places.iter().map(|&x| Ray::from(&self.lattice.ray(beamlet, x, row, 0))),
                );
            }
        }
        rays
    }
}
