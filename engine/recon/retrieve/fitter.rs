//! Fits of a Gaussian on a background to many illumination curves at once, on the device.

use super::background_term::BackgroundTerm;
use super::curves::SlitCurve;
use super::quadrature;
use super::value_noise::{ValueNoise, Weights};
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result};
use beamlet_gpu::{Buffer, Compute, Device, Download, Kernel, Memory, Pace, Upload, push_bytes};
use beamlet_interface::{
    FIT_AMPLITUDE, FIT_AREA_SIGMA, FIT_BACKGROUND, FIT_CENTRE, FIT_CENTRE_SIGMA, FIT_CONDITION,
    FIT_FLAGS, FIT_RESIDUAL, FIT_VALUES, FIT_WIDTH, FIT_WIDTH_SIGMA, FitPush, Step,
};
use ndarray::{ArrayView2, s};
use std::borrow::Cow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Curves on the device at once: 84 MB with 11 steps.
const AT_ONCE: usize = 1 << 20;

/// Fits curves taken at the same offsets.
#[derive(Debug, Clone)]
pub struct Fitter {
    device: Arc<Device>,
    kernel: Arc<Kernel>,
    steps: Arc<Buffer>,
    /// Curves and fits of the call before.
    kept: Arc<Mutex<Option<[Buffer; 2]>>>,
    step_count: usize,
    /// Centre and half width of the scan.
    middle: f64,
    half: f64,
    /// Added to values while they are fitted: with it their variance is the gain times them.
    pedestal: f32,
    /// Least and most width, in half widths.
    min_width: f64,
    max_width: f64,
    noise: ValueNoise,
    /// Background of the curves, per area in the unit of the offsets.
    background: BackgroundTerm,
}

impl Fitter {
    /// A fitter for curves at these offsets, in any unit and order; centres and widths come in
    /// the same unit.
    ///
    /// # Errors
    /// [`Error::Argument`] with fewer than four different offsets, or one that is not finite;
    /// [`Error::Device`], [`Error::Memory`].
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::internals::retrieve::{BackgroundTerm, Fitter, ValueNoise};
    /// use beamlet::{Cancel, Engine, EngineOptions, ndarray::Array2};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let offsets = [-20e-6, -10e-6, 0.0, 10e-6, 20e-6];
    /// let fitter = Fitter::new(&engine, &offsets, ValueNoise::default(), BackgroundTerm::Free)?;
    /// // `[step][curve]`.
    /// let curves = Array2::<f32>::zeros((5, 1000));
    /// println!("{:?}", fitter.fit(curves.view(), &Cancel::default())?[0].centre);
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn new(
        compute: &Compute,
        offsets: &[f64],
        noise: ValueNoise,
        background: BackgroundTerm,
    ) -> Result<Self> {
        let device = compute.device().clone();
        let kernel = Arc::new(device.kernel("fit", push_bytes::<FitPush>())?);
        Self::with_kernel(device, kernel, offsets, noise, background)
    }

