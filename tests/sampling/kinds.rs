//! Light and reported errors of scenes of all kinds.

use crate::apertures;
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cuboid, cylinder, extruded, sphere};
use crate::support::{CARBON, Checked, WATER, Worst, amount, backends, engine, sample};
use beamlet::scene::{Beam, Blur, MaskBody, Scene, Shape, SpectrumOrigin, SpectrumSpec, Transport};
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control, RunRecord};
use ndarray::Array4;

/// Tolerance of the light that is compared.
const TOLERANCE: f64 = 3e-4;

/// A ball, an upright slab and a tilted rod.
pub(super) fn meshes() -> Scene {
    let rod = cylinder(0.1e-3, 0.9e-3, 24, 0.2).turned([1.0, 0.3, 0.0], 0.7);
    let bodies = [
        body(sphere(0.25e-3, 3).moved([-0.4e-3, 0.0, 0.1e-3]).rounded(), CARBON[0], CARBON[1]),
        body(cuboid([0.2e-3, 1.5e-3, 0.5e-3]), WATER[0], WATER[1]),
        body(rod.moved([0.4e-3, 0.0, 0.0]).rounded(), WATER[0], WATER[1]),
    ];
    scenes::scene(&Setup::paper([12, 5]), &bodies, &[-20e-6, 0.0, 9e-6])
}

/// Steps whose walls are along the beam, at either side of the axis, and a box with such sides, turned a little: rays
/// on both sides of a wall cross one body in the same way.
fn walls_of_meshes() -> Scene {
    let (half, high) = (0.15e-3, 1e-3);
    // From the inner corner on, so that triangles from there make a section.
    let section =
        [[0.0, 0.0], [0.0, high], [-half, high], [-half, -high], [half, -high], [half, 0.0]];
    let step = |x: f64| extruded(&section, 0.6e-3).moved([x, 0.0, 0.0]).rounded();
    let turned = cuboid([0.12e-3, 1.2e-3, 0.8e-3]).turned([0.1, 0.2, 1.0], 1e-3);
    let bodies = [
        body(step(-0.4e-3), WATER[0], WATER[1]),
        body(step(0.4e-3), CARBON[0], CARBON[1]),
        body(turned.rounded(), WATER[0], WATER[1]),
    ];
    scenes::scene(&Setup::paper([12, 5]), &bodies, &[-20e-6, 0.0, 9e-6])
}

/// Objects between gold masks, at four offsets.
pub(super) fn of_objects(objects: &str) -> Scene {
    let set_up = "[source]\ndistance = \"1.2 m\"\nspot = \"20 um\"\nenergy = \"25 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [14, 5]\npitch = \"75 um\"\n\
         [sample_mask]\ndistance = \"1.19 m\"\nmaterial = \"gold\"\nthickness = \"200 um\"\n\
         projected_aperture = \"20 um\"\n\
         [detector_mask]\nmaterial = \"gold\"\nthickness = \"200 um\"\nprojected_aperture = \"30 um\"\n\
         [scan]\nmask_offsets = [\"-12 um\", \"-4 um\", \"3 um\", \"11 um\"]\n";
    Scene::from_toml(&[set_up, objects].concat(), std::path::Path::new(".")).expect("a scene")
}

/// Exact shapes, one in the other.
pub(super) fn shapes() -> Scene {
    of_objects(
        "[[object]]\nname = \"tube\"\nshape = { cylinder = { radius = \"240 um\", height = \"4 mm\" } }\n\
         material = \"PMMA\"\nrotate = [{ axis = [0, 1, 0], angle = \"20 deg\" }]\n\
         [[object]]\nname = \"bore\"\nshape = { cylinder = { radius = \"150 um\", height = \"5 mm\" } }\n\
         material = \"air\"\nrotate = [{ axis = [0, 1, 0], angle = \"20 deg\" }]\n\
         [[object]]\nname = \"ball\"\nshape = { sphere = { radius = \"60 um\" } }\nmaterial = \"Al\"\n",
    )
}

/// Exact walls along the beam: a rod with a blind hole, and a tube through both.
fn walls() -> Scene {
    of_objects(
        "[[object]]\nname = \"rod\"\nshape = { cylinder = { radius = \"240 um\", height = \"8 mm\" } }\n\
         material = \"PMMA\"\nrotate = [{ axis = [1, 0, 0], angle = \"90 deg\" }]\n\
         [[object]]\nname = \"hole\"\nshape = { cylinder = { radius = \"150 um\", height = \"5 mm\" } }\n\
         material = \"air\"\nrotate = [{ axis = [1, 0, 0], angle = \"89.9 deg\" }]\n\
         position = [\"0 mm\", \"-2.5 mm\", \"0 mm\"]\n\
         [[object]]\nname = \"tube\"\nshape = { tube = { outer = \"80 um\", inner = \"60 um\", \
         height = \"8.5 mm\" } }\nmaterial = \"Al\"\nrotate = [{ axis = [1, 0, 0], angle = \"90 deg\" }, \
         { axis = [0, 0, 1], angle = \"0.05 deg\" }]\n",
    )
}

