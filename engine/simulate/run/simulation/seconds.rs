//! Times of the stages of a run.

/// Seconds by stage.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seconds {
    pub(super) trace: f64,
    pub(super) illuminate: f64,
    /// Reading light from the device, blur, scatter.
    pub(super) detect: f64,
    pub(super) noise: f64,
    pub(super) write: f64,
}
