//! Materials that scatter: a variance of angles per length, or bodies at random places.

use glam::DVec3;
use std::path::PathBuf;

/// Scattering of a material by structure that no object describes: refraction by angles that are independent from
/// place to place.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Scattering {
    /// Variance of the refraction angle along one axis per path length, rad2/m; across `axis` where there is one. >= 0.
    pub variance: f64,
    /// Direction of fibres or plates along which the variance is another one.
    pub axis: Option<ScatteringAxis>,
    /// Power of the photon energy that the variance is proportional to.
    pub exponent: f64,
    /// Energy of `variance`, keV; `None` with an exponent of 0. > 0.
    pub energy: Option<f64>,
}

impl Scattering {
    /// The same variance per path length, rad2/m, at all energies.
    #[must_use]
    pub const fn new(variance: f64) -> Self {
        Self { variance, axis: None, exponent: 0.0, energy: None }
    }

    /// Another variance per path length, rad2/m, along an axis of the object, of any length > 0.
    #[must_use]
    pub const fn with_axis(self, direction: [f64; 3], variance: f64) -> Self {
        Self { axis: Some(ScatteringAxis { direction, variance }), ..self }
    }

    /// The variance per path length with a power of the photon energy over `energy`, keV.
    #[must_use]
    pub const fn with_exponent(self, exponent: f64, energy: f64) -> Self {
        Self { exponent, energy: Some(energy), ..self }
    }

    /// Variance per path length at an energy, keV, rad2/m; with an axis the mean over all directions
    /// ([`Self::across_and_along`] has both).
    #[must_use]
    pub fn at(&self, energy: f64) -> f64 {
        self.mean() * self.growth(energy)
    }

    /// Variances per path length at an energy, keV, across the axis and along it, rad2/m; without one the same twice.
    #[must_use]
    pub fn across_and_along(&self, energy: f64) -> [f64; 2] {
        let along = self.axis.map_or(self.variance, |axis| axis.variance);
        [self.variance, along].map(|it| it * self.growth(energy))
    }

    /// Its axis, as a unit vector, where the variance along it is not that across it; `None` where all directions are
    /// alike.
    #[doc(hidden)]
    #[must_use]
    pub fn unequal_axis(&self) -> Option<ScatteringAxis> {
        let differs = |axis: &ScatteringAxis| (axis.variance - self.variance).abs() > 0.0;
        let axis = self.axis.filter(differs)?;
        let direction = DVec3::from_array(axis.direction).try_normalize()?.to_array();
        Some(ScatteringAxis { direction, ..axis })
    }

    /// Variance at an energy, keV, over that at its own.
    fn growth(&self, energy: f64) -> f64 {
        self.energy.map_or(1.0, |own| (energy / own).powf(self.exponent))
    }

    /// Variance per path length at its energy, rad2/m: with an axis the mean over all directions.
    pub(crate) fn mean(&self) -> f64 {
        self.axis.map_or(self.variance, |axis| (2.0 * self.variance + axis.variance) / 3.0)
    }
}

/// A direction along which a material scatters by another variance than across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScatteringAxis {
    /// In the frame of the object's shape or mesh, before its rotations. Its length, > 0, and its sign do not count.
    pub direction: [f64; 3],
    /// Variance of the refraction angle along the axis per path length where light comes across it, rad2/m. >= 0.
    pub variance: f64,
}

/// Bodies of one material at random places in another, the host, which its entry defines: light sees their mean, and
/// loses contrast by their structure.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Microstructure {
    /// Shape of the bodies.
    pub shape: BodyShape,
    /// Diameter, m: the median of the spread. > 0.
    pub diameter: f64,
    /// Standard deviation of ln d of the diameters d, 0 to 0.5.
    pub spread: f64,
    /// Fraction of the volume that the bodies have. > 0.
    pub fraction: f64,
    /// Name of the material of the bodies.
    pub of: String,
    /// Table `r,g` of the pair distribution of spheres, r in diameters, relative to the scene's directory. `None`: hard
    /// spheres in equilibrium.
    pub pair_distribution: Option<PathBuf>,
}

/// Shape of the bodies of a microstructure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodyShape {
    /// Spheres.
    Spheres,
    /// Spheres, of air where nothing else is given.
    Voids,
    /// Long cylinders of all directions.
    Cylinders,
}

impl Microstructure {
    /// Bodies of one diameter, m, with a fraction of the volume.
    #[must_use]
    pub fn new(shape: BodyShape, of: impl Into<String>, diameter: f64, fraction: f64) -> Self {
        Self { shape, diameter, spread: 0.0, fraction, of: of.into(), pair_distribution: None }
    }
}
