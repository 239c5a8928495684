//! `beamlet reconstruct` by the program: volumes in files, dithers, truth, and bad input.

#[cfg(target_os = "linux")]
use crate::support::gate::{Gate, Held};
use crate::support::program::{beamlet, done, ended, run, workplace};
use beamlet::ndarray::{Array3, s};
use beamlet::reconstruct::{OpenVolumes, Quantity, VolumeRecord};
use ndarray_npy::{ReadNpyExt, WriteNpyExt};
use std::fs::{self, File};
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

/// A rod beside the axis in a fan with a cone of three rows.
pub(super) const SCENE: &str = r#"
source = { distance = "1.2 m", spot = "10 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [32, 3], pitch = "150 um" }
sample_mask = { distance = "1.1 m", projected_aperture = "30 um", transmission = 0.0 }
detector_mask = { projected_aperture = "30 um", transmission = 0.0 }
sampling = { tolerance = 5e-3, angle_tolerance = "1 urad" }
materials.plastic = { mu = "50 /m", delta = 4e-7 }
[scan]
mask_offsets = { from = "-20 um", to = "20 um", count = 7 }
angles = { from = "0 deg", to = "360 deg", count = 36 }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.7 mm", height = "6 mm" } }
material = "plastic"
position = ["0.4 mm", "0.2 mm", "0 mm"]
"#;

/// A run that is retrieved, for all tests.
pub(super) fn place() -> &'static TempDir {
    static PLACE: OnceLock<TempDir> = OnceLock::new();
    PLACE.get_or_init(|| {
        let place = workplace(SCENE);
        done(place.path(), "simulate scene.toml -q -o run --format npy");
        done(place.path(), "retrieve run -q --format npy");
        place
    })
}

pub(super) fn volume(folder: &Path, quantity: Quantity) -> Array3<f32> {
    OpenVolumes::open(folder).unwrap().volume(quantity).unwrap().values
}

/// Mean of the voxels whose centres are within `radius` of an axis along z, m.
pub(super) fn mean_about(folder: &Path, quantity: Quantity, axis: [f64; 2], radius: f64) -> f64 {
    let volume = OpenVolumes::open(folder).unwrap().volume(quantity).unwrap();
    let (mut sum, mut count) = (0.0, 0.0);
    for (at, value) in volume.values.indexed_iter() {
        let [x, y, _] = volume.grid.centre(at);
        if (x - axis[0]).hypot(y - axis[1]) <= radius {
            (sum, count) = (sum + f64::from(*value), count + 1.0);
        }
    }
    sum / count
}

