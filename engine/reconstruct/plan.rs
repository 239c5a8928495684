//! Plan of a reconstruction: volumes, method, corrections.

use super::grid::VolumeGrid;
use super::method::Method;
use super::quantity::Quantity;
use super::regions::Region;

/// Plan of a reconstruction: volumes, method, corrections.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct VolumePlan {
    /// Quantities, one volume each.
    pub quantities: Vec<Quantity>,
    /// Voxels of every volume.
    pub grid: VolumeGrid,
    /// The method.
    pub method: Method,
    /// Regions whose means are written as CSV.
    pub regions: Vec<Region>,
    /// The uncertainties of the retrieval are used: filtered back-projection makes volumes of the
    /// uncertainties of voxels and of means of regions; iterative methods weigh values by one over the
    /// squares.
    pub sigma: bool,
    /// Stripes of single columns are taken off ([`super::suppress_rings`]).
    pub rings: bool,
    /// Length k of the bias of δ by gradients of μ ([`super::gradient_bias`]): δ becomes δ + kμ where μ is
    /// made, too.
    pub gradient_bias: Option<f64>,
}

impl VolumePlan {
    /// A plan without regions and corrections.
    #[must_use]
    pub const fn new(quantities: Vec<Quantity>, grid: VolumeGrid, method: Method) -> Self {
        let regions = Vec::new();
        Self { quantities, grid, method, regions, sigma: false, rings: false, gradient_bias: None }
    }

    setters! {
        /// Sets the regions whose means are written.
        with_regions(regions: Vec<Region>);
        /// Uses the deviations of the retrieval.
        with_sigma(sigma: bool);
        /// Takes stripes of single columns off.
        with_rings(rings: bool);
        /// Sets the length of the bias of δ.
        with_gradient_bias(gradient_bias: impl Into<Option<f64>>);
    }
}
