//! Internal to beamlet: instances of an object, one shape or mesh in many places.
//!
//! A point p of the prototype (the object's shape or mesh, in metres, centred where the object's
//! placement says so) is at `placement(instance(p))`: each instance scales, rotates and moves it
//! about the object's own origin; then `scale`, `rotate` and `position` of the object place all
//! instances as a group.
//!
//! `table` reads the instances of a file. `packing` makes random arrangements: `periodic` packs
//! discs and spheres in a periodic box, of which those wholly inside the `region` are kept, so
//! that their density is the same everywhere up to the wall; `fibres` places fibres of random
//! direction.

mod fibres;
mod packing;
mod periodic;
mod region;
mod relax;
mod share;
mod sorted;
mod table;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use beamlet_core::watch::Task;
use beamlet_core::{Error, Result};
use beamlet_model::scene::{Instances, Object, Scene};

/// Place of one instance of an object, in the frame of the object before its own placement. The order is
/// scale, rotate, position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InstanceTransform {
    /// Scale along x and y of the prototype. > 0.
    pub scale: f64,
    /// Scale along z of the prototype. It is `scale`, but for packed fibres: these differ in diameter
    /// and not in length. > 0.
    pub scale_z: f64,
    /// Rotation, of unit length.
    pub rotation: DQuat,
    /// Translation, m.
    pub position: DVec3,
}

impl InstanceTransform {
    /// The map from the prototype to the frame of the object.
    #[must_use]
    pub fn affine(&self) -> DAffine3 {
        let scale = DVec3::new(self.scale, self.scale, self.scale_z);
        let linear = DMat3::from_quat(self.rotation) * DMat3::from_diagonal(scale);
        DAffine3::from_mat3_translation(linear, self.position)
    }
}

/// The instances of an object of the scene, in a fixed order: from its file, or its packing. An object
/// without instances has one, at its origin.
///
/// # Errors
/// [`Error::Scene`] with file, line and column where a file of positions has wrong columns, units or
/// numbers, or with the key of a packing that cannot be made and the fill or count that was reached;
/// [`Error::File`] where the file cannot be read or is not the one that the scene records.
pub fn transforms(scene: &Scene, object: &Object) -> Result<Vec<InstanceTransform>> {
    watched(scene, object, Task::unwatched())
}

/// As [`transforms`], watched.
///
/// # Errors
///
/// As [`transforms`]; [`Error::Interrupted`].
pub fn watched(scene: &Scene, object: &Object, task: Task<'_>) -> Result<Vec<InstanceTransform>> {
    match &object.instances {
        None => Ok(vec![InstanceTransform {
            scale: 1.0,
            scale_z: 1.0,
            rotation: DQuat::IDENTITY,
            position: DVec3::ZERO,
        }]),
        Some(Instances::File(path)) => table::read(&scene.checked(path)?),
        Some(Instances::Packing(spec)) => {
            let index = scene.objects.iter().position(|other| other.name == object.name);
            let key = scene.object_key(index.unwrap_or_default(), "");
            packing::pack(&key, object, spec, task)
        }
    }
}

/// The error of a packing at a key of its object.
fn refused(object: &str, key: &str, found: String, allowed: String) -> Error {
    Error::scene(format!("{object}.{key}"), found, allowed)
}
