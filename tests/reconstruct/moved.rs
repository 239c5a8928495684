//! Views with motions of their own: helical and cycloidal scans, tilted axes, tables.

use crate::projector::{adjoint, difference, model, noise, sampled};
use crate::reference::blobs::Blob;
use crate::set_up::{
    PIXEL, blobs, deviation, fan, grid, parallel, places, reconstruct, sinograms, views_over_a_turn,
};
use crate::support::{self, Worst};
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{
    Data, FbpOptions, GridChoice, IterativeOptions, Measured, Quantity, ScanGeometry, Solver,
    VolumeGrid, iterate,
};
use beamlet::scene::{Motion, Scene};
use beamlet::{Backend, RowsControl};
use std::f64::consts::TAU;

/// A scan whose motions are turns by its angles and then those of a function of the angle.
fn moved(geometry: ScanGeometry, after: impl Fn(f64) -> Motion) -> ScanGeometry {
    let turn = |angle: &f64| Motion::about_z(-angle).then(&after(*angle));
    let motions = geometry.angles.iter().map(turn).collect();
    let made = geometry.with_motions(motions);
    assert!(made.motions.is_some());
    made
}

fn about_x(angle: f64) -> Motion {
    Motion::about([1.0, 0.0, 0.0], angle).unwrap()
}

fn along(x: f64, z: f64) -> impl Fn(f64) -> Motion {
    move |angle| Motion::translation([x * angle / TAU, 0.0, z * angle / TAU])
}

/// A cone of 48 by `rows` pixels and `count` views over some turns about the middle.
fn wide(rows: i32, count: i32, turns: f64) -> ScanGeometry {
    let pitch = 2.0 * PIXEL;
    let angle = |n: i32| turns * TAU * ((f64::from(n) + 0.5) / f64::from(count) - 0.5);
    let rows = places(rows, pitch).into_iter().rev().collect();
    let angles = (0..count).map(angle).collect();
    ScanGeometry::new([0.03, 0.06], places(48, pitch), rows, angles)
}

/// A cone of ±8°, 24 by 6 pixels and 11 views.
fn cone() -> ScanGeometry {
    let pitch = 2.0 * PIXEL;
    let rows = places(6, pitch).into_iter().rev().map(|z| z + 0.3 * pitch).collect();
    let mut geometry =
        ScanGeometry::new([0.02, 0.04], places(24, pitch), rows, views_over_a_turn(11));
    geometry.lever = 0.03;
    geometry
}

#[test]
fn back_projection_is_the_transpose_under_any_motion() {
    let helix = along(0.0, 6.0 * PIXEL);
    adjoint(&moved(cone(), helix), &grid([20, 14, 7]), "helical cone");
    let mut beside = cone();
    beside.axis = -2.2 * PIXEL;
    let region =
        VolumeGrid { origin: [-9.0 * PIXEL, 2.0 * PIXEL, 1.5 * PIXEL], ..grid([20, 8, 3]) };
    adjoint(&moved(beside, along(9.0 * PIXEL, 0.0)), &region, "cycloidal cone, a region");
    // Half of the rays along z, and all of them.
    for angle in [0.8, 1.5] {
        let tilted = moved(cone(), move |_| about_x(angle));
        adjoint(&tilted, &grid([10, 14, 9]), "tilted cone");
    }
    let one_row = moved(fan(11), along(0.0, 4.0 * PIXEL));
    adjoint(&one_row, &grid([16, 14, 5]), "helical fan");
    let mut uneven = parallel(11);
    for (n, x) in uneven.columns.iter_mut().enumerate() {
        *x += [0.0, 0.3, -0.2][n % 3] * PIXEL;
    }
    let turning = moved(uneven, |angle| about_x(1.5 * angle).then(&along(5e-4, 0.0)(angle)));
    let oblong = VolumeGrid { voxel: [0.7 * PIXEL, 1.3 * PIXEL, PIXEL], ..grid([16, 14, 5]) };
    adjoint(&turning, &oblong, "parallel beam, any motion");
}

