#![no_main]

use beamlet_fuzz::readers::NPY;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(NPY.seeds), |input: &[u8]| (NPY.read)(input));
