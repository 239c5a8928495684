//! Errors of a scan: of mask offsets, and of intensities.

use beamlet_core::numbers;
use beamlet_core::random::Draws;

/// Kinds of draws.
const OFFSETS: u8 = 0x51;
const INTENSITIES: u8 = 0x52;
/// Along x; along z the next number.
const SOURCE: u8 = 0x53;
const OFFSETS_Z: u8 = 0x55;

/// Errors of the frames of a scan with the sample, `[view][step]`: simulated, and unknown to retrieval.
/// Flats that are taken between views have the errors of the view behind them, a flat for all views has none.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct ScanErrors {
    /// Displacement of the sample mask beside its offset, m; empty: none.
    pub mask_offsets: Vec<Vec<f64>>,
    /// The same along z.
    pub mask_offsets_z: Vec<Vec<f64>>,
    /// Light of a frame over the nominal one; empty: 1.
    pub intensities: Vec<Vec<f64>>,
    /// Displacement of the focal spot in each view (x, z), m; empty: none. One displacement serves all
    /// frames of a view.
    pub source: Vec<[f64; 2]>,
    /// Parameters of drawn errors, until the size of the scan is known.
    pub(super) drawn: Option<DrawnErrors>,
}

/// Errors to be drawn: standard deviations of independent ones, and of the steps of random walks from
/// frame to frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct DrawnErrors {
    /// m.
    pub(super) offset_sigma: f64,
    /// m.
    pub(super) offset_walk: f64,
    pub(super) intensity_sigma: f64,
    pub(super) intensity_walk: f64,
    /// m.
    pub(super) source_sigma: f64,
    /// m.
    pub(super) source_walk: f64,
    pub(crate) seed: u64,
}

impl ScanErrors {
    /// No errors.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.mask_offsets.is_empty()
            && self.mask_offsets_z.is_empty()
            && self.intensities.is_empty()
            && self.source.is_empty()
            && self.drawn.is_none()
    }

    /// Draws the errors for numbers of views, of mask steps, and of mask steps along z (0 where the mask keeps its
    /// height). Random numbers are a function of seed, view and step.
    pub(super) fn draw(&mut self, [views, steps, steps_z]: [usize; 3]) {
        let Some(drawn) = self.drawn.take() else { return };
        if drawn.offset_sigma > 0.0 || drawn.offset_walk > 0.0 {
            let of = (drawn.offset_sigma, drawn.offset_walk);
            self.mask_offsets = frames(drawn.seed, OFFSETS, of, [views, steps]);
            if steps_z > 0 {
                self.mask_offsets_z = frames(drawn.seed, OFFSETS_Z, of, [views, steps_z]);
            }
        }
        if drawn.intensity_sigma > 0.0 || drawn.intensity_walk > 0.0 {
            let of = (drawn.intensity_sigma, drawn.intensity_walk);
            let errors = frames(drawn.seed, INTENSITIES, of, [views, steps]);
            let intensity = |error: f64| libm::exp(error);
            self.intensities =
                errors.into_iter().map(|list| list.into_iter().map(intensity).collect()).collect();
        }
        if drawn.source_sigma > 0.0 || drawn.source_walk > 0.0 {
            let of = (drawn.source_sigma, drawn.source_walk);
            let along = |axis: u8| frames(drawn.seed, SOURCE + axis, of, [views, 1]).concat();
            self.source = along(0).into_iter().zip(along(1)).map(|(x, z)| [x, z]).collect();
        }
    }
}

/// Errors of frames in the order of time: independent ones on top of a random walk.
pub(super) fn frames(
    seed: u64,
    kind: u8,
    (sigma, walk): (f64, f64),
    [views, steps]: [usize; 2],
) -> Vec<Vec<f64>> {
    let mut at = 0.0;
    let mut error = |view: usize, step: usize| {
        let [view, step] = [view, step].map(numbers::count);
        let mut draws = Draws::new(seed, [view, step, 0], kind);
        let own = sigma * draws.normal();
        at += walk * draws.normal();
        own + at
    };
    (0..views).map(|view| (0..steps).map(|step| error(view, step)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_have_their_deviations_and_walks_their_steps() {
        let of = |sigma, walk| frames(7, OFFSETS, (sigma, walk), [400, 5]).concat();
        let rms = |values: &[f64]| {
            (values.iter().map(|it| it * it).sum::<f64>() / values.len() as f64).sqrt()
        };
        // 2,000 draws: 1.6 % of a deviation.
        assert!((rms(&of(2e-6, 0.0)) / 2e-6 - 1.0).abs() < 0.06);
        let walk = of(0.0, 3e-7);
        let steps: Vec<f64> = walk.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!((rms(&steps) / 3e-7 - 1.0).abs() < 0.06);
        assert_eq!(of(1e-6, 0.0)[..10], frames(7, OFFSETS, (1e-6, 0.0), [2, 5]).concat());
    }
}
