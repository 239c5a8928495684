//! EXR frames: any bytes are read or refused.
#![no_main]

use beamlet_fuzz::{exr, frames, put, seeds};
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(exr::seeds), |input: &[u8]| {
    let Some((&control, file)) = input.split_first() else { return };
    frames::read_stack(&put("a.exr", &exr::repaired(control, file)));
});
