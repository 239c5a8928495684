//! Moments kept by a run, illuminated again: the same bits for the same scene, and what a new
//! simulation gives for other masks, steps, spots, energies, constants and detectors.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use crate::support::kept::again;
use crate::support::{Checked, Worst, engine, engine_with};
use beamlet::moments::{MomentWriter, StoredMoments};
use beamlet::scene::Scene;
use beamlet::stack::{ArraySink, Format, RunDirectory, Stacks};
use beamlet::{Backend, Control, EngineOptions, Error};
use sha2::Digest;
use std::path::Path;

const BASE: &str = r#"
[source]
distance = "1.21 m"
spot = ["30 um", "26 um"]
energy = "30 keV"
[detector]
distance = "1.8 m"
pixels = [40, 6]
pitch = "150 um"
[sample_mask]
distance = "1.2 m"
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"
[detector_mask]
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"
[scan]
mask_offsets = { from = "-20 um", to = "20 um", count = 5 }
angles = ["0 deg", "30 deg"]
[materials.rod]
formula = "C"
density = "2.0 g/cm3"
[[object]]
name = "rod"
shape = { cylinder = { radius = "1.5 mm", height = "6 mm", sides = 256 } }
material = "rod"
[[object]]
name = "bead"
shape = { sphere = { radius = "0.2 mm", sides = 32 } }
material = "water"
position = ["0.5 mm", "0.2 mm", "0.1 mm"]
"#;

fn scene(changes: &[&str]) -> Scene {
    let changes: Vec<String> = changes.iter().map(|&c| c.to_owned()).collect();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.toml");
    std::fs::write(&path, BASE).unwrap();
    let mut scene = Scene::load_with(&path, &changes).unwrap();
    scene.directory = ".".into();
    scene
}

fn keeping(band_rows: Option<u32>) -> Checked {
    engine_with(
        EngineOptions::default()
            .with_backend(Backend::Bvh)
            .with_keep_moments(true)
            .with_band_rows(band_rows),
    )
}

/// A run of the base scene with its moments.
fn run(directory: &Path, band_rows: Option<u32>) {
    run_of(&scene(&[]), directory, band_rows);
}

fn run_of(scene: &Scene, directory: &Path, band_rows: Option<u32>) {
    let mut sink = RunDirectory::create(directory, Format::Npy, false).unwrap();
    let mut keep = MomentWriter::new(directory);
    let control = Control::default().with_keep(&mut keep);
    keeping(band_rows).run(scene, &mut sink, control).unwrap();
}

#[test]
fn same_scene_gives_the_same_bits_without_a_ray() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run(&path, Some(2));
    let kept = StoredMoments::open(&path).unwrap();
    let stacks = again(&engine(Backend::Bvh), &kept, kept.scene()).unwrap();
    assert_eq!(stacks.record.tally.rays, 0, "nothing is traced");
    // Moments are kept of what is traced.
    let engine = keeping(None);
    let simulation = engine.reilluminate(&kept, kept.scene()).unwrap();
    let mut keep = MomentWriter::new(directory.path());
    let control = Control::default().with_keep(&mut keep);
    let error = simulation.run(&mut ArraySink::new(), control).unwrap_err();
    assert!(error.to_string().contains("keeping moments"), "{error}");
    let fresh = keeping(None).simulate(&scene(&[])).unwrap();
    assert_eq!(stacks.flat, fresh.flat);
    assert_eq!(stacks.sample, fresh.sample);
}

/// Rays that are all followed in order are not traced anew where the constants are those of the run: they
/// were, without the sample, and stacks were flats.
#[test]
fn exact_transport_is_illuminated_with_its_sample() {
    let exact = ["sampling.transport=exact", "sampling.tolerance=3e-3", "detector.pixels=[12, 2]"];
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run_of(&scene(&exact), &path, None);
    let kept = StoredMoments::open(&path).unwrap();
    let stacks = again(&engine(Backend::Bvh), &kept, kept.scene()).unwrap();
    assert_eq!(stacks.record.tally.rays, 0, "nothing is traced");
    let fresh = keeping(None).simulate(&scene(&exact)).unwrap();
    // Moments are kept in f32: the last digit of light at a silhouette.
    let off = (&stacks.sample - &fresh.sample).fold(0.0_f32, |most, it| most.max(it.abs()));
    assert!(off < 1e-8, "{off:e}");
    let taken = fresh.flat[[2, 0, 0]] - fresh.sample[[0, 2, 0, 0]];
    assert!(taken > 0.01, "the sample takes {taken} of open beam");
}

const SPECTRUM: &str = "source.spectrum={ anode = \"tungsten\", kvp = \"60 kV\", filters = [{ \
                        material = \"Al\", thickness = \"2 mm\" }] }";

