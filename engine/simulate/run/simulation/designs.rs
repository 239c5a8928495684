//! Designs of a set-up that are lit from one walk through their sample: their lines and rays are chosen by the worst of
//! all designs at each place.

use super::Simulation;
use super::prepare::SimulationParts;
use super::work::ViewWork;
use crate::run::{Control, memory};
use crate::sampling::Lattice;
use beamlet_core::{Cancel, Error, Result};
use beamlet_files::{ArraySink, RunRecord, Sink, Stacks, views_of_part};
use beamlet_model::media::MaterialTable;
use beamlet_model::scene::{MaskBody, Scene, Scheme, Transport};

/// Common parts of scenes that can be lit from one walk.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkKey {
    scene: Scene,
    lattice: Lattice,
    media: MaterialTable,
    /// Distance from the source to the analyser, m: it may lie at either face of a mask.
    analyser: f64,
}

impl WalkKey {
    /// The key of a scene; `None` where its light is not that of cells, or apertures end along z.
    ///
    /// # Errors
    /// The scene or its files.
    pub fn of(scene: &Scene) -> Result<Option<Self>> {
        let sampling = &scene.sampling;
        let is_walked = sampling.scheme == Scheme::Cells && sampling.transport != Transport::Wave;
        if !is_walked || scene.has_heights() {
            return Ok(None);
        }
        let SimulationParts { media, lattice, detector, .. } = SimulationParts::of(scene)?;
        let analyser = detector.optics().analyser;
        let mut common = scene.clone();
        for mask in common.sample_mask.iter_mut().chain(&mut common.detector_mask) {
            mask.body = MaskBody::Sheet { transmission: 0.0 };
            (mask.aperture, mask.taper) = (mask.period, 0.0);
            mask.apertures.clear();
        }
        common.scan.mask_offsets = vec![0.0];
        common.scan.view_offsets.clear();
        Ok(Some(Self { scene: common, lattice: lattice.without_reach(), media, analyser }))
    }
}

impl Simulation {
    /// Simulations of scenes of one [`WalkKey`] with the sample of this one.
    ///
    /// # Errors
    /// A scene; [`Error::Memory`] where the memory limit is too small for a row of all of them;
    /// [`Error::Interrupted`].
    #[doc(hidden)]
    pub fn of_designs(&self, scenes: &[Scene], cancel: &Cancel) -> Result<Vec<Self>> {
        let of_scene = |scene| cancel.check().and_then(|()| SimulationParts::of(scene));
        let mut parts = scenes.iter().map(of_scene).collect::<Result<Vec<_>>>()?;
        let lattices = parts.iter().map(|part| part.lattice.clone());
        let Some(lattice) = lattices.reduce(|all, other| all.covering(&other)) else {
            return Ok(Vec::new());
        };
        let (options, designs) = (self.options(), scenes.len() as u64);
        let (limit, band) = (options.memory_limit, options.band_rows);
        let of_scene =
            |scene| memory::estimate_together(scene, &self.sample.objects, limit, band, designs);
        let estimates = scenes.iter().map(of_scene).collect::<Result<Vec<_>>>()?;
        // The scene with most mask steps needs most.
        let largest = estimates.into_iter().max_by_key(|estimate| estimate.row_bytes);
        let memory = largest.unwrap_or(self.memory);
        parts.iter_mut().for_each(|part| part.lattice.clone_from(&lattice));
        let of_part = |part| cancel.check().and_then(|()| self.with_parts(part, memory));
        parts.into_iter().map(of_part).collect()
    }
}

/// Light of designs of [`Simulation::of_designs`], of each one its stacks with counts of the rays of all.
///
/// # Errors
/// As [`Simulation::run`].
pub fn light(designs: &[Simulation], mut control: Control<'_>) -> Result<Vec<Stacks>> {
    let Some(first) = designs.first() else { return Ok(Vec::new()) };
    let views = views_of_part(&first.scene, None)?;
    let mut stacks: Vec<ArraySink> = designs.iter().map(|_| ArraySink::new()).collect();
    let mut sinks: Vec<&mut dyn Sink> = stacks.iter_mut().map(|sink| sink as _).collect();
    let mut work = ViewWork::new(designs, &views, &control.cancel)?;
    for (sink, design) in sinks.iter_mut().zip(designs) {
        sink.begin(&design.scene, &design.start)?;
    }
    for view in views {
        work.view(view, &mut sinks, &mut control)?;
        sinks.iter_mut().try_for_each(|sink| sink.commit(view))?;
    }
    let tally = work.tally();
    first.check_tally(&tally)?;
    for (sink, design) in sinks.iter_mut().zip(designs) {
        let begun = RunRecord::begin(&design.start, design.scene.sampling.seed);
        sink.finish(&RunRecord { tally, ..begun })?;
    }
    stacks.into_iter().map(|sink| sink.into_stacks().ok_or(Error::Interrupted)).collect()
}