    /// The same fits of curves taken at other offsets, whose values have other noise.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(super) fn at(&self, offsets: &[f64], noise: ValueNoise) -> Result<Self> {
        let (device, kernel) = (self.device.clone(), self.kernel.clone());
        Self::with_kernel(device, kernel, offsets, noise, self.background)
    }

    fn with_kernel(
        device: Arc<Device>,
        kernel: Arc<Kernel>,
        offsets: &[f64],
        noise: ValueNoise,
        background: BackgroundTerm,
    ) -> Result<Self> {
        let mut sorted = offsets.to_vec();
        sorted.sort_by(f64::total_cmp);
        let different = 1 + sorted.windows(2).filter(|pair| pair[0] < pair[1]).count();
        if different < 4 || offsets.iter().any(|offset| !offset.is_finite()) {
            return Err(Error::argument(
                "offsets",
                format!("{} offsets, {different} of them different", offsets.len()),
                "a fit of four unknowns needs at least 4 different, finite offsets",
            ));
        }
        let [low, high] = [sorted[0], sorted[sorted.len() - 1]];
        let (middle, half) = (f64::midpoint(low, high), (high - low) / 2.0);
        let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0);
        let least = gaps.fold(f64::INFINITY, f64::min) / half;
        let steps: Vec<Step> = offsets
            .iter()
            .zip(quadrature::trapezoids(offsets))
            .map(|(offset, share)| {
                let at = (offset - middle) / half;
                Step {
                    offset: single(at),
                    offset_low: single(at - f64::from(single(at))),
                    width: single(share / half),
                }
            })
            .collect();
        Ok(Self {
            kernel,
            steps: Arc::new(device.upload("mask steps", &steps)?),
            device,
            kept: Arc::default(),
            step_count: offsets.len(),
            middle,
            half,
            min_width: least / 3.0,
            max_width: 2.0,
            pedestal: match noise.weights {
                Weights::None => 0.0,
                Weights::Poisson => {
                    single(noise.read_noise * noise.read_noise / noise.gain.unwrap_or(1.0))
                }
            },
            noise,
            background,
        })
    }

    /// Number of steps of a curve.
    #[must_use]
    pub const fn steps(&self) -> usize {
        self.step_count
    }

    /// Fits curves, `[step][curve]`. Each is fitted independently: its bits do not depend on the others.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Memory`]; [`Error::Argument`] for another number of steps than
    /// of offsets; [`Error::Interrupted`] when `cancel` was set.
    pub fn fit(&self, curves: ArrayView2<'_, f32>, cancel: &Cancel) -> Result<Vec<SlitCurve>> {
        let (steps, count) = curves.dim();
        if steps != self.step_count {
            return Err(Error::argument(
                "offsets",
                format!("{} offsets for {steps} frames", self.step_count),
                "one offset for each frame",
            ));
        }
        let mut all = Vec::with_capacity(count);
        let room = count.min(AT_ONCE) as u64;
        let [input, output] = self.take_buffers(room)?;
        let mut pace = Pace::new(1 << 15, 1024, 1 << 20);
        let mut values = Vec::new();
        for start in (0..count).step_by(AT_ONCE) {
            let n = (count - start).min(AT_ONCE);
            let rows: Vec<Cow<'_, [f32]>> = curves
                .outer_iter()
                .map(|curve| match curve.slice_move(s![start..start + n]) {
                    part if self.pedestal > 0.0 => part.iter().map(|y| y + self.pedestal).collect(),
                    part => {
                        part.to_slice().map_or_else(|| part.iter().copied().collect(), Cow::from)
                    }
                })
                .collect();
            let place = |step: usize| (step * n * 4) as u64;
            let uploads: Vec<Upload<'_>> =
                (0..).zip(&rows).map(|(step, row)| Upload::new(&input, place(step), row)).collect();
            values.resize(n * FIT_VALUES, 0.0);
            let download = Download::new(&output, 0, &mut values);
            self.dispatch(
                [&input, &output],
                numbers::count(n),
                (&uploads, download),
                (&mut pace, cancel),
            )?;
            all.extend(self.curves(&values));
        }
        *lock(&self.kept) = Some([input, output]);
        Ok(all)
    }

    /// Buffers for `room` curves and their fits: kept ones where they are large enough.
    fn take_buffers(&self, room: u64) -> Result<[Buffer; 2]> {
        let bytes = [room * self.step_count as u64 * 4, room * FIT_VALUES as u64 * 4];
        let fits = |of: &[Buffer; 2]| of.iter().zip(bytes).all(|(it, bytes)| it.len() >= bytes);
        if let Some(kept) = lock(&self.kept).take().filter(fits) {
            return Ok(kept);
        }
        let make = |name: &str, bytes| self.device.buffer(name, bytes, Memory::Device);
        Ok([make("curves", bytes[0])?, make("fits", bytes[1])?])
    }

    /// Fits `count` curves: they go to the device with the first dispatch, and their fits come with the last.
    fn dispatch(
        &self,
        [input, output]: [&Buffer; 2],
        count: u32,
        (uploads, fits): (&[Upload<'_>], Download<'_>),
        pace_and_cancel: (&mut Pace, &Cancel),
    ) -> Result<()> {
        let [fixed, per_area] = match self.background {
            BackgroundTerm::Free => [0.0; 2],
            // The area of a Gaussian is its height times its width times this root.
            BackgroundTerm::PerArea(share) => {
                [self.pedestal, single(share * self.half * (2.0 * std::f64::consts::PI).sqrt())]
            }
            BackgroundTerm::Value(value) => [single(value) + self.pedestal, 0.0],
        };
        let push = |first, _| FitPush {
            background_is_free: (self.background == BackgroundTerm::Free).into(),
            background: fixed,
            background_per_area: per_area,
            steps: self.steps.address(),
            curves: input.address(),
            fits: output.address(),
            step_count: numbers::count(self.step_count),
            pixel_count: count,
            first,
            poisson: (self.noise.weights == Weights::Poisson).into(),
            gain: single(self.noise.gain.unwrap_or(1.0)),
            saturation: single(self.noise.saturation) + self.pedestal,
            min_width: single(self.min_width),
            max_width: single(self.max_width),
        };
        let transfers = (uploads, &mut [fits][..]);
        self.device.run_paced(&self.kernel, count, pace_and_cancel, transfers, push, &mut |_| ())
    }

    /// From planes of values in half widths to curves in the offsets' unit.
    fn curves(&self, values: &[f32]) -> impl Iterator<Item = SlitCurve> {
        let n = values.len() / FIT_VALUES;
        (0..n).map(move |at| {
            let of = |plane: usize| values[plane * n + at];
            let length = |plane: usize| self.half * f64::from(of(plane));
            SlitCurve {
                area: single(f64::from(of(FIT_AMPLITUDE)) * self.half * f64::from(of(FIT_WIDTH))),
                amplitude: of(FIT_AMPLITUDE),
                centre: single(self.middle + length(FIT_CENTRE)),
                width: single(length(FIT_WIDTH)),
                background: of(FIT_BACKGROUND) - self.pedestal,
                residual: of(FIT_RESIDUAL),
                area_sigma: of(FIT_AREA_SIGMA),
                centre_sigma: single(length(FIT_CENTRE_SIGMA)),
                width_sigma: single(length(FIT_WIDTH_SIGMA)),
                condition: of(FIT_CONDITION),
                flags: numbers::whole::<u32>(f64::from(of(FIT_FLAGS))),
            }
        })
    }
}

/// Locks; buffers of a panicking thread are as good as new ones.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
