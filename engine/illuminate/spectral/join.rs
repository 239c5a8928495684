//! Neighbouring cells of faint light joined to fewer.

use super::sums::Sums;

/// Cells being joined: their light, its mean displacement and how far it spreads.
#[derive(Debug, Default)]
pub(super) struct Joining {
    x: Option<[f32; 2]>,
    sums: Sums,
}

impl Joining {
    /// Whether the cell fits with those before it, up to a width.
    pub(super) fn fits(&self, x: [f32; 2], width: f64) -> bool {
        let low = self.x.map_or(x[0], |[low, _]| low);
        f64::from(x[1] - low) <= width
    }

    /// Takes a cell.
    pub(super) fn add(&mut self, x: [f32; 2], sums: &Sums) {
        let low = self.x.map_or(x[0], |[low, _]| low);
        self.x = Some([low, x[1]]);
        self.sums.add(sums, (x[1] - x[0]).into());
    }

    /// The interval joined, with the sums per metre, alike at both ends.
    pub(super) fn take(&mut self) -> Option<([f32; 2], Sums)> {
        let Self { x, sums } = std::mem::take(self);
        let [low, high] = x?;
        let mut mean = Sums::default();
        mean.add(&sums, 1.0 / f64::from(high - low));
        (mean.light, mean.x) = ([mean.light[1]; 3], [mean.x[1]; 3]);
        (mean.light[1] > 0.0).then_some(([low, high], mean))
    }
}