/// Holds the light of kept moments to that of new simulations of changed scenes.
fn match_new_simulations(kept: &StoredMoments, designs: &[(&str, &[&str])]) {
    let engine = engine(Backend::Bvh);
    for (name, changes) in designs {
        // Cells were refined for the run's own set-up: elsewhere their result is as linear, to 1 nm
        // at its analyser; at silhouettes, which cells of other lattices cut elsewhere, more.
        let mut flat = Worst::new("kept moments, flat", 1e-6);
        let mut mean = Worst::new("kept moments, mean deviation", 2e-5);
        let mut worst = Worst::new("kept moments, largest deviation", 1e-3);
        let scene = scene(changes);
        let got = again(&engine, kept, &scene).unwrap();
        let want = engine.simulate(&scene).unwrap();
        for ((at, a), b) in got.flat.indexed_iter().zip(&want.flat) {
            flat.take(f64::from(a - b), || format!("{name}, {at:?}"));
        }
        let mut sum = 0.0;
        for ((at, a), b) in got.sample.indexed_iter().zip(&want.sample) {
            sum += f64::from((a - b).abs());
            worst.take(f64::from(a - b), || format!("{name}, {at:?}"));
        }
        let pixels = f64::from(u32::try_from(got.sample.len()).unwrap());
        mean.take(sum / pixels, || (*name).to_owned());
        let seen: f64 = want
            .sample
            .outer_iter()
            .map(|view| (&view - &want.flat).iter().map(|d| f64::from(d.abs())).sum::<f64>())
            .sum();
        assert!(seen / pixels > 1e-3, "{name}: the sample is seen");
        flat.holds();
        mean.holds();
        worst.holds();
    }
}

#[test]
fn other_set_ups_match_new_simulations() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run(&path, None);
    let kept = StoredMoments::open(&path).unwrap();
    let designs: [(&str, &[&str]); 8] = [
        (
            "apertures",
            &["sample_mask.projected_aperture=20 um", "detector_mask.projected_aperture=24 um"],
        ),
        ("place of the sample mask", &["sample_mask.distance=1.15 m"]),
        (
            "steps and spot",
            &["scan.mask_offsets=[\"-7 um\", \"11 um\"]", "source.spot=[\"10 um\", \"15 um\"]"],
        ),
        ("no detector mask", &["detector_mask.material=vacuum"]),
        (
            "detector",
            &["detector.pixels=[30, 4]", "detector.pitch=170 um", "detector.distance=1.9 m"],
        ),
        ("energy", &["source.energy=24 keV"]),
        ("material", &["materials.rod.density=1.5 g/cm3"]),
        ("spectrum", &[SPECTRUM]),
    ];
    match_new_simulations(&kept, &designs);
}

/// Rays that the device chooses: the same limits, and the same bits in bands and with little memory.
#[test]
fn moments_of_rays_that_the_device_chooses_match_new_simulations() {
    let on_device = scene(&["sampling.refine=device"]);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run_of(&on_device, &path, None);
    let kept = StoredMoments::open(&path).unwrap();
    let engine = engine(Backend::Bvh);
    let same = again(&engine, &kept, kept.scene()).unwrap();
    let limited = EngineOptions::default().with_backend(Backend::Bvh).with_memory_limit(400 << 20);
    for (what, keeping) in [
        ("new", keeping(None)),
        ("bands", keeping(Some(2))),
        ("little memory", engine_with(limited.with_keep_moments(true))),
    ] {
        assert_eq!(keeping.simulate(&on_device).unwrap().sample, same.sample, "{what}");
    }
    let designs: [(&str, &[&str]); 4] = [
        ("the same", &[]),
        (
            "apertures",
            &["sample_mask.projected_aperture=20 um", "detector_mask.projected_aperture=24 um"],
        ),
        (
            "detector",
            &["detector.pixels=[30, 4]", "detector.pitch=170 um", "detector.distance=1.9 m"],
        ),
        ("spectrum", &[SPECTRUM]),
    ];
    match_new_simulations(&kept, &designs);
}

