//! Needs of a scene: bytes on host and device, by rows of a band and rays at once.

use super::MemoryEstimate;
use super::program::{building, program};
use super::rays::{beamlets, cell_rays};
use crate::detector::SubpixelGrid;
use crate::illuminate::{CellIlluminator, Gatherer};
use crate::sampling::Lattice;
use crate::trace::{FIRST_BATCH, LARGEST_BATCH, LISTS_BYTES, RAY_BYTES};
use beamlet_core::{Error, Result, numbers};
use beamlet_files::StackShape;
use beamlet_geometry::{ObjectSummary, PEAK_PER_CUT_TRIANGLE, PEAK_PER_TRIANGLE};
use beamlet_interface::MOMENTS_HEAD;
use beamlet_model::scene::{Beam, Scatter, Scene, Scheme, ShapeOrMesh, Transport};
use std::collections::BTreeSet;

/// Least memory of the lines of one patch under a limit.
const ONE_PATCH: u64 = 12 << 20;
/// Bytes on the host per triangle that stay: vertices, indices, components, neighbours, image of the corners in a view.
const KEPT: u64 = 54;
/// Bytes on the device per triangle: leaves with their neighbours, and nodes of the software tree.
const TREE: u64 = 92;
/// Bytes on the host per instance: its place, component, and data of a view.
const INSTANCE: u64 = 320;
/// Bytes on the device per instance: its leaf, place and surface, and nodes of the tree.
const INSTANCE_TREE: u64 = 230;
/// Bytes on the device per triangle of the driver's structure.
const STRUCTURE: u64 = 60;
/// Bytes on the device per triangle while that is built: boxes and scratch.
const SCRATCH: u64 = 60;
/// Bytes on the host per ray of a group of rows: the ray, its result, segments of its line, cells.
/// For curved bodies, which take most; flat ones take less.
const OF_RAY: u64 = 560;
/// Bytes on the host per cell of lines in memory together: its piece, and all that is made of it.
const OF_CELL: u64 = 700;
/// Largest number of these cells: beyond it patches are sampled in turn.
const MOST_CELLS: u64 = (2 << 30) / OF_CELL;
/// Part of it for the ray that a rectangle begins with.
const BASE: u64 = 160;
/// Bytes on the host per ray and material under a spectrum: moments at both ends of cells.
const KEPT_MOMENTS: u64 = 40;
/// Bytes on the host and on the device per beamlet whose light reaches the detector: its place, and its
/// data of the masks.
const BEAMLET: u64 = 96;
/// Bytes on the device of fields, sums and records of lines by waves, and of the lines of half the spacing.
const WAVE_DEVICE: u64 = 96 << 20;
/// Bytes on the host of the light of lines whose heights are chosen together.
const WAVE_HOST: u64 = 64 << 20;
/// Copies of a frame while it is encoded: values, and raw or compressed blocks.
pub(super) const FRAME_COPIES: u64 = 2;

/// Bytes of a band where no limit is set: larger bands were not faster.
const BAND: u64 = 1 << 30;
/// Rays of a group of rows, about, with room enough; and least.
const RAYS: [u64; 2] = [1 << 20, 1 << 12];
/// Triangles of objects that cut others or are cut.
fn cut_triangles(objects: &[ObjectSummary]) -> u64 {
    let cutters = objects.iter().flat_map(|it| &it.cut_by).copied().collect::<BTreeSet<u32>>();
    let meets = |(number, object): &(u32, &ObjectSummary)| {
        !object.cut_by.is_empty() || cutters.contains(number)
    };
    (0..).zip(objects).filter(meets).map(|(_, object)| object.triangles as u64).sum()
}

/// Bytes on the host and on the device.
#[derive(Debug, Clone, Copy)]
struct HostAndDevice {
    host: u64,
    device: u64,
}

impl HostAndDevice {
    const fn sum(self) -> u64 {
        self.host.saturating_add(self.device)
    }
}

/// Inputs of the estimate from a scene.
#[derive(Debug)]
pub(super) struct Needs {
    /// Program, driver and kernels, including the detector's.
    program: u64,
    triangles: u64,
    instances: u64,
    /// Triangles among them of touching objects.
    cut: u64,
    largest_mesh: u64,
    views: u64,
    rows: u32,
    steps: u64,
    /// Per row of pixels with all steps: sums on the device; light, blurred light and counts on
    /// the host.
    row: HostAndDevice,
    /// Rows beside a band whose light it needs.
    beside: u64,
    frame: u64,
    beamlets: u64,
    /// Rays of a view, about; of cells those of patches that are sampled together.
    pub(super) rays: u64,
    /// The same of a row of pixels, which are sampled together.
    row_rays: u64,
    ray_host: u64,
    ray_device: u64,
    pub(super) cells: bool,
    /// Lines of rays replace cells.
    wave: bool,
    /// Energies of cells are gathered.
    gathered: bool,
    /// Cells of lines in memory together, where they are known.
    pub(super) crowded: u64,
}

