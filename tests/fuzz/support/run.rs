//! A small run, made by the library's own sink: no device has part in it.

use super::PLACE;
use beamlet::scene::{Exposure, Scene};
use beamlet::stack::{Format, OpenRun, RunDirectory, RunStart, Sink, check_run, views};
use beamlet::{Backend, RunRecord, SamplingSummary, SearchCounts, Tally};
use ndarray::{Array3, ArrayD};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The scene of the run: two materials, counts, one angle.
pub const SCENE: &str = include_str!("../scene.toml");

/// The scene, read.
pub fn scene() -> Scene {
    Scene::from_toml(SCENE, ".").expect("the scene reads")
}

/// A complete run of the scene in a folder of this process.
pub fn fixture(name: &str, format: Format) -> PathBuf {
    let path = PLACE.join(name);
    let scene = scene();
    let mut sink = RunDirectory::create(&path, format, false).expect("a new folder");
    let mut start = RunStart::new("none", "none", Backend::Bvh, "requested");
    start.search = Some(SearchCounts::new(500, 1.5));
    sink.begin(&scene, &start).expect("the run begins");
    let rows = 0..scene.detector.pixels[1];
    for view in views(&scene).expect("few views") {
        let [intensities, counts] = [false, true].map(|counts| values(&scene, view, counts));
        if view != Exposure::Dark(0) {
            sink.write(view, rows.clone(), intensities.view()).expect("written");
        }
        sink.write_counts(view, rows.clone(), counts.view()).expect("written");
        let tally = Tally { rays: 7, ..Tally::default() };
        sink.tally(view, &tally).expect("noted");
        sink.commit(view).expect("committed");
    }
    let mut sampling = SamplingSummary::default();
    sampling.patches = 5;
    sampling.mean_rays = 2.5;
    sampling.most_rays = 9;
    sampling.rms_error = 1e-7;
    sampling.worst_error = 3e-7;
    sampling.tolerance = 1e-6;
    sampling.beyond_tolerance = 1;
    let mut record = RunRecord::begin(&start, scene.sampling.seed);
    record.sampling = Some(sampling);
    record.seconds = BTreeMap::from([("total".into(), 0.5)]);
    sink.finish(&record).expect("the run ends");
    path
}

/// Values of a view of the run, `[step][row][column]`.
fn values(scene: &Scene, view: Exposure, counts: bool) -> Array3<f32> {
    let [columns, rows] = scene.detector.pixels.map(|side| side as usize);
    let of_view = match view {
        Exposure::Flat(_) => 1.0,
        Exposure::Dark(_) => 2.0,
        Exposure::Sample(index) => 3.0 + index as f32,
    };
    let scale = if counts { 1000.0 } else { 0.25 };
    Array3::from_shape_fn((scene.scan.mask_offsets.len(), rows, columns), |(s, y, x)| {
        scale * (of_view + s as f32 + 10.0 * y as f32 + 100.0 * x as f32)
    })
}

/// Reads all of a run. Whatever is damaged beside its frames: what is read as committed is what
/// was.
pub fn read(path: &Path) {
    let checked = check_run(path);
    let scene = scene();
    let Ok(run) = OpenRun::open(path) else { return };
    let same = |view: Exposure, counts: bool, found: beamlet::Result<Array3<f32>>| {
        let Ok(found) = found else { return };
        let (found, wanted): (ArrayD<f32>, ArrayD<f32>) =
            (found.into_dyn(), values(&scene, view, counts).into_dyn());
        assert_eq!(found, wanted, "{view:?}");
    };
    if let Ok(flat) = run.flat() {
        same(Exposure::Flat(0), false, flat.view(0));
    }
    if let Ok(sample) = run.sample() {
        for view in 0..run.views() {
            let index = u32::try_from(view).expect("one view");
            same(Exposure::Sample(index), false, sample.view(view));
        }
    }
    if let Ok(Some(flat)) = run.counts_flat() {
        same(Exposure::Flat(0), true, flat.view(0));
    }
    if let Ok(Some(sample)) = run.counts_sample() {
        same(Exposure::Sample(0), true, sample.view(0));
    }
    if let Ok(Some(dark)) = run.dark() {
        same(Exposure::Dark(0), true, dark.view(0));
    }
    let record = run.record();
    if let Ok(checked) = checked
        && checked.problems.is_empty()
    {
        assert_eq!(checked.whole, checked.views);
        assert_eq!(run.views(), record.extent.views as usize);
    }
}
