//! Sinograms of the true scene under its spectrum: what hardening makes of its constants.

use super::data::Data;
use super::hardening::BeamHardening;
use super::measured::Measured;
use super::method::Method;
use super::model::Model;
use super::quantity::Quantity;
use super::truth::Truth;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::single;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Result, reserve};
use beamlet_gpu::Compute;
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use ndarray::{Array3, ArrayView3, s};
use rayon::prelude::*;

/// Light of more than one energy, and the constants of the materials at each.
#[derive(Debug, Clone)]
pub(super) struct Light {
    /// Share of each energy.
    weights: Vec<f64>,
    /// Constants minus the surroundings', `[energy][material]`; material 0 is the surroundings.
    constants: Vec<Vec<Constants>>,
    /// Material of each label.
    of_label: Vec<usize>,
}

impl Light {
    /// The light of materials with its weights; `None` for a single energy.
    pub(super) fn of(media: &MaterialTable) -> Option<Self> {
        let less = |all: &Vec<Constants>| -> Vec<Constants> {
            let around = all[0];
            all.iter()
                .map(|it| Constants { mu: it.mu - around.mu, delta: it.delta - around.delta })
                .collect()
        };
        let objects = media.of_object.iter().map(|material| *material as usize);
        (media.weights.len() > 1).then(|| Self {
            weights: media.weights.clone(),
            constants: media.constants.iter().map(less).collect(),
            of_label: std::iter::once(0).chain(objects).collect(),
        })
    }

    /// Light of each energy behind these lengths of the materials 1 and on, m.
    fn behind<'a>(&'a self, lengths: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.weights.iter().zip(&self.constants).map(move |(weight, constants)| {
            let depth: f64 = constants[1..].iter().zip(lengths).map(|(it, l)| it.mu * l).sum();
            weight * libm::exp(-depth)
        })
    }

    /// −ln of the transmission behind these lengths.
    fn attenuation(&self, lengths: &[f64]) -> f64 {
        -libm::log(self.behind(lengths).sum::<f64>())
    }

    /// Mean refraction angle of the light behind these lengths; `slopes`: angles per δ of the materials.
    fn refraction(&self, lengths: &[f64], slopes: &[f64]) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        for (light, constants) in self.behind(lengths).zip(&self.constants) {
            let angles = constants[1..].iter().zip(slopes).map(|(it, slope)| it.delta * slope);
            sum += light * angles.sum::<f64>();
            all += light;
        }
        sum / all
    }
}

impl Truth {
    /// Values that a method gives for the objects under their spectrum, `[z][y][x]`: the means over the inner voxels
    /// are expected of a reconstruction without noise. `mask`, `[z][y][x]`: voxels that may differ from zero.
    /// `hardening`: the correction of −ln T, for μ. `None` for a single energy, for dark fields, and where
    /// objects reach the sides of the volume, whose remainder is unknown.
    ///
    /// # Errors
    /// As [`Model::new`], [`Model::project`] and [`Method::volume`]; [`beamlet_core::Error::Memory`].
    pub fn expected(
        &self,
        compute: &Compute,
        quantity: Quantity,
        (method, mask): (&Method, Option<ArrayView3<'_, bool>>),
        hardening: Option<&BeamHardening>,
        cancel: &Cancel,
    ) -> Result<Option<Array3<f32>>> {
        let hardened = self.hardened(compute, quantity, method.at_once(), cancel)?;
        let Some(mut sinograms) = hardened else { return Ok(None) };
        if let (Quantity::Mu, Some(polynomial)) = (quantity, hardening) {
            polynomial.apply_until(&mut sinograms, cancel)?;
        }
        let measured = Measured::new(Data::of(quantity), sinograms.view()).with_mask(mask);
        let control = &mut RowsControl::default().with_cancel(cancel.clone());
        let made = method.volume(compute, &self.geometry, &measured, &self.grid, control)?;
        Ok(Some(made.volume.values))
    }

    /// Sinograms of the objects on the voxels under the spectrum, `[view][row][column]`. `None` for a single
    /// energy, for dark fields, and where objects reach the sides of the volume, whose remainder is unknown.
    ///
    /// # Errors
    /// As [`Model::new`] and [`Model::project`]; [`beamlet_core::Error::Memory`].
    fn hardened(
        &self,
        compute: &Compute,
        quantity: Quantity,
        at_once: Option<usize>,
        cancel: &Cancel,
    ) -> Result<Option<Array3<f32>>> {
        let Some(light) = self.light.as_ref().filter(|_| !self.is_cut()) else { return Ok(None) };
        let materials = || 1..light.constants[0].len();
        let project = |data: Data| {
            let model = Model::new(compute, &self.geometry, &self.grid, data, at_once)?;
            let of_material = |material: usize| {
                let is_inside = |label: u16| light.of_label[usize::from(label)] == material;
                let inside = self.labels.mapv(|label| f32::from(u8::from(is_inside(label))));
                let control = &mut RowsControl::default().with_cancel(cancel.clone());
                model.project(inside.view(), control)
            };
            materials().map(of_material).collect::<Result<Vec<_>>>()
        };
        let (lengths, slopes) = match quantity {
            Quantity::Mu => (project(Data::Attenuation)?, Vec::new()),
            Quantity::Delta => (project(Data::Attenuation)?, project(Data::Refraction)?),
            Quantity::DarkField => return Ok(None),
        };
        let (views, rows, columns) = self.geometry.dim();
        let mut values: Vec<f32> = reserve::zeroed(views * rows * columns, "expected sinograms")?;
        values.par_chunks_mut(rows * columns).enumerate().try_for_each(|(view, image)| {
            cancel.check()?;
            for (pixel, value) in image.iter_mut().enumerate() {
                let at = [view, pixel / columns, pixel % columns];
                let of = |all: &[Array3<f32>]| -> Vec<f64> {
                    all.iter().map(|values| f64::from(values[at])).collect()
                };
                let lengths = of(&lengths);
                *value = single(match quantity {
                    Quantity::Mu => light.attenuation(&lengths),
                    _ => light.refraction(&lengths, &of(&slopes)),
                });
            }
            Ok::<(), beamlet_core::Error>(())
        })?;
        Ok(Array3::from_shape_vec((views, rows, columns), values).ok())
    }

    /// True where an object reaches a side of the volume.
    fn is_cut(&self) -> bool {
        let (_, depth, width) = self.labels.dim();
        let sides =
            [s![.., ..1, ..], s![.., depth - 1.., ..], s![.., .., ..1], s![.., .., width - 1..]];
        sides.iter().any(|side| self.labels.slice(side).iter().any(|label| *label > 0))
    }

    /// Sinograms that are alive together for `Self::hardened`.
    pub(super) fn sinograms(&self) -> usize {
        self.light.as_ref().map_or(0, |light| 2 * light.constants[0].len() - 1)
    }
}