#[test]
fn scenes_that_make_the_same_cells_make_them_once() {
    const NARROW: &str = "sample_mask.projected_aperture=20 um";
    const THIN: &str = "sample_mask.thickness=60 um";
    const LINES: &str = "source.spectrum={ anode = \"tungsten\", kvp = \"45 kV\", nodes = 3, \
                         filters = [{ material = \"Al\", thickness = \"3 mm\" }] }";
    const SPOT: &str = "source.spot=[\"20 um\", \"20 um\"]";
    const STEPS: &str = "scan.mask_offsets=[\"-20 um\", \"11 um\"]";
    const ENERGY: &str = "source.energy=28 keV";
    const DISTANCE: &str = "detector.distance=1.85 m";
    // The same bits: two rows have the rims of the rod and the bead.
    const ROWS: &str = "detector.pixels=[40, 2]";
    let scene = |changes: &[&str]| scene(&[&[ROWS][..], changes].concat());
    let engine = engine(Backend::Bvh);
    // What the first scene changes, and scenes that make the same cells or others.
    let families = [
        (vec![], vec![vec![NARROW], vec![THIN], vec![STEPS]], vec![ENERGY, SPOT, LINES]),
        (vec![LINES], vec![vec![LINES, NARROW]], vec![THIN, SPOT, DISTANCE]),
    ];
    for (first, alike, others) in families {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run");
        run_of(&scene(&[]), &path, None);
        let alone = StoredMoments::open(&path).unwrap();
        let others: Vec<_> =
            others.into_iter().map(|change| [&first[..], &[change]].concat()).collect();
        let wanted = |changes: &Vec<&str>| again(&engine, &alone, &scene(changes)).unwrap();
        let want: Vec<Stacks> = alike.iter().chain(&others).map(wanted).collect();
        let sharing = StoredMoments::open(&path).unwrap().sharing(256 << 20);
        let too_little = StoredMoments::open(&path).unwrap().sharing(1 << 10);
        for kept in [&sharing, &too_little] {
            for (changes, want) in alike.iter().chain(&others).zip(&want) {
                again(&engine, kept, &scene(&first)).unwrap();
                let got = again(&engine, kept, &scene(changes)).unwrap();
                assert_eq!(got.flat, want.flat, "{changes:?}");
                assert_eq!(got.sample, want.sample, "{changes:?}");
            }
        }
        // Without the file only what was kept of the first scene is left.
        std::fs::remove_dir_all(path.join("moments")).unwrap();
        for (changes, want) in alike.iter().zip(&want) {
            let got = again(&engine, &sharing, &scene(changes))
                .unwrap_or_else(|e| panic!("{changes:?}: {e}"));
            assert_eq!(got.sample, want.sample, "{changes:?}, without the file");
            again(&engine, &too_little, &scene(changes)).unwrap_err();
        }
        for changes in &others {
            again(&engine, &sharing, &scene(changes)).unwrap_err();
        }
    }
}

/// The key and the whole text of the error of a scene.
fn refusal(kept: &StoredMoments, scene: &Scene) -> (String, String) {
    let error = again(&engine(Backend::Bvh), kept, scene).unwrap_err();
    let text = error.to_string();
    match error {
        Error::Scene { key, .. } => (key, text),
        _ => (String::new(), text),
    }
}

#[test]
fn what_moments_cannot_follow_is_refused_by_its_key() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run(&path, None);
    let kept = StoredMoments::open(&path).unwrap();
    for (change, key, words) in [
        ("source.distance=1.22 m", "source.distance", "1210 mm"),
        ("scan.angles=[\"0 deg\"]", "scan.angles", "2 angles"),
        ("object.bead.position=[\"0 mm\", \"0 mm\", \"0 mm\"]", "object[1].position", "bead"),
        ("object.bead.shape.sphere.radius=0.3 mm", "object[1].mesh", "another shape"),
        ("detector.pixels=[40, 12]", "detector.pixels", "2.000 times"),
        ("detector.pixels=[400, 6]", "detector.pixels", "columns"),
        ("source.energy=15 keV", "source", "times the delta of the run"),
    ] {
        let (found, text) = refusal(&kept, &scene(&[change]));
        assert_eq!(found, key, "{change}: {text}");
        assert!(text.contains(words), "{change}: {text}");
    }
    let mut random = scene(&[]);
    random.sampling.scheme = beamlet::scene::Scheme::Random;
    assert_eq!(refusal(&kept, &random).0, "sampling.scheme");
}

#[test]
fn a_run_whose_moments_are_read_is_not_overwritten_meanwhile() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run(&path, None);
    let kept = StoredMoments::open(&path).unwrap();
    let again = StoredMoments::open(&path).unwrap();
    let error = RunDirectory::create(&path, Format::Npy, true).unwrap_err().to_string();
    assert!(error.contains("another beamlet process is using this run"), "{error}");
    drop((kept, again));
    let writer = RunDirectory::create(&path, Format::Npy, true).unwrap();
    let error = StoredMoments::open(&path).unwrap_err().to_string();
    assert!(error.contains("another beamlet process is writing this run"), "{error}");
    drop(writer);
    StoredMoments::open(&path).unwrap();
}

