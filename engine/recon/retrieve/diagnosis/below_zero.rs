//! Frames whose values lie below zero by more than noise.

use super::watched::Watched;

/// Share of negative values that noise about zero does not exceed, and standard deviations beyond one half.
const SHARE: f64 = 0.6;
const SIGMAS: f64 = 5.0;

/// A frame with more negative values than noise about zero has.
#[derive(Debug, Clone, Copy)]
pub(super) struct BelowZero {
    pub(super) step: usize,
    /// Share of the values of the frame.
    pub(super) share: f64,
}

impl BelowZero {
    /// The frame with the largest share of negative values; `None` where half of the values of a frame without light
    /// may be negative by noise.
    pub(super) fn of(watched: &Watched) -> Option<Self> {
        let shares = watched.negatives().iter().enumerate().map(|(step, [negative, all])| {
            let (share, count) = (*negative as f64 / *all as f64, *all as f64);
            (share > SHARE.max(0.5 + SIGMAS * 0.5 / count.sqrt())).then_some(Self { step, share })
        });
        shares.flatten().max_by(|a, b| a.share.total_cmp(&b.share))
    }
}
