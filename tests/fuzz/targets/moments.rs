//! Moments of a run: whatever their bytes, they are cut to other lattices or refused. A control
//! of [`beamlet_fuzz::OTHER`] has the lattice of another scene.
//!
//! Seeds are those of a run of tests/fuzz/scene.toml, which `BEAMLET_FUZZ_RUN` names.
#![no_main]

use beamlet_fuzz::{OTHER, RAW_HASHES, moments, read, run, seeds, write};
use libfuzzer_sys::fuzz_target;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Words of a ray's moments: those of the surroundings, resin and water.
const WORDS: u32 = 15;
static RUN: LazyLock<PathBuf> = LazyLock::new(|| run::begun("moments"));

fn repaired(control: u8, file: &[u8]) -> Vec<u8> {
    moments::repaired(control, file, run::SCENE.as_bytes(), WORDS)
}

fn of_a_run() -> Vec<(u8, Vec<u8>)> {
    let run = std::env::var_os("BEAMLET_FUZZ_RUN").expect("BEAMLET_FUZZ_RUN names a run");
    let bytes = read(&Path::new(&run).join("moments/view_0000.bin"));
    // Seeds are of use where repairs leave them what they are.
    let same = |file: &[u8]| {
        let repaired = repaired(0, file);
        assert!(file[56..file.len() - 32] == repaired[56..file.len() - 32]);
    };
    same(&bytes);
    let pieces = moments::pieces(&bytes, WORDS as usize);
    pieces.iter().for_each(|piece| same(piece));
    // … and where they are read.
    for other in [false, true] {
        write(&RUN.join("moments/view_0000.bin"), &repaired(0, &bytes));
        assert!(run::read_moments(&RUN, other).is_some_and(|cells| cells > 100));
    }
    let with = |file: Vec<u8>| [(0, file.clone()), (OTHER, file)];
    let mut seeds: Vec<_> = pieces.into_iter().flat_map(with).collect();
    seeds.push((RAW_HASHES, seeds[0].1.clone()));
    seeds
}

fuzz_target!(init: seeds(of_a_run), |input: &[u8]| {
    let Some((&control, file)) = input.split_first() else { return };
    write(&RUN.join("moments/view_0000.bin"), &repaired(control, file));
    let _ = run::read_moments(&RUN, control & OTHER != 0);
});
