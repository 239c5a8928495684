#![no_main]

use beamlet_fuzz::readers::SCENE;
use beamlet_fuzz::seeds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: seeds(SCENE.seeds), |input: &[u8]| (SCENE.read)(input));