/// Mean in the rod of the scene.
fn mean_of_rod(folder: &Path, quantity: Quantity) -> f64 {
    mean_about(folder, quantity, [4e-4, 2e-4], 4e-4)
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The number in a column of the line of a table that begins with some words.
pub(super) fn number(table: &str, line: &str, column: &str) -> f64 {
    let mut lines = table.lines();
    let at = lines.next().unwrap().split(',').position(|name| name == column).unwrap();
    let found = lines.find(|text| text.starts_with(line)).unwrap();
    found.split(',').nth(at).unwrap().parse().unwrap()
}

#[test]
fn a_run_becomes_the_same_volumes_in_every_format() {
    let here = place().path();
    for format in ["tiff", "npy", "exr", "mhd"] {
        done(here, &format!("reconstruct run -o {format} --format {format} -q"));
    }
    assert_eq!(names(&here.join("npy")), ["dark-field.npy", "delta.npy", "mu.npy", "volume.json"]);
    assert_eq!(names(&here.join("exr/mu")).len(), 3);
    for quantity in Quantity::ALL {
        let first = volume(&here.join("tiff"), quantity);
        assert_eq!(first.dim(), (3, 32, 32));
        for other in ["npy", "exr", "mhd"] {
            assert_eq!(volume(&here.join(other), quantity), first, "{other}");
        }
    }
    // The header of a MetaImage, in mm.
    let header = fs::read_to_string(here.join("mhd/mu.mhd")).unwrap();
    for line in ["DimSize = 32 32 3", "ElementType = MET_FLOAT", "ElementDataFile = mu.raw"] {
        assert!(header.contains(line), "{header}");
    }
    let value = |key: &str| -> Vec<f64> {
        let line = header.lines().find(|line| line.starts_with(key)).unwrap();
        line.split_once('=').unwrap().1.split_whitespace().map(|n| n.parse().unwrap()).collect()
    };
    assert!(value("ElementSpacing").iter().all(|side| (side - 0.1).abs() < 1e-12));
    assert!((value("Offset")[0] + 1.55).abs() < 1e-12 && (value("Offset")[2] + 0.1).abs() < 1e-12);
    // Page by page the TIFF has the spacing of its slices, for ImageJ.
    let tiff = fs::read(here.join("tiff/mu.tif")).unwrap();
    let text = String::from_utf8_lossy(&tiff[..2000]).into_owned();
    assert!(text.contains("slices=3\nunit=um\nspacing=100"), "{text}");
    // What is there stays, but for --overwrite, which leaves nothing of the other format.
    let again = run(here, "reconstruct run -o npy");
    assert!(ended(&again, 1).contains("--overwrite"));
    done(here, "reconstruct run -o npy -q --overwrite --quantity mu --format mhd");
    assert_eq!(names(&here.join("npy")), ["mu.mhd", "mu.raw", "volume.json"]);
    fs::write(here.join("npy/mine.txt"), "of others").unwrap();
    let refused = run(here, "reconstruct run -o npy --overwrite");
    assert!(ended(&refused, 1).contains("mine.txt"));
}

#[test]
fn volumes_and_truth_have_the_constants_of_the_rod() {
    let here = place().path();
    let out = done(here, "reconstruct run -o truth --truth --format npy");
    let errors = fs::read_to_string(here.join("truth/errors.csv")).unwrap();
    assert!(out.contains(&errors), "{out}");
    // 36 views, a Gaussian as the curve, apertures that see a fifth: some per cent (tomography).
    let mu = mean_of_rod(&here.join("truth"), Quantity::Mu);
    assert!((mu / 50.0 - 1.0).abs() < 0.06, "{mu}");
    let delta = mean_of_rod(&here.join("truth"), Quantity::Delta);
    assert!((delta / 4e-7 - 1.0).abs() < 0.25, "{delta}");
    assert_eq!(number(&errors, "rod,plastic,mu,", "truth").to_bits(), 50_f64.to_bits());
    let record = VolumeRecord::read(&here.join("truth")).unwrap();
    assert_eq!(record.version, env!("CARGO_PKG_VERSION"));
    assert_eq!(record.commit.as_deref(), option_env!("BEAMLET_COMMIT"));
    assert_eq!(record.labels[&1], "rod (plastic)");
    // Labels are the discs of a closed form, by the centre of each voxel.
    let labels =
        Array3::<u16>::read_npy(File::open(here.join("truth/labels.npy")).unwrap()).unwrap();
    for (at, label) in labels.indexed_iter() {
        let [x, y, _] = record.grid().centre(at);
        let from_rim = (x - 4e-4).hypot(y - 2e-4) - 7e-4;
        assert!(from_rim.abs() < 1e-7 || (*label > 0) == (from_rim < 0.0), "{at:?}: {label}");
    }
    let truth = Array3::<f32>::read_npy(File::open(here.join("truth/mu_truth.npy")).unwrap());
    assert_eq!(truth.unwrap(), labels.mapv(|label| 50.0 * f32::from(label)));
}

#[test]
fn five_dithers_interleave_by_their_places() {
    let place = workplace(SCENE);
    let here = place.path();
    let mut folders = String::new();
    for dither in [1, -2, 0, 2, -1] {
        // Openings of both masks move by 30 um on the detector.
        let moved = |distance: f64| f64::from(dither) * 30.0 * distance / 1.8;
        let sets = format!("sample_mask.offset={} um", moved(1.1));
        let other = format!("detector_mask.offset={} um", moved(1.8));
        let views = "scan.angles={ from = \"0 deg\", to = \"360 deg\", count = 24 }";
        let name = format!("dither{dither}");
        let words = ["simulate", "scene.toml", "-q", "-o", &name, "--format", "npy"];
        let row = "detector.pixels=[32, 1]";
        let sets = ["--set", &sets, "--set", &other, "--set", views, "--set", row];
        let simulated = beamlet(here).args(words).args(sets).output().unwrap();
        assert!(ended(&simulated, 0).is_empty());
        done(here, &format!("retrieve {name} -q --method exact-curve --format npy"));
        folders.push_str(&format!(" {name}"));
    }
    done(here, &format!("reconstruct{folders} -o all --format npy --quantity delta -q"));
    let record = VolumeRecord::read(&here.join("all")).unwrap();
    assert_eq!(record.sinograms, [24, 1, 160]);
    assert!((record.axis_column - 79.5).abs() < 0.01, "{}", record.axis_column);
    let delta = mean_of_rod(&here.join("all"), Quantity::Delta);
    // The bias of attenuation gradients is -1.5 %, the curve's up to 1 %; 24 views.
    assert!((delta / 4e-7 - 1.0).abs() < 0.04, "{delta}");
    // Twice the same places, and other angles.
    let twice = run(here, "reconstruct dither0 dither0/retrieved -o twice");
    assert!(ended(&twice, 1).contains("dithers must differ"));
    let path = here.join("dither1/retrieved/geometry.json");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        text.replace("\"source_to_detector_m\": 1.8", "\"source_to_detector_m\": 1.9"),
    )
    .unwrap();
    let other = run(here, "reconstruct dither0 dither1 -o other");
    assert!(ended(&other, 1).contains("has other distances than dither0/retrieved"));
    assert!(!here.join("twice").exists() && !here.join("other").exists());
}

