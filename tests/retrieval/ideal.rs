//! Ideal images against closed forms: moments of the refraction angles of the light of an opening.

use crate::support::{Worst, backends, engine};
use beamlet::ndarray::Array3;
use beamlet::retrieve::{Method, RetrieveOptions, Retriever};
use beamlet::scene::{Mesh, Motion, Object, Scene, ShapeOrMesh};
use beamlet::{Backend, Error, RowsControl, material, spectrum};
use beamlet::{IdealImages, IdealOptions, ideal};
use ndarray::Axis;

/// Source to rotation centre, to the detector, and from the rotation centre to the detector mask, m.
const CENTRE: f64 = 1.21;
const DETECTOR: f64 = 1.8;
/// Constants of the plastic: 1/m, and the decrement.
const MU: f64 = 80.0;
const DELTA: f64 = 2.5e-7;

/// The set-up of the paper before `pixels`, with a plastic of round numbers. Bars have no thickness, so that
/// the detector mask is on the detector.
fn scene(pixels: [u32; 2], more: &str) -> Scene {
    Scene::from_toml(&text(pixels, more), ".").unwrap()
}

fn text(pixels: [u32; 2], more: &str) -> String {
    format!(
        "{}\n[detector]\ndistance = \"1.8 m\"\npixels = {pixels:?}\npitch = \"150 um\"\n\
         [materials.plastic]\nmu = \"{MU} /m\"\ndelta = {DELTA:e}\n{more}",
        include_str!("../support/masks.toml")
            .replace("material = \"gold\"\nthickness = \"225 um\"", "transmission = 0.0")
    )
}

fn made(scene: &Scene, options: &IdealOptions) -> IdealImages {
    ideal(&engine(Backend::Bvh), scene, options, &mut RowsControl::default()).unwrap()
}

/// Means of a function over the opening before a column, 30 um wide on the detector; its argument is x at
/// the rotation centre, m.
fn over_opening(column: usize, columns: u32, of: impl Fn(f64) -> f64) -> f64 {
    let count = 2000;
    let centre = (column as f64 + 0.5 - f64::from(columns) / 2.0) * 150e-6;
    let at = |i: i32| centre + 30e-6 * ((f64::from(i) + 0.5) / f64::from(count) - 0.5);
    (0..count).map(|i| of(at(i) * CENTRE / DETECTOR)).sum::<f64>() / f64::from(count)
}

/// Contrasts of light that a ray at x passes as e^−τ, deflected by an angle.
fn contrasts(column: usize, columns: u32, ray: impl Fn(f64) -> [f64; 2]) -> [f64; 3] {
    let of = |power: i32| {
        over_opening(column, columns, |x| {
            let [depth, angle] = ray(x);
            (-depth).exp() * angle.powi(power)
        })
    };
    let [light, first, second] = [of(0), of(1), of(2)];
    let mean = first / light;
    [light, mean, second / light - mean * mean]
}

/// A wedge whose thickness grows by `slope` along x from `thin` at x = 0, m.
fn wedge(slope: f64, thin: f64) -> Object {
    let half = 2e-3;
    let back = |x: f64| thin + slope * x;
    let corners = [[-half, 0.0], [half, 0.0], [half, back(half)], [-half, back(-half)]];
    let corner = |z: f64| corners.map(|[x, y]| [x, y, z]);
    let vertices = [corner(-half), corner(half)].concat();
    let mut triangles = vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]];
    for side in 0..4 {
        let next = (side + 1) % 4;
        triangles.extend([[side, next, next + 4], [side, next + 4, side + 4]]);
    }
    Object::new("wedge", ShapeOrMesh::from(Mesh::Arrays { vertices, triangles }), "plastic")
}

/// One angle, and a transmission that falls along x: T is the mean over the opening, α = −δ dt/dx, no dark
/// field.
#[test]
fn a_wedge_has_one_angle_and_no_dark_field() {
    let (slope, thin) = (2.0, 4.2e-3);
    let columns = 13;
    let mut scene = scene([columns, 2], "");
    scene.objects.push(wedge(slope, thin));
    let images = made(&scene, &IdealOptions::default()).images;
    let mut transmission = Worst::new("T of a wedge", 2e-5);
    // Rays are oblique by up to 5e-4, on a face of slope 2.
    let mut angle = Worst::new("refraction of a wedge over the angle, less 1", 2e-3);
    for column in 0..13 {
        // Thickness along the ray through x at y = 0.
        let depth = |x: f64| MU * (thin + slope * x) / (1.0 - slope * x / CENTRE);
        let expected = over_opening(column, columns, |x| (-depth(x)).exp());
        let x = (column as f64 - 6.0) * 150e-6 * CENTRE / DETECTOR;
        let arm = 1.0 - depth(x) / MU / (DETECTOR - CENTRE);
        let found = |name: &str| f64::from(images[name][[0, 1, column]]);
        transmission.take(found("transmission") / expected - 1.0, || format!("column {column}"));
        let alpha = -DELTA * slope * arm;
        angle.take(found("refraction") / alpha - 1.0, || format!("column {column}"));
        assert!(found("dark_field") < 1e-9 * alpha.abs(), "column {column}");
        assert!(found("transmission_error") < 1e-4 && found("refraction_error") < 1e-10);
    }
    transmission.holds();
    angle.holds();
}

