//! Functions of the tests, benchmarks and fuzz targets beyond the public interface of beamlet. Nothing
//! here is stable, and nothing in the command line uses it.

/// The detector.
pub mod detector {
    pub use beamlet_model::spectrum::excess_noise;
    pub use beamlet_simulate::detector::{DetectorModel, Noise};

    /// The detector of a simulation, and the grid that takes its light.
    #[must_use]
    pub const fn model(simulation: &beamlet_simulate::run::Simulation) -> &DetectorModel {
        simulation.detector_model()
    }
}
/// Meshes: loaded although they have defects, examined, hashed.
pub mod geometry {
    pub use beamlet_geometry::adjacency::across_edges;
    pub use beamlet_geometry::load::{diagnose, load_lenient};
    pub use beamlet_geometry::read::file_hash;
}
/// Fits of curves.
pub mod retrieve {
    pub use beamlet_recon::retrieve::curves::SlitCurve;
    pub use beamlet_recon::retrieve::fitter::Fitter;
    pub use beamlet_recon::retrieve::{BackgroundTerm, ValueNoise};
}
/// Instances of objects.
pub mod instances {
    pub use beamlet_packing::{InstanceTransform, transforms};
}
/// Vulkan.
pub mod gpu {
    pub use crate::shaders;
    pub use beamlet_gpu::{
        AccelerationStructure, Buffer, Device, DeviceKind, DeviceOptions, Fault, FaultAnswer,
        FaultyCall, Kernel, LazyKernel, Memory, PUSH_BYTES, Recorder, Submission,
    };
}
/// Images of one channel.
pub mod image {
    pub use beamlet_core::image::read;
}
/// The tables of docs/scene.md.
pub mod scene {
    pub use beamlet_model::scene::docs::{tables, title};
}
/// Structs and constants shared with shaders.
pub mod interface {
    pub use beamlet_interface::*;
}
/// The choice of a backend.
pub mod backend {
    pub use beamlet_simulate::run::simulation::choose;
}
/// Memory of a run.
pub mod memory {
    pub use beamlet_simulate::run::memory::{MemoryEstimate, estimate};
}
/// Designs that are lit from one walk.
pub mod designs {
    pub use beamlet_simulate::run::simulation::designs::{WalkKey, light};
}
/// Lattices.
pub mod sampling {
    pub use beamlet_model::optics::Optics;
    pub use beamlet_simulate::run::simulation::cells::cells_of_rows;
    pub use beamlet_simulate::sampling::Lattice;
}
/// Rays.
pub mod trace {
    pub use beamlet_interface::{Ray, RayResult};
    pub use beamlet_model::media::MaterialTable;
    pub use beamlet_simulate::run::simulation::{moments, trace};
    pub use beamlet_simulate::trace::{
        CrossingFinder, DeviceSample, Moment, Moments, TraceKernels, Tracer,
    };
}
/// Structure functions of bodies at random places.
pub mod microstructure {
    pub use beamlet_model::microstructure::{Bodies, variances};
}
