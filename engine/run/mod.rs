//! One run: every view of a scene, traced, illuminated and handed to a sink.

mod control;
pub(crate) mod edge_blur;
mod engine;
mod estimate;
pub(crate) mod memory;
pub(crate) mod quality;
pub(crate) mod simulation;

pub(crate) use control::watching;
pub use control::{Control, Progress, RowsControl, ViewProgress, load_sample};
pub use edge_blur::EdgeBlur;
pub use engine::{Engine, EngineOptions, devices};
pub use estimate::RunEstimate;
pub(crate) use memory::PROGRAM;
pub use memory::{MemoryEstimate, require_memory};
pub use simulation::Simulation;
