//! Plan of a reconstruction: volumes, method, corrections.

use super::gradient_bias::add_gradient_bias;
use super::grid::{Volume, VolumeGrid};
use super::hardening::{BeamEnergy, HardeningChoice};
use super::input::Input;
use super::method::Method;
use super::open::OpenVolumes;
use super::quantity::Quantity;
use super::redundancy::Redundancy;
use super::voxel_mask::VoxelMask;
use beamlet_core::{Error, Result, setters};
use std::path::PathBuf;

/// Plan of a reconstruction: volumes, method, corrections.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct VolumePlan {
    /// Quantities, one volume each, in any order.
    pub quantities: Vec<Quantity>,
    /// Voxels of every volume.
    pub grid: VolumeGrid,
    /// The method.
    pub method: Method,
    /// Stripes of single columns are taken off ([`super::suppress_rings`]).
    pub rings: bool,
    /// Views that lost their refraction ([`super::LostViews`]) keep their weight in δ.
    pub keep_views: bool,
    /// Length k of the bias of δ by gradients of μ ([`super::gradient_bias`]): δ becomes δ + kμ where μ is
    /// made, too.
    pub gradient_bias: Option<f64>,
    /// Energy of the beam, for the record.
    pub beam: Option<BeamEnergy>,
    /// Sinograms of μ are corrected for the hardening of a beam with a spectrum.
    pub beam_hardening: Option<HardeningChoice>,
    /// Voxels that may differ from zero, in iterative methods.
    pub mask: Option<VoxelMask>,
    /// Folder of volumes on the same grid that iterations begin with. `None`: zero.
    pub start: Option<PathBuf>,
}

impl VolumePlan {
    /// A plan without corrections.
    #[must_use]
    pub const fn new(quantities: Vec<Quantity>, grid: VolumeGrid, method: Method) -> Self {
        Self {
            quantities,
            grid,
            method,
            rings: false,
            keep_views: false,
            gradient_bias: None,
            beam: None,
            beam_hardening: None,
            mask: None,
            start: None,
        }
    }

    setters! {
        /// Takes stripes of single columns off.
        with_rings(rings: bool);
        /// Keeps views that lost their refraction in δ.
        with_keep_views(keep_views: bool);
        /// Sets the length of the bias of δ.
        with_gradient_bias(gradient_bias: impl Into<Option<f64>>);
        /// Sets the energy of the beam, for the record.
        with_beam(beam: impl Into<Option<BeamEnergy>>);
        /// Sets the material of the correction of beam hardening.
        with_beam_hardening(beam_hardening: impl Into<Option<HardeningChoice>>);
        /// Sets the voxels that may differ from zero.
        with_mask(mask: impl Into<Option<VoxelMask>>);
        /// Sets the folder of volumes that iterations begin with.
        with_start(start: impl Into<Option<PathBuf>>);
    }

    /// The quantities in the order in which they are made: δ needs the volume of μ.
    pub(super) fn ordered(&self) -> impl Iterator<Item = Quantity> + '_ {
        Quantity::ALL.into_iter().filter(move |quantity| self.quantities.contains(quantity))
    }

    /// Files and folders that are read beside the input.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        let mask = self.mask.as_ref().and_then(VoxelMask::path);
        mask.map(ToOwned::to_owned).into_iter().chain(self.start.clone()).collect()
    }

    /// Refuses what does not fit an input, before any work is done.
    ///
    /// # Errors
    /// [`Error::Argument`] with the reason; [`Error::File`] for a mask or start that is not there or
    /// does not fit.
    pub fn check(&self, input: &Input) -> Result<()> {
        input.geometry().check()?;
        self.grid.check(input.geometry())?;
        if self.quantities.is_empty() {
            return Err(Error::argument("quantities", "none", "one or more"));
        }
        if let Some(k) = self.gradient_bias.filter(|k| !k.is_finite()) {
            return Err(Error::argument("gradient_bias", k.to_string(), "a finite length, m"));
        }
        self.method.check_extras(self.mask.is_some(), self.start.is_some())?;
        self.check_hardening()?;
        if let Some(mask) = &self.mask {
            mask.check(&self.grid)?;
        }
        if self.method.filtered().is_some() {
            Redundancy::of(input.geometry())?;
        }
        for quantity in self.ordered() {
            self.method.check(quantity)?;
            if let Some(path) = &self.start {
                let found = OpenVolumes::open(path)?;
                if !found.record().units.contains_key(quantity.name()) {
                    let problem = format!("has no volume {} to start from", quantity.name());
                    return Err(Error::file(path, problem, None));
                }
                let has_bias = quantity == Quantity::Delta && found.gradient_bias().is_some();
                if has_bias && !found.record().units.contains_key(Quantity::Mu.name()) {
                    let problem = "has delta + k mu and no volume mu, by which k mu is taken off";
                    return Err(Error::file(path, problem, None));
                }
                same_grid(&found, &self.grid, path)?;
            }
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Argument`] for a correction of beam hardening without a volume of μ.
    pub(super) fn check_hardening(&self) -> Result<()> {
        if self.beam_hardening.is_some() && !self.quantities.contains(&Quantity::Mu) {
            let allowed = "volumes of mu: refraction and dark field have no hardening to correct";
            return Err(Error::argument("beam_hardening", "no volume of mu", allowed));
        }
        Ok(())
    }

    /// The volume that iterations of a quantity begin with; δ without kμ, as sinograms show it.
    ///
    /// # Errors
    /// [`Error::File`] where it cannot be read, or holds values that are not finite.
    pub(super) fn start_of(&self, quantity: Quantity) -> Result<Option<Volume>> {
        let Some(path) = &self.start else { return Ok(None) };
        let volumes = OpenVolumes::open(path)?;
        let mut volume = volumes.volume(quantity)?;
        if let (Quantity::Delta, Some(k)) = (quantity, volumes.gradient_bias()) {
            add_gradient_bias(&mut volume, &volumes.volume(Quantity::Mu)?, -k)?;
        }
        let bad = volume.values.indexed_iter().find(|(_, value)| !value.is_finite());
        if let Some(((z, y, x), value)) = bad {
            let problem = format!(
                "{}: {value} in voxel x {x}, y {y}, z {z}; allowed: finite values",
                quantity.name()
            );
            return Err(Error::file(path, problem, None));
        }
        Ok(Some(volume))
    }
}

/// # Errors
/// [`Error::File`] where volumes lie on another grid.
fn same_grid(found: &OpenVolumes, grid: &VolumeGrid, path: &std::path::Path) -> Result<()> {
    let other = found.record().grid();
    let is_near = |a: &[f64; 3], b: &[f64; 3]| {
        a.iter().zip(b).zip(&grid.voxel).all(|((a, b), side)| (a - b).abs() <= 1e-6 * side)
    };
    if other.size == grid.size
        && is_near(&other.voxel, &grid.voxel)
        && is_near(&other.origin, &grid.origin)
    {
        return Ok(());
    }
    let words = |grid: &VolumeGrid| {
        format!("{:?} voxels of {:?} m from {:?} m", grid.size, grid.voxel, grid.origin)
    };
    let problem = format!("has {}; this reconstruction has {}", words(&other), words(grid));
    Err(Error::file(path, problem, None))
}
