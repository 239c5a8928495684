//! Retrieval and reconstruction of beamlet.

pub mod compare;
pub mod reconstruct;
pub mod retrieve;
