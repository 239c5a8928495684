//! `beamlet report` and `beamlet view` of a reconstruction; see `report.rs` for the browser.

use super::report::{chromium, explore_with};
use crate::support::program::{done, ended, run, workplace};
use crate::support::{everything, sample};
use beamlet::ndarray::Array3;
use ndarray_npy::{read_npy, write_npy};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const SCENE: &str = r#"
source = { distance = "1.2 m", spot = ["0 um", "0 um"], energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [16, 3], pitch = "150 um" }
scan = { angles = { from = "0 deg", to = "360 deg", count = 24 } }
materials.plastic = { mu = "50 /m", delta = 4e-7 }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.4 mm", height = "6 mm" } }
material = "plastic"
position = ["0.2 mm", "0 mm", "0 mm"]
"#;

/// Volumes of a rod; mu is what the test knows: x + 20 y + 400 z.
fn volumes() -> TempDir {
    let place = workplace(SCENE);
    let path = place.path();
    write_npy(path.join("mu.npy"), &Array3::<f32>::from_elem((24, 3, 16), 0.01)).unwrap();
    let words =
        "--geometry scene.toml --quantity mu --method cgls --iterations 3 --truth --format npy";
    done(path, &format!("reconstruct mu.npy {words} -o volume -q"));
    let known = Array3::from_shape_fn((3, 16, 16), |(z, y, x)| (x + 20 * y + 400 * z) as f32);
    write_npy(path.join("volume/mu.npy"), &known).unwrap();
    place
}

fn page(path: &Path, more: &str) -> String {
    done(path, &format!("report volume --overwrite {more}"));
    fs::read_to_string(path.join("volume.html")).unwrap()
}

#[test]
fn the_page_shows_slices_values_and_histograms() {
    let place = volumes();
    let printed = done(place.path(), "report volume");
    assert_eq!(printed, "volume.html\n");
    let page = fs::read_to_string(place.path().join("volume.html")).unwrap();
    for word in ["https:", "src=", "@import", "url(http", "fetch(", "XMLHttpRequest", "{{", "{%"] {
        assert!(!page.replacen("/*! https:", "", 1).contains(word), "{word}");
    }
    let Some(program) = chromium() else {
        println!("left out: there is no chromium");
        return;
    };
    let script = include_str!("explore_volume.js");
    // With `BEAMLET_ALL` at the width of a screen, too.
    for width in sample(vec![390, 1400], 2) {
        let verdict = explore_with(&program, place.path(), &page, width, script);
        assert!(verdict.failed().is_empty(), "{width}: {:#?}", verdict.failed());
        assert_eq!(verdict.checks.len(), 42, "{width}: every check was made");
    }
    // The exploration is no proof unless it fails on a page that is broken. A page has two faults; with
    // `BEAMLET_ALL` each fault has a page of its own.
    let faults = [
        (
            "slider.addEventListener(\"input\"",
            "slider.addEventListener(\"other\"",
            "a slider moves",
        ),
        ("panels.forEach(drawSlice);", "drawSlice(panels[0]);", "a slider moves"),
        ("high - 1 - Math.floor", "high - Math.floor", "a click chooses"),
        ("\nbegin();", "\nbegin();\nconsole.error('on purpose');", "on purpose"),
    ];
    let pages: Vec<_> = match everything() {
        true => faults.iter().map(|fault| vec![*fault]).collect(),
        false => vec![vec![faults[0], faults[3]]],
    };
    for faults in pages {
        let mut broken = page.clone();
        for (right, wrong, _) in &faults {
            assert!(broken.contains(right), "{right}");
            broken = broken.replacen(right, wrong, 1);
        }
        let failed =
            explore_with(&program, place.path(), &broken, 1400, script).failed().join("\n");
        for (_, wrong, named) in faults {
            assert!(failed.contains(named), "{wrong} went unnoticed: {failed}");
        }
    }
}

#[test]
fn a_page_of_volumes_with_a_limit_is_binned_and_says_so() {
    let place = volumes();
    let [whole, small] = ["", "--most 1KiB"].map(|more| page(place.path(), more));
    assert!(
        !whole.contains("means over blocks")
            && small.contains("blocks of 2 × 2 × 2 of the [16, 16, 3]")
    );
    let data = |page: &str| {
        let arrays = page.split("<script type=\"text/plain\"").skip(1);
        arrays.map(|part| part.split_once("</script>").unwrap().0.len()).sum::<usize>()
    };
    // Base64 makes a third more; names and paddings come on top, three arrays.
    assert!(data(&small) < 1024 * 4 / 3 + 3 * 60 && data(&whole) > 4 * data(&small));
}

