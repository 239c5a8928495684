#![no_main]

use beamlet_fuzz::readers::TIFF;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(TIFF.seeds), |input: &[u8]| (TIFF.read)(input));
