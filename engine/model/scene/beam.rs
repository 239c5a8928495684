//! Emission of the source: one photon energy, or a spectrum.

use beamlet_core::setters;
use std::path::PathBuf;

/// Emission of the source.
#[derive(Debug, Clone, PartialEq)]
pub enum Beam {
    /// Photons of one energy, keV. > 0.
    Energy(f64),
    /// Photons of many energies.
    Spectrum(SpectrumSpec),
}

impl Beam {
    /// The photon energy, keV, where there is one only.
    pub const fn single_energy(&self) -> Option<f64> {
        match self {
            Self::Energy(energy) => Some(*energy),
            Self::Spectrum(_) => None,
        }
    }
}

/// A spectrum, before and after its filters.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SpectrumSpec {
    /// Where the photons come from.
    pub origin: SpectrumOrigin,
    /// Filters in the beam before the first mask, besides the filters of `origin`.
    pub filters: Vec<Filter>,
    /// Number of energy nodes, >= 1; `None`: chosen for the accuracy.
    pub nodes: Option<u32>,
}

impl SpectrumSpec {
    /// A spectrum without further filters, with the number of energy nodes that its accuracy needs.
    #[must_use]
    pub const fn new(origin: SpectrumOrigin) -> Self {
        Self { origin, filters: Vec::new(), nodes: None }
    }

    setters! {
        /// Puts filters into the beam.
        with_filters(filters: Vec<Filter>);
        /// Sets the number of energy nodes.
        with_nodes(nodes: impl Into<Option<u32>>);
    }
}

/// Where the photons of a spectrum come from.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SpectrumOrigin {
    /// Table file: energy in keV, weight in photons.
    File {
        /// The file, relative to the scene's directory.
        path: PathBuf,
    },
    /// The built-in model of an X-ray tube.
    Tube {
        /// Metal of the target.
        anode: Anode,
        /// Tube voltage, kV, within [`Anode::kvp_range`].
        kvp: f64,
        /// Angle between the target's face and the optical axis, rad, 6 to 45 degrees.
        anode_angle: f64,
        /// Filters of the tube itself: window, oil, housing.
        inherent_filters: Vec<Filter>,
    },
}

/// Least and greatest anode angle, rad: 6 and 45 degrees.
pub(crate) const ANODE_ANGLES: [f64; 2] = [6.0_f64.to_radians(), 45.0_f64.to_radians()];

/// Default anode angle, rad: 12 degrees.
pub(super) const ANODE_ANGLE: f64 = 12.0_f64.to_radians();

/// Metal of the target of a tube.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Anode {
    /// Z = 74.
    Tungsten,
    /// Z = 42.
    Molybdenum,
}

impl Anode {
    /// Every anode by its name.
    pub const ALL: [(&'static str, Self); 2] =
        [("tungsten", Self::Tungsten), ("molybdenum", Self::Molybdenum)];

    /// The name of the metal, a built-in material too.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tungsten => "tungsten",
            Self::Molybdenum => "molybdenum",
        }
    }

    /// Its chemical symbol.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Tungsten => "W",
            Self::Molybdenum => "Mo",
        }
    }

    /// Least and greatest tube voltage of the built-in model, kV.
    pub const fn kvp_range(self) -> [f64; 2] {
        match self {
            Self::Tungsten => [20.0, 160.0],
            Self::Molybdenum => [20.0, 50.0],
        }
    }
}

/// A sheet across the whole beam.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Filter {
    /// Material name.
    pub material: String,
    /// Thickness along the beam, m. > 0.
    pub thickness: f64,
}

impl Filter {
    /// A sheet of a material, thickness in m.
    #[must_use]
    pub fn new(material: impl Into<String>, thickness: f64) -> Self {
        Self { material: material.into(), thickness }
    }
}
