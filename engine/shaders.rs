//! The compiled shaders of the engine, as SPIR-V words. The table is in build.rs.

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
