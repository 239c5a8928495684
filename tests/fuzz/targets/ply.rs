#![no_main]

use beamlet_fuzz::readers::PLY;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(PLY.seeds), |input: &[u8]| (PLY.read)(input));
