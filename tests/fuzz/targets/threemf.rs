#![no_main]

use beamlet_fuzz::readers::THREEMF;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(THREEMF.seeds), |input: &[u8]| (THREEMF.read)(input));
