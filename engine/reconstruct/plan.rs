//! What is reconstructed, and how.

use super::grid::VolumeGrid;
use super::method::Method;
use super::quantity::Quantity;
use super::regions::Region;

/// What is reconstructed, and how.
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
}

impl VolumePlan {
    /// A plan without regions.
    #[must_use]
    pub const fn new(quantities: Vec<Quantity>, grid: VolumeGrid, method: Method) -> Self {
        Self { quantities, grid, method, regions: Vec::new() }
    }

    setters! {
        /// Sets the regions whose means are written.
        with_regions(regions: Vec<Region>);
    }
}
