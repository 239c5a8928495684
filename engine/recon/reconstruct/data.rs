//! What sinograms hold.

use super::quantity::Quantity;
use beamlet_interface::{ARM_NONE, ARM_SLOPE, ARM_SQUARED};

/// Kind of the values of sinograms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Data {
    /// −ln of the transmission: integrals of μ.
    Attenuation,
    /// Refraction angles along the rows, rad: differences of integrals of δ over each column.
    Refraction,
    /// Refraction angles integrated along the rows, m: integrals of δ.
    Phase,
    /// Variances of refraction angles, rad²: integrals of dark field per length.
    DarkField,
}

impl Data {
    /// Quantity that their volume holds.
    #[must_use]
    pub const fn quantity(self) -> Quantity {
        match self {
            Self::Attenuation => Quantity::Mu,
            Self::Refraction | Self::Phase => Quantity::Delta,
            Self::DarkField => Quantity::DarkField,
        }
    }

    /// Data of a volume as retrieval makes them.
    pub const fn of(quantity: Quantity) -> Self {
        match quantity {
            Quantity::Mu => Self::Attenuation,
            Quantity::Delta => Self::Refraction,
            Quantity::DarkField => Self::DarkField,
        }
    }

    /// `ARM_`
    pub(super) const fn arm(self) -> u32 {
        match self {
            Self::Attenuation => ARM_NONE,
            Self::Refraction | Self::Phase => ARM_SLOPE,
            Self::DarkField => ARM_SQUARED,
        }
    }
}
