//! Ordered crossings of rays, for pictures of the sample: the visible surface, and surfaces behind it.

use super::ray::Ray;
use super::tracer::TraceKernels;
use super::upload::DeviceSample;
use beamlet_core::Result;
use beamlet_gpu::{Buffer, Device, Memory, Pace};
use beamlet_interface as interface;
use beamlet_interface::{Crossing, CrossingsPush, GROUP};
use std::sync::Arc;

/// Rays whose crossings lie on the device at once.
const RAYS: u32 = 1 << 15;

/// A crossing of a ray with a surface of the sample.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SurfaceCrossing {
    /// Along the optical axis in the beam frame, m.
    pub y: f32,
    /// Index of the object whose surface it is.
    pub object: u32,
    /// The ray goes into the object here, and does not leave it.
    pub entering: bool,
    /// Unit normal, away from the object's material, beam frame.
    pub normal: [f32; 3],
}

impl From<&interface::SurfaceCrossing> for SurfaceCrossing {
    fn from(met: &interface::SurfaceCrossing) -> Self {
        Self { y: met.y, object: met.object, entering: met.entering != 0, normal: met.normal }
    }
}

/// Surfaces of objects that enclose the same volume count as one within this distance along the normal, m.
const COINCIDE: f64 = 1e-8;

/// The crossings of a ray, in order, at which another object wins behind than before: others lie in an
/// object that is listed later, or in another instance of the same.
#[must_use]
pub fn uncovered(met: &[SurfaceCrossing]) -> Vec<SurfaceCrossing> {
    let coincide = |a: &SurfaceCrossing, b: &SurfaceCrossing| {
        let cosine = a.normal[1].abs().max(b.normal[1].abs());
        a.entering == b.entering
            && a.object != b.object
            && f64::from((a.y - b.y).abs() * cosine) <= COINCIDE
    };
    let mut inside: Vec<u32> = Vec::new();
    let mut found = Vec::with_capacity(met.len());
    for (at, it) in met.iter().enumerate() {
        if !it.entering
            && let Some(own) = inside.iter().position(|other| *other == it.object)
        {
            inside.swap_remove(own);
        }
        let [before, after] = [&met[..at], &met[at + 1..]];
        let beside = if it.entering { after } else { before };
        let covered = inside.iter().any(|other| *other >= it.object)
            || beside.iter().any(|other| other.object > it.object && coincide(it, other));
        if !covered {
            found.push(*it);
        }
        if it.entering {
            inside.push(it.object);
        }
    }
    found
}

/// Finds the first crossings of rays, with the software BVH on any device.
#[derive(Debug)]
pub struct CrossingFinder {
    device: Arc<Device>,
    sample: Arc<DeviceSample>,
    kernels: Arc<TraceKernels>,
    most: u32,
    /// Rays at once.
    room: u32,
    rays: Buffer,
    met: Buffer,
    counts: Buffer,
    lists: Buffer,
}

impl CrossingFinder {
    /// A finder of up to `most` (at least 1) crossings of a ray, for up to `room` rays at once.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`], or [`beamlet_core::Error::Device`] where the driver refuses.
    pub fn new(
        device: &Arc<Device>,
        kernels: &Arc<TraceKernels>,
        sample: &Arc<DeviceSample>,
        most: u32,
        room: u32,
    ) -> Result<Self> {
        // Lists of the rays of a workgroup are interleaved.
        let room = room.clamp(1, RAYS).next_multiple_of(GROUP);
        kernels.crossings.get()?;
        let most = most.max(1);
        let of_all = |each: usize| u64::from(room) * u64::from(most) * each as u64;
        let make = |name: &str, bytes: u64| device.buffer(name, bytes, Memory::Device);
        Ok(Self {
            device: device.clone(),
            sample: sample.clone(),
            kernels: kernels.clone(),
            most,
            room,
            rays: make("rays", u64::from(room) * size_of::<interface::Ray>() as u64)?,
            met: make("crossings", of_all(size_of::<interface::SurfaceCrossing>()))?,
            lists: make("lists of crossings", of_all(size_of::<Crossing>()))?,
            counts: make("counts of crossings", u64::from(room) * 4)?,
        })
    }

    /// Calls `visit` with the index of every ray, in order, and its first crossings, front to
    /// back.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`].
    pub fn find(
        &self,
        rays: &[Ray],
        mut visit: impl FnMut(usize, &[SurfaceCrossing]),
    ) -> Result<()> {
        let most = self.most as usize;
        let kernel = self.kernels.crossings.get()?;
        let mut pace = Pace::new(4096, GROUP, RAYS);
        let mut done = 0;
        let mut met_by_ray = Vec::with_capacity(most);
        for batch in rays.chunks(self.room as usize) {
            let count = u32::try_from(batch.len()).unwrap_or(self.room);
            let packed: Vec<interface::Ray> = batch.iter().map(interface::Ray::from).collect();
            self.rays.write(0, &packed)?;
            let mut first = 0;
            while first < count {
                let push = CrossingsPush {
                    sample_ref: self.sample.record(None),
                    rays: self.rays.address(),
                    met: self.met.address(),
                    counts: self.counts.address(),
                    count: count.min(first + pace.size()),
                    first,
                    lists: self.lists.address(),
                    capacity: self.most,
                    stride: GROUP,
                };
                let groups = (push.count - first).div_ceil(GROUP);
                let took = self.device.run(|r| {
                    r.dispatch(kernel, bytemuck::bytes_of(&push), [groups, 1, 1]);
                })?;
                first = push.count;
                pace.adapt(took);
            }
            let counts = self.counts.read::<u32>(0, batch.len())?;
            let met = self.met.read::<interface::SurfaceCrossing>(0, batch.len() * most)?;
            for (ray, (count, met)) in counts.iter().zip(met.chunks(most)).enumerate() {
                met_by_ray.clear();
                met_by_ray.extend(met[..*count as usize].iter().map(SurfaceCrossing::from));
                visit(done + ray, &met_by_ray);
            }
            done += batch.len();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_in_later_objects_are_covered_and_coincident_faces_are_one() {
        let at = |y: f32, object: u32, entering: bool| SurfaceCrossing {
            y,
            object,
            entering,
            normal: [0.0, if entering { -1.0 } else { 1.0 }, 0.0],
        };
        // 0 and 1 cross, 1 is left last; 2 is a bore in 1 whose mouth is the face of 1; 3 twice.
        let met = [
            at(1.0, 0, true),
            at(2.0, 1, true),
            at(2.0, 2, true),
            at(3.0, 0, false),
            at(4.0, 2, false),
            at(5.0, 1, false),
            at(6.0, 3, true),
            at(7.0, 3, true),
            at(8.0, 3, false),
            at(9.0, 3, false),
        ];
        let found: Vec<f32> = uncovered(&met).iter().map(|it| it.y).collect();
        assert_eq!(found, [1.0, 2.0, 4.0, 5.0, 6.0, 9.0]);
        assert_eq!(uncovered(&met)[1].object, 2);
    }
}
