//! Whole runs of exact shapes that cross: a rod with a bore that leaves it is the tube, whatever else a
//! scene has, and crossing rods match fine facets.

use crate::support::{Worst, amount, backends, engine, everything};
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Motion, Scene, Transport};
use beamlet::stack::Stacks;
use beamlet::{Backend, geometry};

const ENERGY: &str = "energy = \"30 keV\"";
const SPECTRUM: &str = "spectrum = \"photons.csv\"";
const PHOTONS: &str = "20,1\n30,2\n40,1\n";

/// The paper's masks before a row of pixels at two steps; three rows and steps with `BEAMLET_ALL`.
fn set_up(beam: &str, sampling: &str, rest: &str) -> String {
    let (rows, middle) = amount((1, ""), (3, "\"0 um\", "));
    format!(
        "[source]\ndistance = \"1.21 m\"\nspot = \"30 um\"\n{beam}\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [12, {rows}]\npitch = \"150 um\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0\nprojected_aperture = \"30 um\"\n\
         [detector_mask]\ntransmission = 0\nprojected_aperture = \"30 um\"\n\
         [scan]\nmask_offsets = [\"-12 um\", {middle}\"15 um\"]\nangles = [\"0 deg\", \"40 deg\"]\n\
         [sampling]\n{sampling}\n{rest}"
    )
}

/// An upright object of a shape; `more`: lines of it.
fn object(name: &str, shape: &str, material: &str, more: &str) -> String {
    format!(
        "[[object]]\nname = \"{name}\"\nmaterial = \"{material}\"\nshape = {{ {shape} }}\n\
         rotate = [{{ axis = [1, 0.3, 0], angle = \"25 deg\" }}]\n{more}\n"
    )
}

/// A rod with a bore that leaves it, filled with `inner`, and the tube that it is, for an `inner` equal
/// to the surroundings.
fn both(material: &str, inner: &str, more: &str) -> [String; 2] {
    let rod = "cylinder = { radius = \"0.4 mm\", height = \"0.5 mm\" }";
    let bore = "cylinder = { radius = \"0.25 mm\", height = \"0.7 mm\" }";
    let tube = "tube = { outer = \"0.4 mm\", inner = \"0.25 mm\", height = \"0.5 mm\" }";
    [
        [object("rod", rod, material, more), object("bore", bore, inner, more)].concat(),
        object("tube", tube, material, more),
    ]
}

/// The scene in one view, in two with `BEAMLET_ALL`; or in two that move the sample.
fn scene(directory: &std::path::Path, text: &str, moves: bool) -> Scene {
    let mut scene = Scene::from_toml(text, directory).expect("a scene");
    if moves {
        let motion = |axis, angle, by| {
            Motion::about(axis, angle).expect("an axis").then(&Motion::translation(by))
        };
        scene.scan.motions = vec![
            motion([0.2, 1.0, -0.3], 0.5, [0.1e-3, 0.0, -0.05e-3]),
            motion([1.0, 0.0, 0.4], 1.1, [0.0, 0.2e-3, 0.1e-3]),
        ];
    } else {
        scene.scan.angles.truncate(amount(1, 2));
    }
    scene
}

fn compare(what: &str, limit: f64, a: &Stacks, b: &Stacks) {
    let mut worst = Worst::new("crossing shapes, intensity", limit);
    for ((at, a), b) in a.sample.indexed_iter().zip(&b.sample) {
        worst.take(f64::from(a - b), || format!("{what}, {at:?}"));
    }
    let tally = &a.record.tally;
    assert_eq!([tally.unbalanced, tally.not_finite, tally.dropped], [0; 3], "{what}");
    worst.holds();
}

