//! Whole runs of tiny scenes with keys at the ends of their ranges: they end with light or an error.
#![no_main]

use beamlet::Engine;
use beamlet_fuzz::tiny_run;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static ENGINE: LazyLock<Engine> = LazyLock::new(tiny_run::engine);

fn seeds() -> Vec<Vec<u8>> {
    (0..16).map(tiny_run::drawn).collect()
}

fuzz_target!(init: beamlet_fuzz::seeds(seeds), |bytes: &[u8]| {
    let _ = tiny_run::run(&ENGINE, &tiny_run::scene_of(bytes));
});