/// The scene on two rows of pixels; on all of its rows with `BEAMLET_ALL`.
pub(super) fn few_rows(mut scene: Scene) -> Scene {
    let rows = &mut scene.detector.pixels[1];
    *rows = amount(2, *rows);
    scene
}

/// The scene on two rows of 8 pixels; on all of them with `BEAMLET_ALL`.
pub(super) fn few_pixels(mut scene: Scene) -> Scene {
    let columns = &mut scene.detector.pixels[0];
    *columns = amount(8, *columns);
    few_rows(scene)
}

/// The beam of a tube, at some energy nodes.
pub(super) fn tube(kvp: f64, nodes: u32) -> Beam {
    let tube = SpectrumOrigin::Tube {
        anode: beamlet::scene::Anode::Tungsten,
        kvp,
        anode_angle: 0.2,
        inherent_filters: Vec::new(),
    };
    Beam::Spectrum(SpectrumSpec::new(tube).with_nodes(nodes))
}

pub(super) fn with_tube(mut scene: Scene) -> Scene {
    scene.source.beam = tube(40.0, 4);
    scene
}

/// Far from the axis thick bars narrow apertures so much, and otherwise at each energy, that light goes energy by
/// energy.
fn aside() -> Scene {
    let mut scene = with_tube(shapes());
    scene.detector.pixels = [360, 2];
    let bars = scene.sample_mask.as_mut().map(|mask| &mut mask.body);
    if let Some(MaskBody::Bars { thickness, .. }) = bars {
        *thickness = 400e-6;
    }
    for object in &mut scene.objects {
        object.placement.position[0] = 8.5e-3;
    }
    scene
}

/// A slab whose faces are almost along the beam: light is totally reflected, at each energy from other angles on.
pub(super) fn grazed() -> Scene {
    let mut scene = with_tube(shapes());
    scene.detector.pixels = amount([16, 2], [40, 2]);
    scene.objects.truncate(1);
    let slab = &mut scene.objects[0];
    slab.geometry = Shape::Box { size: [0.4e-3, 3e-3, 5e-3] }.into();
    slab.placement.rotate = vec![([0.0, 0.0, 1.0], 5e-4)];
    slab.placement.position = [17e-6, 0.0, 0.0];
    scene
}

/// Scenes that differ in what stands in the beam.
fn scenes_of_all_kinds() -> Vec<(&'static str, Scene)> {
    let mut leaking = meshes();
    for mask in leaking.sample_mask.iter_mut().chain(&mut leaking.detector_mask) {
        mask.body = MaskBody::Sheet { transmission: 0.2 };
    }
    let mut bare = meshes();
    (bare.sample_mask, bare.detector_mask) = (None, None);
    bare.scan.mask_offsets = vec![0.0];
    let mut tracked = meshes();
    tracked.detector_mask = None;
    let mut blurred = meshes();
    blurred.detector.blur = Some(Blur::Gaussian { sigma: [40e-6; 2] });
    vec![
        ("leaking masks", leaking),
        ("meshes", meshes()),
        ("no detector mask", tracked),
        ("shapes", shapes()),
        ("no masks", bare),
        ("walls along the beam", few_rows(walls())),
        ("detector blur", blurred),
        ("walls of meshes", walls_of_meshes()),
    ]
}

pub(super) fn run(engine: &Checked, scene: &Scene, tolerance: f64) -> (Array4<f32>, RunRecord) {
    let mut scene = scene.clone();
    scene.sampling.tolerance = Some(tolerance);
    let mut sink = ArraySink::new();
    let record = engine.run(&scene, &mut sink, Control::default()).expect("a run");
    let tally = &record.tally;
    assert!(tally.reflected <= tally.rays + tally.exact, "{tally:?}");
    (sink.into_stacks().expect("stacks").sample, record)
}

#[expect(clippy::cast_possible_truncation, reason = "the nearest value")]
const fn narrow(value: f64) -> f32 {
    value as f32
}

/// Largest difference and root mean square of values.
pub(super) fn apart(a: &Array4<f32>, b: &Array4<f32>) -> [f64; 2] {
    let off = || a.iter().zip(b).map(|(a, b)| f64::from(a - b));
    let squares: f64 = off().map(|it| it * it).sum();
    [off().fold(0.0, |most: f64, it| most.max(it.abs())), (squares / a.len() as f64).sqrt()]
}

