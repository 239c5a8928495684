//! Place where rays are chosen: as the scene requests, or by the device.

use beamlet_geometry::Sample;
use beamlet_gpu::DeviceKind;
use beamlet_model::scene::{Refine, Scene, Scheme, Transport};

/// True if rays of a scene are chosen, either on the host or on the device.
fn applies(scene: &Scene) -> bool {
    let sampling = &scene.sampling;
    sampling.scheme == Scheme::Cells && sampling.transport != Transport::Wave
}

/// Settles where the rays of a loaded scene are chosen on a kind of device, and returns why there; nothing where
/// no rays are chosen.
#[must_use]
pub fn settle(scene: &mut Scene, sample: &Sample, kind: DeviceKind) -> Option<String> {
    let auto = scene.sampling.refine == Refine::Auto;
    if !applies(scene) || sample.is_empty() {
        if auto {
            scene.sampling.refine = Refine::Host;
        }
        return None;
    }
    let (place, reason) = match kind {
        DeviceKind::Cpu => (Refine::Host, "the device is a CPU"),
        // On the device drawn normals count half of all light as an error.
        _ if scene.objects.iter().any(|it| it.roughness > 0.0) => {
            (Refine::Host, "surfaces are rough")
        }
        _ => (Refine::Device, "the device is a GPU"),
    };
    if auto {
        scene.sampling.refine = place;
    }
    // Resumed runs state the chosen place: it has the same reason.
    let reason = if scene.sampling.refine == place { reason } else { "by the scene" };
    Some(reason.into())
}
