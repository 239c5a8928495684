//! Sinks: what goes in comes out through other readers, and only what is committed counts.

use crate::support::files;
use beamlet::scene::{
    Beam, Detector, Exposure, MaskBody, MaskSpec, Object, Scan, Scene, Shape, Source,
};
use beamlet::stack::{
    ArraySink, CallbackSink, Format, OpenRun, RunDirectory, RunStart, RunState, Sink, StackShape,
};
use beamlet::{Backend, Error, RunRecord, SearchCounts};
use ndarray::{Array3, Array4, s};
use ndarray_npy::ReadNpyExt;
use std::fs;
use std::path::{Path, PathBuf};

const COLUMNS: usize = 7;
const ROWS: usize = 5;
const STEPS: usize = 3;
const VIEWS: u32 = 2;

fn scene() -> Scene {
    let mask = |distance: f64, period: f64, aperture: f64| {
        Some(MaskSpec::new(distance, period, aperture, MaskBody::Sheet { transmission: 0.0 }))
    };
    let source = Source::new(1.21, [30e-6, 26e-6], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, [7, 5], [150e-6; 2]));
    scene.directory = PathBuf::new();
    scene.sample_mask = mask(1.2, 100e-6, 20e-6);
    scene.detector_mask = mask(1.8, 150e-6, 30e-6);
    scene.scan = Scan::new(vec![-1e-5, 0.0, 1e-5], vec![0.0, 1.0]);
    let rod = Shape::Cylinder { radius: 2e-4, height: 1e-3, sides: Some(64) };
    scene.objects.push(Object::new("rod", rod, "carbon"));
    scene
}

fn start() -> RunStart {
    let mut start = RunStart::new("tested device", "1.0", Backend::Bvh, "the test says so");
    start.search = Some(SearchCounts::new(500, 1.5));
    start
}

fn record() -> RunRecord {
    let mut record = RunRecord::begin(&start(), 1);
    record.tally.rays = 1234;
    record
}

/// Values that differ everywhere, some of them awkward.
fn values(view: Exposure) -> Array3<f32> {
    let view = match view {
        Exposure::Flat(_) => 0.5,
        Exposure::Dark(_) => unreachable!("the scene has no detector.photons"),
        Exposure::Sample(index) => f32::from(u16::try_from(index).unwrap()) + 1.25,
    };
    Array3::from_shape_fn((STEPS, ROWS, COLUMNS), |(step, row, column)| {
        if (step, row, column) == (1, 2, 3) {
            return f32::MIN_POSITIVE / 4.0;
        }
        (view * 1000.0 + (step * 100 + row * 10 + column) as f32) / 3.0
    })
}

/// Writes a view in bands of at most `band` rows.
fn put(sink: &mut dyn Sink, view: Exposure, band: usize) {
    let values = values(view);
    for first in (0..ROWS).step_by(band) {
        let last = ROWS.min(first + band);
        let rows = u32::try_from(first).unwrap()..u32::try_from(last).unwrap();
        sink.write(view, rows, values.slice(s![.., first..last, ..])).unwrap();
    }
}

fn whole_run(sink: &mut dyn Sink, band: usize) {
    sink.begin(&scene(), &start()).unwrap();
    for view in [Exposure::Flat(0), Exposure::Sample(0), Exposure::Sample(1)] {
        put(sink, view, band);
        sink.commit(view).unwrap();
    }
    sink.finish(&record()).unwrap();
}

fn run_in(path: &Path, format: Format, band: usize) {
    whole_run(&mut RunDirectory::create(path, format, false).unwrap(), band);
}

fn read_exr(path: &Path) -> (Vec<f32>, String) {
    use exr::prelude::*;
    let image = read_first_flat_layer_from_file(path).unwrap();
    assert_eq!(image.layer_data.size, Vec2(COLUMNS, ROWS));
    let [channel] = image.layer_data.channel_data.list.as_slice() else { panic!("one channel") };
    assert_eq!(channel.name.to_string(), "Y");
    let FlatSamples::F32(values) = &channel.sample_data else { panic!("32-bit floats") };
    let about = match &image.layer_data.attributes.other[&Text::from("beamlet")] {
        AttributeValue::Text(text) => text.to_string(),
        other => panic!("{other:?}"),
    };
    (values.clone(), about)
}

