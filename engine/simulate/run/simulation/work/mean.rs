//! Means of the intensities of the poses of a view.

use beamlet_core::numbers::single;
use ndarray::{Array3, Zip};

/// A running mean. The mean of one pose has its bits.
#[derive(Debug)]
pub(super) struct Mean {
    count: usize,
    first: Option<Array3<f32>>,
    sum: Option<Array3<f64>>,
}

impl Mean {
    /// The mean of `count` intensities.
    pub(super) const fn of(count: usize) -> Self {
        Self { count, first: None, sum: None }
    }

    pub(super) fn add(&mut self, intensities: Array3<f32>) {
        if self.count == 1 {
            self.first = Some(intensities);
            return;
        }
        match &mut self.sum {
            None => self.sum = Some(intensities.mapv(f64::from)),
            Some(sum) => {
                Zip::from(sum).and(&intensities).for_each(|sum, it| *sum += f64::from(*it))
            }
        }
    }

    /// The mean, once all were added.
    pub(super) fn finish(self) -> Array3<f32> {
        let count = self.count as f64;
        match (self.first, self.sum) {
            (Some(one), _) => one,
            (None, Some(sum)) => sum.mapv(|sum| single(sum / count)),
            (None, None) => Array3::zeros((0, 0, 0)),
        }
    }
}
