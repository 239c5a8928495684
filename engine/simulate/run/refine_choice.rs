//! Place where rays are chosen: as the scene requests, or by the device.

use beamlet_core::{Error, Result};
use beamlet_geometry::Sample;
use beamlet_gpu::DeviceKind;
use beamlet_model::scene::{Refine, Scene, Scheme, Transport};

/// Properties of a scene that refinement on the device does not know; `None`: it knows all. `energies`: number
/// of energy nodes.
fn unknown(scene: &Scene, energies: usize, keeps_moments: bool) -> Option<&'static str> {
    if energies > 1 && scene.sampling.transport == Transport::Exact {
        Some("a spectrum of several energies and transport = \"exact\"")
    } else if keeps_moments {
        Some("kept moments")
    } else {
        None
    }
}

/// True if rays of a scene are chosen, either on the host or on the device.
fn applies(scene: &Scene) -> bool {
    let sampling = &scene.sampling;
    sampling.scheme == Scheme::Cells && sampling.transport != Transport::Wave
}

/// Refuses refinement on the device of a scene that it does not know.
///
/// # Errors
/// [`Error::Scene`].
pub(crate) fn refuse(scene: &Scene, energies: usize, keeps_moments: bool) -> Result<()> {
    if scene.sampling.refine != Refine::Device || !applies(scene) {
        return Ok(());
    }
    match unknown(scene, energies, keeps_moments) {
        Some(found) => {
            Err(Error::scene("sampling.refine", format!("device, with {found}"), "host"))
        }
        None => Ok(()),
    }
}

/// Settles where the rays of a loaded scene are chosen on a kind of device, and returns why there; nothing where
/// no rays are chosen.
#[must_use]
pub fn settle(
    scene: &mut Scene,
    sample: &Sample,
    energies: usize,
    (kind, keeps_moments): (DeviceKind, bool),
) -> Option<String> {
    let auto = scene.sampling.refine == Refine::Auto;
    if !applies(scene) || sample.is_empty() {
        if auto {
            scene.sampling.refine = Refine::Host;
        }
        return None;
    }
    let (place, reason) = match unknown(scene, energies, keeps_moments) {
        Some(found) => (Refine::Host, format!("the device does not know {found}")),
        None => by_kind(kind),
    };
    if auto {
        scene.sampling.refine = place;
    }
    // Resumed runs state the chosen place: it has the same reason.
    Some(if scene.sampling.refine == place { reason } else { "by the scene".into() })
}

/// Place of a sample that the device knows, and why there.
fn by_kind(kind: DeviceKind) -> (Refine, String) {
    match kind {
        DeviceKind::Cpu => (Refine::Host, "the device is a CPU".into()),
        _ => (Refine::Device, "the device is a GPU".into()),
    }
}