#[test]
fn pictures_of_volumes_have_a_bar_a_unit_and_a_range() {
    let place = volumes();
    let path = place.path();
    let printed = done(path, "view volume -o pictures --format svg --slice 2");
    let names = ["labels", "mu", "mu_truth"];
    let files = names
        .iter()
        .flat_map(|name| ["z_0002", "y", "x"].map(|slice| format!("pictures/{name}_{slice}.svg")));
    let expected: Vec<String> = files.chain(["pictures/residuals_mu.svg".to_owned()]).collect();
    assert_eq!(printed.lines().collect::<Vec<_>>(), expected);
    let text = |name: &str| fs::read_to_string(path.join("pictures").join(name)).unwrap();
    let slice = text("mu_z_0002.svg");
    // x + 20 y + 400 z from z = 2 on; a fifth of 1.6 mm, rounded.
    for words in [
        "x [mm]",
        "y [mm]",
        ">200 µm<",
        "1/m]",
        "z = 100 µm, method cgls",
        "values from 800 to 1115 1/m",
    ] {
        assert!(slice.contains(words), "{words}: {slice}");
    }
    let labels = text("labels_z_0002.svg");
    for words in [">rod (plastic)<", ">surroundings (vacuum)<", "z = 100 µm"] {
        assert!(labels.contains(words), "{words}: {labels}");
    }
    assert!(!labels.contains("values from"), "{labels}");
    let section = text("mu_y.svg");
    assert!(section.contains("z [mm]") && section.contains("y = 50 µm"), "{section}");
    let residuals = text("residuals_mu.svg");
    assert!(residuals.contains("iteration 3 is used: rms"), "{residuals}");
    // Labels of 32-bit floats are the same objects.
    let file = path.join("volume/labels.npy");
    let found: Array3<u16> = read_npy(&file).unwrap();
    assert!(found.iter().any(|label| *label == 1), "{found:?}");
    write_npy(&file, &found.mapv(f32::from)).unwrap();
    done(path, "view volume -o floats --format svg --slice 2 --map labels");
    assert_eq!(fs::read_to_string(path.join("floats/labels_z_0002.svg")).unwrap(), labels);
    let one = done(path, "view volume -o one --map mu --range mu=0..60 --width 400");
    assert_eq!(one.lines().count(), 4, "{one}");
    let picture = fs::read(path.join("one/mu_z_0001.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG") && picture[16..20] == 400_u32.to_be_bytes());
}

/// A picture of labels is the same for every format of the volumes.
#[test]
fn labels_are_integers_in_every_format_that_has_them() {
    let place = volumes();
    let path = place.path();
    let words = "reconstruct mu.npy --geometry scene.toml --quantity mu --truth -q -o";
    let expected = done(path, "view volume -o npy --format svg --map labels");
    let read = |folder: &str, line: &str| {
        let name = line.split_once('/').map_or(line, |(_, name)| name);
        fs::read_to_string(path.join(folder).join(name))
            .unwrap()
            .replace("method fbp", "method cgls")
    };
    for format in ["tiff", "exr", "mhd"] {
        done(path, &format!("{words} of_{format} --format {format}"));
        done(path, &format!("view of_{format} -o {format} --format svg --map labels"));
        for line in expected.lines() {
            assert_eq!(read(format, line), read("npy", line), "{format} {line}");
        }
    }
    let voxels = 16 * 16 * 3;
    assert_eq!(fs::metadata(path.join("of_mhd/labels.raw")).unwrap().len(), 2 * voxels);
    assert_eq!(fs::metadata(path.join("of_mhd/mu.raw")).unwrap().len(), 4 * voxels);
    let header = fs::read_to_string(path.join("of_mhd/labels.mhd")).unwrap();
    assert!(header.contains("ElementType = MET_USHORT\n"), "{header}");
    // Labels of 32-bit floats are read, too.
    let raw = fs::read(path.join("of_mhd/labels.raw")).unwrap();
    let floats = raw.chunks(2).flat_map(|it| f32::from(u16::from(it[0])).to_le_bytes());
    fs::write(path.join("of_mhd/labels.raw"), floats.collect::<Vec<u8>>()).unwrap();
    fs::write(path.join("of_mhd/labels.mhd"), header.replace("MET_USHORT", "MET_FLOAT")).unwrap();
    done(path, "view of_mhd -o float --format svg --map labels");
    for line in expected.lines() {
        assert_eq!(read("float", line), read("npy", line), "{line}");
    }
    fs::write(path.join("of_mhd/labels.mhd"), header.replace("MET_USHORT", "MET_DOUBLE")).unwrap();
    let message = ended(&run(path, "view of_mhd -o none --map labels"), 1);
    assert!(message.contains("labels.mhd") && message.contains("MET_USHORT"), "{message}");
}
