//! 3MF files: any archive either loads or is refused. Inputs are models, put into an archive here,
//! unless their control leaves the archive to them.
#![no_main]

use beamlet_fuzz::{meshes, seeds};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(init: seeds(meshes::threemf_seeds), |bytes: &[u8]| {
    let file = meshes::threemf(bytes);
    let _ = beamlet::internals::geometry::diagnose(Path::new("a.3mf"), &file, 1e-3);
});
