//! progress.log: whatever it says, a run is read as it was committed or refused. Lengths and
//! checksums of views that the run has are made good. A control of [`beamlet_fuzz::OTHER`]
//! damages the log of a run in NPY.
#![no_main]

use beamlet::stack::Format;
use beamlet_fuzz::{OTHER, RAW_HASHES, read, run, seeds, with_control, write};
use libfuzzer_sys::fuzz_target;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;

/// A run with its log: the second and third words of each line by the first.
struct Run {
    path: PathBuf,
    text: String,
    words: BTreeMap<String, [String; 2]>,
}

static RUNS: LazyLock<[Run; 2]> = LazyLock::new(|| {
    [("exr", Format::Exr), ("npy", Format::Npy)].map(|(name, format)| {
        let path = run::fixture(name, format);
        let text = String::from_utf8(read(&path.join("progress.log"))).expect("a text");
        let words = text.lines().filter_map(|line| {
            let mut words = line.split(' ').map(str::to_owned);
            Some((words.next()?, [words.next()?, words.next()?]))
        });
        Run { path, words: words.collect(), text }
    })
});

fn logs() -> Vec<(u8, Vec<u8>)> {
    let [exr, npy] = RUNS.each_ref().map(|run| run.text.clone().into_bytes());
    vec![(0, exr.clone()), (RAW_HASHES, exr), (OTHER, npy)]
}

/// Lines of views that the run has, with their lengths and checksums.
fn repaired(run: &Run, file: &[u8]) -> Vec<u8> {
    let of_line = |line: &[u8]| {
        let Ok(text) = std::str::from_utf8(line) else { return line.to_vec() };
        let mut words: Vec<&str> = text.split(' ').collect();
        if let Some(good) = run.words.get(words[0]) {
            for (word, good) in words.iter_mut().skip(1).zip(good) {
                *word = good;
            }
        }
        words.join(" ").into_bytes()
    };
    file.split(|byte| *byte == b'\n').map(of_line).collect::<Vec<_>>().join(&b'\n')
}

fuzz_target!(init: seeds(|| with_control(logs())), |input: &[u8]| {
    let Some((&control, file)) = input.split_first() else { return };
    let run = &RUNS[usize::from(control & OTHER != 0)];
    let file = if control & RAW_HASHES == 0 { repaired(run, file) } else { file.to_vec() };
    write(&run.path.join("progress.log"), &file);
    run::read(&run.path);
});
