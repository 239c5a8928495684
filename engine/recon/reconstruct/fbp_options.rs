//! Options of filtered back-projection.

use super::filter::Filter;
use super::geometry::ScanGeometry;
use super::quantity::Quantity;
use beamlet_core::{Error, Result, setters};
use serde::Serialize;

/// How a filtered back-projection is done; what differs from the default is set in a chain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FbpOptions {
    /// Window of the filter.
    pub filter: Filter,
    /// Frequency from which on nothing counts, as a share of Nyquist's. Above 0, at most 1.
    pub cut_off: f64,
    /// Corrections for the lever arms of voxels before and behind the axis of rotation, by the volume
    /// before. `None`: one where views over less than a turn see a geometry with a lever arm. Each
    /// takes the voxels of the grid for the whole sample.
    pub arm_passes: Option<usize>,
    /// Rows of a body that is wider than the detector go on as those of an ellipse, in place of zeros:
    /// attenuation and dark field.
    pub extrapolate: bool,
    /// Values of volume and of projections that are on the device at once; no bit of the volume
    /// depends on it. `None`: 64 Mi each.
    #[serde(skip)]
    pub at_once: Option<usize>,
}

impl Default for FbpOptions {
    fn default() -> Self {
        let (filter, cut_off) = (Filter::RamLak, 1.0);
        Self { filter, cut_off, arm_passes: None, extrapolate: false, at_once: None }
    }
}

impl FbpOptions {
    setters! {
        /// Sets the window of the filter.
        with_filter(filter: Filter);
        /// Sets the frequency from which on nothing counts, as a share of Nyquist's.
        with_cut_off(cut_off: f64);
        /// Sets the number of corrections for lever arms.
        with_arm_passes(arm_passes: impl Into<Option<usize>>);
        /// Continues rows beyond the detector.
        with_extrapolate(extrapolate: bool);
        /// Bounds the values on the device.
        with_at_once(at_once: impl Into<Option<usize>>);
    }

    /// # Errors
    /// [`Error::Argument`] for options that cannot be.
    pub(super) fn check(&self, quantity: Quantity) -> Result<()> {
        let options = self;
        if !(options.cut_off > 0.0 && options.cut_off <= 1.0) {
            let found = options.cut_off.to_string();
            return Err(Error::argument("cut_off", found, "above 0, at most 1"));
        }
        if options.extrapolate && quantity == Quantity::Delta {
            let allowed =
                "attenuation or dark field: refraction beyond the ends of a row is unknown";
            return Err(Error::argument("extrapolate", "refraction angles", allowed));
        }
        Ok(())
    }

    /// Corrections for lever arms in a scan; `is_turn`: over a whole turn.
    pub(super) fn passes(
        &self,
        geometry: &ScanGeometry,
        quantity: Quantity,
        is_turn: bool,
    ) -> usize {
        if quantity == Quantity::Mu || geometry.lever.is_infinite() {
            return 0;
        }
        self.arm_passes.unwrap_or(usize::from(!is_turn))
    }
}
