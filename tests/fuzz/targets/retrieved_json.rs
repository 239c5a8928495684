//! retrieved.json: any bytes are a record or refused, and a record that reads can be written and
//! read again. The images beside it are compared, or refused by its inputs.
#![no_main]

use beamlet::retrieve::Record;
use beamlet_fuzz::{PLACE, npy, seeds, with_control, write};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

static IMAGES: LazyLock<PathBuf> = LazyLock::new(|| {
    let path = PLACE.join("retrieved");
    std::fs::create_dir_all(&path).expect("a new folder");
    let header = b"\x93NUMPY\x01\x00\x00\x00{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 3), }\n";
    write(&path.join("transmission.npy"), &npy::repaired(0, header));
    path
});

fn records() -> Vec<(u8, Vec<u8>)> {
    let mut record = Record::default();
    record.version = "0.1.0".into();
    record.method = "gaussian".into();
    record.weights = "none".into();
    record.gain = Some(1.5);
    record.sources = vec!["flat".into(), "sample".into()];
    record.files = [("a.csv".into(), "0".repeat(64))].into();
    record.inputs = [("transmission.npy".into(), "0".repeat(64))].into();
    record.offsets = vec![-1e-5, 0.0, 1e-5];
    record.magnification = 1.5;
    record.lever_arm = 0.6;
    record.angle_per_shift = -2.5;
    record.shape = [1, 2, 3];
    record.units = [("transmission".into(), "1".into())].into();
    record.flags = [(1, "dark: no light".into()), (2, "edge".into())].into();
    record.flagged = [(1, 3)].into();
    vec![(0, serde_json::to_vec_pretty(&record).expect("it can be written"))]
}

fuzz_target!(init: seeds(|| with_control(records())), |input: &[u8]| {
    let Some((_, file)) = input.split_first() else { return };
    let path = IMAGES.join("retrieved.json");
    write(&path, file);
    if let Ok(record) = Record::read(&path) {
        write(&path, &serde_json::to_vec(&record).expect("it can be written"));
        assert_eq!(Record::read(&path).expect("it can be read again"), record);
    }
    if let Ok(found) = beamlet::compare::compare(&IMAGES, &IMAGES, None, &mut beamlet::RowsControl::default()) {
        assert!(found.iter().all(|difference| difference.within(0.0)));
    }
});
