//! Beam tracking: the light of each aperture of a sample mask over the pixels it falls on.

use super::method::BEAMLET_PIXELS;
use crate::numbers;
use crate::optics::Optics;
use crate::scene::Scene;
use crate::{Error, Result};
use ndarray::{Array3, ArrayView3};

/// Where beamlets land on the detector.
#[derive(Debug, Clone)]
pub(super) struct Beamlets {
    /// First pixel of each beamlet's window.
    starts: Vec<usize>,
    /// Pixels of a window.
    pixels: usize,
    /// Columns of the detector.
    columns: usize,
    /// Width of a pixel, m.
    pitch: f64,
}

impl Beamlets {
    /// Of a scene that [`super::Method::check`] let through.
    pub(super) fn of(scene: &Scene) -> Result<Self> {
        let optics = Optics::of(scene);
        let Some(mask) = &optics.sample_mask else {
            return Err(Error::scene("sample_mask", "nothing", "a sample mask"));
        };
        let columns = f64::from(optics.detector.pixels[0]);
        let period = mask.period_columns(&optics.detector);
        let shift = mask.offset_columns(&optics.detector, optics.mask_offsets[0]);
        // Window of whole pixels about each centre; the detector's pixel c has its centre at c.
        let pixels = period.round().max(BEAMLET_PIXELS);
        let centre = |k: f64| (k + 0.5 - columns / 2.0) * period + shift + columns / 2.0 - 0.5;
        let around = (columns / 2.0 - shift / period).floor();
        let reach = numbers::whole::<i64>((columns / period).ceil()) + 1;
        let starts: Vec<usize> = (-reach..=reach)
            .map(|k| (centre(around + k as f64) - (pixels - 1.0) / 2.0).round())
            .filter(|start| *start >= 0.0 && start + pixels <= columns)
            .map(numbers::whole::<usize>)
            .collect();
        if starts.is_empty() {
            return Err(Error::scene(
                "detector.pixels",
                format!("{columns} columns"),
                format!("at least one beamlet of {pixels} pixels on the detector"),
            ));
        }
        Ok(Self {
            starts,
            pixels: numbers::whole::<usize>(pixels),
            columns: numbers::whole::<usize>(columns),
            pitch: optics.detector.pitch[0],
        })
    }

    /// Number of beamlets along a row.
    pub(super) fn count(&self) -> usize {
        self.starts.len()
    }

    /// Columns of the detector.
    pub(super) const fn columns(&self) -> usize {
        self.columns
    }

    /// Places of a window's pixels from its middle, m on the detector.
    pub(super) fn offsets(&self) -> Vec<f64> {
        let middle = (self.pixels - 1) as f64 / 2.0;
        (0..self.pixels).map(|i| (i as f64 - middle) * self.pitch).collect()
    }

    /// `[pixel of the window][row][beamlet]` of a single frame `[1][row][column]`.
    pub(super) fn gather(&self, frame: ArrayView3<'_, f32>) -> Array3<f32> {
        let (_, rows, _) = frame.dim();
        Array3::from_shape_fn((self.pixels, rows, self.starts.len()), |(pixel, row, beamlet)| {
            frame[[0, row, self.starts[beamlet] + pixel]]
        })
    }
}
