//! One run: every view of a scene, traced, illuminated and handed to a sink.

mod control;
pub(crate) mod edge_blur;
mod engine;
mod estimate;
pub(crate) mod memory;
pub(crate) mod quality;
pub(crate) mod simulation;

pub(crate) use control::watching;
pub use control::{Blocks, Control, Progress, ViewProgress, load_sample};
pub use edge_blur::EdgeBlur;
pub use engine::{Engine, EngineOptions, devices};
pub use estimate::RunEstimate;
pub use memory::MemoryEstimate;
pub use simulation::Simulation;
