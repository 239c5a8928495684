//! The sample on the device: uploaded once, poses are records.

use crate::accel::{Bvh, twofold};
use beamlet_core::Result;
use beamlet_core::numbers::{count, high_word, low_word, single};
use beamlet_geometry as geometry;
use beamlet_gpu::{AccelerationStructure, Buffer, Device};
use beamlet_interface as interface;
use beamlet_interface::{KIND_HEIGHTS, KIND_MOVED, PoseTransform, Surface};
use beamlet_model::media::{MaterialTable, ScatteringAxis, moment_words};
use beamlet_model::scene::{Motion, Scene, Transport};
use glam::DVec3;
use std::sync::Arc;

/// Error of the slope, rad, above which the first order is not enough at a surface.
pub(crate) const FIRST_ORDER_ERROR: f64 = 1e-9;

/// Incidence below which rays of lines are near grazing, largest critical angles: phases err by 2 % of the angle of
/// refraction there, and by 1/(4n²) of it at n critical angles.
const NEAR_GRAZING: f64 = 4.0;

/// The sample on the device, for both backends.
#[derive(Debug)]
pub struct DeviceSample {
    /// The records that shaders start from: at the mean constants of the spectrum, then at each
    /// of its nodes.
    records: Buffer,
    /// Number of materials.
    pub materials: u32,
    /// `KIND_` bits of the surfaces that are placed, which kernels have to know of.
    pub(super) kinds: u32,
    /// Leaves of the tree over the sample.
    pub(crate) leaves: u32,
    _buffers: Vec<Buffer>,
    _acceleration: Option<AccelerationStructure>,
}

impl DeviceSample {
    /// Uploads geometry, materials and poses; builds acceleration structures if `ray_query`.
    /// `across`: [`geometry::across_edges`] of the sample.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`], [`beamlet_core::Error::Device`], [`beamlet_core::Error::Mesh`].
    pub fn upload(
        device: &Arc<Device>,
        scene: &Scene,
        sample: &geometry::Sample,
        across: &[[u32; 3]],
        media: &MaterialTable,
        ray_query: bool,
    ) -> Result<Self> {
        let bvh = Bvh::build(sample, across, scene.displacement())?;
        Self::with_bvh(device, scene, sample, bvh, media, ray_query)
    }

    /// As [`DeviceSample::upload`], with the trees of the sample.
    pub(crate) fn with_bvh(
        device: &Arc<Device>,
        scene: &Scene,
        sample: &geometry::Sample,
        bvh: Bvh,
        media: &MaterialTable,
        ray_query: bool,
    ) -> Result<Self> {
        let Bvh {
            nodes,
            leaves,
            facets: _,
            boxes,
            neighbours,
            corner_normals,
            placed,
            prototypes,
            shapes,
            partners,
            kinds,
        } = bvh;
        let (poses, is_moved) = pose_transforms(scene, sample);
        let mut surfaces: Vec<Surface> =
            (0..).zip(&sample.components).map(|(i, c)| surface(scene, media, i, c)).collect();
        graze_by_partners(scene, media, sample, &mut surfaces);
        let has_heights = scene.sampling.transport == Transport::Wave
            && surfaces.iter().any(|surface| surface.roughness > 0.0);
        let kinds = kinds
            | media.kinds()
            | if has_heights { KIND_HEIGHTS } else { 0 }
            | if is_moved { KIND_MOVED } else { 0 };
        let materials = media.names.len();
        let buffers = vec![
            upload(device, "nodes", &nodes)?,
            upload(device, "leaves", &leaves)?,
            upload(device, "surfaces", &surfaces)?,
            device.upload("constants", &constants(media))?,
            upload(device, "materials of objects", &media.of_object)?,
            device.upload("poses", &poses)?,
            upload(device, "neighbours of leaves", &neighbours)?,
            upload(device, "places of instances", &placed)?,
            upload(device, "prototypes", &prototypes)?,
            upload(device, "shapes", &shapes)?,
            upload(device, "normals of corners", &corner_normals)?,
            upload(device, "shapes that cross a shape", &partners)?,
            upload(device, "axes of materials", &axes(media))?,
        ];
        let (prototype_count, sample_leaves) = (count(prototypes.len()), count(boxes.len()));
        // The host's copies are freed before the driver allocates memory to build in.
        drop((nodes, leaves, neighbours, placed));
        let is_queried = ray_query && !boxes.is_empty();
        let acceleration = is_queried.then(|| acceleration(device, boxes)).transpose()?;
        let table = (materials * size_of::<interface::Constants>()) as u64;
        let record = |table_index: u64| interface::Sample {
            nodes: buffers[0].address(),
            leaves: buffers[1].address(),
            surfaces: buffers[2].address(),
            constants: buffers[3].address() + table_index * table,
            object_materials: buffers[4].address(),
            poses: buffers[5].address(),
            neighbours: buffers[6].address(),
            placed: buffers[7].address(),
            prototypes: buffers[8].address(),
            shapes: buffers[9].address(),
            normals: buffers[10].address(),
            partners: buffers[11].address(),
            axes: buffers[12].address(),
            prototype_count,
            sample_leaves,
            seed: [low_word(scene.sampling.seed), high_word(scene.sampling.seed)],
            acceleration: acceleration.as_ref().map_or(0, AccelerationStructure::address),
        };
        let records: Vec<_> = (0..=media.weights.len() as u64).map(record).collect();
        let records = device.upload("sample", &records)?;
        Ok(Self {
            records,
            materials: count(materials),
            kinds,
            leaves: sample_leaves,
            _buffers: buffers,
            _acceleration: acceleration,
        })
    }

