//! Methods: each a function from sinograms to a volume.

use super::data::Data;
use super::fbp::fbp;
use super::fbp_options::FbpOptions;
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::iterative::iterate;
use super::measured::Measured;
use super::phase::integrated;
use super::quantity::Quantity;
use super::solver::IterativeOptions;
use crate::retrieve::Drift;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result};
use beamlet_gpu::Compute;
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
        /// δ is made of refraction angles integrated along the rows ([`super::phase_along_rows`]), not of the
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
    /// Drift that was taken off refraction angles before they were integrated; `None` where they were
    /// not.
    pub drift: Option<Drift>,
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
            Self::Fbp(options) => json!(options),
            Self::Iterative { options, phase } => {
                let mut options = json!(options);
                options["phase"] = json!(phase);
                options
            }
        }
    }

    /// Options of filtered back-projection, where it is that.
    pub(super) const fn filtered(&self) -> Option<&FbpOptions> {
        match self {
            Self::Fbp(options) => Some(options),
            Self::Iterative { .. } => None,
        }
    }

    /// The same with a bound of the values of volume and of sinograms that are on the device at once.
    pub(super) const fn with_at_once(mut self, values: Option<usize>) -> Self {
        if let Self::Fbp(options) = &mut self {
            options.at_once = values;
        }
        self
    }

    /// True if a quantity is made of refraction angles integrated along the rows.
    pub(super) fn is_of_phase(&self, quantity: Quantity) -> bool {
        matches!(self, Self::Iterative { phase: true, .. }) && quantity == Quantity::Delta
    }

    /// Refuses options that do not fit a quantity, before any work is done.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Argument`] with the reason.
    pub fn check(&self, quantity: Quantity) -> Result<()> {
        match self {
            Self::Fbp(options) => options.check(quantity),
            Self::Iterative { options, phase } => options.check(data(quantity, *phase)),
        }
    }

    /// Refuses what only iterations take: voxels that may differ from zero, and a start.
    pub(super) fn check_extras(&self, mask: bool, start: bool) -> Result<()> {
        let found = match (self, mask, start) {
            (Self::Fbp(_), true, _) => "fbp with a mask",
            (Self::Fbp(_), _, true) => "fbp with a start",
            _ => return Ok(()),
        };
        let allowed = "cgls, sirt or bb: filtered back-projection computes every voxel \
                       independently, in one step";
        Err(Error::argument("method", found, allowed))
    }

    /// The volume of sinograms with what is known beside them. Filtered back-projection has no weights,
    /// mask and start.
    ///
    /// # Errors
    /// As the function of the method.
    pub fn volume(
        &self,
        compute: &Compute,
        geometry: &ScanGeometry,
        measured: &Measured<'_>,
        grid: &VolumeGrid,
        control: &mut RowsControl<'_>,
    ) -> Result<Made> {
        let (sinograms, quantity) = (measured.sinograms, measured.data.quantity());
        match self {
            Self::Fbp(options) => {
                self.check_extras(measured.mask.is_some(), measured.start.is_some())?;
                let volume = fbp(compute, geometry, sinograms, quantity, grid, options, control)?;
                Ok(Made { volume, residuals: Vec::new(), best: 0, drift: None })
            }
            Self::Iterative { options, .. } => {
                let integrated = self
                    .is_of_phase(quantity)
                    .then(|| integrated(geometry, sinograms, None, &control.cancel))
                    .transpose()?;
                let given = match &integrated {
                    Some((phase, _)) => (Data::Phase, phase.view()),
                    None => (measured.data, measured.sinograms),
                };
                let measured = Measured { data: given.0, sinograms: given.1, ..*measured };
                let made = iterate(compute, geometry, &measured, grid, options, control)?;
                let drift = integrated.as_ref().map(|(_, drift)| *drift);
                let (volume, residuals) = (made.volume, made.residuals);
                Ok(Made { volume, residuals, best: made.best, drift })
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