/// The kernels of circles and those of motions sum the same terms.
#[test]
fn circles_by_motions_are_circles() {
    let mut worst = Worst::new("a circle by motions", 3e-6);
    let mut geometry = cone();
    geometry.axis = -2.2 * PIXEL;
    let turns = geometry.angles.iter().map(|angle| Motion::about_z(-angle)).collect();
    let mut by_motions = geometry.clone();
    by_motions.motions = Some(turns);
    let grid = grid([20, 14, 9]);
    let volume = noise((9, 14, 20), 5);
    for data in [Data::Attenuation, Data::Refraction, Data::DarkField] {
        let control = &mut RowsControl::default();
        let project = |geometry| model(geometry, &grid, data, None).project(volume.view(), control);
        let mut project = project;
        let [own, other] = [&geometry, &by_motions].map(|geometry| project(geometry).unwrap());
        worst.take(difference(&own, &other), || format!("{data:?}"));
    }
    worst.holds();
}

/// Linear interpolation adds 1/6 of a squared voxel to the variance of a blob of 8 in both directions
/// across a ray, the difference over a column 1/12: 0.65 % of the height of its derivative, half of that
/// in the mean.
#[test]
fn projected_blobs_are_the_closed_form_under_motion() {
    let mut worst = Worst::new("projected blobs", 3.3e-3);
    let tilt = |angle: f64| move |_| about_x(angle);
    let mut scans = vec![
        ("helical", moved(wide(12, 20, 3.0), along(0.0, 20.0 * PIXEL))),
        ("cycloidal", moved(wide(24, 8, 1.0), along(15.0 * PIXEL, 0.0))),
        ("tilted by 20 degrees", moved(wide(24, 8, 1.0), tilt(0.35))),
        ("seen from above", moved(wide(24, 8, 1.0), tilt(1.4))),
    ];
    // Blobs at 1.2 mm then have arms from 0.94 to 1.06.
    scans.iter_mut().for_each(|(_, scan)| scan.lever = 0.02);
    let blobs = blobs().map(|blob| {
        let [x, y, _] = blob.centre;
        Blob { centre: [x, y, x / 2.0], ..blob }
    });
    let grid = grid([80, 80, 72]);
    let volume = sampled(&grid, |point| blobs.iter().map(|blob| blob.at(point)).sum());
    for (name, geometry) in &scans {
        for (data, quantity) in [
            (Data::Attenuation, Quantity::Mu),
            (Data::Refraction, Quantity::Delta),
            (Data::DarkField, Quantity::DarkField),
        ] {
            let truth = sinograms(geometry, &blobs, quantity);
            let made = model(geometry, &grid, data, None)
                .project(volume.view(), &mut RowsControl::default())
                .unwrap();
            worst.take(difference(&made, &truth), || format!("{name}, {data:?}"));
        }
    }
    worst.holds();
}

/// Three turns of a helix, a quarter of the blobs' height in each view. By CGLS from refraction; with
/// `BEAMLET_ALL` by Barzilai-Borwein steps, from attenuation and from dark fields, too.
#[test]
fn helical_scans_give_the_blobs() {
    let mut worst = Worst::new("blobs of a helical scan", 5e-3);
    let views = if support::everything() { 180 } else { 130 };
    let mut geometry = moved(wide(10, views, 3.0), along(0.0, 10.0 * PIXEL));
    geometry.lever = 0.02;
    let blobs = [([6.0, -4.0, -4.0], 5.0, 1.0), ([-5.0, 5.0, 5.0], 4.0, 0.7)].map(
        |(centre, sigma, peak)| Blob {
            centre: centre.map(|place: f64| place * PIXEL),
            sigma: sigma * PIXEL,
            peak,
        },
    );
    let grid = grid([44, 44, 40]);
    let cases = vec![
        (Data::Refraction, Quantity::Delta, Solver::Cgls),
        (Data::Attenuation, Quantity::Mu, Solver::Cgls),
        (Data::Attenuation, Quantity::Mu, Solver::Bb),
        (Data::DarkField, Quantity::DarkField, Solver::Cgls),
    ];
    for (data, quantity, solver) in support::sample(cases, 4) {
        let sinograms = sinograms(&geometry, &blobs, quantity);
        let options = IterativeOptions::default()
            .with_solver(solver)
            .with_iterations(support::amount(10, 15));
        let measured = Measured::new(data, sinograms.view());
        let engine = support::engine(Backend::Bvh);
        let control = &mut RowsControl::default();
        let made = iterate(&engine, &geometry, &measured, &grid, &options, control).unwrap();
        let error = deviation(&made.volume, &blobs);
        println!("measured {data:?} {solver:?}: {error:.2e}");
        worst.take(error, || format!("{data:?}, {solver:?}"));
    }
    worst.holds();
}

