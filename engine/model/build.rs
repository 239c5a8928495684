//! Unpacks the tables of the elements.
#![allow(clippy::print_stdout, reason = "cargo reads it")]

use std::path::{Path, PathBuf};
use std::{env, fs};
use xraydb::XrayDb;
use xraydb_data::XrayDatabase;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    write_elements(&out.join("elements.bin"));
}

/// Writes the tables of the elements that the library reads, not packed: unpacking all of them takes 0.1 s,
/// and half of their bytes are tables that no formula needs.
fn write_elements(path: &Path) {
    let elements = XrayDb::try_new().expect("the crate has its tables");
    let bytes = postcard::to_allocvec(elements.raw()).expect("tables of plain values");
    let mut tables: XrayDatabase = postcard::from_bytes(&bytes).expect("such bytes were written");
    tables.xray_transitions.clear();
    tables.coster_kronig.clear();
    tables.waasmaier.clear();
    for widths in
        [&mut tables.keski_rahkonen_krause, &mut tables.krause_oliver, &mut tables.corelevel_widths]
    {
        widths.clear();
    }
    for element in &mut tables.chantler {
        for attenuation in [&mut element.mu_photo, &mut element.mu_incoh, &mut element.mu_total] {
            attenuation.clear();
        }
    }
    let bytes = postcard::to_allocvec(&tables).expect("tables of plain values");
    fs::write(path, bytes).expect("OUT_DIR can be written");
}
