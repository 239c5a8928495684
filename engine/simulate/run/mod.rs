//! One run: every view of a scene, traced, illuminated and handed to a sink.

mod control;
pub mod edge_blur;
mod estimate;
pub mod memory;
pub mod quality;
pub mod simulation;
mod simulator;

pub use control::{Control, Progress, ViewProgress, load_sample, watching};
pub use edge_blur::EdgeBlur;
pub use estimate::RunEstimate;
pub use memory::MemoryEstimate;
pub use simulation::Simulation;
pub use simulator::Simulator;
