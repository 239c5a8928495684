//! STL files: any bytes either load or are refused. The count of triangles follows the length.
#![no_main]

use beamlet_fuzz::{meshes, seeds};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(init: seeds(meshes::stl_seeds), |input: &[u8]| {
    let _ = beamlet::internals::geometry::diagnose(Path::new("a.stl"), &meshes::stl(input), 1e-3);
});