impl Needs {
    pub(super) fn of(scene: &Scene, objects: &[ObjectSummary]) -> Result<Self> {
        let extent = StackShape::of(scene)?;
        let grid = SubpixelGrid::of(scene)?;
        let optics = grid.optics(scene);
        let mut materials: Vec<&str> = scene.objects.iter().map(|o| o.material.as_str()).collect();
        materials.push(&scene.surroundings);
        materials.sort_unstable();
        materials.dedup();
        let cells = scene.sampling.scheme == Scheme::Cells;
        let lattice = Lattice::of(&optics, 0.0);
        let beamlets = beamlets(&lattice)?;
        let [columns, rows] = optics.detector.pixels.map(u64::from);
        let [rays, row_rays] = if cells {
            cell_rays(&optics, &lattice, objects)
        } else {
            let of_pixel = u64::from(optics.sampling.rays.count());
            // Parts of a row are traced separately.
            [columns.saturating_mul(rows).saturating_mul(of_pixel), 0]
        };
        let of_mesh = |(object, summary): (&beamlet_model::scene::Object, &ObjectSummary)| {
            let is_mesh = matches!(object.geometry, ShapeOrMesh::Mesh(_));
            if is_mesh { summary.triangles as u64 } else { 0 }
        };
        let steps = u64::from(extent.steps);
        let lit_pixels = columns * u64::from(grid.parts[1]);
        let lit_row = steps * lit_pixels;
        let detector = &scene.detector;
        let copies = u64::from(detector.blur.is_some())
            + u64::from(detector.counts.is_some())
            + if matches!(detector.scatter, Some(Scatter::Kernel { .. })) { 2 } else { 0 };
        let row = HostAndDevice {
            host: 4 * lit_row + 8 * lit_pixels + copies * 4 * steps * u64::from(extent.columns),
            device: 8 * (lit_row + lit_pixels),
        };
        let wave = scene.sampling.transport == Transport::Wave;
        let ray_host = match scene.source.beam {
            Beam::Energy(_) => OF_RAY,
            Beam::Spectrum(_) => OF_RAY + KEPT_MOMENTS * materials.len() as u64,
        };
        let ray_device = RAY_BYTES + 4 * (MOMENTS_HEAD + 5 * materials.len()) as u64;
        Ok(Self {
            program: program(scene).saturating_add(grid.kernel_bytes),
            triangles: objects.iter().map(|o| o.triangles as u64).sum(),
            instances: objects.iter().map(|o| o.instances as u64).sum(),
            cut: cut_triangles(objects),
            largest_mesh: scene.objects.iter().zip(objects).map(of_mesh).max().unwrap_or(0),
            views: extent.views.into(),
            rows: extent.rows,
            steps,
            row,
            beside: 2 * u64::from(grid.margin[1] + grid.scatter_rows),
            frame: extent.frame_bytes(),
            beamlets,
            rays,
            row_rays,
            ray_host,
            ray_device,
            cells,
            wave,
            gathered: cells && !wave && matches!(scene.source.beam, Beam::Spectrum(_)),
            crowded: 0,
        })
    }

    /// The same of a number of scenes that are lit together.
    pub(super) const fn of_scenes(mut self, scenes: u64) -> Self {
        self.row.host = self.row.host.saturating_mul(scenes);
        self.row.device = self.row.device.saturating_mul(scenes);
        self.beamlets = self.beamlets.saturating_mul(scenes);
        self
    }

    /// The estimate with the largest bands and groups of rays that a limit allows.
    pub(super) fn within(
        &self,
        scene: &Scene,
        limit: Option<u64>,
        band_rows: Option<u32>,
    ) -> Result<MemoryEstimate> {
        let mut rays = RAYS[0];
        let in_bands = |rows: u64, rays: u64| {
            let rows = u32::try_from(rows).unwrap_or(self.rows).clamp(1, self.rows);
            let left_for_lines = limit.map(|limit| self.left(limit, rows, rays));
            MemoryEstimate { left_for_lines, ..self.at(rows, rays) }
        };
        if let Some(rows) = band_rows {
            return Ok(in_bands(rows.into(), rays));
        }
        let Some(all_of_it) = limit else {
            return Ok(in_bands(BAND / self.row.sum().max(1), rays));
        };
        let patch = if self.cells && self.rays > 0 { ONE_PATCH } else { 0 };
        let limit = all_of_it.saturating_sub(patch);
        // Rays get up to half of what one row leaves: small groups keep a device less busy.
        let one_row = self.run(1, 0).sum();
        let half = limit.saturating_sub(one_row) / 2;
        while rays > RAYS[1] && self.run(1, rays).sum() - one_row > half {
            rays /= 2;
        }
        let least = self.at(1, rays);
        if least.peak_bytes > limit {
            return Err(self.refuse(scene, &least, [all_of_it, patch]));
        }
        let fixed = self.run(0, rays).sum();
        Ok(in_bands((limit - fixed) / self.row.sum().max(1), rays))
    }