/// Every other scene against a run at a tolerance three times as tight; all of them, six times, with `BEAMLET_ALL`. Spectra
/// have the exact shapes, apertures.rs has a mask alone, borders.rs a blur. Every value holds the tolerance, and is
/// within the error that is told for the worst but for a factor of two and the finer run's own tolerance.
#[test]
fn light_of_all_kinds_of_scenes_holds_the_tolerance() {
    let engine = engine(Backend::Bvh);
    let finer = TOLERANCE / amount(3.0, 6.0);
    for (name, scene) in sample(scenes_of_all_kinds(), 2) {
        let (want, _) = run(&engine, &scene, finer);
        let (got, record) = run(&engine, &scene, TOLERANCE);
        let [worst, rms] = apart(&got, &want);
        let told = record.sampling.expect("reported errors");
        println!(
            "measured kinds, {name}: worst {worst:.1e}, rms {rms:.1e}, told {:.1e}",
            told.worst_error
        );
        assert!(worst < TOLERANCE && rms < 0.2 * TOLERANCE, "{name}: {worst} {rms}");
        assert!(worst < 2.0 * told.worst_error + finer, "{name}: {worst}, {told:?}");
        assert!(told.worst_error > 0.0 && told.worst_error <= TOLERANCE, "{name}: {told:?}");
        assert_eq!(told.beyond_tolerance, 0, "{name}");
    }
}

/// Both backends make the same rays.
#[test]
fn both_backends_have_the_same_rays() {
    let scene = few_rows(shapes());
    let runs: Vec<_> = backends().into_iter().map(|it| run(&engine(it), &scene, 1e-3)).collect();
    for (sample, record) in &runs {
        let [worst, _] = apart(sample, &runs[0].0);
        assert!(worst < 1e-6, "{worst}");
        assert_eq!(record.tally.patch_rays, runs[0].1.tally.patch_rays);
        assert_eq!(record.tally.exact, runs[0].1.tally.exact);
    }
}

/// Light of a spectrum as the sum over runs at each of its energies.
pub(super) fn sum_over_energies(engine: &Checked, scene: &Scene, tolerance: f64) -> Array4<f32> {
    let nodes = beamlet::spectrum::nodes(scene).expect("energies");
    let mut sum: Option<Array4<f32>> = None;
    for (energy, weight) in nodes.energies.iter().zip(&nodes.weights) {
        let mut one = scene.clone();
        one.source.beam = Beam::Energy(*energy);
        let mut light = run(engine, &one, tolerance).0;
        light.mapv_inplace(|it| narrow(weight * f64::from(it)));
        sum = Some(sum.map_or(light.clone(), |sum| sum + light));
    }
    sum.expect("energies")
}

/// Under a spectrum the sum over runs at each energy is what a run of all energies is to give. Rays close to total
/// reflection are traced at each, one in each rectangle: behind the face of a slab, where the light falls to a fifth
/// over 1.5 um, that errs by more. Every other case, all with `BEAMLET_ALL`.
#[test]
fn light_of_a_spectrum_is_the_sum_over_its_energies() {
    let engine = engine(Backend::Bvh);
    let mut hard = shapes();
    hard.source.beam = tube(90.0, 5);
    let cases = vec![
        ("grazed slab", grazed(), 7.0),
        ("tube", with_tube(shapes()), 5.0),
        ("bars that leak", hard, 5.0),
        ("thick bars aside", aside(), 5.0),
    ];
    for (name, scene, most) in sample(cases, 2) {
        let scene = few_rows(scene);
        let sum = sum_over_energies(&engine, &scene, TOLERANCE / amount(3.0, 6.0));
        let (got, record) = run(&engine, &scene, TOLERANCE);
        let [worst, rms] = apart(&got, &sum);
        println!("measured kinds, {name}: worst {worst:.1e}, rms {rms:.1e}");
        assert!(worst < most * TOLERANCE && rms < 0.15 * most * TOLERANCE, "{name}: {worst} {rms}");
        assert!(record.tally.exact > 0, "{name}");
    }
}

/// The light of two energies that hardly differ is that of one of them. Behind apertures that end along z it has the same
/// cells; others take light as even about each line, where one energy has it linear between lines.
#[test]
fn light_of_energies_side_by_side_is_that_of_one() {
    let engine = engine(Backend::Bvh);
    let place = tempfile::tempdir().expect("a folder");
    let path = place.path().join("lines.csv");
    std::fs::write(&path, "energy_keV,weight\n25,0.5\n25.0001,0.5\n").expect("a file");
    let spectrum = SpectrumSpec::new(SpectrumOrigin::File { path }).with_nodes(2);
    let kinds = scenes_of_all_kinds().into_iter().map(|(name, scene)| (name, scene, 1.5e-4));
    let behind = apertures::scenes().into_iter().map(|(name, scene)| (name, scene, 1e-5));
    for (name, mut scene, most) in kinds.chain(behind) {
        for (number, object) in scene.objects.iter_mut().enumerate() {
            object.material = ["PMMA", "Al"][number % 2].into();
        }
        for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
            if let MaskBody::Bars { material, .. } = &mut mask.body {
                *material = "gold".into();
            }
        }
        scene.source.beam = Beam::Energy(25.0);
        let (one, _) = run(&engine, &scene, TOLERANCE);
        scene.source.beam = Beam::Spectrum(spectrum.clone());
        let (got, _) = run(&engine, &scene, TOLERANCE);
        let [worst, _] = apart(&got, &one);
        println!("measured kinds, energies side by side, {name}: worst {worst:.1e}");
        assert!(worst < most, "{name}: {worst}");
    }
}

