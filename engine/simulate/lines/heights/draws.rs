//! Rays that are independent random samples.

/// Rays that are independent random samples, of a line or of all lines.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Draws {
    count: u32,
    /// Sum of the squares of their areas, in the unit of light.
    pub(super) squares: f64,
    /// Sums over areas: of the squared light of their rays; of those that have a next one beside them the areas, and of
    /// half the squared change to it.
    light: f64,
    compared: f64,
    changes: f64,
}

impl Draws {
    /// Adds a ray that passes a share of the light of an area, and its change of light to the next one.
    pub(crate) fn add(&mut self, area: f64, passed: f64, change: Option<f64>) {
        self.count += 1;
        self.squares += area * area;
        self.light += area * passed * passed;
        if let Some(change) = change {
            self.compared += area;
            self.changes += 0.5 * area * change * change;
        }
    }

    pub(super) fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            squares: self.squares + other.squares,
            light: self.light + other.light,
            compared: self.compared + other.compared,
            changes: self.changes + other.changes,
        }
    }

    /// True if there are any.
    pub(crate) const fn are_any(&self) -> bool {
        self.count > 0
    }

    /// Variance of the light of an area of 1. Draws that agree leave a share of 1 / (count + 2) open.
    pub(crate) fn variance(&self) -> f64 {
        let seen = if self.compared > 0.0 { self.changes / self.compared } else { 0.0 };
        let area = (self.squares * f64::from(self.count)).sqrt().max(f64::MIN_POSITIVE);
        seen.max(0.25 / f64::from(self.count + 2) * self.light / area)
    }
}
