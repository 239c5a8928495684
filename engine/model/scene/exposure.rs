//! Exposures of the detector: flats, darks, or the sample in a view.

/// Subject of a stack of frames; the unit of commit of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Exposure {
    /// Without the sample, index into the flats of the scan.
    Flat(u32),
    /// Without light: dark frames, of which there are counts alone; index into the darks of the scan.
    Dark(u32),
    /// With the sample, index into the scene's angles.
    Sample(u32),
}

impl Exposure {
    /// Index in its stack.
    #[must_use]
    pub const fn index(self) -> u32 {
        match self {
            Self::Flat(index) | Self::Dark(index) | Self::Sample(index) => index,
        }
    }

    /// Another exposure of its stack.
    #[must_use]
    pub const fn with_index(self, index: u32) -> Self {
        match self {
            Self::Flat(_) => Self::Flat(index),
            Self::Dark(_) => Self::Dark(index),
            Self::Sample(_) => Self::Sample(index),
        }
    }

    /// True if it is a flat.
    #[must_use]
    pub const fn is_flat(self) -> bool {
        matches!(self, Self::Flat(_))
    }

    /// True if it is a dark.
    #[must_use]
    pub const fn is_dark(self) -> bool {
        matches!(self, Self::Dark(_))
    }
}
