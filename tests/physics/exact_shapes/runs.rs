//! Whole runs: what is retrieved of exact cylinders, both backends, bands and threads.

use super::rays::{LEVER, first_order};
use super::solids::{Kind, Solid, cylinder, sphere};
use crate::reference::fit::fit;
use crate::reference::masks::Bars;
use crate::reference::normal::cumulative;
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::support::cuts::{Cut, bands, no_bit_changes};
use crate::support::{CARBON, WATER, Worst, amount, backends, engine, free_gaussian, sample};
use crate::transport::ray;
use beamlet::retrieve::Retriever;
use beamlet::scene::{Instances, MaterialSpec, Scene};
use std::fmt::Write as _;

const PIXELS: u32 = 32;

/// 11 steps over +-25 um.
fn offsets() -> Vec<f64> {
    (0..11).map(|i| -25e-6 + 5e-6 * f64::from(i)).collect()
}

fn with(mut scene: Scene, solids: &[(Solid, [f64; 2])]) -> Scene {
    for (number, (solid, [mu, delta])) in solids.iter().enumerate() {
        let material = format!("material {number}");
        scene.objects.push(solid.object(&format!("solid {number}"), &material));
        scene.materials.insert(material, MaterialSpec::Constants { mu: *mu, delta: *delta });
    }
    scene
}

/// Curve of a pixel of thin opaque masks: light of the aperture, which moves by the offset, lands
/// where the magnification and the solid bring it, blurred by the spot. Sums over places of the
/// aperture and heights of the row: what they leave is below 1e-12 rad.
fn curve(setup: &Setup, solid: Option<&Solid>, column: u32) -> Vec<f64> {
    let blur = 0.5 * setup.sigma()[0];
    let pixel = f64::from(column) + 0.5 - 0.5 * f64::from(PIXELS);
    let [along, up] = [40, 8].map(|n: u32| move |k: u32| (f64::from(k) + 0.5) / f64::from(n) - 0.5);
    let at = |offset: f64, k: u32, j: u32| {
        // In the plane of the aperture.
        let x = pixel * 100e-6 + offset + 20e-6 * along(k);
        let z = 100e-6 * up(j);
        let slope = [x / 1.2, z / 1.2];
        let place = slope.map(|s| 1.21 * s);
        let ray = ray(0.0, 0.0, slope, 0);
        let moved = solid.map_or(0.0, |solid| {
            first_order(std::slice::from_ref(solid), &CARBON[1..], &ray, place).displacement[0]
        });
        let off = 1.5 * (x - pixel * 100e-6) + moved;
        cumulative((15e-6 - off) / blur) - cumulative((-15e-6 - off) / blur)
    };
    let sum = |offset: f64| {
        let cells = (0..40).flat_map(|k| (0..8).map(move |j| (k, j)));
        cells.map(|(k, j)| at(offset, k, j)).sum::<f64>() / 320.0 * 0.2
    };
    offsets().into_iter().map(sum).collect()
}

