//! Mask steps of stacks that are left out.

use super::Input;
use beamlet_core::{Error, Result};
use ndarray::{Array3, Axis};

impl Input {
    /// Leaves out these mask steps, counted from 0, of flat and sample: their frames and their offsets.
    ///
    /// # Errors
    /// [`Error::Argument`] for a step that the scan does not have, and where none remains.
    pub fn without_steps(mut self, steps: &[usize]) -> Result<Self> {
        let all = self.scene.scan.mask_offsets.len();
        let mut omitted = steps.to_vec();
        omitted.sort_unstable();
        omitted.dedup();
        if let Some(step) = omitted.last().filter(|step| **step >= all) {
            let allowed = format!("0 to {}, the steps of the scan", all - 1);
            return Err(Error::argument("omit_steps", format!("step {step}"), allowed));
        }
        if omitted.len() == all {
            let found = format!("all {all} steps");
            return Err(Error::argument("omit_steps", found, "fewer steps than the scan has"));
        }
        self.scene.scan.omit_steps(&omitted);
        self.omitted = omitted;
        Ok(self)
    }

    /// Mask steps of the files that are left out.
    pub(in crate::retrieve) fn omitted_steps(&self) -> &[usize] {
        &self.omitted
    }

    /// Frames `[step][row][column]` without the omitted steps.
    pub(super) fn kept_steps(&self, data: Array3<f32>) -> Array3<f32> {
        if self.omitted.is_empty() {
            return data;
        }
        let steps = 0..data.len_of(Axis(0));
        let kept: Vec<usize> = steps.filter(|step| !self.omitted.contains(step)).collect();
        data.select(Axis(0), &kept)
    }
}
