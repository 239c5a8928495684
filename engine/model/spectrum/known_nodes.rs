//! Energy nodes of the last scenes: a program needs the nodes of a scene several times, and designs of a sweep often
//! share beam and materials.

use super::Nodes;
use crate::scene::{
    Absorber, Beam, DetectorMode, MaskBody, MaterialSpec, Scene, SpectrumOrigin, Substrate,
};
use beamlet_core::Result;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Most scenes that are kept.
const MOST: usize = 32;

static KNOWN: Mutex<Vec<(NodesInput, Nodes)>> = Mutex::new(Vec::new());

/// All that the nodes of a scene depend on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NodesInput {
    beam: Beam,
    distance: f64,
    mode: DetectorMode,
    absorber: Option<Absorber>,
    masks: Vec<(MaskBody, Option<Substrate>)>,
    materials: BTreeMap<String, MaterialSpec>,
    surroundings: String,
    path_material: String,
    /// Materials of the objects.
    sample: Vec<String>,
}

impl NodesInput {
    /// The input of a scene; `None` where it is in files, which may change.
    pub(super) fn of(scene: &Scene) -> Option<Self> {
        let is_file = |spec: &MaterialSpec| matches!(spec, MaterialSpec::Table { .. });
        match &scene.source.beam {
            Beam::Spectrum(spec) if matches!(spec.origin, SpectrumOrigin::Tube { .. }) => {}
            _ => return None,
        }
        let of_masks = scene.masks().map(|(_, mask)| (mask.body.clone(), mask.substrate.clone()));
        (!scene.materials.values().any(is_file)).then(|| Self {
            beam: scene.source.beam.clone(),
            distance: scene.detector.distance,
            mode: scene.detector.mode,
            absorber: scene.detector.absorber.clone(),
            masks: of_masks.collect(),
            materials: scene.materials.clone(),
            surroundings: scene.surroundings.clone(),
            path_material: scene.path_material.clone(),
            sample: scene.objects.iter().map(|object| object.material.clone()).collect(),
        })
    }

    /// The nodes of this input, which `compute` gives where they are not known.
    pub(super) fn nodes(self, compute: impl FnOnce() -> Result<Nodes>) -> Result<Nodes> {
        let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, nodes)) = known().iter().find(|(input, _)| *input == self) {
            return Ok(nodes.clone());
        }
        let nodes = compute()?;
        let mut known = known();
        if known.len() == MOST {
            known.remove(0);
        }
        known.push((self, nodes.clone()));
        Ok(nodes)
    }
}
