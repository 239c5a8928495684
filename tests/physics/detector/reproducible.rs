//! The same counts whatever the bands, batches, threads and interrupts.

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, star};
use crate::support::cuts::{Cut, bands, no_bit_changes};
use crate::support::{CARBON, engine, engine_of, files};
use beamlet::scene::Exposure;
use beamlet::scene::{Blur, Counts, KernelFile, Scatter, Scene};
use beamlet::stack::{Format, OpenRun, RunDirectory, StackFile};
use beamlet::{Backend, Cancel, Control, EngineOptions, Error, Progress};
use ndarray::Array2;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Everything that a detector may have, in few pixels.
fn scene(place: &Path) -> Scene {
    let mut setup = Setup::paper([7, 9]);
    setup.detector_mask = None;
    let ball = star(0.2e-3, 0.3e-3, 2, 3).moved([0.05e-3, 0.0, 0.1e-3]);
    let mut scene = scenes::scene(&setup, &[body(ball, 40.0 * CARBON[0], CARBON[1])], &[0.0, 9e-6]);
    let kernel = |name: &str, values: Array2<f64>, pixel: f64| {
        let path = place.join(name);
        ndarray_npy::write_npy(&path, &values).unwrap();
        KernelFile::new(path, [pixel; 2])
    };
    let lopsided = Array2::from_shape_fn((5, 7), |(row, column)| (row + 2 * column) as f64);
    let veil = Array2::from_elem((3, 3), 1.0);
    scene.detector.blur = Some(Blur::Kernel(kernel("blur.npy", lopsided, 60e-6)));
    let kernel = kernel("veil.npy", veil, 200e-6);
    scene.detector.scatter = Some(Scatter::Kernel { kernel, fraction: 0.05 });
    scene.detector.counts = Some(
        Counts::of_photons(500.0).with_electronic_noise(3.0).with_offset(20.0).with_bit_depth(12),
    );
    scene.scan.angles = vec![0.0, 0.7, 1.4];
    scene.sampling.tolerance = Some(1e-2);
    scene
}

#[test]
fn bands_batches_and_threads_change_no_bit_of_counts() {
    let place = tempfile::tempdir().unwrap();
    let mut scene = scene(place.path());
    (scene.scan.flats_every, scene.scan.darks_every) = (Some(2), Some(5));
    let cuts = [
        Cut { threads: Some(1), ..bands(1) },
        Cut { batch: Some(4096), threads: Some(3), ..bands(5) },
    ];
    let whole = no_bit_changes("counts", &scene, &cuts);
    // Wide windows of a Gaussian.
    let mut blurred = scene.clone();
    blurred.detector.blur = Some(Blur::Gaussian { sigma: [60e-6, 110e-6] });
    no_bit_changes("Gaussian blur", &blurred, &[bands(2)]);
    // Another seed changes the counts and nothing of the light.
    let mut seeded = scene;
    seeded.sampling.seed += 1;
    let other = engine(Backend::Bvh).simulate(&seeded).unwrap();
    assert_eq!(other.flat, whole.flat);
    let [a, b] = [&whole, &other].map(|stacks| &stacks.counts.as_ref().unwrap().flat);
    assert!(a != b);
}

fn without_log(run: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = files::of_run(run);
    files.remove(Path::new("progress.log"));
    files
}

#[test]
fn interrupted_run_goes_on_to_the_same_files_and_overwrites_its_own_alone() {
    let place = tempfile::tempdir().unwrap();
    let scene = scene(place.path());
    let options = EngineOptions::default().with_backend(Backend::Bvh).with_band_rows(4);
    let engine = engine_of(options);
    for format in [Format::Exr, Format::Npy] {
        let [whole, broken] =
            ["whole", "broken"].map(|n| place.path().join(format!("{n}_{format}")));
        let mut sink = RunDirectory::create(&whole, format, false).unwrap();
        engine.run(&scene, &mut sink, Control::default()).unwrap();
        // In the second view with the sample.
        let cancel = Cancel::default();
        let mut sink = RunDirectory::create(&broken, format, false).unwrap();
        let ended = engine.run(
            &scene,
            &mut sink,
            Control::default().with_progress(&mut |progress| {
                    if matches!(&progress, Progress::Views(views) if views.view == Exposure::Sample(1))
                    {
                        cancel.cancel();
                    }
                }).with_cancel(cancel.clone()),
        );
        assert!(matches!(ended, Err(Error::Interrupted)));
        drop(sink);
        let mut sink = RunDirectory::resume(&broken, &scene).unwrap();
        assert_eq!(sink.committed(), [Exposure::Flat(0), Exposure::Dark(0), Exposure::Sample(0)]);
        // Counts that were changed since do not count.
        if format == Format::Npy {
            // A run is locked from the first look on.
            drop(sink);
            let path = broken.join("counts/flat.npy");
            let mut bytes = fs::read(&path).unwrap();
            *bytes.last_mut().unwrap() ^= 1;
            fs::write(&path, bytes).unwrap();
            sink = RunDirectory::resume(&broken, &scene).unwrap();
            assert_eq!(sink.committed(), [Exposure::Dark(0), Exposure::Sample(0)]);
        }
        let skip = sink.committed().to_vec();
        engine.run(&scene, &mut sink, Control::default().with_skip(skip)).unwrap();
        drop(sink);
        let [one, other] = [&whole, &broken].map(|run| without_log(run));
        assert_eq!(one, other, "{format}");
        let run = OpenRun::open(&whole).unwrap();
        let rows = |stack: Option<StackFile>| stack.unwrap().rows(0, 0..9).unwrap();
        let flat = rows(Some(run.flat().unwrap()));
        let (counts, dark) = (rows(run.counts_flat().unwrap()), rows(run.dark().unwrap()));
        let z =
            |count: f32, light: f32| (count - 20.0 - 500.0 * light) / (500.0 * light + 9.0).sqrt();
        assert!(counts.iter().zip(&flat).all(|(count, light)| z(*count, *light).abs() < 6.0));
        assert!(dark.iter().all(|number| (number - 20.0).abs() < 18.0));
        assert_eq!(run.counts_sample().unwrap().unwrap().shape(), [3, 2, 9, 7]);
        let names = files::paths(&whole);
        let wanted: &[&str] = match format {
            Format::Exr => &[
                "counts/flat/step_001.exr",
                "counts/sample/view_0002/step_000.exr",
                "dark/step_001.exr",
                "flat/step_000.exr",
            ],
            _ => &["counts/flat.npy", "counts/sample.npy", "dark.npy", "sample.npy"],
        };
        assert!(
            wanted.iter().all(|name| names.iter().any(|path| path == Path::new(name))),
            "{names:?}"
        );
        // A run without counts takes the place; a file of somebody else stays.
        fs::write(whole.join("counts/notes.txt"), "mine").unwrap();
        let mut bare = scene.clone();
        bare.detector.counts = None;
        let mut sink = RunDirectory::create(&whole, format, true).unwrap();
        engine.run(&bare, &mut sink, Control::default()).unwrap();
        let mut left = files::paths(&whole);
        left.retain(|path| path.starts_with("counts") || path.starts_with("dark"));
        assert_eq!(left, [Path::new("counts/notes.txt")]);
    }
}
