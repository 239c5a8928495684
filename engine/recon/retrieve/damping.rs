//! Damping of Levenberg-Marquardt, and the limits of descents.

/// Steps below this, in the units of the unknowns, end a fit.
pub(super) const SETTLED: f64 = 1e-7;
/// Number of times that weights follow the fit, at most.
pub(super) const WEIGHINGS: usize = 40;
/// Change of the unknowns, in the units of a step, below which weights have settled.
pub(super) const WEIGHED: f64 = 1e-6;
/// Damping beyond which no step leads lower.
const MOST: f64 = 1e12;

/// Damping of the equations of a step, as a part of their scaled diagonal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Damping(f64);

impl Damping {
    pub(super) const fn new() -> Self {
        Self(1e-3)
    }

    pub(super) const fn value(self) -> f64 {
        self.0
    }

    /// Follows a step that lowered the squares by `gained`, of which `foretold` were expected (Nielsen's rule).
    pub(super) fn ease(&mut self, gained: f64, foretold: f64) {
        let ratio = gained / foretold.max(f64::MIN_POSITIVE);
        let factor = (1.0 - (2.0 * ratio - 1.0).powi(3)).max(0.1);
        self.0 = (self.0 * factor).clamp(1e-12, MOST);
    }

    /// Follows a step that raised the squares.
    pub(super) const fn tighten(&mut self) {
        self.0 *= 8.0;
    }

    /// Follows equations that are singular.
    pub(super) const fn lift(&mut self) {
        self.0 = (8.0 * self.0).max(1e-9);
    }

    /// True where no step leads lower.
    pub(super) const fn is_hopeless(self) -> bool {
        self.0 > MOST
    }
}