#[test]
fn sinograms_from_a_file_are_the_retrieved_ones() {
    let here = place().path();
    let read = |name: &str| {
        Array3::<f32>::read_npy(File::open(here.join("run/retrieved").join(name)).unwrap()).unwrap()
    };
    let write = |name: &str, values: &Array3<f32>| {
        values.write_npy(File::create(here.join(name)).unwrap()).unwrap();
    };
    write("angles.npy", &read("refraction.npy"));
    write("short.npy", &read("refraction.npy").slice(s![..35, .., ..]).to_owned());
    let from = "--geometry scene.toml --format npy";
    done(here, &format!("reconstruct angles.npy -o file --quantity delta -q {from}"));
    done(here, "reconstruct run -o images --quantity delta -q --format npy");
    let [file, images] = ["file", "images"].map(|name| volume(&here.join(name), Quantity::Delta));
    assert_eq!(file, images);
    let refused = |line: &str, code, word: &str| {
        let message = ended(&run(here, line), code);
        assert!(message.contains(word), "{line}: {message}");
        assert!(!here.join("none").exists() && !here.join("none.partial").exists(), "{line}");
    };
    let short = format!("reconstruct short.npy -o none --quantity delta {from}");
    refused(&short, 1, "[35, 3, 32]; the scene has 36 angles, 3 rows and 32 columns");
    refused("reconstruct angles.npy -o none --quantity delta", 1, "need --geometry");
    refused(&format!("reconstruct angles.npy -o none {from}"), 2, "needs --quantity");
    refused(
        &format!("reconstruct scene.toml -o none --quantity mu {from}"),
        1,
        "not a file of sinograms",
    );
    refused(
        &format!("reconstruct run -o none --quantity mu {from}"),
        2,
        "retrieved images have their own",
    );
    // A view without a value.
    let mut empty = read("refraction.npy");
    empty.slice_mut(s![3, .., ..]).fill(f32::NAN);
    write("empty.npy", &empty);
    let line = format!("reconstruct empty.npy -o none --quantity delta {from}");
    refused(&line, 1, "view 3 has no pixel with a value");
}

