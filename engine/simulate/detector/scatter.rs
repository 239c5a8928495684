//! Scattered light that the scene adds: an image, or the light itself spread by a kernel.

use super::kernel::{KernelOf, Measured};
use super::spread::Window;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result, image};
use beamlet_model::scene::{Exposure, Scatter, Scene};
use ndarray::{Array2, Array3, ArrayView3, Axis, s};
use std::ops::Range;

/// The added light.
#[derive(Debug, Clone)]
pub(super) enum ScatterStage {
    /// An image in open beam, with the sample.
    Image(Array2<f32>),
    /// Weights of the pixels around a pixel, which sum to the fraction.
    Kernel { window: Window, margin: [usize; 2] },
}

impl ScatterStage {
    pub(super) fn of(scene: &Scene) -> Result<Option<Self>> {
        match &scene.detector.scatter {
            None => Ok(None),
            Some(Scatter::Image(path)) => {
                let path = scene.checked(path)?;
                let image = image::read(&path)?;
                let [columns, rows] = scene.detector.pixels.map(|n| n as usize);
                let key = "detector.scatter.image";
                if image.dim() != (rows, columns) {
                    let found =
                        format!("{}: {} x {} pixels", path.display(), image.ncols(), image.nrows());
                    let allowed = format!("the detector's {columns} x {rows} pixels");
                    return Err(Error::scene(key, found, allowed));
                }
                if let Some(value) = image.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
                    let found = format!("{}: {value}", path.display());
                    return Err(Error::scene(key, found, "finite intensities >= 0"));
                }
                let image = image.mapv(single);
                Ok(Some(Self::Image(image)))
            }
            Some(Scatter::Kernel { kernel, fraction }) => {
                let measured = Measured::read(scene, kernel, KernelOf::Scatter)?;
                let margin =
                    [0, 1].map(|axis| numbers::whole::<u32>(measured.profile(axis).reach().ceil()));
                let weights = measured.weights(margin, [1; 2]) * *fraction;
                let window = Window::new(weights, [1; 2], scene.detector.pixels[0] as usize);
                Ok(Some(Self::Kernel { window, margin: margin.map(|n| n as usize) }))
            }
        }
    }

    /// The rows `band` with the light scattered into them; `light` are the rows `needed`.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn add(
        &self,
        view: Exposure,
        band: &Range<u32>,
        needed: &Range<u32>,
        light: ArrayView3<'_, f32>,
        cancel: &Cancel,
    ) -> Result<Array3<f32>> {
        let from = (band.start - needed.start) as usize;
        let mut out = light.slice(s![.., from..from + band.len(), ..]).to_owned();
        match self {
            Self::Image(image) => {
                if matches!(view, Exposure::Sample(_)) {
                    let rows = image.slice(s![band.start as usize..band.end as usize, ..]);
                    out.axis_iter_mut(Axis(0)).for_each(|mut frame| frame += &rows);
                }
            }
            Self::Kernel { window, margin: [across, down] } => {
                // Light on the detector's pixels alone scatters: beyond its edges there is none.
                let (steps, rows, columns) = light.dim();
                let shape = (steps, band.len() + 2 * down, columns + 2 * across);
                let mut framed = Array3::zeros(shape);
                // Row 0 of the frame is `down` rows above the band.
                let skip = down.saturating_sub(from);
                let take = (from + skip).saturating_sub(*down);
                let rows = (rows - take).min(shape.1 - skip);
                framed
                    .slice_mut(s![.., skip..skip + rows, *across..across + columns])
                    .assign(&light.slice(s![.., take..take + rows, ..]));
                out += &window.gather(framed.view(), [band.len(), columns], cancel)?;
            }
        }
        Ok(out)
    }
}
