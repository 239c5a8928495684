//! Methods: each a function from sinograms to a volume.

use super::fbp::{FbpOptions, fbp};
use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::quantity::Quantity;
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
}

impl Default for Method {
    fn default() -> Self {
        Self::Fbp(FbpOptions::default())
    }
}

impl Method {
    /// Name on the command line and in records.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Fbp(_) => "fbp",
        }
    }

    /// Options as records have them.
    #[must_use]
    pub fn options(&self) -> Value {
        match self {
            Self::Fbp(options) => {
                json!({ "filter": options.filter.name(), "cut_off": options.cut_off })
            }
        }
    }

    /// The volume of sinograms `[view][row][column]`.
    ///
    /// # Errors
    /// As the function of the method.
    pub fn volume(
        &self,
        engine: &Engine,
        geometry: &ScanGeometry,
        sinograms: ArrayView3<'_, f32>,
        quantity: Quantity,
        grid: &VolumeGrid,
        control: &mut RowsControl<'_>,
    ) -> Result<Volume> {
        match self {
            Self::Fbp(options) => {
                fbp(engine, geometry, sinograms, quantity, grid, options, control)
            }
        }
    }
}
