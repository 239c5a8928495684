//! The detector of a run: from the light on the grid to intensities and counts, band by band.

use super::blur;
use super::grid::SubpixelGrid;
use super::noise::{Frame, Noise};
use super::scatter::ScatterStage;
use super::spread::Window;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_model::optics::Optics;
use beamlet_model::scene::{
    Beam, Exposure, Scene, SpectrumOrigin, SpectrumSpec, validate_thresholds,
};
use beamlet_model::spectrum::{self, Spectrum};
use ndarray::{Array3, ArrayView3};
use std::ops::Range;

/// The detector of a scene, ready.
#[derive(Debug, Clone)]
pub struct DetectorModel {
    grid: SubpixelGrid,
    optics: Optics,
    /// Weights of the grid around a pixel.
    blur: Option<Window>,
    scatter: Option<ScatterStage>,
    noise: Option<Noise>,
}

impl DetectorModel {
    /// Reads the files that the detector names and makes its stages ready.
    ///
    /// # Errors
    /// `Error::File` and `Error::Scene` for files that cannot serve, an unknown absorber, or
    /// a detector that sees nothing of the beam.
    pub fn of(scene: &Scene) -> Result<Self> {
        let grid = SubpixelGrid::of(scene)?;
        validate_thresholds(&scene.detector, highest_energy(scene)?)?;
        let nodes = spectrum::open_beam(scene)?;
        Ok(Self {
            grid,
            optics: grid.optics(scene),
            blur: blur::window(scene, &grid)?,
            scatter: ScatterStage::of(scene)?,
            noise: Noise::of(scene, spectrum::excess_noise(&scene.detector, &nodes))?,
        })
    }

    /// The grid that takes the light.
    #[must_use]
    pub const fn grid(&self) -> &SubpixelGrid {
        &self.grid
    }

    /// Optics for tracing and illumination: the grid in place of the detector.
    #[must_use]
    pub const fn optics(&self) -> &Optics {
        &self.optics
    }

    /// True if a pixel takes up light of others.
    #[must_use]
    pub(crate) const fn spreads_light(&self) -> bool {
        self.blur.is_some() || matches!(self.scatter, Some(ScatterStage::Kernel { .. }))
    }

    /// Whether there is noise, and so counts and dark frames.
    #[must_use]
    pub const fn noise(&self) -> Option<&Noise> {
        self.noise.as_ref()
    }

    /// Intensities of a band of the detector's rows, from the light on the grid's
    /// `SubpixelGrid::lit_rows`, `[step][row][column]`.
    ///
    /// # Errors
    /// `Error::Interrupted`.
    pub(crate) fn intensities(
        &self,
        view: Exposure,
        band: &Range<u32>,
        lit: Array3<f32>,
        cancel: &Cancel,
    ) -> Result<Array3<f32>> {
        let needed = self.grid.needed(band);
        let pixels = match &self.blur {
            Some(blur) => {
                let columns = self.grid.pixels[0] as usize;
                blur.gather(lit.view(), [needed.len(), columns], cancel)?
            }
            None => lit,
        };
        match &self.scatter {
            Some(scatter) => scatter.add(view, band, &needed, pixels.view(), cancel),
            None => Ok(pixels),
        }
    }

    /// Detector numbers of a band of intensities; `None` without noise.
    ///
    /// # Errors
    /// As [`Noise::counts`].
    pub fn counts(
        &self,
        view: Exposure,
        band: &Range<u32>,
        intensities: ArrayView3<'_, f32>,
        cancel: &Cancel,
    ) -> Result<Option<Frame>> {
        let frame = |noise: &Noise| noise.counts(view, band.start, intensities, cancel);
        self.noise.as_ref().map(frame).transpose()
    }
}

/// Highest energy of the beam, keV: of a tube its voltage.
fn highest_energy(scene: &Scene) -> Result<f64> {
    match &scene.source.beam {
        Beam::Energy(energy) => Ok(*energy),
        Beam::Spectrum(SpectrumSpec { origin: SpectrumOrigin::Tube { kvp, .. }, .. }) => Ok(*kvp),
        Beam::Spectrum(spec) => {
            let spectrum = Spectrum::before_filters(scene, spec)?.significant();
            Ok(spectrum.energies_kev.last().copied().unwrap_or(0.0))
        }
    }
}