#[test]
fn damaged_moments_are_named_and_not_used() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run(&path, None);
    let view = path.join("moments/view_0001.bin");
    let bytes = std::fs::read(&view).unwrap();
    let open = || StoredMoments::open(&path).unwrap_err().to_string();
    let mut changed = bytes.clone();
    changed[bytes.len() / 2] ^= 1;
    for (what, damaged) in [
        ("does not match its hash", changed),
        ("does not match its hash", bytes[..bytes.len() - 100].to_vec()),
        ("is cut off", bytes[..20].to_vec()),
    ] {
        std::fs::write(&view, damaged).unwrap();
        let text = open();
        assert!(text.contains("view_0001.bin") && text.contains(what), "{text}");
    }
    std::fs::remove_file(&view).unwrap();
    assert!(open().contains("view_0001.bin"));
    std::fs::write(&view, bytes).unwrap();
    StoredMoments::open(&path).unwrap();
    let scene_path = path.join("scene.toml");
    let text = std::fs::read_to_string(&scene_path).unwrap();
    std::fs::write(&scene_path, format!("{text}\n# changed\n")).unwrap();
    assert!(open().contains("another scene"), "{}", open());
    std::fs::remove_dir_all(path.join("moments")).unwrap();
    assert!(open().contains("--keep-moments"));
    assert!(StoredMoments::open(directory.path()).unwrap_err().to_string().contains("scene.toml"));
}

/// Random numbers that are the same on every machine (splitmix64).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        usize::try_from(self.next() % limit as u64).unwrap()
    }
}

#[test]
fn moments_of_rays_that_graze_an_exact_sphere_are_accepted() {
    let ball = scene(&[
        "detector.pixels=[16, 4]",
        "scan.angles=[\"0 deg\"]",
        "object.rod.position=[\"-9 mm\", \"0 mm\", \"0 mm\"]",
        "object.bead.shape={ sphere = { radius = \"0.2 mm\" } }",
        "object.bead.position=[\"0.5 mm\", \"0 mm\", \"0.05 mm\"]",
    ]);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run_of(&ball, &path, None);
    let kept = StoredMoments::open(&path).unwrap();
    let stacks = again(&engine(Backend::Bvh), &kept, kept.scene()).unwrap();
    assert!(stacks.sample.iter().all(|value| value.is_finite()));
}

/// Seals a file of moments: what stands in it counts as written.
fn with_hash(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 32;
    let hash = sha2::Sha256::digest(&bytes[..end]);
    bytes[end..].copy_from_slice(&hash);
    bytes
}

#[test]
fn moments_with_a_good_hash_and_a_bad_content_are_refused_by_name_or_end_in_stacks() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run");
    run(&path, None);
    let view = path.join("moments/view_0001.bin");
    let good = std::fs::read(&view).unwrap();
    let rounds = std::env::var("BEAMLET_ROUNDS").map_or(16, |text| text.parse().unwrap());
    let seed = std::env::var("BEAMLET_SEED").map_or(1, |text| text.parse().unwrap());
    let values = [
        0,
        1,
        2,
        7,
        0x7fff_ffff,
        0xffff_ffff,
        0x8000_0000,
        0x0001_0000,
        f32::INFINITY.to_bits(),
        f32::NAN.to_bits(),
        f32::MAX.to_bits(),
        (-1.0_f32).to_bits(),
        1e9_f32.to_bits(),
        1e-30_f32.to_bits(),
        1.0_f32.to_bits(),
        1e4_f32.to_bits(),
    ];
    let scenes = [
        scene(&[]),
        scene(&["sample_mask.distance=1.15 m", "scan.mask_offsets=[\"-7 um\", \"11 um\"]"]),
        scene(&["source.energy=24 keV", "detector.pixels=[30, 5]"]),
    ];
    let engine = engine(Backend::Bvh);
    let mut dice = Dice(seed);
    let mut refused = 0;
    for round in 0..rounds {
        let mut bytes = good.clone();
        for _ in 0..1 + dice.below(3) {
            // Often among the heads, where counts are; else anywhere.
            let words = if dice.below(2) == 0 { 400 } else { bytes.len() / 4 - 8 };
            let at = 4 * (5 + dice.below(words - 5));
            // The seal of the scene stays, or nothing behind it is read.
            if (24..56).contains(&at) {
                continue;
            }
            let value = values.get(dice.below(values.len() + 4)).copied();
            let value = value.unwrap_or_else(|| u32::try_from(dice.next() >> 32).unwrap());
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        std::fs::write(&view, with_hash(bytes)).unwrap();
        let began = std::time::Instant::now();
        let done = StoredMoments::open(&path)
            .and_then(|kept| scenes.iter().try_for_each(|s| again(&engine, &kept, s).map(drop)));
        if let Err(error) = done {
            refused += 1;
            assert!(error.to_string().contains("view_0001.bin"), "round {round}: {error}");
        }
        let seconds = began.elapsed().as_secs_f64();
        assert!(seconds < 60.0, "round {round} took {seconds} s");
    }
    assert!(refused > rounds / 3, "{refused} of {rounds} were refused");
    std::fs::write(&view, with_hash(good)).unwrap();
    again(&engine, &StoredMoments::open(&path).unwrap(), &scenes[1]).unwrap();
}
