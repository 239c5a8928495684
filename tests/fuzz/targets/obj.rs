//! OBJ files: any bytes either load or are refused.
#![no_main]

use beamlet_fuzz::{bare_seeds, meshes};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(init: bare_seeds(meshes::obj_seeds), |bytes: &[u8]| {
    let _ = beamlet::internals::geometry::diagnose(Path::new("a.obj"), bytes, 1e-3);
});