#[test]
fn a_dry_run_says_what_it_would_take_and_writes_nothing() {
    let here = place().path();
    let out = done(here, "reconstruct run -o dry --dry-run --voxel 50um");
    for words in
        ["64 x 64 x 6 voxels", "MiB on the host", "s of back-projection", "nothing was written"]
    {
        assert!(out.contains(words), "{words}: {out}");
    }
    assert!(!here.join("dry").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupt_between_two_volumes_leaves_nothing() {
    let here = place().path();
    let mut command = beamlet(here);
    command.args(["reconstruct", "run", "-o", "ended", "--format", "npy"]);
    let mut begun = Held::at(Gate::Write("ended.partial/mu"), command);
    assert!(here.join("ended.partial").is_dir());
    begun.interrupt();
    ended(&begun.ends(), 130);
    assert!(!here.join("ended.partial").exists() && !here.join("ended").exists());
}

#[test]
fn delta_gets_k_times_mu_unless_it_is_refused() {
    let here = place().path();
    let out = done(here, "reconstruct run -o corrected --format npy");
    done(here, "reconstruct run -o plain --no-gradient-bias -q --format npy");
    let record = VolumeRecord::read(&here.join("corrected")).unwrap();
    let k = record.gradient_bias_m.unwrap();
    assert!(out.contains("bias     delta + k mu"), "{out}");
    assert_eq!(VolumeRecord::read(&here.join("plain")).unwrap().gradient_bias_m, None);
    // (M/z)(z_c/z₁)(σ² − a²/12) with the flat of the retrieval and the distances of the scene.
    let text = fs::read_to_string(here.join("run/retrieved/retrieved.json")).unwrap();
    let retrieved: serde_json::Value = serde_json::from_str(&text).unwrap();
    let (width, aperture) = (retrieved["flat_width"].as_f64().unwrap(), 30e-6 * 1.1 / 1.8);
    let expected = (1.8 / 1.1 / 0.6) * (1.2 / 1.1) * (width.powi(2) - aperture * aperture / 12.0);
    assert!((k / expected - 1.0).abs() < 1e-9, "{k} {expected}");
    let read = |name: &str| volume(&here.join(name), Quantity::Delta);
    let mu = volume(&here.join("corrected"), Quantity::Mu);
    for ((with, without), mu) in read("corrected").iter().zip(&read("plain")).zip(&mu) {
        let added = k * f64::from(*mu);
        assert!((f64::from(with - without) - added).abs() < 1e-3 * added.abs() + 1e-13);
    }
    // Without a volume of μ there is nothing to add.
    done(here, "reconstruct run -o alone --quantity delta -q --format npy");
    assert_eq!(read("alone"), read("plain"));
}

/// Iterations fit sinograms, which show δ − kμ: a start with kμ and one without begin alike.
#[test]
fn a_start_of_delta_is_taken_without_k_times_mu() {
    let here = place().path();
    let usual = "--quantity mu,delta -q --format npy";
    done(here, &format!("reconstruct run -o with_bias {usual}"));
    done(here, &format!("reconstruct run -o without_bias --no-gradient-bias {usual}"));
    let go_on = |start: &str| {
        let name = format!("from_{start}");
        let method = "--method cgls --iterations 1";
        done(here, &format!("reconstruct run -o {name} {method} --start {start} {usual}"));
        volume(&here.join(name), Quantity::Delta)
    };
    let [with, without] = ["with_bias", "without_bias"].map(go_on);
    let mu = volume(&here.join("with_bias"), Quantity::Mu);
    let k = VolumeRecord::read(&here.join("with_bias")).unwrap().gradient_bias_m.unwrap();
    let most = mu.iter().map(|mu| k * f64::from(mu.abs())).fold(0.0, f64::max);
    let off = |(a, b): (&f32, &f32)| f64::from((a - b).abs());
    let apart = with.iter().zip(&without).map(off).fold(0.0, f64::max);
    println!("measured: volumes {apart:.1e} apart, k mu up to {most:.1e}");
    // Values of f32, and kμ a hundredth of δ. With kμ in the start one step leaves most of it.
    assert!(apart < 0.02 * most, "{apart:e} {most:e}");
    // Without the volume of μ, kμ cannot be taken off.
    let record = fs::read_to_string(here.join("with_bias/volume.json")).unwrap();
    fs::create_dir(here.join("torn")).unwrap();
    fs::write(here.join("torn/volume.json"), record.replace("\"mu\": ", "\"other\": ")).unwrap();
    let line = "reconstruct run -o none --method cgls --start torn --quantity delta";
    assert!(ended(&run(here, line), 1).contains("no volume mu"));
}

/// The image of the phase is the integral of the refraction image along each row, without its mean.
#[test]
fn retrieve_integrates_refraction_along_the_rows() {
    let here = place().path();
    let printed = done(here, "retrieve run -o phases --phase --format npy");
    assert!(printed.contains("phase    ") && printed.contains("is subtracted"), "{printed}");
    let read = |name: &str| {
        Array3::<f32>::read_npy(File::open(here.join("phases").join(name)).unwrap()).unwrap()
    };
    let (angles, phase) = (read("refraction.npy"), read("phase.npy"));
    assert_eq!(phase.dim(), (36, 3, 32));
    let (mut drift, mut worst, mut most) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (angles, phase) in angles.rows().into_iter().zip(phase.rows()) {
        let angles: Vec<f64> = angles.iter().map(|angle| f64::from(*angle)).collect();
        let mean = angles.iter().sum::<f64>() / 32.0;
        drift = drift.max(mean.abs());
        let mut sum = 0.0;
        for (angle, phase) in angles.iter().zip(phase) {
            // Half of the column, 0.1 mm at the axis; cosines of ±0.1° count for nothing.
            let middle = sum - (angle - mean) * 0.05e-3;
            sum -= (angle - mean) * 0.1e-3;
            worst = worst.max((f64::from(*phase) - middle).abs());
            most = most.max(f64::from(phase.abs()));
        }
    }
    assert!(worst < 1e-4 * most, "{worst} of {most}");
    // Twice the radius times δ; apertures see a fifth of the rod, so views scatter by a third.
    assert!((most / (1.4e-3 * 4e-7) - 1.0).abs() < 0.5, "{most}");
    let text = fs::read_to_string(here.join("phases/retrieved.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(
        (record["drift"]["largest_rad"].as_f64().unwrap() / drift - 1.0).abs() < 1e-3,
        "{text}"
    );
    assert_eq!(record["units"]["phase"], "m");
    assert!(!here.join("run/retrieved/phase.npy").exists());
    let drawn =
        done(here, "view phases -o phase_pictures --format svg --show retrieved --map phase");
    let picture = fs::read_to_string(here.join(drawn.lines().next().unwrap())).unwrap();
    assert!(
        picture.contains("integral of δ along the beam") && picture.contains("[nm]"),
        "{picture}"
    );
}
