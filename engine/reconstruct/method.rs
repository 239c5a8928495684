//! Methods: each a function from sinograms to a volume.

use super::data::Data;
use super::fbp::fbp;
use super::fbp_options::FbpOptions;
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::iterative::iterate;
use super::measured::Measured;
use super::phase::phase_along_rows;
use super::quantity::Quantity;
use super::solver::IterativeOptions;
use crate::run::RowsControl;
use crate::{Engine, Result};
use ndarray::ArrayView3;
use serde_json::{Value, json};

/// A method of reconstruction with its options.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Filtered back-projection ([`fbp`]).
    Fbp(FbpOptions),
    /// Weighted least squares ([`iterate`]).
    Iterative {
        /// Solver, and where it ends.
        options: IterativeOptions,
        /// δ is made of refraction angles integrated along the rows ([`phase_along_rows`]), not of the
        /// angles.
        phase: bool,
    },
}

impl Default for Method {
    fn default() -> Self {
        Self::Fbp(FbpOptions::default())
    }
}

/// Result of a method.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Made {
    /// The volume.
    pub volume: Volume,
    /// Root mean squares of the residuals of the start and of each iteration; empty without iterations.
    pub residuals: Vec<f64>,
    /// Number of the iteration that the volume is of.
    pub best: usize,
}

impl Method {
    /// An iterative method; `phase`: δ of refraction angles integrated along the rows.
    #[must_use]
    pub const fn iterative(options: IterativeOptions, phase: bool) -> Self {
        Self::Iterative { options, phase }
    }

    /// Name on the command line and in records.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Fbp(_) => "fbp",
            Self::Iterative { options, .. } => options.solver.name(),
        }
    }

    /// Options as records have them.
    #[must_use]
    pub fn options(&self) -> Value {
        match self {
            Self::Fbp(options) => json!({
                "filter": options.filter.name(),
                "cut_off": options.cut_off,
                "arm_passes": options.arm_passes,
                "extrapolate": options.extrapolate,
            }),
            Self::Iterative { options, phase } => json!({
                "iterations": options.iterations,
                "discrepancy": options.discrepancy,
                "non_negative": options.is_non_negative,
                "phase": phase,
            }),
        }
    }

    /// Options of filtered back-projection, where it is that.
    pub(super) const fn filtered(&self) -> Option<&FbpOptions> {
        match self {
            Self::Fbp(options) => Some(options),
            Self::Iterative { .. } => None,
        }
    }

    /// Refuses options that do not fit a quantity, before any work is done.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] with the reason.
    pub fn check(&self, quantity: Quantity) -> Result<()> {
        match self {
            Self::Fbp(options) => options.check(quantity),
            Self::Iterative { options, phase } => options.check(data(quantity, *phase)),
        }
    }

    /// The volume of sinograms `[view][row][column]`, with weights of their values or without; filtered
    /// back-projection has none.
    ///
    /// # Errors
    /// As the function of the method.
    pub fn volume(
        &self,
        engine: &Engine,
        geometry: &ScanGeometry,
        (sinograms, weights): (ArrayView3<'_, f32>, Option<ArrayView3<'_, f32>>),
        quantity: Quantity,
        grid: &VolumeGrid,
        control: &mut RowsControl<'_>,
    ) -> Result<Made> {
        match self {
            Self::Fbp(options) => {
                let volume = fbp(engine, geometry, sinograms, quantity, grid, options, control)?;
                Ok(Made { volume, residuals: Vec::new(), best: 0 })
            }
            Self::Iterative { options, phase } => {
                let data = data(quantity, *phase);
                let integrated = (data == Data::Phase)
                    .then(|| phase_along_rows(geometry, sinograms, None))
                    .transpose()?;
                let given = integrated.as_ref().map_or(sinograms, |phase| phase.view());
                let measured = Measured::new(data, given).with_weights(weights);
                let made = iterate(engine, geometry, &measured, grid, options, control)?;
                Ok(Made { volume: made.volume, residuals: made.residuals, best: made.best })
            }
        }
    }
}

const fn data(quantity: Quantity, phase: bool) -> Data {
    match quantity {
        Quantity::Delta if phase => Data::Phase,
        _ => Data::of(quantity),
    }
}