#[test]
fn exr_frames_read_back_bit_for_bit_with_their_geometry() {
    let temporary = tempfile::tempdir().unwrap();
    let run = temporary.path().join("run");
    run_in(&run, Format::Exr, ROWS);
    for step in 0..STEPS {
        let (flat, _) = read_exr(&run.join(format!("flat/step_{step:03}.exr")));
        assert_eq!(
            flat,
            values(Exposure::Flat(0)).slice(s![step, .., ..]).iter().copied().collect::<Vec<_>>()
        );
        let (frame, about) = read_exr(&run.join(format!("sample/view_0001/step_{step:03}.exr")));
        let wanted = values(Exposure::Sample(1));
        assert!(
            frame
                .iter()
                .zip(wanted.slice(s![step, .., ..]))
                .all(|(a, b)| a.to_bits() == b.to_bits())
        );
        let about: serde_json::Value = serde_json::from_str(&about).unwrap();
        assert_eq!(about["mask_offset"], scene().scan.mask_offsets[step]);
        assert_eq!(about["angle"], 1.0);
        assert_eq!(about["source_distance"], 1.21);
    }
}

#[test]
fn npy_stacks_read_back_bit_for_bit() {
    let temporary = tempfile::tempdir().unwrap();
    run_in(temporary.path(), Format::Npy, 2);
    let open = |name| fs::File::open(temporary.path().join(name)).unwrap();
    let flat = Array3::<f32>::read_npy(open("flat.npy")).unwrap();
    let sample = Array4::<f32>::read_npy(open("sample.npy")).unwrap();
    assert_eq!(flat, values(Exposure::Flat(0)));
    assert_eq!(sample.dim(), (VIEWS as usize, STEPS, ROWS, COLUMNS));
    for index in 0..VIEWS {
        assert_eq!(sample.slice(s![index as usize, .., .., ..]), values(Exposure::Sample(index)));
    }
    let bytes = fs::read(temporary.path().join("flat.npy")).unwrap();
    assert_eq!((bytes.len() - 4 * STEPS * ROWS * COLUMNS) % 64, 0, "values are aligned");
}

#[test]
fn bands_do_not_change_a_byte() {
    for format in [Format::Exr, Format::Npy, Format::Tiff] {
        let temporary = tempfile::tempdir().unwrap();
        let [one, many] = ["one", "many"].map(|name| temporary.path().join(name));
        run_in(&one, format, ROWS);
        run_in(&many, format, 2);
        assert_eq!(files::of_run(&one), files::of_run(&many));
    }
}

#[test]
fn nothing_is_written_before_the_run_begins() {
    let temporary = tempfile::tempdir().unwrap();
    let path = temporary.path().join("run");
    let sink = RunDirectory::create(&path, Format::Exr, false).unwrap();
    drop(sink);
    assert!(!path.exists());
}

#[test]
fn a_view_that_is_not_committed_leaves_no_file_that_counts() {
    for (format, band) in
        [(Format::Exr, ROWS), (Format::Exr, 2), (Format::Npy, 2), (Format::Tiff, 2)]
    {
        let temporary = tempfile::tempdir().unwrap();
        let mut sink = RunDirectory::create(temporary.path(), format, false).unwrap();
        sink.begin(&scene(), &start()).unwrap();
        put(&mut sink, Exposure::Flat(0), band);
        sink.commit(Exposure::Flat(0)).unwrap();
        put(&mut sink, Exposure::Sample(0), band);
        drop(sink);
        assert!(!temporary.path().join("sample").exists());
        assert!(!temporary.path().join("partial").exists());
        let resumed = RunDirectory::resume(temporary.path(), &scene()).unwrap();
        assert_eq!(resumed.committed(), [Exposure::Flat(0)]);
        assert_eq!(resumed.recorded().unwrap().state, RunState::Interrupted);
    }
}