#[test]
fn refraction_of_an_exact_cylinder_is_retrieved_to_1e_9_rad() {
    assert!((LEVER - 0.59).abs() < 1e-15);
    let mut worst = Worst::new("retrieved, exact cylinder, refraction angle (rad)", 1e-9);
    let setup = Setup::paper([PIXELS, 1]).with_bars(Bars::Sheet { transmission: 0.0 });
    let upright = Solid::new(cylinder(1.1e-3, 8e-3));
    let ten = 10.0_f64.to_radians();
    let leaning = upright.clone().turned([0.0, 1.0, 0.0], ten);
    let towards = upright.clone().turned([1.0, 0.0, 0.0], ten);
    let flat = curve(&setup, None, 16);
    let solids = [("towards", towards), ("leaning", leaning), ("upright", upright)];
    let both = |it: (&'static str, Solid)| backends().into_iter().map(move |on| (it.clone(), on));
    // The one that leans towards the source, with one backend; all with `BEAMLET_ALL`.
    for ((name, solid), backend) in sample(solids.into_iter().flat_map(both).collect(), 6) {
        let of = [(solid.clone(), [0.0, CARBON[1]])];
        let mut scene = with(scenes::scene(&setup, &[], &offsets()), &of);
        // The default of 2 nrad leaves about 0.3 nrad.
        scene.sampling.angle_tolerance = Some(1e-10);
        scene.sampling.tolerance = Some(1e-5);
        let engine = engine(backend);
        let stacks = engine.simulate(&scene).expect("a stack");
        let options = free_gaussian();
        let mut retriever = Retriever::new(&engine, &scene, &options).expect("a method");
        retriever.set_flat_array(stacks.flat.view()).expect("a flat field");
        let frames = stacks.sample.index_axis(ndarray::Axis(0), 0);
        let images = retriever.retrieve_array(frames).expect("images");
        // Within 0.86 of the radius.
        for column in 7..PIXELS - 7 {
            let found = images.get("refraction").expect("an image")[[0, column as usize]];
            let [f, s] = [&flat, &curve(&setup, Some(&solid), column)];
            let [f, s] = [f, s].map(|curve| fit(&offsets(), curve));
            let want = -1.5 / 0.59 * (s[1] - f[1]);
            let place = || format!("{backend}, {name}, column {column}: {found} for {want}");
            worst.take(f64::from(found) - want, place);
        }
    }
    worst.holds();
}

/// Exact shapes of every kind, beads in many places among them, in a view; two with `BEAMLET_ALL`.
fn crowd(directory: &std::path::Path) -> Scene {
    let mut beads = String::from("x_um,y_um,z_um,scale,axis_x,axis_y,axis_z,angle_deg\n");
    for k in 0..24_i32 {
        let [x, z] = [k % 6, k / 6].map(|at| 110 * at);
        writeln!(
            beads,
            "{},{},{},{},1,{},2,{}",
            x - 300,
            400 + k,
            z - 200,
            0.5 + 0.008 * f64::from(k),
            k % 3,
            17 * k
        )
        .expect("text");
    }
    std::fs::write(directory.join("beads.csv"), beads).expect("a file");
    let solids = [
        (
            Solid::new(cylinder(0.2e-3, 0.7e-3))
                .turned([1.0, 0.3, 0.0], 0.7)
                .at([-0.4e-3, 0.0, 0.0]),
            CARBON,
        ),
        (
            Solid::new(Kind::Cone { bottom: 0.2e-3, top: 0.0, half: 0.2e-3 })
                .at([0.45e-3, 0.0, 0.0]),
            WATER,
        ),
        (Solid::new(sphere(0.09e-3)).at([-0.4e-3, 0.0, 0.0]), [0.0, 1e-6]),
        (
            Solid::new(Kind::Tube { outer: 0.15e-3, inner: 0.1e-3, half: 0.1e-3 })
                .turned([1.0, 0.0, 0.0], 0.4)
                .at([0.8e-3, 0.0, 0.0]),
            CARBON,
        ),
        (Solid::new(Kind::Ellipsoid([20e-6, 30e-6, 25e-6])), CARBON),
    ];
    let mut scene = with(scenes::scene(&Setup::paper([8, 3]), &[], &[-20e-6, 0.0, 9e-6]), &solids);
    let beads = scene.objects.last_mut().expect("beads");
    beads.instances = Some(Instances::File(directory.join("beads.csv")));
    scene.scan.angles = amount(vec![1.5], vec![0.0, 1.5]);
    scene.sampling.tolerance = Some(5e-4);
    scene
}

#[test]
fn exact_shapes_and_instances_give_the_same_picture_however_it_is_made() {
    let directory = tempfile::tempdir().expect("a directory");
    let scene = crowd(directory.path());
    let every = Cut { batch: Some(4096), threads: Some(1), ..bands(3) };
    let cuts = vec![Cut { batch: Some(1025), threads: Some(7), ..bands(1) }, every];
    let cuts: Vec<Cut> = sample(cuts, 2).collect();
    let whole = no_bit_changes("exact shapes", &scene, &cuts);
    let tally = &whole.record.tally;
    assert_eq!([tally.unbalanced, tally.not_finite, tally.dropped], [0; 3]);
    assert!(tally.exact > 0);
    for backend in backends().into_iter().skip(1) {
        let mut worst = Worst::new("exact shapes, pictures of both backends", 1e-6);
        let other = engine(backend).simulate(&scene).expect("a stack");
        for ((at, a), b) in whole.sample.indexed_iter().zip(&other.sample) {
            worst.take(f64::from(a - b), || format!("{backend}, {at:?}"));
        }
        worst.holds();
    }
}
