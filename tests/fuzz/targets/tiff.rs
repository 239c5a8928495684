//! TIFF stacks and images: any bytes are read or refused. A control of [`beamlet_fuzz::OTHER`]
//! reads an image (kernels, spots).
#![no_main]

use beamlet_fuzz::{OTHER, frames, put, seeds, tiff};
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(tiff::seeds), |input: &[u8]| {
    let Some((&control, file)) = input.split_first() else { return };
    let path = put("a.tif", &tiff::repaired(control, file));
    match control & OTHER {
        0 => frames::read_stack(&path),
        _ => {
            let _ = beamlet::internals::image::read(&path);
        }
    }
});
