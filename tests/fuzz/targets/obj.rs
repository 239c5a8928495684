//! OBJ files: any bytes either load or are refused.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|bytes: &[u8]| {
    let _ = beamlet::geometry::examine(Path::new("a.obj"), bytes, 1e-3);
});
