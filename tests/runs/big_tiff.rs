//! TIFF stacks beyond 4 GiB with the real program, and another reader of them.
//!
//! Ignored by default: minutes, 5 GiB of disk, and `tifffile` from the Python package index.
//! `cargo test --release --test runs -- big_tiff:: --include-ignored --nocapture`
#![cfg(all(feature = "cli", target_os = "linux"))]

use crate::support::program::{Workplace, ended};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::Read;
use std::process::{Command, Output};
use std::time::Instant;

/// 66 pages of 64 MiB; those of the eleven steps of a view differ.
const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [4096, 4096]
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 11 }
angles = { from = "0 deg", to = "5 deg", count = 6 }
"#
);

/// Reads page by page what the pages' own directories say, and compares the views with progress.log.
const READER: &str = r#"
import hashlib, sys
from pathlib import Path
import numpy, tifffile

run = Path(sys.argv[1])
sums = dict(line.split()[0::2][:2] for line in (run / "progress.log").read_text().splitlines())
for name, views in [("flat", 1), ("sample", 6)]:
    with tifffile.TiffFile(run / f"{name}.tif") as file:
        assert len(file.pages) == 11 * views, len(file.pages)
        print(name, "BigTIFF" if file.is_bigtiff else "TIFF", file.imagej_metadata)
        assert file.is_bigtiff == (name == "sample")
        for view in range(views):
            found = hashlib.sha256()
            for step in range(11):
                page = file.pages[11 * view + step].asarray()
                assert page.shape == (4096, 4096) and page.dtype == numpy.float32
                found.update(page.tobytes())
            wanted = sums[name if name == "flat" else f"sample/{view}"]
            assert wanted == "sha256:" + found.hexdigest(), (name, view)
"#;

/// Runs another program in the folder of the scene.
fn other(place: &Workplace, program: impl AsRef<OsStr>, words: &[&str]) {
    succeeded(&Command::new(program).args(words).current_dir(place.path("")).output().unwrap());
}

fn succeeded(output: &Output) {
    ended(output, 0);
    println!("{}", String::from_utf8_lossy(&output.stdout).trim_end());
}

#[test]
#[ignore = "minutes, 5 GiB of disk, and tifffile from the Python package index"]
fn stacks_beyond_4_gib_are_read_back_by_beamlet_and_tifffile() {
    let place = Workplace::new(SCENE);
    let began = Instant::now();
    let passed = |what: &str| println!("{what} after {:.0} s", began.elapsed().as_secs_f64());
    succeeded(&place.simulate(&["--format", "tiff"]));
    let size = fs::metadata(place.path("run/sample.tif")).unwrap().len();
    assert!(size > 4 << 30, "{size}");
    let mut head = [0; 8];
    File::open(place.path("run/sample.tif")).unwrap().read_exact(&mut head).unwrap();
    assert_eq!(&head, b"II\x2b\0\x08\0\0\0");
    passed("written");
    // Each page by its directory, against the checksums of what was written.
    succeeded(&place.beamlet(&["compare", "run", "run"]));
    succeeded(&place.beamlet(&["check", "run"]));
    passed("read by beamlet");
    other(&place, "python3", &["-m", "venv", "venv"]);
    let packages = ["install", "--quiet", "--disable-pip-version-check", "numpy", "tifffile"];
    other(&place, place.path("venv/bin/pip"), &packages);
    other(&place, place.path("venv/bin/python"), &["-c", READER, "run"]);
    passed("read by tifffile");
}
