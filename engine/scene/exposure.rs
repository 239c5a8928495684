//! Exposures of the detector: flat, dark, or the sample in a view.

/// Subject of a stack of frames; the unit of commit of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Exposure {
    /// Without the sample.
    Flat,
    /// Without light: the dark frames, of which there are counts alone.
    Dark,
    /// With the sample, index into the scene's angles.
    Sample(u32),
}
