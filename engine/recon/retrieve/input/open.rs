//! Inputs of runs, simulated stacks and measured stacks.

use super::correction::{Correction, Dark};
use super::{Input, faults};
use beamlet_core::{Error, Result, numbers};
use beamlet_files::{OpenRun, StackFile};
use beamlet_model::scene::Scene;
use beamlet_model::spectrum;
use std::path::Path;

impl Input {
    /// A run; with `counts` its detector numbers instead of intensities. Noise and saturation are then
    /// taken from the scene's detector, and the mean of the run's dark frames is subtracted.
    ///
    /// # Errors
    /// [`Error::File`] where it has none, or cannot be read.
    pub fn of_run(run: &OpenRun, counts: bool) -> Result<Self> {
        let scene = run.scene().clone();
        let all = run.record().extent.views;
        if run.views() < all as usize {
            let path = run.path().display();
            log::warn!(
                "{path}: {} of {all} views are committed; the rest is left out",
                run.views()
            );
        }
        let input = if counts {
            let (Some(flat), Some(sample)) = (run.counts_flat()?, run.counts_sample()?) else {
                let problem = match scene.detector.counts {
                    Some(_) => {
                        "has no committed counts of flat and sample yet: wait for the run, or resume it"
                    }
                    None => {
                        "has no counts: its scene has neither detector.photons nor detector.exposure"
                    }
                };
                return Err(Error::file(run.path(), problem, None));
            };
            Self::simulated_counts(&scene, flat, sample, run.dark()?)?
        } else {
            Self::simulated(&scene, run.flat()?, run.sample()?)
        };
        Ok(Self { run: run.hashes().clone(), ..input })
    }

    /// Simulated intensities of a scene. Several flats are taken every `scan.flats_every` views.
    #[must_use]
    pub fn simulated(scene: &Scene, flat: StackFile, sample: StackFile) -> Self {
        let flats_every = scene.scan.flats_every.filter(|_| flat.shape()[0] > 1);
        Self { is_run: true, flats_every, ..Self::new(scene.clone(), flat, sample, Vec::new()) }
    }

    /// Simulated detector numbers of a scene. Noise and saturation are taken from its detector; the mean
    /// of the dark frames is subtracted, with `scan.darks_every` interpolated between darks.
    ///
    /// # Errors
    /// [`Error::File`] where the dark cannot be read; [`Error::Scene`] for materials of the detector.
    pub fn simulated_counts(
        scene: &Scene,
        flat: StackFile,
        sample: StackFile,
        dark: Option<StackFile>,
    ) -> Result<Self> {
        let numbers = scene.detector.counts;
        // The largest number stands for all that was clipped to it.
        let saturation = numbers
            .and_then(|n| n.bit_depth)
            .map(|bits| numbers::single(libm::exp2(f64::from(bits)) - 1.0));
        let noise = match numbers {
            Some(n) => Some([spectrum::variance_per_value(scene)?, n.electronic_noise]),
            None => None,
        };
        let dark = match (dark, scene.scan.darks_every) {
            (Some(darks), Some(every)) if darks.shape()[0] > 1 => {
                Some(Dark::between(darks, every, scene.scan.views())?)
            }
            (dark, _) => dark.as_ref().map(Dark::of).transpose()?,
        };
        let correction = Correction { dark, bad: None, saturation };
        let input = Self::simulated(scene, flat, sample);
        Ok(Self { correction, noise, counts: true, ..input })
    }

    /// Measured stacks. `scene` gives the geometry; its mask offsets are those of the frames.
    /// The dark is averaged over its frames and subtracted from both.
    ///
    /// # Errors
    /// [`Error::File`] where shapes do not agree, naming both files; where the sample has the values of
    /// the flat, or the dark is brighter than the flat in its darkest steps; where a file that the scene
    /// refers to does not have the hash that the scene has of it. [`Error::Argument`] where mask offsets
    /// span less than a tenth or more than ten periods of the sample mask.
    pub fn measured(
        scene: &Scene,
        flat: StackFile,
        sample: StackFile,
        dark: Option<&StackFile>,
    ) -> Result<Self> {
        if let Some(error) = scene.changed_files().into_iter().next() {
            return Err(error);
        }
        let scene = scene.with_file_hashes()?;
        faults::check_offsets(&scene)?;
        require_one_shape(&flat, std::iter::once(&sample).chain(dark))?;
        let files = [&flat, &sample].into_iter().chain(dark).filter_map(StackFile::file);
        let read = files.map(Path::to_owned).collect();
        let names = |s: &StackFile| Some((s.path().display().to_string(), s.frame_names()?));
        let frames = [&flat, &sample].into_iter().chain(dark).filter_map(names).collect();
        faults::check_sample(&flat, &sample)?;
        let mut warnings = faults::of_bytes(&flat, &sample);
        warnings.extend(faults::of_pixels(&scene, &flat));
        let dark = match dark {
            Some(stack) => {
                let dark = Dark::of(stack)?;
                faults::check_dark(&flat, &dark)?;
                Some(dark)
            }
            None => None,
        };
        let correction = Correction { dark, ..Correction::default() };
        let input = Self::new(scene, flat, sample, read);
        Ok(Self { correction, counts: true, frames, warnings, ..input })
    }
}

/// Refuses stacks with frames of another shape than those of the flat.
pub(super) fn require_one_shape<'a>(
    flat: &StackFile,
    others: impl Iterator<Item = &'a StackFile>,
) -> Result<()> {
    let [_, _, rows, columns] = flat.shape();
    for other in others {
        let [_, _, other_rows, other_columns] = other.shape();
        if [other_rows, other_columns] != [rows, columns] {
            let problem = format!(
                "has frames of {other_rows} x {other_columns} pixels; the frames of {} have {rows} x {columns}",
                flat.path().display()
            );
            return Err(Error::file(other.path(), problem, None));
        }
    }
    Ok(())
}