/// Rays that are all followed in order at each energy: of two energies, of four with `BEAMLET_ALL`.
#[test]
fn exact_light_of_a_spectrum_is_the_sum_over_its_energies() {
    let engine = engine(Backend::Bvh);
    let cases = vec![("shapes", with_tube(shapes()), 5.0), ("grazed slab", grazed(), 7.0)];
    for (name, scene, most) in sample(cases, 2) {
        let mut scene = few_pixels(scene);
        scene.source.beam = tube(40.0, amount(2, 4));
        scene.sampling.transport = Transport::Exact;
        let sum = sum_over_energies(&engine, &scene, TOLERANCE / 3.0);
        let (got, _) = run(&engine, &scene, TOLERANCE);
        let [worst, rms] = apart(&got, &sum);
        println!("measured kinds, {name}, exact: worst {worst:.1e}, rms {rms:.1e}");
        assert!(worst < most * TOLERANCE && rms < 0.15 * most * TOLERANCE, "{name}: {worst} {rms}");
    }
}

/// Balls of facets in a row bend light into one another: first order, whose rays are straight, differs by many
/// tolerances.
#[test]
fn every_ray_of_exact_transport_is_followed_in_order() {
    let ball = |y: i32| {
        format!(
            "[[object]]\nname = \"ball at {y}\"\nshape = {{ sphere = {{ radius = \"120 um\", sides = 32 }} }}\n\
             material = \"Al\"\nposition = [\"8 um\", \"{y} mm\", \"5 um\"]\n"
        )
    };
    let mut scene = of_objects(&[0, 60, 120].map(ball).concat());
    scene.source.beam = Beam::Energy(9.0);
    let engine = engine(Backend::Bvh);
    let mut run = |transport, tolerance| {
        scene.sampling.transport = transport;
        run(&engine, &scene, tolerance).0
    };
    let want = run(Transport::Exact, TOLERANCE / 3.0);
    let straight = run(Transport::FirstOrder, TOLERANCE / 3.0);
    let got = run(Transport::Exact, TOLERANCE);
    let again = run(Transport::Exact, TOLERANCE);
    let [worst, rms] = apart(&got, &want);
    let [bent, _] = apart(&straight, &want);
    println!("measured kinds, exact: worst {worst:.1e}, rms {rms:.1e}; first order {bent:.1e}");
    assert!(bent > 30.0 * TOLERANCE, "first order differs by {bent:e} only");
    assert!(worst < 5.0 * TOLERANCE && rms < 0.5 * TOLERANCE, "{worst:e}, {rms:e}");
    assert_eq!(got, again);
}

/// Rays leave a round body near its end by up to several rows, and a box through its lid: light of little height goes over
/// the border of a row, wherever ends lie in it. Facets at a rim may hide between lines: 1.24 tolerances.
#[test]
fn light_at_ends_of_bodies_is_found_wherever_they_lie_in_a_row() {
    let engine = engine(Backend::Bvh);
    let shapes = [
        ("sphere = { radius = \"120 um\" }", 1.0),
        ("sphere = { radius = \"120 um\", sides = 48 }", 1.5),
        ("box = { size = [\"300 um\", \"1 mm\", \"240 um\"] }", 1.0),
    ];
    for (shape, tolerances) in shapes {
        let mut worst = Worst::new("light at ends", tolerances * TOLERANCE);
        for shift in sample((0..8).collect(), 3) {
            // Rows are 50 um high at the object.
            let z = f64::from(shift) * 6.25 + 1.3;
            let mut scene = of_objects(&format!(
                "[[object]]\nname = \"body\"\nshape = {{ {shape} }}\nmaterial = \"PMMA\"\n\
                 position = [\"10 um\", \"0 um\", \"{z} um\"]\n"
            ));
            scene.detector_mask = None;
            scene.detector.pixels[0] = 6;
            let (want, _) = run(&engine, &scene, TOLERANCE / 6.0);
            let (got, _) = run(&engine, &scene, TOLERANCE);
            let [most, _] = apart(&got, &want);
            worst.take(most, || format!("{shape} at {z} um"));
        }
        worst.holds();
    }
}
