//! Scenes, and rays of runs, that waves do not compute.

use super::{inline, plan};
use crate::detector::DetectorModel;
use crate::run::quality;
use beamlet_core::tally::Tally;
use beamlet_core::{Error, Result};
use beamlet_model::optics::Optics;
use beamlet_model::scene::{Object, Scene, Scheme, Transport};
use beamlet_model::spectrum;

/// A warning where more of the light of the touched patches of a run by waves than its tolerance crosses surfaces near
/// grazing.
pub(crate) fn grazing_warning(scene: &Scene, tally: &Tally) -> Option<String> {
    let share = tally.grazing_light as f64 * 1e-9 / tally.patches.max(1) as f64;
    let is_much = share > scene.sampling.tolerances().light;
    (scene.sampling.transport == Transport::Wave && is_much).then(|| {
        format!(
            "waves: {:.2} % of the light of the patches that the sample touches crosses surfaces near grazing or is \
             totally reflected; it is computed by rays, without diffraction, and stays in its row",
            100.0 * share
        )
    })
}

/// Refuses a scene that waves do not compute, whatever its transport; no device is needed.
///
/// # Errors
/// [`Error::Scene`] with the reason; the spectrum and the materials of the masks.
pub fn refuse_by_waves(scene: &Scene) -> Result<()> {
    let mut scene = quality::resolved(scene)?;
    scene.sampling.transport = Transport::Wave;
    let detector = DetectorModel::of(&scene)?;
    refuse(&scene, detector.optics())?;
    let nodes = spectrum::nodes(&scene)?;
    let nodes: Vec<_> = nodes.energies.iter().copied().zip(nodes.weights).collect();
    plan::refuse_masks(&scene, detector.optics(), &nodes)
}

/// Refuses by name what lines of rays along x do not describe.
pub(crate) fn refuse(scene: &Scene, optics: &Optics) -> Result<()> {
    if scene.sampling.transport != Transport::Wave {
        return Ok(());
    }
    let wave = |found: &str, allowed: &str| {
        Err(Error::scene("sampling.transport", format!("\"wave\" with {found}"), allowed))
    };
    if scene.sampling.scheme == Scheme::Random {
        return wave("scheme = \"random\"", "scheme = \"cells\"");
    }
    let has_no_length =
        |object: &&Object| object.roughness > 0.0 && object.correlation_length.is_none();
    if let Some(object) = scene.objects.iter().find(has_no_length) {
        let found = format!("the rough object \"{}\" without correlation_length", object.name);
        return wave(&found, "roughness = 0, or a correlation_length of the object");
    }
    if optics.sample_mask.is_none() {
        inline::refuse(scene, optics)?;
    }
    for mask in optics.sample_mask.iter().chain(&optics.detector_mask) {
        let (found, allowed) = if mask.openings(mask.distance()).ends().count() > 1 {
            ("several slits in a period of", "masks without apertures or shifts")
        } else if mask.is_tapered() {
            ("the tapered bars of", "masks without a taper")
        } else if mask.has_walls() {
            ("bars of several layers in", "bars of one material")
        } else if mask.has_substrate() {
            ("the substrate of", "masks without a substrate")
        } else {
            continue;
        };
        return wave(&format!("{found} {}", mask.name()), allowed);
    }
    let parts = optics.spot.placed();
    let first = parts.first().map(|part| (part.offset[1], part.deviation[1]));
    if parts.iter().any(|part| Some((part.offset[1], part.deviation[1])) != first) {
        return wave("a focal spot whose parts differ along z", "parts that are alike along z");
    }
    Ok(())
}