/// Each run errs by the tolerance of 1e-4 at most.
#[test]
fn rod_with_a_bore_through_it_is_the_tube() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    std::fs::write(here.join("photons.csv"), PHOTONS).expect("a file");
    let places =
        "x_um,y_um,z_um,axis_x,axis_y,axis_z,angle_deg\n-450,0,0,0,0,1,0\n460,900,50,1,0,0,20\n";
    std::fs::write(here.join("places.csv"), places).expect("a file");
    let water = "[surroundings]\nmaterial = \"water\"\nregion = { cylinder = { radius = \"3 mm\", height = \"4 mm\" } }\n";
    let fine = "tolerance = 1e-4\nangle_tolerance = \"30 nrad\"";
    let exact = "tolerance = 1e-4\nangle_tolerance = \"30 nrad\"\ntransport = \"exact\"";
    let rough = "tolerance = 1e-3\nmax_rays = 2000";
    let mut cases = vec![
        ("one energy", ENERGY, fine, "", both("PMMA", "vacuum", ""), 2e-4),
        ("exact transport", ENERGY, exact, "", both("PMMA", "vacuum", ""), 2e-4),
        ("a spectrum", SPECTRUM, fine, "", both("PMMA", "vacuum", ""), 2e-4),
        ("water around", ENERGY, fine, water, both("PMMA", "water", ""), 2e-4),
        ("rough surfaces", ENERGY, rough, "", both("PMMA", "vacuum", "roughness = 0.02"), 2e-3),
        ("instances", ENERGY, fine, "", both("PMMA", "vacuum", "instances = \"places.csv\""), 2e-4),
    ];
    // One energy, and a spectrum in views that move the sample; the others and both backends with
    // `BEAMLET_ALL`.
    let moving = cases[2].clone();
    cases.truncate(amount(1, cases.len()));
    cases.push(("motions", moving.1, moving.2, moving.3, moving.4, moving.5));
    for (name, beam, sampling, rest, [rod, tube], limit) in cases {
        // Once each of the kinds of transport on the second backend.
        let both = ["one energy", "exact transport", "instances"].contains(&name);
        let on = if both && everything() { backends() } else { vec![Backend::Bvh] };
        let [rod, tube] =
            [rod, tube].map(|objects| set_up(beam, sampling, &[rest, &*objects].concat()));
        let [rod, tube] = [rod, tube].map(|text| scene(here, &text, name == "motions"));
        let loaded = geometry::load(&rod).expect("a sample");
        assert!(
            loaded.triangles.is_empty() && !loaded.objects[0].cut_by.is_empty()
                || name == "water around"
        );
        for backend in on {
            let engine = engine(backend);
            let [rod, tube] = [&rod, &tube].map(|scene| engine.simulate(scene).expect("a stack"));
            compare(&format!("{name}, {backend}"), limit, &rod, &tube);
        }
    }
}

/// Rods across each other, a ball where they cross, and a cone: as they are and of 256 facets around,
/// which are off the surface by 23 nm and refract by 1 % of the angle. Each run errs by the tolerance of
/// 2e-4 at most.
#[test]
fn crossing_rods_are_those_of_fine_facets() {
    let directory = tempfile::tempdir().expect("a directory");
    let objects = |sides: &str| {
        let across = "position = [\"0.05 mm\", \"0 mm\", \"0.03 mm\"]";
        [
            object(
                "a",
                &format!("cylinder = {{ radius = \"0.3 mm\", height = \"1 mm\"{sides} }}"),
                "PMMA",
                "",
            ),
            format!(
                "[[object]]\nname = \"b\"\nmaterial = \"water\"\n\
                 shape = {{ cylinder = {{ radius = \"0.15 mm\", height = \"1.4 mm\"{sides} }} }}\n\
                 rotate = [{{ axis = [0.2, 1, 0], angle = \"80 deg\" }}]\n{across}\n"
            ),
            object(
                "c",
                &format!("sphere = {{ radius = \"0.2 mm\"{} }}", sides.replace("256", "128")),
                "vacuum",
                across,
            ),
        ]
        .concat()
    };
    let sampling = "tolerance = 2e-4\nangle_tolerance = \"30 nrad\"";
    let [exact, facets] = ["", ", sides = 256"]
        .map(|sides| set_up(ENERGY, sampling, &objects(sides)))
        .map(|text| scene(directory.path(), &text, false));
    let (checked, refusals) = load_lenient(&exact).expect("a sample");
    // The ball lies wholly in "a": nested, without overlap.
    assert!(refusals.is_empty());
    assert_eq!(checked.overlaps, [[0, 1], [1, 2]]);
    let engine = engine(Backend::Bvh);
    let [whole, by_facets] = [&exact, &facets].map(|it| engine.simulate(it).expect("a stack"));
    compare("fine facets", 5e-4, &whole, &by_facets);
    if everything() {
        let mut ordered = exact.clone();
        ordered.sampling.transport = Transport::Exact;
        let ordered = engine.simulate(&ordered).expect("a stack");
        compare("exact transport and auto", 4e-4, &whole, &ordered);
    }
    // Volumes of the meshes.
    let [left, by_facets] = [&exact, &facets].map(|it| geometry::load(it).expect("a sample"));
    let meshes = left.meshes(20e-9).expect("meshes");
    for (mesh, object) in meshes.iter().zip(&by_facets.objects) {
        let share = mesh.volume() / object.volume - 1.0;
        assert!(share.abs() < 1e-3, "{}: {share:e}", mesh.name);
    }
}
