//! Scans, sinograms and grids that cannot be reconstructed.

use crate::set_up::{PIXEL, fan, grid, places, reconstruct, views};
use crate::support;
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{
    Data, FbpOptions, IterativeOptions, Measured, Method, Quantity, ScanGeometry, VolumeGrid,
    VolumePlan, estimate, find_axis, suppress_rings,
};
use beamlet::scene::{Beam, Detector, Motion, RotationAxis, Scene, Source};
use beamlet::{Backend, Cancel, Error, RowsControl};

#[track_caller]
fn refused(geometry: &ScanGeometry, sinograms: &Array3<f32>, grid: &VolumeGrid, words: &str) {
    let options = FbpOptions::default();
    let made = reconstruct(geometry, sinograms, Quantity::Mu, grid, &options);
    let message = made.unwrap_err().to_string();
    assert!(message.contains(words), "{message}");
}

#[test]
fn what_cannot_be_reconstructed_is_named() {
    let (good, grid) = (fan(180), grid([8, 8, 1]));
    let zeros = |geometry: &ScanGeometry| Array3::zeros((geometry.angles.len(), 1, 96));
    let few = fan(110);
    refused(&few, &zeros(&few), &grid, "half a turn and the fan");
    let mut torn = fan(180);
    torn.angles.drain(40..60);
    refused(&torn, &zeros(&torn), &grid, "a gap of 42");
    refused(&good, &Array3::zeros((180, 2, 96)), &grid, "(180, 1, 96)");
    let mut sinograms = zeros(&good);
    sinograms[[7, 0, 5]] = f32::NAN;
    refused(&good, &sinograms, &grid, "view 7, row 0, column 5");
    let far = VolumeGrid { origin: [-200.0 * PIXEL; 3], ..grid };
    refused(&good, &zeros(&good), &far, "from the axis of rotation");
    let mut unsorted = fan(180);
    unsorted.columns.swap(3, 4);
    refused(&unsorted, &zeros(&good), &grid, "ascending");
    let two = ScanGeometry::new([0.01, 0.02], places(96, PIXEL), vec![0.0], views(2));
    refused(&two, &zeros(&two), &grid, "three or more");
}

/// Geometries that a caller takes apart are errors, and end no program.
#[test]
fn estimates_of_scans_that_cannot_be_are_refused() {
    let engine = support::engine(Backend::Bvh);
    let refused = |geometry: &ScanGeometry, grid: VolumeGrid, words: &str| {
        for method in [Method::default(), Method::iterative(IterativeOptions::default(), false)] {
            let plan = VolumePlan::new(vec![Quantity::Mu], grid, method);
            let made = estimate(&engine, geometry, &plan, true, &mut RowsControl::default());
            let message = made.unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    };
    let good = grid([8, 8, 1]);
    let changed = |change: fn(&mut ScanGeometry)| {
        let mut geometry = fan(180);
        change(&mut geometry);
        geometry
    };
    refused(&changed(|it| it.columns.clear()), good, "0 columns");
    refused(&changed(|it| it.rows.clear()), good, "0 rows");
    refused(&changed(|it| it.angles.truncate(1)), good, "1 view");
    refused(&fan(180), grid([0, 8, 1]), "one voxel or more");
}

/// A long search ends where its caller wants.
#[test]
fn the_search_of_the_axis_and_of_stripes_can_be_interrupted() {
    let geometry = fan(180);
    let mut sinograms = Array3::ones((180, 1, 96));
    let cancel = Cancel::default();
    cancel.cancel();
    let found = find_axis(&geometry, sinograms.view(), Data::Attenuation, &cancel);
    assert!(matches!(found, Err(Error::Interrupted)), "{found:?}");
    let made = suppress_rings(&geometry, sinograms.view_mut(), &cancel);
    assert!(matches!(made, Err(Error::Interrupted)), "{made:?}");
    let measured = Measured::new(Data::Refraction, sinograms.view());
    let method = Method::iterative(IterativeOptions::default(), true);
    let control = &mut RowsControl::default().with_cancel(cancel);
    let engine = support::engine(Backend::Bvh);
    let made = method.volume(&engine, &geometry, &measured, &grid([8, 8, 1]), control);
    assert!(matches!(made, Err(Error::Interrupted)), "{made:?}");
}

/// Work that is cancelled midway ends at its next look at the cancel, and reports no further progress.
#[test]
fn a_volume_that_is_cancelled_midway_ends_before_its_next_report() {
    let geometry = fan(180);
    let sinograms = Array3::ones((180, 1, 96));
    let measured = Measured::new(Data::Attenuation, sinograms.view());
    let engine = support::engine(Backend::Bvh);
    // In parts of some views, however fast the device is.
    let parts = FbpOptions::default().with_at_once(96 * 96);
    for method in [Method::Fbp(parts), Method::iterative(IterativeOptions::default(), false)] {
        let (cancel, mut reports) = (Cancel::default(), 0);
        let mut progress = |_, _| {
            reports += 1;
            if reports == 2 {
                cancel.cancel();
            }
        };
        let control = RowsControl::default().with_progress(&mut progress);
        let control = &mut control.with_cancel(cancel.clone());
        let made = method.volume(&engine, &geometry, &measured, &grid([96, 96, 1]), control);
        assert!(matches!(made, Err(Error::Interrupted)), "{method:?}");
        assert_eq!(reports, 2, "{method:?}");
    }
}

#[test]
fn the_scan_of_a_scene_has_its_pixels_and_motions() {
    let source = Source::new(1.2, [30e-6; 2], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, [4, 2], [150e-6, 100e-6]));
    scene.scan.angles = views(180);
    let geometry = ScanGeometry::of_scene(&scene);
    assert_eq!(geometry.columns, places(4, 150e-6));
    assert_eq!(geometry.rows, [50e-6, -50e-6]);
    let grid = VolumeGrid::of(&geometry).unwrap();
    assert_eq!(grid.size, [4, 4, 2]);
    assert!((grid.voxel[0] - 100e-6).abs() < 1e-12 && (grid.origin[2] + 50e-6 / 1.5).abs() < 1e-12);
    scene.scan.axis = RotationAxis::new([0.3e-3, 2e-3, 0.0], 0.0, 0.0);
    let shifted = ScanGeometry::of_scene(&scene);
    assert_eq!((shifted.axis, shifted.source_distance), (0.3e-3, 1.202));
    scene.scan.axis.tilt_x = 1e-3;
    assert_eq!(ScanGeometry::of_scene(&scene).motions.map(|all| all.len()), Some(180));
    scene.scan.axis = RotationAxis::default();
    scene.scan.motions = vec![Motion::translation([1e-3, 0.0, 0.0]); 180];
    let moved = ScanGeometry::of_scene(&scene).motions.unwrap();
    let [x, y, z] = moved[0].point([0.0; 3]);
    assert!((x - 1e-3).abs() < 1e-12 && y.abs() < 1e-12 && z.abs() < 1e-12, "{x} {y} {z}");
}
