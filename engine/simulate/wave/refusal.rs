//! Scenes that waves do not compute.

use beamlet_core::{Error, Result};
use beamlet_gpu::EngineOptions;
use beamlet_model::optics::{MaskShape, Optics};
use beamlet_model::scene::{Refine, Scene, Scheme, Transport};

/// Refuses by name what lines of rays along x do not describe.
pub(crate) fn refuse(scene: &Scene, optics: &Optics, options: &EngineOptions) -> Result<()> {
    if scene.sampling.transport != Transport::Wave {
        return Ok(());
    }
    let wave = |found: &str, allowed: &str| {
        Err(Error::scene("sampling.transport", format!("\"wave\" with {found}"), allowed))
    };
    if scene.sampling.scheme == Scheme::Random {
        return wave("scheme = \"random\"", "scheme = \"cells\"");
    }
    if scene.sampling.refine == Refine::Device {
        return wave("refine = \"device\"", "refine = \"host\"");
    }
    if options.keep_moments {
        return wave("kept moments", "a run without --keep-moments");
    }
    if let Some(object) = scene.objects.iter().find(|object| object.roughness > 0.0) {
        let found = format!("the rough object \"{}\"", object.name);
        return wave(&found, "roughness = 0: roughness has no correlation length");
    }
    let Some(mask) = &optics.sample_mask else {
        return wave("no sample mask", "a scene with a sample mask");
    };
    for mask in [Some(mask), optics.detector_mask.as_ref()].into_iter().flatten() {
        if MaskShape::of(scene, mask, mask.distance(), None)?.thickness > 0.0 {
            let found = format!("thick bars in {}", mask.name());
            return wave(&found, "masks with a transmission in place of a material and thickness");
        }
    }
    let parts = optics.spot.placed();
    let first = parts.first().map(|part| (part.offset[1], part.deviation[1]));
    if parts.iter().any(|part| Some((part.offset[1], part.deviation[1])) != first) {
        return wave("a focal spot whose parts differ along z", "parts that are alike along z");
    }
    Ok(())
}
