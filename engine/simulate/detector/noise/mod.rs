//! Numbers that the detector reads out: photons, electronic noise, gain, offset, bit depth.

mod poisson;

use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::{self, single};
use beamlet_core::random::Draws;
use beamlet_model::scene::{Counts, Exposure, Scene};
use beamlet_model::spectrum::photons;
use ndarray::{Array3, ArrayView3};
use poisson::{gamma, poisson};
use rayon::prelude::*;
use std::ops::{Add as _, Range};

/// Excess noise below this is none.
const NO_EXCESS: f64 = 1e-9;

/// From intensities to detector numbers. Every number is a pure function of the seed, the kind of
/// frame, view, step, row, column and the intensity there.
#[derive(Debug, Clone)]
pub struct Noise {
    counts: Counts,
    /// Mean number of photons of an open pixel.
    photons: f64,
    /// Variance of the signal of one photon over the square of its mean.
    spread: f64,
    seed: u64,
    steps: usize,
    columns: usize,
    most: f64,
    /// Detector number of no light.
    offset: f64,
}

/// Detector numbers of a band.
#[derive(Debug, Clone)]
pub struct Frame {
    /// `[step][row][column]`.
    pub numbers: Array3<f32>,
    /// Numbers that the bit depth clipped.
    pub clipped: Clipped,
}

/// Detector numbers that a bit depth clipped.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Clipped {
    /// At 0.
    pub low: u64,
    /// At the largest number.
    pub high: u64,
}

impl std::ops::Add for Clipped {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { low: self.low + other.low, high: self.high + other.high }
    }
}

impl Noise {
    /// The noise of a scene; `None` without any. `excess`: the excess noise factor of
    /// [`excess_noise`](beamlet_model::spectrum::excess_noise), at least 1.
    ///
    /// # Errors
    /// Errors of the beam.
    pub fn of(scene: &Scene, excess: f64) -> Result<Option<Self>> {
        let Some(counts) = scene.detector.counts else { return Ok(None) };
        let spread = if excess - 1.0 > NO_EXCESS { excess - 1.0 } else { 0.0 };
        Ok(Some(Self {
            counts,
            photons: photons(scene, &counts)?,
            spread,
            seed: scene.sampling.seed,
            steps: scene.scan.mask_offsets.len(),
            columns: scene.detector.pixels[0] as usize,
            offset: counts.number_without_light(),
            most: counts.bit_depth.map_or(f64::INFINITY, |bits| libm::exp2(f64::from(bits)) - 1.0),
        }))
    }

    /// Numbers of a band of rows from `first_row` on, of intensities `[step][row][column]`.
    ///
    /// # Errors
    /// [`beamlet_core::Error::File`] where the band has another shape than the scene's;
    /// [`beamlet_core::Error::Interrupted`].
    pub fn counts(
        &self,
        view: Exposure,
        first_row: u32,
        intensities: ArrayView3<'_, f32>,
        cancel: &Cancel,
    ) -> Result<Frame> {
        let (steps, rows, columns) = intensities.dim();
        if (steps, columns) != (self.steps, self.columns) {
            let problem =
                format!("a band of {steps} steps and {columns} columns is not the scene's");
            return Err(beamlet_core::Error::file("counts", problem, None));
        }
        let values = intensities.as_standard_layout();
        let values = values.as_slice().unwrap_or_default();
        self.frame(view, first_row, rows, |index| values[index], cancel)
    }

    /// Numbers of a dark, a frame of each step, in a band of rows.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`].
    pub fn dark(&self, index: u32, rows: Range<u32>, cancel: &Cancel) -> Result<Frame> {
        self.frame(Exposure::Dark(index), rows.start, rows.len(), |_| 0.0, cancel)
    }

    fn frame(
        &self,
        view: Exposure,
        first_row: u32,
        rows: usize,
        intensity: impl Fn(usize) -> f32 + Sync,
        cancel: &Cancel,
    ) -> Result<Frame> {
        let mut numbers = Array3::zeros((self.steps, rows, self.columns));
        let (kind, view) = match view {
            Exposure::Flat(index) => (1, index),
            Exposure::Sample(index) => (2, index),
            Exposure::Dark(index) => (3, index),
        };
        let line = |(index, line): (usize, &mut [f32])| {
            let mut clipped = Clipped::default();
            if cancel.is_cancelled() {
                return clipped;
            }
            let (step, row) = (index / rows, first_row + numbers::count(index % rows));
            for (column, number) in line.iter_mut().enumerate() {
                // Columns and rows have 16 bits each.
                let place = [row << 16 | numbers::count(column), view, numbers::count(step)];
                let light = f64::from(intensity(index * self.columns + column));
                let value = self.number(light, Draws::new(self.seed, place, kind));
                *number = single(self.recorded(value, &mut clipped));
            }
            clipped
        };
        let clipped = match numbers.as_slice_mut() {
            Some(all) if self.columns > 0 => all
                .par_chunks_mut(self.columns)
                .enumerate()
                .map(line)
                .reduce(Clipped::default, Clipped::add),
            _ => Clipped::default(),
        };
        cancel.check()?;
        Ok(Frame { numbers, clipped })
    }

    /// A number as the bit depth leaves it.
    fn recorded(&self, value: f64, clipped: &mut Clipped) -> f64 {
        if self.most.is_infinite() {
            return value;
        }
        let whole = value.round();
        clipped.low += u64::from(whole < 0.0);
        clipped.high += u64::from(whole > self.most);
        whole.max(0.0).min(self.most)
    }

    /// One number, neither rounded nor clipped.
    fn number(&self, intensity: f64, mut draws: Draws) -> f64 {
        let counts = &self.counts;
        let photons = poisson(self.photons * intensity, &mut draws);
        let signal = if self.spread > 0.0 {
            // The sum of that number of gamma numbers of mean 1 and variance `spread`.
            self.spread * gamma(photons / self.spread, &mut draws)
        } else {
            photons
        };
        let mut value = self.offset + counts.gain * signal;
        if counts.electronic_noise > 0.0 {
            value += counts.electronic_noise * draws.normal();
        }
        value
    }
}
