//! beamlet simulates edge-illumination X-ray phase contrast imaging from CAD models.
//!
//! A [`scene::Scene`] is loaded or built, an [`Engine`] opens a Vulkan device, and a run streams stacks
//! of frames, one per mask step, to a [`stack::Sink`] or returns them as `ndarray` arrays. Lengths are
//! metres, angles radians and energies keV unless a name says otherwise. Frame of reference and signs:
//! docs/physics.md.
//!
//! ```no_run
//! use beamlet::{Engine, EngineOptions, scene::Scene};
//!
//! let scene = Scene::load("scene.toml")?;
//! let stacks = Engine::open(&EngineOptions::default())?.simulate(&scene)?;
//! println!("{:?}", stacks.sample.shape());
//! # Ok::<(), beamlet::Error>(())
//! ```
//!
//! The engine never prints, exits or panics on input; messages go through the `log` crate.

pub mod check;
#[doc(hidden)]
pub mod cli_support;
mod engine;
mod ideal;
#[doc(hidden)]
pub mod internals;
mod labels;
#[doc(hidden)]
pub mod shaders;
pub mod sweep;

/// Compiles the code of docs/rust.md.
#[cfg(doctest)]
#[doc = include_str!("../docs/rust.md")]
struct Page;

pub use ndarray;

pub use beamlet_core::{Cancel, Error, Place, Result, RowsControl, Tally};
pub use beamlet_files::{
    AuditedError, FacetKink, RunProfile, RunRecord, SamplingError, SamplingSummary, SearchCounts,
};
pub use beamlet_geometry::{MaskMeshOptions, MaskPlace, mask_meshes};
pub use beamlet_gpu::{
    Backend, Compute, DeviceDescription, DeviceKind, EngineOptions, KernelCache, KernelProfile,
    Profile, Traffic,
};
#[doc(hidden)]
pub use beamlet_interface::shared_structs;
pub use beamlet_simulate::run::{
    Control, EdgeBlur, MemoryEstimate, Progress, RunEstimate, Simulation, ViewProgress, load_sample,
};
pub use beamlet_simulate::trace::{Ray, SurfaceCrossing, uncovered};
pub use engine::{Engine, devices};
pub use ideal::{IdealImages, IdealOptions, ideal};
pub use labels::truth;

/// Differences of images and stacks.
pub mod compare {
    pub use beamlet_recon::compare::{Difference, DifferencesTo, compare};
}
/// Geometry of the sample: meshes and shapes, read, checked and placed.
pub mod geometry {
    pub use beamlet_geometry::{
        BeamExtent, Component, DefectCount, DefectPlace, Defects, LoadProgress, LoadStep,
        MaskMeshOptions, MaskPlace, NamedMesh, ObjectSummary, Sample, Swept, check_clearance, load,
        mask_meshes, swept, write_meshes,
    };
}
/// Attenuation and refraction constants of materials.
pub mod material {
    pub use beamlet_model::material::{
        Constants, constants, constants_at, constants_over, of_builtin, range,
    };
}
/// Reconstruction: volumes of attenuation, refraction and dark field.
pub mod reconstruct {
    pub use beamlet_recon::reconstruct::{
        AstraFile, BeamEnergy, BeamHardening, Data, FbpOptions, Filter, GridChoice,
        HardeningChoice, HardeningRecord, Input, Iterated, IterativeOptions, LABELS, LostUse,
        LostView, LostViews, Made, Measured, Method, Model, MomentRecord, OpenVolumes, PixelCounts,
        Quantity, Reconstructed, ScanGeometry, Solver, Truth, Volume, VolumeEstimate, VolumeFormat,
        VolumeGrid, VolumePlan, VolumeRecord, VolumesTo, VoxelMask, VoxelShape, add_gradient_bias,
        deviation_weights, estimate, fbp, fill_images, find_axis, gradient_bias, iterate,
        phase_along_rows, prepare_sinograms, reaching_ends, reconstruct, suppress_rings,
        write_astra,
    };
}
/// Retrieval: from illumination curves to transmission, refraction and dark field.
pub mod retrieve {
    pub use beamlet_recon::retrieve::{
        Aperture, Background, Columns, Corrections, Drift, EmptyBeam, EmptyBeamOfView, Images,
        ImagesTo, Input, Lattice, MaskCurve, Method, Plane, ReadRows, Record, Region, Response,
        RetrieveOptions, RetrievedArrays, Retriever, RimError, ViewCorrection, Weights, flags,
        offsets, retrieve, retrieve_arrays, rim_errors,
    };
}
/// Scenes: the model in SI units, and its files.
pub mod scene {
    pub use beamlet_model::scene::{
        Absorber, Anode, ApertureLattice, ApertureShape, BarLayer, Beam, Blur, BodyShape, Counts,
        Detector, DetectorMode, Exposure, Filter, Fly, Instances, KernelFile, MaskBody, MaskSpec,
        MaterialSpec, Mesh, MeshFormat, Microstructure, Motion, Normals, Object, Packing,
        PackingAmount, PackingKind, PackingRegion, Pattern, Photons, Placement, Pose, Quality,
        RandomRays, Rectangle, RotationAxis, Sampling, Scan, ScanErrors, Scatter, Scattering,
        ScatteringAxis, Scene, Scheme, Shape, ShapeOrMesh, Source, SpectrumOrigin, SpectrumSpec,
        Spot, SpotFit, SpotPart, Substrate, Tolerances, Transport, View,
    };
}
/// Spectra and their energy nodes.
pub mod spectrum {
    pub use beamlet_model::spectrum::{
        Nodes, Spectrum, TOLERANCE, excess_noise, nodes, nodes_with, response,
    };
}
/// Stacks of frames, and the sinks that take them.
pub mod stack {
    pub use beamlet_files::{
        Abilities, ArraySink, CallbackSink, CountStacks, FORMAT_VERSION, Format, FrameOrder,
        GeometryFile, JoinOptions, JoinedPart, Maps, OpenRun, Order, Platform, RunCheck,
        RunDirectory, RunFile, RunRecord, RunStart, RunState, SamplingError, SamplingSummary,
        SearchCounts, Sink, StackFile, StackShape, Stacks, ViewAngles, ViewRange, canonical,
        check_run, is_of_run, is_same_place, join, layout, refuse_overlap, views,
    };
}
