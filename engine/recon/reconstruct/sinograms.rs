//! The model of an iterative method on vectors: sinograms of a volume, and the transpose.

use super::data::Data;
use super::joseph::twofold;
use super::model::Model;
use super::vectors::{Vector, Vectors, value_address};
use super::work::Work;
use beamlet_core::Result;
use beamlet_core::numbers::count;
use beamlet_gpu::{Buffer, Kernel, push_bytes};
use beamlet_interface::{CHUNK, SinogramPush, Slopes, StepLaw};
use bytemuck::Zeroable;
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

    /// Constants for views from one on, whose rays are on the device.
    fn push_from(&self, view: usize) -> SinogramPush {
        SinogramPush {
            laws: self.laws.address() + (view * size_of::<StepLaw>()) as u64,
            rays: self.model.projector().rays().address(),
            ..self.push
        }
    }

    /// Number of values of a volume.
    pub(super) fn voxels(&self) -> usize {
        self.model.size().iter().product()
    }

    /// Number of values of sinograms.
    pub(super) fn values(&self) -> usize {
        self.model.rays().geometry.shape().iter().product()
    }

    /// Sinograms of a volume.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`], [`beamlet_core::Error::Device`].
    pub(super) fn project(
        &self,
        volume: &Vector,
        to: &Vector,
        vectors: &mut Vectors,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let (projector, stream) = (self.model.projector(), &mut vectors.stream);
        let views = self.model.rays().geometry.angles.len() as f64;
        let planes = [0, self.model.size()[2]];
        let rays_of_a_view = self.push.rows as usize * self.push.place_count as usize;
        let per_view = self.push.rows as usize * self.push.columns as usize;
        for [first, n] in projector.parts() {
            let shares = [first, first + n].map(|view| view as f64 / views);
            stream.fill(projector.rays(), 4 * (n * rays_of_a_view) as u64, 0.0);
            work.stage(shares, |work| {
                projector.forward((volume, planes), [first, n], stream, work)
            })?;
            stream.keep(to);
            let push = SinogramPush {
                values: value_address(to, first * per_view),
                count: count(n * per_view),
                ..self.push_from(first)
            };
            stream.dispatch(&self.forward, &push, push.count.div_ceil(CHUNK));
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
        to: &Vector,
        vectors: &mut Vectors,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let (projector, stream) = (self.model.projector(), &mut vectors.stream);
        let planes = [0, self.model.size()[2]];
        let per_view = self.push.rows as usize * self.push.columns as usize;
        let rays_of_a_view = self.push.rows as usize * self.push.place_count as usize;
        stream.fill(to, to.len(), 0.0);
        for part in projector.parts() {
            let [first, n] = part;
            let address = |vector: &Vector| value_address(vector, first * per_view);
            let push = SinogramPush {
                values: address(values),
                weights: weights.map_or(0, address),
                is_weighted: weights.is_some().into(),
                count: count(n * rays_of_a_view),
                ..self.push_from(first)
            };
            [Some(values), weights].into_iter().flatten().for_each(|vector| stream.keep(vector));
            stream.dispatch(&self.back, &push, push.count.div_ceil(CHUNK));
            work.stage(self.model.share(planes, part), |work| {
                projector.back((to, planes), part, stream, work)
            })?;
        }
        Ok(())
    }
}
