//! The model of an iterative method on vectors: sinograms of a volume, and the transpose.

use super::data::Data;
use super::joseph::twofold;
use super::model::Model;
use super::projector::Source;
use super::vectors::{Operand, Vector, Vectors};
use super::work::Work;
use beamlet_core::numbers::count;
use beamlet_core::{Error, Result};
use beamlet_gpu::{Buffer, Kernel, push_bytes};
use beamlet_interface::{CHUNK, SinogramPush, Slopes, StepLaw};
use bytemuck::Zeroable;
use ndarray::ArrayView3;
use std::sync::Arc;

/// Projections of vectors as sinograms.
#[derive(Debug)]
pub(super) struct Sinograms<'a> {
    model: &'a Model,
    forward: Arc<Kernel>,
    back: Arc<Kernel>,
    laws: Buffer,
    _places: Buffer,
    _slopes: Buffer,
    /// Constants; what differs from dispatch to dispatch is 0.
    push: SinogramPush,
}

impl<'a> Sinograms<'a> {
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub(super) fn new(model: &'a Model) -> Result<Self> {
        let (rays, device) = (model.rays(), model.projector().device());
        let (_, rows, columns) = rays.geometry.dim();
        let places: Vec<[f32; 2]> = rays.steps().into_iter().map(twofold).collect();
        let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let slopes: Vec<Slopes> = all
            .map(|(row, column)| {
                let [[left, left_low], [right, right_low]] =
                    model.factors(row, column).map(twofold);
                Slopes { left, left_low, right, right_low }
            })
            .collect();
        let bytes = push_bytes::<SinogramPush>();
        let laws = device.upload("paths between slices", &rays.step_laws())?;
        let of_places = device.upload("places of rays", &places)?;
        let of_columns = device.upload("factors of columns", &slopes)?;
        let push = SinogramPush {
            places: of_places.address(),
            slopes: of_columns.address(),
            columns: count(columns),
            place_count: count(places.len()),
            rows: count(rows),
            is_difference: (model.data() == Data::Refraction).into(),
            ..SinogramPush::zeroed()
        };
        Ok(Self {
            model,
            forward: Arc::new(device.kernel("sinogram", bytes)?),
            back: Arc::new(device.kernel("sinogram_back", bytes)?),
            laws,
            _places: of_places,
            _slopes: of_columns,
            push,
        })
    }

    /// Constants for views from one on, the n-th of those whose rays are on the device.
    fn push_from(&self, view: usize, n: usize) -> SinogramPush {
        let projector = self.model.projector();
        let rays = n * self.push.rows as usize * self.push.place_count as usize;
        SinogramPush {
            laws: self.laws.address() + (view * size_of::<StepLaw>()) as u64,
            rays: projector.rays().address() + 4 * rays as u64,
            ..self.push
        }
    }

    /// Sinograms of a volume.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`], [`beamlet_core::Error::Device`].
    pub(super) fn project(
        &self,
        volume: &Vector,
        to: &mut Vector,
        vectors: &mut Vectors,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let projector = self.model.projector();
        let [x, y, z] = self.model.size();
        let source = match volume {
            Vector::Device(buffer) => Source::Device(buffer),
            Vector::Host(values) => {
                let view = ArrayView3::from_shape((z, y, x), values);
                let wrong = |error: ndarray::ShapeError| {
                    Error::argument("volume", error.to_string(), "a value for each voxel")
                };
                Source::Host(view.map_err(wrong)?)
            }
        };
        let views = self.model.rays().geometry.angles.len() as f64;
        let per_view = self.push.rows as usize * self.push.columns as usize;
        for [first, n] in projector.parts() {
            let shares = [first, first + n].map(|view| view as f64 / views);
            work.stage(shares, |work| {
                projector.forward(&source, [first, n], &mut vectors.stream, work)
            })?;
            let range = (per_view, first..first + n);
            vectors.each(&mut [Operand::Write(to)], range, |stream, [view, views], at| {
                let count = count(views * per_view);
                let push =
                    SinogramPush { values: at[0], count, ..self.push_from(view, view - first) };
                stream.dispatch(&self.forward, &push, count.div_ceil(CHUNK));
            })?;
        }
        Ok(())
    }

    /// The transpose of [`Self::project`], of values times weights.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`], [`beamlet_core::Error::Device`].
    pub(super) fn gather(
        &self,
        (values, weights): (&Vector, Option<&Vector>),
        to: &mut Vector,
        vectors: &mut Vectors,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let projector = self.model.projector();
        let [x, y, _] = self.model.size();
        let whole = if let Vector::Device(buffer) = &*to { Some(buffer.clone()) } else { None };
        for planes in projector.slabs(whole.is_some()) {
            let own = planes[0] * x * y..planes[1] * x * y;
            let slab = whole.as_ref().map_or_else(|| projector.slab(), Ok)?;
            vectors.stream.fill(slab, 4 * own.len() as u64, 0.0);
            for part in projector.parts() {
                self.spread((values, weights), part, vectors)?;
                work.stage(self.model.share(planes, part), |work| {
                    projector.back((slab, planes), part, &mut vectors.stream, work)
                })?;
            }
            if let Vector::Host(values) = to {
                vectors.stream.submit(&mut [])?;
                slab.read_into(0, &mut values[own])?;
            }
        }
        Ok(())
    }

    /// Makes the values of the rays of a part of the views.
    fn spread(
        &self,
        (values, weights): (&Vector, Option<&Vector>),
        [first, n]: [usize; 2],
        vectors: &mut Vectors,
    ) -> Result<()> {
        let per_view = self.push.rows as usize * self.push.columns as usize;
        let rays_of_a_view = self.push.rows as usize * self.push.place_count as usize;
        let mut operands = vec![Operand::Read(values)];
        operands.extend(weights.map(Operand::Read));
        let range = (per_view, first..first + n);
        vectors.each(&mut operands, range, |stream, [view, views], at| {
            let push = SinogramPush {
                values: at[0],
                weights: at.get(1).copied().unwrap_or_default(),
                is_weighted: weights.is_some().into(),
                count: count(views * rays_of_a_view),
                ..self.push_from(view, view - first)
            };
            stream.dispatch(&self.back, &push, push.count.div_ceil(CHUNK));
        })
    }
}