#[test]
fn a_changed_frame_no_longer_counts_as_committed() {
    for (format, name) in [
        (Format::Exr, "sample/view_0000/step_001.exr"),
        (Format::Npy, "sample.npy"),
        (Format::Tiff, "sample.tif"),
    ] {
        let temporary = tempfile::tempdir().unwrap();
        run_in(temporary.path(), format, ROWS);
        let path = temporary.path().join(name);
        let mut bytes = fs::read(&path).unwrap();
        let header = bytes.len() - 4 * COLUMNS * ROWS * STEPS * VIEWS as usize;
        let at = if format == Format::Exr { bytes.len() - 3 } else { header + 41 };
        bytes[at] ^= 1;
        fs::write(&path, bytes).unwrap();
        let resumed = RunDirectory::resume(temporary.path(), &scene()).unwrap();
        assert_eq!(resumed.committed(), [Exposure::Flat(0), Exposure::Sample(1)]);
    }
}

#[test]
fn another_scene_or_device_does_not_resume_a_run() {
    let temporary = tempfile::tempdir().unwrap();
    run_in(temporary.path(), Format::Npy, ROWS);
    let mut other = scene();
    other.sampling.seed = 2;
    let message = RunDirectory::resume(temporary.path(), &other).unwrap_err().to_string();
    assert!(message.contains("seed") && message.contains("there 1, here 2"), "{message}");

    let mut elsewhere = start();
    elsewhere.device = "another device".into();
    let mut sink = RunDirectory::resume(temporary.path(), &scene()).unwrap();
    let message = sink.begin(&scene(), &elsewhere).unwrap_err().to_string();
    assert!(message.contains("another device") && message.contains("tested device"), "{message}");
    // It holds the lock of the run as long as it lives.
    assert!(RunDirectory::resume(temporary.path(), &scene()).is_err());
    drop(sink);
    let mixed = RunDirectory::resume(temporary.path(), &scene()).unwrap();
    mixed.allow_mixed(true).begin(&scene(), &elsewhere).unwrap();
}

#[test]
fn a_run_is_not_overwritten_unless_asked_and_files_of_others_survive() {
    for format in [Format::Exr, Format::Npy, Format::Tiff] {
        let temporary = tempfile::tempdir().unwrap();
        let path = temporary.path();
        run_in(path, Format::Exr, ROWS);
        let foreign =
            ["notes.txt", "flat/notes.txt", "sample/view_0000/notes.txt", "sample/mine/a"];
        fs::create_dir(path.join("sample/mine")).unwrap();
        for name in foreign {
            fs::write(path.join(name), name).unwrap();
        }
        let message = RunDirectory::create(path, format, false).unwrap_err().to_string();
        assert!(message.contains("holds a run already"), "{message}");
        whole_run(&mut RunDirectory::create(path, format, true).unwrap(), ROWS);
        for name in foreign {
            assert_eq!(fs::read_to_string(path.join(name)).unwrap(), name);
        }
        let exr_left = path.join("sample/view_0001/step_000.exr").exists();
        assert_eq!(exr_left, format == Format::Exr);
        assert_eq!(RunDirectory::resume(path, &scene()).unwrap().committed().len(), 3);
    }
}

#[test]
fn overwriting_never_takes_the_files_of_a_directory_that_is_no_run() {
    let temporary = tempfile::tempdir().unwrap();
    fs::write(temporary.path().join("scene.toml"), "mine").unwrap();
    for overwrite in [false, true] {
        let error = RunDirectory::create(temporary.path(), Format::Exr, overwrite).unwrap_err();
        assert!(matches!(error, Error::File { .. }));
    }
    assert_eq!(fs::read_to_string(temporary.path().join("scene.toml")).unwrap(), "mine");
}

#[test]
fn a_run_that_was_ended_before_its_record_stood_can_begin_again() {
    let temporary = tempfile::tempdir().unwrap();
    let path = temporary.path();
    for name in ["progress.log", "scene.toml", "run.json.new"] {
        fs::write(path.join(name), "").unwrap();
    }
    run_in(path, Format::Npy, ROWS);
    assert_eq!(RunDirectory::resume(path, &scene()).unwrap().committed().len(), 3);
    // A log with something in it, or a file of others beside it, is left alone.
    fs::remove_file(path.join("run.json")).unwrap();
    assert!(RunDirectory::create(path, Format::Npy, true).is_err());
}

