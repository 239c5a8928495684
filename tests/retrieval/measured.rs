//! Frames of a laboratory on the command line: patterns for names in a folder, and steps that are left out.

use crate::noise::{COLUMNS, ROWS, counts, scene_text};
use crate::stacks::even;
use crate::support::program::{done, ended, run};
use beamlet::retrieve::{Input, Record};
use beamlet::stack::Maps;
use ndarray::{Array4, Axis};
use ndarray_npy::write_npy;
use std::fs::{self, File};
use std::path::Path;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray16;

const COUNT: usize = 11;

/// Counts of flat and of two views, with a set-up for them.
fn set_up(here: &Path) -> [Array4<f32>; 2] {
    let offsets = even(COUNT, 25.0);
    fs::write(here.join("set_up.toml"), scene_text(2, &offsets)).unwrap();
    [(1, 1), (2, 2)].map(|(views, seed)| counts(views, &offsets, [5e3, 0.0], seed))
}

fn retrieve(here: &Path, words: &str, images: &str) -> Record {
    let line = format!(
        "retrieve --geometry set_up.toml --gain 1 --format npy -q --overwrite -o {images} {words}"
    );
    done(here, &line);
    Record::read(&here.join(images).join("retrieved.json")).unwrap()
}

/// Every image of two folders has the same bits.
fn equal(here: &Path, folders: [&str; 2]) {
    let [a, b] = folders.map(|name| Maps::open(here.join(name)).unwrap());
    for name in a.names() {
        for view in 0..a.views() {
            let [a, b] = [&a, &b].map(|maps| maps.map(name, view).unwrap());
            assert!(a.iter().zip(&b).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}, {view}");
        }
    }
}

#[test]
fn frames_are_named_by_patterns_in_one_folder() {
    let place = tempfile::tempdir().unwrap();
    let here = place.path();
    let stacks = set_up(here);
    fs::create_dir(here.join("raw")).unwrap();
    for (name, stack) in ["FLAT", "PROJ"].into_iter().zip(&stacks) {
        write_npy(here.join(format!("{name}.npy")), stack).unwrap();
        let frames = stack.outer_iter().flat_map(|view| {
            view.outer_iter().map(|frame| frame.mapv(|y| y as u16)).collect::<Vec<_>>()
        });
        for (number, frame) in frames.enumerate() {
            let file = File::create(here.join(format!("raw/{name}_{number}.tif"))).unwrap();
            let mut encoder = TiffEncoder::new(file).unwrap();
            let values = frame.as_slice().unwrap();
            encoder.write_image::<Gray16>(COLUMNS as u32, ROWS as u32, values).unwrap();
        }
    }
    fs::write(here.join("raw/notes.txt"), "of the experiment").unwrap();
    let record = retrieve(here, "--flat raw/FLAT_* --sample raw/PROJ_*.tif", "images");
    retrieve(here, "--flat FLAT.npy --sample PROJ.npy", "of_stacks");
    equal(here, ["images", "of_stacks"]);
    assert_eq!(record.sources, ["raw/FLAT_*", "raw/PROJ_*.tif"]);
    assert_eq!(record.frames["raw/FLAT_*"][..2], ["FLAT_0.tif", "FLAT_1.tif"]);
    assert_eq!(record.frames["raw/PROJ_*.tif"].len(), 2 * COUNT);
    assert!(record.inputs.contains_key("raw/PROJ_*.tif"), "{:?}", record.inputs);
    // Another command finds the frames from beside the images.
    let again = Input::reopened(&record, &here.join("images")).unwrap();
    assert_eq!((again.views(), again.steps()), (2, [COUNT, COUNT]));
    done(here, "view images -o pictures --show curve --pixel 3,2");

    let words = "retrieve --geometry set_up.toml --sample raw/PROJ_* -o none --flat";
    for (flat, message) in [
        ("raw/EMPTY_*", "raw/EMPTY_*: names no frames"),
        ("raw/*", "which differ in more than numbers"),
        ("missing/FLAT_*", "missing/FLAT_*: cannot be read"),
    ] {
        let found = ended(&run(here, &format!("{words} {flat}")), 1);
        assert!(found.contains(message), "{found}");
    }
    let found = ended(
        &run(here, "retrieve --geometry set_up.toml --sample raw/PROJ_* -o raw --flat raw/FLAT_*"),
        1,
    );
    assert!(found.contains("which this command reads"), "{found}");
}

#[test]
fn omitted_steps_leave_the_images_of_the_other_steps() {
    let place = tempfile::tempdir().unwrap();
    let here = place.path();
    let stacks = set_up(here);
    // The beam was lost in step 7, and step 2 is to be left out, too.
    let kept: Vec<usize> = (0..COUNT).filter(|step| ![2, 7].contains(step)).collect();
    for (name, mut stack) in ["flat", "sample"].into_iter().zip(stacks) {
        write_npy(here.join(format!("kept_{name}.npy")), &stack.select(Axis(1), &kept)).unwrap();
        stack.index_axis_mut(Axis(1), 7).fill(0.0);
        write_npy(here.join(format!("{name}.npy")), &stack).unwrap();
    }
    let all = even(COUNT, 25.0);
    let offsets: Vec<String> = kept.iter().map(|step| format!("{} um", all[*step])).collect();
    fs::write(here.join("offsets.txt"), offsets.join("\n")).unwrap();
    let record = retrieve(here, "--flat flat.npy --sample sample.npy --omit-steps 7,2", "images");
    let words = "--flat kept_flat.npy --sample kept_sample.npy --offsets offsets.txt";
    let of_kept = retrieve(here, words, "of_kept");
    equal(here, ["images", "of_kept"]);
    assert_eq!((record.omitted_steps, record.offsets), (vec![2, 7], of_kept.offsets));
    let record = Record::read(&here.join("images/retrieved.json")).unwrap();
    let again = Input::reopened(&record, &here.join("images")).unwrap();
    assert_eq!((again.views(), again.steps()), (2, [9, 9]));
    assert_eq!(again.sample_rows(1, 0..2).unwrap().dim(), (9, 2, COLUMNS));
    done(here, "view images -o pictures --show curve --pixel 3,2");

    for (words, message) in [
        ("--omit-steps 11", "omit_steps: found step 11; allowed: 0 to 10"),
        ("--omit-steps 0,1,2,3,4,5,6,7,8", "at least 3"),
    ] {
        let line = format!(
            "retrieve --geometry set_up.toml --flat flat.npy --sample sample.npy -o none \
             --method exact-curve {words}"
        );
        let found = ended(&run(here, &line), 1);
        assert!(found.contains(message), "{found}");
        assert!(!here.join("none").exists());
    }
}
