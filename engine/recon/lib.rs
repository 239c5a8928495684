//! Internal to beamlet: retrieval and reconstruction.

pub mod compare;
pub mod reconstruct;
pub mod retrieve;
