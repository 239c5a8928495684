#![no_main]

use beamlet_fuzz::readers::STL;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(STL.seeds), |input: &[u8]| (STL.read)(input));
