//! Arrays that lost or gained bytes, and their headers.

use super::{SCENE, assert_says};
use crate::support::program::{Workplace, ended};
use std::sync::OnceLock;

const ARRAYS: [&str; 5] =
    ["flat.npy", "sample.npy", "dark.npy", "counts/flat.npy", "counts/sample.npy"];

/// A finished run with counts, and its arrays.
fn finished() -> (Workplace, Vec<Vec<u8>>) {
    static MADE: OnceLock<Workplace> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let photons = "pitch = \"150 um\"\nphotons = 1000\n";
        let place = Workplace::new(&SCENE.replace("pitch = \"150 um\"\n", photons));
        ended(&place.simulate(&["--format", "npy"]), 0);
        place
    });
    let place = made.copy();
    let arrays = ARRAYS.map(|name| place.bytes(name)).to_vec();
    (place, arrays)
}

/// Damages each array in turn; after `--resume` all have their bytes again. Says what was told
/// of each.
fn mended(damage: impl Fn(&[u8]) -> Vec<u8>) -> Vec<String> {
    let (place, arrays) = finished();
    let mut told = Vec::new();
    for (name, whole) in ARRAYS.into_iter().zip(&arrays) {
        place.write(name, &damage(whole));
        let message = ended(&place.simulate(&["--resume"]), 0);
        assert_says(&message, &[name]);
        for (name, whole) in ARRAYS.into_iter().zip(&arrays) {
            assert_eq!(place.bytes(name), *whole, "{name} after: {message}");
        }
        told.push(message);
    }
    told
}

#[test]
fn arrays_that_lost_their_last_bytes_lose_the_last_view_alone() {
    let told = mended(|whole| whole[..whole.len() - 5].to_vec());
    let [flat, sample, dark, counts_flat, counts_sample] = told.try_into().unwrap();
    for (message, view) in [(flat, "(flat)"), (counts_flat, "(flat)"), (dark, "(dark)")] {
        assert_says(&message, &[view, "it is simulated again"]);
    }
    for message in [sample, counts_sample] {
        assert_says(&message, &["sample.npy: has ", " were written", "sample/3"]);
        assert!(!message.contains("sample/2"), "{message}");
    }
}

#[test]
fn arrays_that_gained_bytes_keep_every_view() {
    for message in mended(|whole| [whole, b"abc".as_slice()].concat()) {
        assert!(!message.contains("it is simulated again"), "{message}");
        assert_says(&message, &[" were written"]);
    }
}

#[test]
fn a_header_that_says_another_shape_is_written_again() {
    let told = mended(|whole| {
        let mut changed = whole.to_vec();
        let shape = changed.iter().position(|byte| *byte == b'(').unwrap();
        changed[shape + 1] = b'7';
        changed
    });
    for message in told {
        assert!(!message.contains("it is simulated again"), "{message}");
        assert_says(&message, &["has another header than was written"]);
    }
}

#[test]
fn bytes_lost_in_the_middle_make_the_views_behind_them_again_and_no_other() {
    let (place, arrays) = finished();
    let whole = &arrays[1];
    // Three bytes of view 1, so that later ones are shifted.
    let view = 4 * 2 * 2 * 8;
    let at = whole.len() - 3 * view + 7;
    let lost = [&whole[..at], &whole[at + 3..]].concat();
    place.write("sample.npy", &lost);
    let message = ended(&place.simulate(&["--resume"]), 0);
    assert_says(&message, &["sample/1 differs", "sample/2 differs", "sample/3"]);
    assert!(!message.contains("sample/0"), "{message}");
    assert_eq!(place.bytes("sample.npy"), *whole);
}

#[test]
fn a_damaged_array_is_mended_before_its_run_goes_on() {
    let (place, arrays) = finished();
    // As if it had been interrupted after the second view.
    let log = String::from_utf8(place.bytes("progress.log")).unwrap();
    let head: String = log.split_inclusive('\n').filter(|l| !l.contains("sample/3")).collect();
    place.write("progress.log", head.as_bytes());
    let run = String::from_utf8(place.bytes("run.json")).unwrap();
    place.write("run.json", run.replace("\"done\"", "\"running\"").as_bytes());
    place.write("counts/sample.npy", &arrays[4][..arrays[4].len() - 200]);
    let message = ended(&place.simulate(&["--resume"]), 0);
    assert_says(&message, &["counts/sample.npy", "sample/2", "simulated again"]);
    for (name, whole) in ARRAYS.into_iter().zip(&arrays) {
        assert_eq!(place.bytes(name), *whole, "{name}");
    }
}