    /// Address of the record that shaders start from, at a node of the spectrum or (`None`) at
    /// the mean constants.
    #[must_use]
    pub fn record(&self, node: Option<usize>) -> u64 {
        let index = node.map_or(0, |n| n + 1);
        self.records.address() + (index * size_of::<interface::Sample>()) as u64
    }

    /// Words of the moments of a ray, without their head.
    pub(super) const fn moment_words(&self) -> usize {
        moment_words(self.materials as usize, self.kinds)
    }
}

/// Largest distance of anything in the sample at most, m, by the distance of a point.
fn farthest(sample: &geometry::Sample, distance: fn(DVec3) -> f64) -> f64 {
    let own = sample.vertices.iter().map(|vertex| DVec3::from_array(*vertex));
    let placed = sample.placed.iter().map(|placed| {
        let [low, high] = sample.bounds_of_placed(placed);
        low.abs().max(high.abs())
    });
    own.chain(placed).map(distance).fold(0.0, f64::max)
}

/// Uploads; a zero where there is nothing, for shaders that look at the first.
fn upload<T: bytemuck::Pod>(device: &Arc<Device>, name: &str, items: &[T]) -> Result<Buffer> {
    if items.is_empty() { device.upload(name, &[T::zeroed()]) } else { device.upload(name, items) }
}

/// Constants of all materials: the means, then of each node of the spectrum.
fn constants(media: &MaterialTable) -> Vec<interface::Constants> {
    std::iter::once(&media.mean())
        .chain(&media.constants)
        .flatten()
        .map(|c| interface::Constants {
            mu: single(c.mu),
            delta: single(c.delta),
            scattering: single(c.scattering),
        })
        .collect()
}

/// Directions of the scattering of all materials; none where all scatter alike in all directions.
fn axes(media: &MaterialTable) -> Vec<interface::ScatteringAxis> {
    let of = |axis: &Option<ScatteringAxis>| {
        let (direction, [across, along]) =
            axis.map_or((DVec3::ZERO, [1.0; 2]), |axis| (axis.direction, axis.shares));
        interface::ScatteringAxis {
            direction: direction.to_array().map(single),
            across: single(across),
            excess: single(along - across),
        }
    };
    media.axes.iter().map(of).collect()
}

