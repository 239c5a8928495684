//! Lines of rays, traced in batches, and their light in the pixels of their beamlets.

use super::grazing::{GrazingLight, GrazingPart, Share};
use super::kernels::WaveKernels;
use super::line::LineRays;
use super::plan::WavePlan;
use crate::illuminate::GrowingBuffer;
use crate::lines::{Heights, Judged, JudgedLight, LinePlace, Values};
use crate::sampling::Lattice;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Buffer, Device, Download, Kernel, Recorder, Upload, push_bytes};
use beamlet_interface::{
    GROUP, Ray, WAVE_EMPTY, WaveField, WaveFieldPush, WaveLine, WaveLinePush, WavePair,
};
use std::sync::Arc;

/// Bytes of fields on the device that lines are traced for at a time.
const FIELD_BYTES: usize = 1 << 25;
/// Products of pairs of a dispatch: long ones would block a screen.
const MOST_PRODUCTS: u64 = 1 << 25;

const _: () = assert!(push_bytes::<WaveLinePush>() <= beamlet_gpu::PUSH_BYTES);

/// Light of a line.
#[derive(Debug, Clone)]
pub(super) struct LineLight {
    /// `[step][pixel of the beamlet]`, without light near grazing.
    pub light: Vec<f32>,
    /// Its parts near grazing.
    pub grazing: Vec<GrazingPart>,
}

impl Judged for LineLight {
    fn judged(&self) -> JudgedLight<'_> {
        let values = Values { first: 0, values: &self.light };
        JudgedLight { values, ..JudgedLight::default() }
    }
}

/// Lines of a beamlet and row.
#[derive(Debug)]
pub(super) struct Patch {
    /// Beamlet of the lattice.
    pub beamlet: i64,
    /// Row of the detector.
    pub row: i64,
    /// Its lines.
    pub heights: Heights<LineLight>,
}

impl Patch {
    /// The line at a height, rows below the upper border.
    pub(super) fn line(&self, z: f64) -> LinePlace {
        LinePlace { beamlet: self.beamlet, row: self.row as f64 + z }
    }
}

/// Buffers of lines on the device, which grow as needed.
#[derive(Debug)]
pub(super) struct Lines {
    device: Arc<Device>,
    pub(super) plan: Arc<WavePlan>,
    kernels: Arc<WaveKernels>,
    fields: GrowingBuffer,
    /// Variances of materials that scatter, where the sample has any.
    variances: GrowingBuffer,
    sums: GrowingBuffer,
    records: GrowingBuffer,
    light: GrowingBuffer,
    offsets: Buffer,
    steps: u32,
}

impl Lines {
    pub(super) fn new(
        device: &Arc<Device>,
        plan: &Arc<WavePlan>,
        kernels: &Arc<WaveKernels>,
    ) -> Result<Self> {
        let lists: Vec<f32> =
            plan.offsets.iter().flatten().map(|offset| numbers::single(*offset)).collect();
        Ok(Self {
            device: device.clone(),
            plan: plan.clone(),
            kernels: kernels.clone(),
            fields: GrowingBuffer::new(device, "fields of lines"),
            variances: GrowingBuffer::new(device, "variances of lines"),
            sums: GrowingBuffer::new(device, "sums of pairs"),
            records: GrowingBuffer::new(device, "records of lines"),
            light: GrowingBuffer::new(device, "light of lines"),
            offsets: device.upload("offsets of lines", &lists)?,
            steps: numbers::count(plan.offsets[0].len()),
        })
    }

    /// Values of a line: `[step][pixel of the beamlet]`.
    pub(super) fn values(&self) -> usize {
        self.steps as usize * self.plan.most_pixels as usize
    }

