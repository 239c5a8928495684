#![no_main]

use beamlet_fuzz::readers::EXR;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(EXR.seeds), |input: &[u8]| (EXR.read)(input));