/// Images refer to the lever arm of the axis of rotation wherever it is along the beam; where views move the
/// sample along the beam, to the arm of its mean place: the angle of a view 50 mm before it is 50 mm over the arm
/// larger.
#[test]
fn angles_refer_to_the_axis_where_it_is_along_the_beam() {
    let (slope, thin, axis) = (2.0, 4.2e-3, 1.36);
    let mut scene = scene([3, 1], "");
    scene.objects.push(wedge(slope, thin));
    let arm = DETECTOR - axis;
    let mut worst = Worst::new("refraction of a displaced wedge over the angle, less 1", 2e-3);
    let mut check = |scene: &Scene, displaced: &[f64], name: &str| {
        let options = RetrieveOptions::default();
        let retriever = Retriever::new(&engine(Backend::Bvh), scene, &options).unwrap();
        let per_shift = -scene.magnification() / arm;
        assert!((retriever.angle_per_shift() / per_shift - 1.0).abs() < 1e-12, "{name}");
        let images = made(scene, &IdealOptions::default()).images;
        for (view, by) in displaced.iter().enumerate() {
            let x = -150e-6 * (axis + by) / DETECTOR;
            // From the rear face, which the light leaves at an angle, to the analyser.
            let rear = arm - by - (thin + slope * x);
            let expected = -DELTA * slope * rear / arm;
            let found = f64::from(images["refraction"][[view, 0, 0]]);
            worst.take(found / expected - 1.0, || format!("{name}, view {view}"));
        }
    };
    scene.scan.mask_offsets = (-5..=5).map(|n| 5e-6 * f64::from(n)).collect();
    scene.scan.axis.shift = [0.0, axis - CENTRE, 0.0];
    check(&scene, &[0.0], "shift of the axis");
    scene.scan.axis.shift = [0.0; 3];
    scene.scan.angles = vec![0.0; 2];
    let displaced = [-0.05, 0.05];
    scene.scan.motions =
        displaced.map(|by| Motion::translation([0.0, axis - CENTRE + by, 0.0])).to_vec();
    check(&scene, &displaced, "motions");
    worst.holds();
}

/// Gradients within an opening: α = 2δx/√(R² − x²), weighted by the light, and its variance.
#[test]
fn a_cylinder_is_the_mean_over_each_opening() {
    let radius = 0.6e-3;
    let columns = 11;
    let body = format!(
        "[[object]]\nname = \"rod\"\nmaterial = \"plastic\"\n\
         shape = {{ cylinder = {{ radius = \"{} mm\", height = \"9 mm\" }} }}\n",
        radius * 1e3
    );
    let scene = scene([columns, 2], &body);
    let options = IdealOptions::default().with_tolerance(1e-4).with_angle_tolerance(2e-9);
    for backend in backends() {
        let engine = engine(backend);
        let images = ideal(&engine, &scene, &options, &mut RowsControl::default()).unwrap().images;
        let mut worst = [
            Worst::new("T of a cylinder", 1e-4),
            // The angle is taken off at the rear of the rod, whose arm is 1e-3 less: its faces refract alike.
            Worst::new("refraction of a cylinder, of 1 urad", 3e-3),
            Worst::new("root of the dark field of a cylinder, of 1 urad", 5e-3),
        ];
        for column in 0..11_usize {
            // The rim is at 5.95 columns from the middle; the fourth has a gradient of 2 %.
            let ray = |x: f64| {
                let half = (radius * radius - x * x).sqrt();
                [2.0 * MU * half, 2.0 * DELTA * x / half]
            };
            let expected = contrasts(column, columns, ray);
            let found = ["transmission", "refraction", "dark_field"]
                .map(|name| f64::from(images[name][[0, 0, column]]));
            let place = || format!("{backend:?}, column {column}");
            worst[0].take(found[0] - expected[0], place);
            worst[1].take((found[1] - expected[1]) * 1e6, place);
            worst[2].take((found[2].sqrt() - expected[2].sqrt()) * 1e6, place);
        }
        worst.into_iter().for_each(Worst::holds);
    }
}

