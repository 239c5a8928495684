#![no_main]

use beamlet_fuzz::readers::OBJ;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(OBJ.seeds), |input: &[u8]| (OBJ.read)(input));
