//! What the detector is exposed to: flat, dark, or the sample at an angle.

/// What a stack of frames is taken of; the unit of commit of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Exposure {
    /// Without the sample.
    Flat,
    /// Without light: the dark frames, of which there are counts alone.
    Dark,
    /// With the sample, index into the scene's angles.
    Sample(u32),
}
