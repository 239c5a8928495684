//! Filters along rows, in f64 on the host: the ramp, and the Hilbert filter for derivatives.

use beamlet_core::fourier::transforms;
use beamlet_core::options::{Choice, Word};
use rustfft::Fft;
use rustfft::num_complex::Complex;
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;
use std::sync::Arc;

/// Window on high frequencies. For refraction the same windows apply to the Hilbert filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Filter {
    /// All alike.
    #[default]
    RamLak,
    /// Factor sin(x)/x, 0.64 at the cut-off.
    SheppLogan,
    /// Cosine, 0 at the cut-off.
    Hann,
}

impl Choice for Filter {
    const CHOICES: &'static [Self] = &[Self::RamLak, Self::SheppLogan, Self::Hann];

    fn word(self) -> Word {
        let name = match self {
            Self::RamLak => "ram-lak",
            Self::SheppLogan => "shepp-logan",
            Self::Hann => "hann",
        };
        Word { name, help: "" }
    }
}

impl Filter {
    /// Factor at a frequency, as a share of the cut-off.
    fn factor(self, share: f64) -> f64 {
        match self {
            _ if share > 1.0 => 0.0,
            Self::SheppLogan if share > 0.0 => libm::sin(FRAC_PI_2 * share) / (FRAC_PI_2 * share),
            Self::RamLak | Self::SheppLogan => 1.0,
            Self::Hann => 0.5 + 0.5 * libm::cos(PI * share),
        }
    }
}

/// A filter of rows of one length.
pub(super) struct RowFilter {
    spectrum: Vec<Complex<f64>>,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
    columns: usize,
}

impl fmt::Debug for RowFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RowFilter").field("columns", &self.columns).finish_non_exhaustive()
    }
}

impl RowFilter {
    /// A filter of rows of `columns` values at this pitch (m), which count as zero beyond their ends:
    /// the ramp, or the Hilbert filter.
    pub(super) fn new(
        columns: usize,
        pitch: f64,
        is_hilbert: bool,
        (filter, cut_off): (Filter, f64),
    ) -> Self {
        let length = (2 * columns).next_power_of_two();
        let [forward, inverse] = transforms(length);
        let mut spectrum = vec![Complex::new(0.0, 0.0); length];
        let half = length / 2;
        for n in (1..half).step_by(2) {
            let x = n as f64 * PI;
            let [right, left] =
                if is_hilbert { [2.0 / x, -2.0 / x] } else { [-1.0 / (x * x * pitch); 2] };
            spectrum[n].re = right;
            spectrum[length - n].re = left;
        }
        if !is_hilbert {
            spectrum[0].re = 0.25 / pitch;
        }
        forward.process(&mut spectrum);
        for (n, value) in spectrum.iter_mut().enumerate() {
            let share = n.min(length - n) as f64 / half as f64 / cut_off;
            *value *= filter.factor(share) / length as f64;
        }
        Self { spectrum, forward, inverse, columns }
    }

    /// Filters a row.
    pub(super) fn apply(&self, row: &[f64]) -> Vec<f64> {
        let mut padded = vec![Complex::new(0.0, 0.0); self.spectrum.len()];
        for (to, from) in padded.iter_mut().zip(row) {
            to.re = *from;
        }
        self.forward.process(&mut padded);
        padded.iter_mut().zip(&self.spectrum).for_each(|(value, factor)| *value *= factor);
        self.inverse.process(&mut padded);
        padded[..self.columns].iter().map(|value| value.re).collect()
    }
}