    pub(super) fn at(&self, band_rows: u32, rays_at_once: u64) -> MemoryEstimate {
        let n = self.triangles;
        let instances = self.instances();
        let phase = |host: u64, device: u64| HostAndDevice {
            host: host.saturating_add(self.program),
            device,
        };
        let uploaded = (TREE + STRUCTURE + SCRATCH) * n + instances.device;
        let phases = [
            phase(PEAK_PER_TRIANGLE * self.largest_mesh + KEPT * (n - self.largest_mesh), 0),
            phase(PEAK_PER_CUT_TRIANGLE * self.cut + KEPT * (n - self.cut), 0),
            phase(building(n + self.instances) + instances.host, 0),
            phase(KEPT * n + instances.host, uploaded),
            self.run(band_rows, rays_at_once),
        ];
        let peak = |of: fn(HostAndDevice) -> u64| phases.into_iter().map(of).max().unwrap_or(0);
        MemoryEstimate {
            band_rows,
            rays_at_once,
            batch_rays: self.batch_rays(rays_at_once),
            row_bytes: self.row.sum(),
            band_bytes: self.row.sum().saturating_mul(u64::from(band_rows) + self.beside),
            host_bytes: peak(|b| b.host),
            device_bytes: peak(|b| b.device),
            peak_bytes: peak(HostAndDevice::sum),
            left_for_lines: None,
        }
    }

    /// Remainder of a limit for lines in bands of `band_rows` rows.
    fn left(&self, limit: u64, band_rows: u32, rays_at_once: u64) -> u64 {
        let rays = self.rays_together(rays_at_once);
        let others = self.run(band_rows, rays_at_once).sum() - self.sampling(rays);
        limit.saturating_sub(others).saturating_sub(BASE * rays)
    }

    /// Rays of a group of rows.
    fn rays_together(&self, rays_at_once: u64) -> u64 {
        rays_at_once.max(self.row_rays).min(self.rays)
    }

    /// Rays that the buffers of a tracer hold.
    fn batch_rays(&self, rays_at_once: u64) -> u32 {
        let [least, most] = [FIRST_BATCH, LARGEST_BATCH].map(|rays| rays_at_once.min(rays.into()));
        numbers::at_most(numbers::length(self.rays_together(rays_at_once).clamp(least, most)))
    }

    /// Bytes of the lines of `rays` rays.
    const fn sampling(&self, rays: u64) -> u64 {
        if self.cells { self.ray_host * rays } else { 0 }
    }

    /// Placed surfaces.
    const fn instances(&self) -> HostAndDevice {
        HostAndDevice {
            host: INSTANCE * self.instances,
            device: (INSTANCE_TREE + STRUCTURE + SCRATCH) * self.instances,
        }
    }

    /// While views are traced and illuminated in bands of `rows` rows.
    fn run(&self, band_rows: u32, rays_at_once: u64) -> HostAndDevice {
        let rays = self.rays_together(rays_at_once);
        let band = u64::from(band_rows) + self.beside;
        let [wave_host, wave_device] = if self.wave { [WAVE_HOST, WAVE_DEVICE] } else { [0; 2] };
        let host = self.program
            + wave_host
            + KEPT * self.triangles
            + self.instances().host
            + BEAMLET * self.beamlets
            + self.sampling(rays)
            + OF_CELL * self.crowded.min(MOST_CELLS)
            + 64 * self.views
            + FRAME_COPIES * self.frame;
        let device = LISTS_BYTES
            + CellIlluminator::BYTES
            + if self.gathered { Gatherer::BYTES } else { 0 }
            + wave_device
            + (TREE + STRUCTURE) * self.triangles
            + self.instances().device
            + self.ray_device * u64::from(self.batch_rays(rays_at_once))
            + 16 * self.views;
        HostAndDevice {
            host: host.saturating_add(band.saturating_mul(self.row.host)),
            device: device.saturating_add(band.saturating_mul(self.row.device)),
        }
    }

    fn refuse(&self, scene: &Scene, least: &MemoryEstimate, [limit, patch]: [u64; 2]) -> Error {
        let [columns, _] = scene.detector.pixels;
        let steps = self.steps;
        let geometry = self.at(1, least.rays_at_once).peak_bytes - least.band_bytes;
        let remedy = if geometry > limit {
            "raise the memory limit, or simplify the meshes"
        } else {
            "raise the memory limit, or simulate fewer columns or mask steps"
        };
        Error::Memory {
            purpose: format!(
                "a run of this scene, with one row of {columns} pixels x {steps} mask steps and \
                 {} triangles in memory,",
                self.triangles
            ),
            needed: least.peak_bytes + patch,
            available: Some(limit),
            remedy: remedy.into(),
        }
    }
}