    /// Light of lines that miss the sample, of all beamlets: `[beamlet][step][pixel]`.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub(super) fn flat(&mut self, list: usize) -> Result<Vec<f32>> {
        let count = numbers::count(self.plan.pixels.len());
        let records: Vec<WaveLine> =
            (0..count).map(|beamlet| WaveLine { first_ray: WAVE_EMPTY, beamlet }).collect();
        self.light_of(&records, list)
    }

    /// Light of lines at a pose of the sample.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(super) fn light(
        &mut self,
        tracer: &mut Tracer,
        lattice: &Lattice,
        lines: &[LinePlace],
        [pose, list]: [u32; 2],
    ) -> Result<Vec<LineLight>> {
        let each = self.plan.rays as usize;
        let energies = self.plan.energies as usize;
        let bytes = size_of::<WaveField>() + self.plan.laws as usize * size_of::<f32>();
        let at_once = (FIELD_BYTES / (each * energies * bytes)).max(1);
        let values = self.values();
        let mut all = Vec::with_capacity(lines.len());
        for some in lines.chunks(at_once) {
            let spacing = self.plan.spacing;
            let rays = LineRays { lattice, lines: some, each, spacing, pose };
            let flagged = self.trace(tracer, &rays)?;
            let found = GrazingLight::find(tracer, &rays, &flagged, energies)?;
            self.take_out(&found.shares, rays.count())?;
            let record = |(index, line): (usize, &LinePlace)| WaveLine {
                first_ray: numbers::count(index * each),
                beamlet: numbers::narrow(line.beamlet - self.plan.beamlets.start),
            };
            let records: Vec<WaveLine> = some.iter().enumerate().map(record).collect();
            let light = self.light_of(&records, list as usize)?;
            let pairs = light.chunks_exact(values).zip(found.of_line);
            all.extend(pairs.map(|(light, grazing)| LineLight { light: light.to_vec(), grazing }));
        }
        Ok(all)
    }

    /// Traces lines, and leaves the fields of all energies, `[energy][line][ray]`. Rays near grazing.
    fn trace(&mut self, tracer: &mut Tracer, lines: &LineRays<'_>) -> Result<Vec<usize>> {
        let (plan, all) = (self.plan.clone(), lines.count());
        let size = all * plan.energies as usize;
        let fields = self.fields.fit::<WaveField>(size)?;
        if plan.laws > 0 {
            self.variances.fit::<f32>(size * plan.laws as usize)?;
        }
        let variances = self.variances.get().map_or(0, Buffer::address);
        let kernel = self.kernels.field.get()?;
        let mut flagged = Vec::new();
        let mut first = 0;
        while first < all {
            let count = (all - first).min(tracer.capacity() as usize);
            let rays: Vec<Ray> =
                (first..first + count).map(|at| lines.ray(at, lines.x(at))).collect();
            let some = tracer.with_moments_on_device(&rays, |tracer| {
                let field = |energy: u32| WaveFieldPush {
                    moments: tracer.moments().address(),
                    fields: fields.address(),
                    materials: plan.media(energy),
                    variances,
                    ray_count: numbers::count(count),
                    first: numbers::count(energy as usize * all + first),
                    words: tracer.moment_stride(),
                    material_count: plan.materials,
                    scattering_words: tracer.scattering_words(),
                    laws: plan.laws,
                    lever: numbers::single(plan.lever),
                };
                let record = |r: &mut Recorder<'_>| {
                    for energy in 0..plan.energies {
                        let groups = [numbers::count(count).div_ceil(GROUP), 1, 1];
                        r.dispatch(kernel, bytemuck::bytes_of(&field(energy)), groups);
                    }
                };
                self.device.run(record).map(|_| ())
            })?;
            flagged.extend(some.into_iter().map(|index| first + index));
            first += count;
        }
        Ok(flagged)
    }

    /// Takes shares of the light of rays out of the fields of `all` rays at each energy.
    fn take_out(&self, shares: &[Share], all: usize) -> Result<()> {
        let Some(fields) = self.fields.get().filter(|_| !shares.is_empty()) else {
            return Ok(());
        };
        let follows = |a: &Share, b: &Share| a.energy == b.energy && a.ray + 1 == b.ray;
        let runs: Vec<&[Share]> = shares.chunk_by(follows).collect();
        let place =
            |run: &[Share]| ((run[0].energy * all + run[0].ray) * size_of::<WaveField>()) as u64;
        let mut values: Vec<Vec<WaveField>> =
            runs.iter().map(|run| bytemuck::zeroed_vec(run.len())).collect();
        let download = |(run, values)| Download::new(fields, place(run), values);
        let places = runs.iter().copied().zip(values.iter_mut().map(Vec::as_mut_slice));
        self.device.read(&mut places.map(download).collect::<Vec<_>>())?;
        for (field, of) in values.iter_mut().flatten().zip(shares) {
            let amplitude = (1.0 - of.share).sqrt();
            (field.re, field.im) = (amplitude * field.re, amplitude * field.im);
        }
        let uploads: Vec<Upload<'_>> = runs
            .iter()
            .zip(&values)
            .map(|(run, values)| Upload::new(fields, place(run), values))
            .collect();
        self.device.run_with(&uploads, |_| {}, &mut []).map(drop)
    }

    /// Light of lines whose fields are on the device.
    fn light_of(&mut self, records: &[WaveLine], list: usize) -> Result<Vec<f32>> {
        let kernels = self.kernels.clone();
        let kernel = kernels.line.get()?;
        let (plan, count) = (self.plan.clone(), records.len());
        let values = count * self.values();
        let of_line = u64::from(plan.rays) * 64;
        let at_once = numbers::whole::<u32>((MOST_PRODUCTS / of_line).max(1) as f64);
        let parts = numbers::count(self.values()).div_ceil(GROUP);
        let device = self.device.clone();
        let line_buffer = self.records.fit::<WaveLine>(count)?;
        let light = self.light.fit::<f32>(values)?;
        let room = at_once.min(numbers::count(count)) as usize * (parts * plan.rays) as usize;
        let sums = self.sums.fit::<WavePair>(room)?;
        let template = WaveLinePush {
            lines: line_buffer.address(),
            fields: 0,
            sums: sums.address(),
            offsets: self.offsets.address() + u64::from(self.steps) * 4 * list as u64,
            light: light.address(),
            steps: self.steps,
            laws: plan.laws,
            ..bytemuck::Zeroable::zeroed()
        };
        let field_bytes = (count * plan.rays as usize * size_of::<WaveField>()) as u64;
        let variance_bytes =
            u64::from(plan.laws) * (count * plan.rays as usize * size_of::<f32>()) as u64;
        let fields = self.fields.get().map_or(0, Buffer::address);
        let variances = self.variances.get().map_or(0, Buffer::address);
        let mut uploads = &[Upload::new(&line_buffer, 0, records)][..];
        for first_line in (0..numbers::count(count)).step_by(at_once as usize) {
            let groups = [at_once.min(numbers::count(count) - first_line), parts, 1];
            let record = |r: &mut Recorder<'_>| {
                for energy in 0..plan.energies {
                    let push = WaveLinePush {
                        params: plan.params(energy),
                        fields: fields + u64::from(energy) * field_bytes,
                        variances: variances + u64::from(energy) * variance_bytes,
                        first_line,
                        adds: u32::from(energy > 0),
                        ..template
                    };
                    dispatch(r, kernel, &push, groups);
                }
            };
            device.run_with(uploads, record, &mut [])?;
            uploads = &[];
        }
        let mut found = beamlet_core::reserve::zeroed::<f32>(values, "light of lines")?;
        device.read(&mut [Download::new(&light, 0, &mut found)])?;
        Ok(found)
    }
}

/// Records a dispatch after all before, whose sums it replaces.
fn dispatch(r: &mut Recorder<'_>, kernel: &Kernel, push: &WaveLinePush, groups: [u32; 3]) {
    r.barrier();
    r.dispatch(kernel, bytemuck::bytes_of(push), groups);
}
