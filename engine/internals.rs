//! Functions of the tests, benchmarks and fuzz targets beyond the public interface of beamlet. Nothing
//! here is stable, and nothing in the command line uses it.

/// The detector.
pub mod detector {
    pub use crate::detector::{DetectorModel, Noise};
    pub use crate::spectrum::excess_noise;

    /// The detector of a simulation, and the grid that takes its light.
    #[must_use]
    pub const fn model(simulation: &crate::Simulation) -> &DetectorModel {
        simulation.detector_model()
    }
}
/// Meshes: loaded although they have defects, examined, hashed.
pub mod geometry {
    pub use crate::geometry::adjacency::across_edges;
    pub use crate::geometry::load::{diagnose, load_lenient};
    pub use crate::geometry::read::file_hash;
}
/// Fits of curves.
pub mod retrieve {
    pub use crate::retrieve::curves::Curves;
    pub use crate::retrieve::fitter::{FitOptions, Fitter};
}
/// Instances of objects.
pub mod instances {
    pub use crate::geometry::instances::{InstanceTransform, transforms};
}
/// Vulkan.
pub mod gpu {
    pub use crate::gpu::{
        AccelerationStructure, Buffer, Device, DeviceKind, DeviceOptions, Fault, FaultAnswer,
        FaultyCall, Kernel, LazyKernel, Memory, PUSH_BYTES, Recorder, Submission,
    };
    pub use crate::shaders;
}
/// Images of one channel.
pub mod image {
    pub use crate::image::read;
}
/// The tables of docs/scene.md.
pub mod scene {
    pub use crate::scene::docs::{tables, title};
}
/// Structs and constants shared with shaders.
pub mod interface {
    pub use crate::interface::*;
}
/// The choice of a backend.
pub mod backend {
    pub use crate::run::simulation::choose;
}
/// Memory of a run.
pub mod memory {
    pub use crate::run::memory::{MemoryEstimate, estimate};
}
/// Lattices.
pub mod sampling {
    pub use crate::optics::Optics;
    pub use crate::run::simulation::cells::cells_of_rows;
    pub use crate::sampling::Lattice;
}
/// Rays.
pub mod trace {
    pub use crate::interface::{Ray, RayResult};
    pub use crate::media::MaterialTable;
    pub use crate::run::simulation::{moments, trace};
    pub use crate::trace::{CrossingFinder, DeviceSample, Moment, Moments, TraceKernels, Tracer};
}