#[test]
fn bands_out_of_order_or_missing_are_refused() {
    let temporary = tempfile::tempdir().unwrap();
    let mut sink = RunDirectory::create(temporary.path(), Format::Npy, false).unwrap();
    sink.begin(&scene(), &start()).unwrap();
    let values = values(Exposure::Flat(0));
    assert!(sink.write(Exposure::Flat(0), 2..4, values.slice(s![.., 2..4, ..])).is_err());
    sink.write(Exposure::Flat(0), 0..2, values.slice(s![.., 0..2, ..])).unwrap();
    assert!(sink.commit(Exposure::Flat(0)).is_err());
}

#[test]
fn arrays_and_callbacks_take_the_same_stacks() {
    let mut arrays = ArraySink::new();
    whole_run(&mut arrays, 2);
    let stacks = arrays.into_stacks().unwrap();
    assert_eq!(stacks.flat, values(Exposure::Flat(0)));
    assert_eq!(stacks.sample.slice(s![1, .., .., ..]), values(Exposure::Sample(1)));
    assert_eq!(stacks.record, record());

    let mut bands = Vec::new();
    let mut sink = CallbackSink::new(|view, rows, data: ndarray::ArrayView3<'_, f32>| {
        bands.push((view, rows.clone()));
        assert_eq!(data, values(view).slice(s![.., rows.start as usize..rows.end as usize, ..]));
        Ok(())
    });
    whole_run(&mut sink, 3);
    assert_eq!(bands.len(), 6);
}

#[test]
fn names_grow_with_the_numbers_they_hold() {
    let temporary = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.scan.angles = vec![0.0; 10_001];
    let mut sink = RunDirectory::create(temporary.path(), Format::Exr, false).unwrap();
    sink.begin(&scene, &start()).unwrap();
    let view = Exposure::Sample(10_000);
    put(&mut sink, view, ROWS);
    sink.commit(view).unwrap();
    assert!(temporary.path().join("sample/view_10000/step_000.exr").exists());
    let view = Exposure::Sample(7);
    put(&mut sink, view, ROWS);
    sink.commit(view).unwrap();
    assert!(temporary.path().join("sample/view_00007/step_002.exr").exists());
    assert_eq!(StackShape::of(&scene).unwrap().all_views().count(), 10_002);
}

#[test]
fn an_open_run_reads_back_what_was_written_and_only_committed_views() {
    for format in [Format::Exr, Format::Npy, Format::Tiff] {
        let temporary = tempfile::tempdir().unwrap();
        run_in(temporary.path(), format, 2);
        let run = OpenRun::open(temporary.path()).unwrap();
        assert_eq!(run.scene().scan, scene().scan);
        assert_eq!((run.views(), run.record().state), (2, RunState::Done));
        assert_eq!(run.flat().unwrap().view(0).unwrap(), values(Exposure::Flat(0)));
        let sample = run.sample().unwrap();
        for view in 0..2 {
            let expected = values(Exposure::Sample(u32::try_from(view).unwrap()));
            assert_eq!(sample.view(view).unwrap(), expected);
        }
        assert!(run.counts_flat().unwrap().is_none() && run.dark().unwrap().is_none());

        let cut = tempfile::tempdir().unwrap();
        let mut sink = RunDirectory::create(cut.path(), format, false).unwrap();
        sink.begin(&scene(), &start()).unwrap();
        assert!(OpenRun::open(cut.path()).unwrap().flat().is_err());
        for view in [Exposure::Flat(0), Exposure::Sample(0)] {
            put(&mut sink, view, 2);
            sink.commit(view).unwrap();
        }
        drop(sink);
        let run = OpenRun::open(cut.path()).unwrap();
        assert_eq!(run.sample().unwrap().shape()[0], 1);
        assert!(run.sample().unwrap().view(1).is_err());
    }
}
