//! Samples that follow the flat where views and steps change places.

use super::watched::Watched;
use beamlet_files::FrameOrder;

/// Slope of the sample over the flat, in units of their means, that another order has where it is the right one, and its
/// ratio to the slope in the own order.
const SLOPE: f64 = 0.5;
const RATIO: f64 = 3.0;

/// Products of the sample with the flat about its mean over the steps, in the order of the frames and in the other one.
#[derive(Debug)]
pub(super) struct Transposition {
    order: FrameOrder,
    /// Views and steps of the files; `None` where frames are not those of the files one by one.
    extent: Option<[usize; 2]>,
    views: usize,
    own: f64,
    other: f64,
    squares: f64,
    /// Sums of flat and sample.
    light: [f64; 2],
}

impl Transposition {
    /// No view yet.
    pub(super) const fn new(order: FrameOrder, extent: Option<[usize; 2]>) -> Self {
        Self { order, extent, views: 0, own: 0.0, other: 0.0, squares: 0.0, light: [0.0; 2] }
    }

    /// Adds the values of a view.
    pub(super) fn add(&mut self, [flat, sample]: [&Watched; 2]) {
        let Some([views, steps]) = self.extent else { return };
        let view = self.views;
        self.views += 1;
        let other = |step: usize| match self.order {
            FrameOrder::StepView => (step * views + view) % steps,
            FrameOrder::ViewStep => (view * steps + step) / views,
        };
        for ((_, flat), (_, sample)) in flat.iter().zip(sample.iter()) {
            if flat.len() != steps || flat.iter().chain(&sample).any(|value| !value.is_finite()) {
                continue;
            }
            let mean = flat.iter().sum::<f64>() / steps as f64;
            for (step, y) in sample.iter().enumerate() {
                self.own += y * (flat[step] - mean);
                self.other += y * (flat[other(step)] - mean);
                self.squares += (flat[step] - mean).powi(2);
                self.light = [self.light[0] + flat[step], self.light[1] + y];
            }
        }
    }

    /// True if the sample follows the flat in the other order, and not in its own.
    pub(super) fn is_likely(&self) -> bool {
        let [flat, sample] = self.light;
        let is_whole =
            self.extent.is_some_and(|[views, steps]| views > 1 && steps > 1 && views == self.views);
        let slope = |product: f64| product / self.squares * flat / sample;
        is_whole
            && sample > 0.0
            && slope(self.other) > SLOPE
            && slope(self.other) > RATIO * slope(self.own).abs()
    }

    /// The fault and its remedy.
    pub(super) fn warning(&self) -> String {
        let (read, order) = match self.order {
            FrameOrder::StepView => ("[step][view]", "view,step"),
            FrameOrder::ViewStep => ("[view][step]", "step,view"),
        };
        format!(
            "views and steps of the sample may be transposed: read as {read} it does not change with the mask offset as the \
             flat does, and in the other order it does; --frame-order {order} (for arrays: exchange their first two axes)"
        )
    }
}
