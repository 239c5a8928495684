//! Quantity of a volume.

/// Quantity of a volume, which determines the values of its sinograms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Linear attenuation, 1/m, from −ln T.
    Mu,
    /// Decrement of the refractive index, from refraction angles along x, rad.
    Delta,
    /// Dark field per length, rad²/m, from variances of the refraction angle, rad².
    DarkField,
}

impl Quantity {
    /// Every quantity.
    pub const ALL: [Self; 3] = [Self::Mu, Self::Delta, Self::DarkField];

    /// Name on the command line, in files and in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mu => "mu",
            Self::Delta => "delta",
            Self::DarkField => "dark-field",
        }
    }

    /// Retrieved image that it is reconstructed from.
    #[must_use]
    pub const fn image(self) -> &'static str {
        match self {
            Self::Mu => "transmission",
            Self::Delta => "refraction",
            Self::DarkField => "dark_field",
        }
    }

    /// Unit of a volume.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Mu => "1/m",
            Self::Delta => "1",
            Self::DarkField => "rad²/m",
        }
    }
}