/// The driver's acceleration structure of boxes, whose copy on the host is freed before it is built.
fn acceleration(device: &Arc<Device>, boxes: Vec<[[f32; 3]; 2]>) -> Result<AccelerationStructure> {
    let on_device = device.upload("boxes of the acceleration structure", &boxes)?;
    let number = count(boxes.len());
    drop(boxes);
    AccelerationStructure::build(device, &on_device, number)
}

/// Transforms of all poses; true if some pose moves the sample otherwise than by a turn about z.
fn pose_transforms(scene: &Scene, sample: &geometry::Sample) -> (Vec<PoseTransform>, bool) {
    let motions: Vec<Motion> = scene.poses().collect();
    let is_moved = !motions.iter().all(Motion::is_turn);
    let reach = match is_moved {
        true => farthest(sample, DVec3::length) + scene.displacement(),
        false => farthest(sample, |point| point.truncate().length()),
    };
    let transform = |motion: &Motion| pose_transform(scene, motion, reach);
    (motions.iter().map(transform).collect(), is_moved)
}

fn pose_transform(scene: &Scene, motion: &Motion, reach: f64) -> PoseTransform {
    let [[x, x_rest], [y, y_rest], [z, z_rest]] = motion.rows().map(twofold);
    let [position, position_rest] = twofold(motion.offset());
    PoseTransform {
        x,
        y,
        z,
        x_rest,
        y_rest,
        z_rest,
        position,
        position_rest,
        start: -single(1.01 * reach + 1e-6),
        analyser: single(scene.analyser_distance() - scene.source.distance),
    }
}

fn surface(
    scene: &Scene,
    media: &MaterialTable,
    index: u32,
    component: &geometry::Component,
) -> Surface {
    let [inside, outside] = media.sides(component.object, component.outside);
    let jump = media.step(inside, outside);
    let object = &scene.objects[component.object as usize];
    let grazing = match scene.sampling.transport {
        Transport::FirstOrder => 0.0,
        // Heights of rough surfaces belong to straight rays.
        Transport::Wave if object.roughness > 0.0 => 0.0,
        // Rays of lines below it are traced exactly at each energy.
        Transport::Wave => NEAR_GRAZING * (2.0 * media.largest_step(inside, outside)).sqrt(),
        Transport::Auto | Transport::Exact => least_cosine(jump),
    };
    Surface {
        object: component.object,
        inside,
        outside,
        hash: hash(index),
        grazing: single(grazing),
        roughness: single(object.roughness),
        correlation: single(object.correlation_length.unwrap_or(0.0)),
        smooth_: component.smooth.into(),
    }
}

/// Surfaces of shapes that cross graze by the largest step of delta to what may be around them.
fn graze_by_partners(
    scene: &Scene,
    media: &MaterialTable,
    sample: &geometry::Sample,
    surfaces: &mut [Surface],
) {
    if matches!(scene.sampling.transport, Transport::FirstOrder | Transport::Wave) {
        return;
    }
    let component_of = |at: u32| sample.placed[at as usize].component as usize;
    for (at, partners) in sample.partners.lists() {
        let own = component_of(at);
        let inside = surfaces[own].inside;
        let objects = partners.iter().map(|it| sample.components[component_of(*it)].object);
        let jump = objects
            .filter(|it| *it < sample.components[own].object)
            .map(|it| media.step(inside, media.of_object[it as usize]))
            .fold(0.0, f64::max);
        surfaces[own].grazing = surfaces[own].grazing.max(single(least_cosine(jump)));
    }
}

/// Cosine of incidence below which the first order is not enough at a step of delta: the error of
/// the slope is jump^2 / (2 c^3).
pub(crate) fn least_cosine(jump: f64) -> f64 {
    libm::cbrt(jump * jump / (2.0 * FIRST_ORDER_ERROR))
}

/// Mixes a component's index into 32 bits (splitmix64), so that sums of few of them differ.
pub(crate) fn hash(component: u32) -> u32 {
    let mut z = (u64::from(component) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 32) as u32 | 1
}
