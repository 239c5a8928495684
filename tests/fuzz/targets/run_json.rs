//! run.json: whatever it says, a run is read as it was committed or refused, and a record that
//! reads can be written and read again. A control of [`beamlet_fuzz::OTHER`] damages the record of
//! a run in NPY.
#![no_main]

use beamlet::stack::{Format, RunFile};
use beamlet_fuzz::{OTHER, read, run, seeds, with_control, write};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

static RUNS: LazyLock<[PathBuf; 2]> =
    LazyLock::new(|| [("exr", Format::Exr), ("npy", Format::Npy)].map(|(n, f)| run::fixture(n, f)));

fn records() -> Vec<(u8, Vec<u8>)> {
    let [exr, npy] = RUNS.each_ref().map(|run| read(&run.join("run.json")));
    vec![(0, exr), (OTHER, npy)]
}

fuzz_target!(init: seeds(|| with_control(records())), |input: &[u8]| {
    let Some((&control, file)) = input.split_first() else { return };
    let run = &RUNS[usize::from(control & OTHER != 0)];
    let path = run.join("run.json");
    write(&path, file);
    if let Ok(record) = RunFile::read(&path) {
        write(&path, &serde_json::to_vec(&record).expect("it can be written"));
        assert_eq!(RunFile::read(&path).expect("it can be read again"), record);
    }
    run::read(run);
});
