//! The volumes of a reconstruction, quantity by quantity, with their errors and tables.

use super::LABELS;
use crate::reconstruct::gradient_bias::add_gradient_bias;
use crate::reconstruct::grid::Volume;
use crate::reconstruct::input::Input;
use crate::reconstruct::method::Made;
use crate::reconstruct::moment::reaching_ends;
use crate::reconstruct::plan::VolumePlan;
use crate::reconstruct::quantity::Quantity;
use crate::reconstruct::record::{HardeningRecord, VolumeRecord};
use crate::reconstruct::sinogram_volume::{Sinograms, reconstruct_sinograms};
use crate::reconstruct::truth::Truth;
use crate::reconstruct::write::{VolumeFormat, Voxels, write};
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Cancel, Result};
use beamlet_files::ImageDirectory;
use beamlet_gpu::Compute;
use ndarray::{Array2, Array3};

/// Mean sinogram at both ends of the rows, over the largest mean of a column, beyond which a body is cut.
const CUT: f64 = 0.2;

/// Tables beside the volumes, as CSV.
#[derive(Debug, Default)]
pub(super) struct Tables {
    pub(super) errors: String,
    pub(super) residuals: String,
}

/// A reconstruction, quantity by quantity.
pub(super) struct Making<'a> {
    pub(super) compute: &'a Compute,
    pub(super) input: &'a Input,
    pub(super) plan: &'a VolumePlan,
    pub(super) truth: Option<&'a Truth>,
    pub(super) mask: Option<Array3<bool>>,
    pub(super) format: VolumeFormat,
    pub(super) images: ImageDirectory,
    pub(super) record: VolumeRecord,
    pub(super) tables: Tables,
    /// Volume of μ that δ is corrected by.
    pub(super) mu: Option<Volume>,
    /// Views and rows in which a body reaches an end of the row, where the transmission is known.
    pub(super) reaching: Option<Array2<bool>>,
}

impl Making<'_> {
    /// Makes and writes the volume of a quantity, with what belongs to it.
    pub(super) fn quantity(
        &mut self,
        quantity: Quantity,
        control: &mut RowsControl<'_>,
    ) -> Result<()> {
        let made = self.made(quantity, control)?;
        append(&mut self.tables.residuals, &residual_table(quantity, &made));
        if let Some(mut drift) = made.drift {
            // Sinograms come without gaps.
            drift.filled = self.record.pixels[quantity.name()].without_answer;
            self.record.drift = Some(drift);
        }
        let mut volume = made.volume;
        if let (Quantity::Delta, Some(k), Some(mu)) = (quantity, self.plan.gradient_bias, &self.mu)
        {
            add_gradient_bias(&mut volume, mu, k)?;
            self.record.gradient_bias_m = Some(k);
        }
        let named = (quantity.name(), quantity.unit());
        self.put(named, Voxels::Values(&volume.values), &control.cancel)?;
        if let Some(truth) = self.truth {
            if let Some(values) = truth.values(quantity) {
                let name = format!("{}_truth", quantity.name());
                self.put((&name, quantity.unit()), Voxels::Values(&values), &control.cancel)?;
                let table = truth.errors(&volume, &control.cancel)?;
                append(&mut self.tables.errors, &table);
            }
            if !self.record.units.contains_key(LABELS) {
                self.put((LABELS, "1"), Voxels::Labels(truth.labels()), &control.cancel)?;
            }
        }
        if quantity == Quantity::Mu && self.plan.gradient_bias.is_some() {
            self.mu = Some(volume);
        }
        Ok(())
    }

    /// The volume of a quantity, of corrected sinograms.
    fn made(&mut self, quantity: Quantity, control: &mut RowsControl<'_>) -> Result<Made> {
        let Self { compute, input, plan, .. } = self;
        let (geometry, cancel) = (input.geometry(), control.cancel.clone());
        if quantity == Quantity::Delta && self.reaching.is_none() {
            self.reaching = input.reaching_ends(&cancel)?;
        }
        let (values, counts) = input.sinograms(quantity, &cancel)?;
        self.record.pixels.insert(quantity.name().to_owned(), counts);
        if quantity == Quantity::Mu {
            self.reaching = Some(reaching_ends(values.view()));
        }
        let is_filtered = plan.method.filtered().is_some_and(|options| !options.extrapolate);
        if quantity == Quantity::Mu && is_filtered && is_cut(&values) {
            log::warn!(
                "the sample reaches beyond both ends of the rows: mu is too large towards the edge of the \
                 slices; a wider detector, dithers, or --extrapolate"
            );
        }
        let start = plan.start_of(quantity)?;
        let sinograms = Sinograms {
            quantity,
            values,
            weights: None,
            reaching: self.reaching.clone(),
            mask: self.mask.as_ref().map(|mask| mask.view()),
            start: start.as_ref().map(|start| start.values.view()),
        };
        let found = reconstruct_sinograms(compute, geometry, plan, sinograms, control)?;
        if let (Some(polynomial), Some(choice)) = (&found.hardening, &plan.beam_hardening) {
            self.record.beam_hardening = Some(HardeningRecord {
                material: choice.material.clone(),
                energy_kev: polynomial.energy,
                coefficients: polynomial.coefficients.clone(),
                largest: polynomial.most,
                error: polynomial.error,
            });
        }
        if found.moments.is_some() {
            self.record.refraction_moment = found.moments;
        }
        Ok(found.made)
    }

    /// Writes a volume.
    fn put(
        &mut self,
        (name, unit): (&str, &str),
        voxels: Voxels<'_>,
        cancel: &Cancel,
    ) -> Result<()> {
        self.record.units.insert(name.to_owned(), unit.to_owned());
        let (images, grid) = (&mut self.images, &self.plan.grid);
        let files = write(images, self.format, (name, unit), grid, voxels, cancel)?;
        self.record.files.extend(files);
        Ok(())
    }
}

/// True if a body covers both ends of the rows in the mean over views and rows.
fn is_cut(sinograms: &Array3<f32>) -> bool {
    let mut sums = vec![0.0_f64; sinograms.dim().2];
    for ((_, _, column), value) in sinograms.indexed_iter() {
        sums[column] += f64::from(*value);
    }
    let most = sums.iter().copied().fold(0.0, f64::max);
    match sums[..] {
        [first, .., last] => first.min(last) > CUT * most,
        _ => false,
    }
}

/// Residuals of the iterations, as CSV; empty without.
fn residual_table(quantity: Quantity, made: &Made) -> String {
    let mut text = String::new();
    for (n, residual) in made.residuals.iter().enumerate() {
        if n == 0 {
            text.push_str("quantity,iteration,residual,taken\n");
        }
        let taken = u8::from(n == made.best);
        text.push_str(&format!("{},{n},{residual:e},{taken}\n", quantity.name()));
    }
    text
}

/// Appends a table to one with the same heading.
fn append(to: &mut String, table: &str) {
    let body = table.split_once('\n').map_or("", |(_, body)| body);
    to.push_str(if to.is_empty() { table } else { body });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three columns of two views: a body inside, one beyond one end, and one beyond both.
    #[test]
    fn only_a_body_beyond_both_ends_is_cut() {
        let sinograms =
            |columns: [f32; 3]| Array3::from_shape_fn((2, 1, 3), |(_, _, column)| columns[column]);
        assert!(!is_cut(&sinograms([0.0, 1.0, 0.0])));
        assert!(!is_cut(&sinograms([0.6, 1.0, 0.1])));
        assert!(is_cut(&sinograms([0.6, 1.0, 0.3])));
        assert!(!is_cut(&sinograms([0.0; 3])));
    }
}
