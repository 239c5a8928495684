//! Light of the views of a run. Its kind is chosen once, at set-up; each kind owns its buffers, kernels and sums.
//!
//! - `cells`: sums of the light of cells, which several kinds have;
//! - `blank`: a run without a sample;
//! - `lines`: cells of lines and rays through the sample; `survey`: their cost and measured errors;
//! - `random`: random rays;
//! - `waves`: lines by waves.

mod blank;
mod cells;
mod lines;
mod random;
mod survey;
mod waves;

use super::Simulation;
use crate::illuminate::EnergyBinning;
use crate::run::RunEstimate;
use crate::sampling::{Lattice, MomentRecording, ProjectedBounds};
use crate::wave::WavePlans;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use beamlet_model::scene::Exposure;
use blank::Blank;
use lines::Lines;
use ndarray::Array3;
use random::Random;
use std::ops::Range;
use waves::Waves;

/// Kind of the light of a scene, with the tables of its set-up.
#[derive(Debug)]
pub(super) enum LightKind {
    /// Cells at one energy, or at the mean of a spectrum whose energies are gathered.
    Cells(Option<Box<Spectrum>>),
    Random,
    Waves(WavePlans),
}

/// Energies of cells, and moments of the rays that bound them.
#[derive(Debug)]
pub(super) struct Spectrum {
    pub energies: EnergyBinning,
    pub recording: MomentRecording,
}

impl LightKind {
    /// Energies of cells; `None` for one energy, and where each energy has light of its own.
    pub(super) fn spectrum(&self) -> Option<&Spectrum> {
        match self {
            Self::Cells(spectrum) => spectrum.as_deref(),
            Self::Random | Self::Waves(_) => None,
        }
    }
}

/// Pose of the sample in a view.
#[derive(Debug)]
pub(super) struct Pose {
    pub view: Exposure,
    /// Index among the poses of all views; 0 in a flat.
    pub index: u32,
    /// Shadows of the components of the sample; none in a flat.
    pub shadows: Vec<ProjectedBounds>,
}

/// Rows of the grid whose light is added together.
#[derive(Debug)]
pub(super) struct LitRows {
    pub rows: Range<i64>,
    /// Rows of the sums.
    pub band: Range<i64>,
}

impl LitRows {
    /// Rows whose undeflected light reaches the band.
    fn direct(&self, lattice: &Lattice) -> Range<i64> {
        self.band.start - lattice.blur_rows..self.band.end + lattice.blur_rows
    }
}

/// Seconds by stage.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seconds {
    pub trace: f64,
    pub illuminate: f64,
    /// Reading light from the device, blur, scatter.
    pub detect: f64,
    pub noise: f64,
    pub write: f64,
}

/// Receives the rays traced so far, and the share of the rows in work that is done.
pub(super) type Report<'a> = &'a mut dyn FnMut(u64, f64);

/// Light of one kind: sums of a band of rows after another.
pub(super) trait Light {
    /// Begins sums of the light of rows of the grid at the mask offsets of a view.
    ///
    /// # Errors
    /// Of the device or memory.
    fn begin(&mut self, rows: &Range<u32>, view: Exposure) -> Result<()>;

    /// Rays, or places of light, of a row: they bound how many rows are added together.
    fn items_of_row(&self, pose: &Pose) -> u64;

    /// Adds the light of rows; their counts, besides those of [`Light::tally`].
    ///
    /// # Errors
    /// Of the device or memory; [`beamlet_core::Error::Interrupted`].
    fn add(&mut self, pose: &Pose, rows: &LitRows, report: Report<'_>) -> Result<Tally>;

    /// The sums of each design that is lit, `[step][row][column]`, share of open beam.
    ///
    /// # Errors
    /// Of the device or memory.
    fn intensities(&self) -> Result<Vec<Array3<f32>>>;

    /// Counts of the rays traced so far.
    fn tally(&self) -> Tally;

    /// Seconds of tracing and illumination so far.
    fn seconds(&self) -> Seconds;

    /// Estimates rays and time of all views.
    ///
    /// # Errors
    /// As [`Light::add`].
    fn estimate(&mut self) -> Result<RunEstimate>;
}

impl Simulation {
    /// Light of a run of designs with one sample; of more than one by lines.
    ///
    /// # Errors
    /// Of the device or memory, or where a kernel is not made.
    pub(super) fn light<'s>(designs: &'s [Self], cancel: &Cancel) -> Result<Box<dyn Light + 's>> {
        let first = &designs[0];
        Ok(match &first.light {
            LightKind::Cells(_) if first.sample.is_empty() => {
                Box::new(Blank::new(designs, cancel)?)
            }
            LightKind::Cells(_) => Box::new(Lines::new(designs, cancel)?),
            LightKind::Random => Box::new(Random::new(first, cancel)?),
            LightKind::Waves(plans) => Box::new(Waves::new(first, plans, cancel)?),
        })
    }

    /// Rows of the sums of the largest band.
    fn most_lit_rows(&self) -> usize {
        let grid = self.detector.grid();
        self.bands().map(|rows| grid.lit_rows(&rows).len()).max().unwrap_or(0)
    }

    /// Rows of the sums of the band with a row of the grid.
    fn band_of(&self, row: i64) -> Range<u32> {
        let lit = self.bands().map(|band| self.detector.grid().lit_rows(&band));
        let last = lit.reduce(|own, next| if i64::from(next.start) <= row { next } else { own });
        last.unwrap_or_default()
    }

    /// Number of rows of the grid.
    fn grid_rows(&self) -> i64 {
        self.detector.optics().detector.pixels[1].into()
    }

    /// Number of poses of the sample.
    fn pose_count(&self) -> f64 {
        self.scene.scan.poses() as f64
    }

    /// Pose of the sample of this index, with its shadows.
    pub(super) fn pose(&self, index: u32) -> Pose {
        let shadows =
            if self.sample.is_empty() { Vec::new() } else { self.projected_bounds(index) };
        Pose { view: Exposure::Sample(self.view_of(index)), index, shadows }
    }

    /// Rows that shadows reach, as far as a run adds their light.
    pub(super) fn shadow_rows(&self, shadows: &[ProjectedBounds]) -> Range<i64> {
        let halo = self.lattice.halo;
        let rows = shadows.iter().map(|it| it.rows.map(|row| numbers::whole::<i64>(row.floor())));
        let ends = rows.reduce(|[top, bottom], [a, b]| [top.min(a), bottom.max(b)]);
        let [top, bottom] = ends.map_or([0, 0], |[top, bottom]| [top, bottom + 1]);
        let top = top.max(-halo);
        top..bottom.min(self.grid_rows() + halo).max(top)
    }

    /// Cells of a row whose light is traced, or of one without a sample.
    fn cells_of_row(&self, pose: &Pose) -> u64 {
        let beamlets = &self.lattice.beamlets;
        let beamlets = numbers::narrow::<u64>(beamlets.end - beamlets.start);
        // Without rays all rows go together: invocations side by side that see one aperture from several rows do the
        // same work, four times as fast as those that see several apertures.
        if pose.shadows.is_empty() {
            beamlets
        } else {
            beamlets * (2 * u64::from(self.lattice.cells) + 1) * 2
        }
    }
}