/// Fibres side by side, which each ray crosses once: σ² = (2δ)² [asinh ρ/s − 1], where ρ is the reach over 2δ
/// and s = ρ/√(1 + ρ²) the share of the light within it. The variance grows with the logarithm of the
/// reach without end.
#[test]
fn unresolved_fibres_follow_the_logarithm_of_the_reach() {
    // Eight radii are the opening as the axis of rotation sees it.
    let radius = 30e-6 * CENTRE / DETECTOR / 8.0;
    let mut rows = "x_m,y_m,z_m\n".to_owned();
    for number in -60..60 {
        let x = (f64::from(number) + 0.5) * 2.0 * radius;
        rows.push_str(&format!("{x:e},0,0\n"));
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("places.csv");
    std::fs::write(&path, rows).unwrap();
    let body = format!(
        "[materials.clear]\nmu = \"0 /m\"\ndelta = {DELTA:e}\n\
         [[object]]\nname = \"fibres\"\nmaterial = \"clear\"\ninstances = \"{}\"\n\
         shape = {{ cylinder = {{ radius = \"{} um\", height = \"1 mm\" }} }}\n",
        path.display(),
        0.9999e6 * radius
    );
    let scene = scene([3, 1], &body);
    let mut worst = Worst::new("dark field of one layer of fibres, relative", 0.02);
    for ratio in [1.0, 4.0, 16.0] {
        let options = IdealOptions::default()
            .with_reach(2.0 * DELTA * ratio)
            .with_angle_tolerance(5e-9)
            .with_most_rays(16384);
        let images = made(&scene, &options).images;
        let share = ratio / f64::hypot(1.0, ratio);
        let expected = (2.0 * DELTA).powi(2) * (ratio.asinh() / share - 1.0);
        // The middle opening lies over four whole fibres.
        let found = f64::from(images["dark_field"][[0, 0, 1]]);
        worst.take(found / expected - 1.0, || format!("reach {ratio}"));
        assert!(f64::from(images["refraction"][[0, 0, 1]]).abs() < 0.03 * expected.sqrt());
        assert!((images["transmission"][[0, 0, 1]] - 1.0).abs() < 1e-6);
        let told = f64::from(images["dark_field_error"][[0, 0, 1]]);
        assert!(told > 0.0 && told < 0.1 * expected, "{told:e} of {expected:e}");
    }
    worst.holds();
}

/// Two rough faces square to the beam add (δσ)² each.
#[test]
fn rough_faces_add_their_variance() {
    let body = "[[object]]\nname = \"plate\"\nmaterial = \"plastic\"\nroughness = 0.05\n\
                shape = { box = { size = [\"4 mm\", \"0.1 mm\", \"4 mm\"] } }\n";
    let images = made(&scene([3, 2], body), &IdealOptions::default()).images;
    let expected = 2.0 * (DELTA * 0.05_f64).powi(2);
    let mut worst = Worst::new("dark field of rough faces, relative", 1e-3);
    for value in &images["dark_field"] {
        worst.take(f64::from(*value) / expected - 1.0, || "plate".into());
    }
    worst.holds();
}

/// The mean of e^−μ(E)t over the nodes of the spectrum.
#[test]
fn spectra_are_sums_over_their_nodes() {
    let body = "[[object]]\nname = \"plate\"\nmaterial = \"aluminium\"\n\
                shape = { box = { size = [\"4 mm\", \"3 mm\", \"4 mm\"] } }\n";
    let tube = "spectrum = { anode = \"tungsten\", kvp = \"60 kV\" }";
    let text = text([3, 1], body).replace("energy = \"30 keV\"", tube);
    let scene = Scene::from_toml(&text, ".").unwrap();
    let nodes = spectrum::nodes(&scene).unwrap();
    assert!(nodes.energies.len() > 3);
    let constants = material::constants_over(&scene, "aluminium", &nodes.energies).unwrap();
    let through = |(weight, it): (&f64, &material::Constants)| weight * (-3e-3 * it.mu).exp();
    let expected: f64 = nodes.weights.iter().zip(&constants).map(through).sum();
    let images = made(&scene, &IdealOptions::default()).images;
    let found = f64::from(images["transmission"][[0, 0, 1]]);
    assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
}

/// Retrieval without noise finds the ideal images of a smooth body within the bias of its method: 0.5 % of α,
/// and T of the light of a blurred opening.
#[test]
fn retrieval_finds_ideal_images_where_a_body_is_smooth() {
    let body = "[scan]\nmask_offsets = { from = \"-25 um\", to = \"25 um\", count = 11 }\n\
                angles = [\"0 deg\", \"40 deg\"]\n\
                [[object]]\nname = \"ball\"\nmaterial = \"plastic\"\n\
                shape = { ellipsoid = { semi_axes = [\"2 mm\", \"1.4 mm\", \"2 mm\"] } }\n";
    let scene = scene([15, 3], body);
    let engine = engine(Backend::Bvh);
    let truth = made(&scene, &IdealOptions::default());
    let stacks = engine.simulate(&scene).unwrap();
    let options = RetrieveOptions::default().with_method(Method::ExactCurve);
    let mut retriever = Retriever::new(&engine, &scene, &options).unwrap();
    retriever.set_flat_array(stacks.flat.view()).unwrap();
    let mut worst = [Worst::new("T", 2e-3), Worst::new("refraction, of 1 urad", 1e-2)];
    for view in 0..2 {
        let images = retriever.retrieve_array(stacks.sample.index_axis(Axis(0), view)).unwrap();
        for (worst, (name, scale)) in
            worst.iter_mut().zip([("transmission", 1.0), ("refraction", 1e6)])
        {
            let found = images.get(name).unwrap();
            for ((row, column), value) in found.indexed_iter() {
                let off = f64::from(value - truth.images[name][[view, row, column]]);
                worst.take(off * scale, || format!("view {view}, row {row}, column {column}"));
            }
        }
    }
    worst.into_iter().for_each(Worst::holds);
    assert_eq!(truth.images["transmission"].dim(), (2, 3, 15));
    assert!(truth.geometry.contains("\"angles_deg\""));
}

/// A rod behind the axis moves to both sides equally in a sweep about the optical axis. Few rays see all of
/// a sweep of many parts.
#[test]
fn ideal_images_of_fly_scans_cover_the_whole_sweep() {
    let fly = "[scan]\nfly = { count = 100, sweep = \"4 deg\" }\n[[object]]\nname = \"rod\"\n\
               material = \"plastic\"\nshape = { cylinder = { radius = \"0.2 mm\", height = \"9 mm\" } }\n\
               position = [\"0 mm\", \"6 mm\", \"0 mm\"]\n";
    let images = made(&scene([8, 1], fly), &IdealOptions::default()).images;
    let row: Vec<f32> = images["transmission"].iter().copied().collect();
    println!("transmission in a sweep: {row:?}");
    // A quarter of the sweep moves the rod by a column, which changes the transmission by 2 %.
    let mut worst = Worst::new("transmission beside its mirror image", 2e-3);
    for (column, value) in row.iter().enumerate() {
        worst.take(f64::from(value - row[row.len() - 1 - column]), || column.to_string());
    }
    worst.holds();
    assert!(row.iter().copied().fold(1.0, f32::min) < 0.99);
}

#[test]
fn ideal_images_have_the_columns_of_retrieved_ones() {
    let shape = |scene: &Scene| -> Array3<f32> {
        made(scene, &IdealOptions::default()).images["transmission"].clone()
    };
    // Dithers side by side.
    let dithered = scene([4, 2], "[scan]\ndithers = [\"0 um\", \"20 um\", \"40 um\"]\n");
    assert_eq!(shape(&dithered).dim(), (1, 2, 12));
    // A beamlet every 5 pixels behind a sample mask alone.
    let mut tracked = scene([20, 2], "");
    tracked.detector_mask = None;
    tracked.detector.pitch = [30e-6; 2];
    assert_eq!(shape(&tracked).dim(), (1, 2, 4));
    // Each second pixel lies behind bars.
    let mut skipped = scene([4, 2], "");
    let mask = skipped.detector_mask.as_mut().unwrap();
    (mask.period, mask.offset) = (300e-6, 75e-6);
    let is_open: Vec<bool> = shape(&skipped).iter().take(4).map(|value| !value.is_nan()).collect();
    assert_eq!(is_open.iter().filter(|open| **open).count(), 2, "{is_open:?}");
}

#[test]
fn options_that_cannot_be_are_refused() {
    let scene = scene([2, 1], "");
    let default = IdealOptions::default;
    for (options, name) in [
        (default().with_reach(0.0), "reach"),
        (default().with_tolerance(f64::NAN), "tolerance"),
        (default().with_angle_tolerance(-1.0), "angle_tolerance"),
        (default().with_most_rays(3), "most_rays"),
    ] {
        let found = ideal(&engine(Backend::Bvh), &scene, &options, &mut RowsControl::default());
        match found {
            Err(Error::Argument { name: found, .. }) => assert_eq!(found, name),
            other => panic!("{name}: {other:?}"),
        }
    }
    let control = &mut RowsControl::default();
    control.cancel.cancel();
    let ended = ideal(&engine(Backend::Bvh), &scene, &default(), control);
    assert!(matches!(ended, Err(Error::Interrupted)), "{ended:?}");
}
