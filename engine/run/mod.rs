//! One run: every view of a scene, traced, illuminated and handed to a sink.

mod control;
pub(crate) mod edge_blur;
mod estimate;
pub(crate) mod memory;
pub(crate) mod quality;
pub(crate) mod simulation;
mod simulator;

pub(crate) use control::watching;
pub use control::{Control, Progress, ViewProgress, load_sample};
pub use edge_blur::EdgeBlur;
pub use estimate::RunEstimate;
pub use memory::MemoryEstimate;
pub use simulation::Simulation;
pub(crate) use simulator::Simulator;