const SCENE: &str = r#"
    [source]
    distance = "0.5 m"
    spot = "0 um"
    energy = "30 keV"
    [detector]
    distance = "1 m"
    pixels = [12, 6]
    pitch = "100 um"
    [scan]
    angles = { from = "-540 deg", to = "540 deg", count = 24 }
"#;

#[test]
fn scenes_have_the_motions_of_their_views() {
    let mut scene = Scene::from_toml(SCENE, ".").unwrap();
    let circle = ScanGeometry::of_scene(&scene);
    assert_eq!(circle.motions, None);
    scene.scan.travel = [0.0, 0.0, 2e-4];
    scene.scan.axis.shift = [3e-4, 2e-3, 0.0];
    let geometry = ScanGeometry::of_scene(&scene);
    assert!((geometry.source_distance - 0.502).abs() < 1e-15);
    assert!((geometry.axis - 3e-4).abs() < 1e-15, "{}", geometry.axis);
    let motions = geometry.motions.as_ref().unwrap();
    for (motion, angle) in motions.iter().zip(&circle.angles) {
        // The sample turns back by the angle of the set-up, and travels up along the axis, whose place beside
        // the optical axis is apart.
        let (sin, cos) = angle.sin_cos();
        let [x, y, z] = motion.point([1e-3, 2e-3, 5e-3]);
        let expected =
            [1e-3 * cos + 2e-3 * sin, 2e-3 * cos - 1e-3 * sin, 5e-3 + 2e-4 * angle / TAU];
        let off = [x - expected[0], y - expected[1], z - expected[2]];
        assert!(off.iter().all(|off| off.abs() < 1e-12), "{off:?}");
    }
    // Planes cover what the rows see of the axis: 1.5 turns of 0.2 mm either way, and the rows.
    let grid = GridChoice::default().grid(&geometry).unwrap();
    let [low, high] = grid.ends()[2];
    // The last view is at 495 degrees; rows reach 0.1255 mm.
    assert!((low + 4.005e-4).abs() < 1e-9 && (4.255e-4..4.8e-4).contains(&high), "{low} {high}");
    let far = GridChoice::default().with_size([4, 4, 1]).with_origin([0.0, 0.0, 2e-3]);
    let message = far.grid(&geometry).unwrap_err().to_string();
    assert!(message.contains("that no view sees"), "{message}");
    let message = reconstruct(
        &geometry,
        &Array3::zeros((24, 6, 12)),
        Quantity::Mu,
        &grid,
        &FbpOptions::default(),
    )
    .unwrap_err()
    .to_string();
    assert!(message.contains("helical") && message.contains("cgls"), "{message}");
}

#[test]
fn motions_have_to_fit_the_views() {
    let geometry = moved(wide(4, 12, 1.0), along(0.0, PIXEL));
    let mut short = geometry.clone();
    short.motions.as_mut().unwrap().pop();
    let zeros = Array3::<f32>::zeros((12, 4, 48));
    let refused = |geometry: &ScanGeometry, grid: &VolumeGrid, words: &str| {
        let measured = Measured::new(Data::Attenuation, zeros.view());
        let engine = support::engine(Backend::Bvh);
        let options = IterativeOptions::default();
        let control = &mut RowsControl::default();
        let made = iterate(&engine, geometry, &measured, grid, &options, control);
        let message = made.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    refused(&short, &grid([4, 4, 4]), "11 motions for 12 views");
    let far = VolumeGrid { origin: [0.0, -0.031, 0.0], ..grid([4, 4, 4]) };
    refused(&geometry, &far, "between the source and the detector");
}
