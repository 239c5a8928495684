//! What one body needs of its rays changes nothing where another stands.

use crate::support::{amount, backends, engine, sample};
use beamlet::Backend;
use beamlet::scene::Scene;

/// Columns of light that the plain body meets.
const PLAIN: std::ops::Range<usize> = 0..24;

/// A prism on the left; `other` is the body on the right, 12 pixels and more away.
fn scene(other: &str) -> Scene {
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = [\"20 um\", \"20 um\"]\nenergy = \"20 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [64, 2]\npitch = \"100 um\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0\nprojected_aperture = \"20 um\"\n\
         [detector_mask]\ntransmission = 0\nprojected_aperture = \"20 um\"\n\
         [scan]\nmask_offsets = [\"-8 um\", \"0 um\", \"8 um\"]\n\
         [[object]]\nname = \"plain\"\nmaterial = \"nylon 66\"\nposition = [\"-1.3 mm\", \"0 mm\", \"0 mm\"]\n\
         shape = {{ cylinder = {{ radius = \"0.5 mm\", height = \"3 mm\", sides = 24 }} }}\n\
         [[object]]\nname = \"other\"\nmaterial = \"carbon\"\n{other}\n"
    );
    Scene::from_toml(&text, std::env::temp_dir()).expect("a scene")
}

#[test]
fn pixels_of_a_plain_body_keep_their_bits_beside_any_other() {
    let at = "position = [\"1.3 mm\", \"0 mm\", \"0 mm\"]\n";
    let shape = |rest: &str| {
        format!("{at}shape = {{ cylinder = {{ radius = \"0.4 mm\", height = \"3 mm\"{rest} }} }}\n")
    };
    let faceted = shape(", sides = 48");
    let directory = std::env::temp_dir().join("beamlet-rough-local");
    std::fs::create_dir_all(&directory).expect("a folder");
    let places = directory.join("places.csv");
    std::fs::write(&places, "x_mm,y_mm,z_mm\n0.2,0,0\n-0.2,0.1,0\n").expect("a file");
    let instances = format!(
        "{at}shape = {{ cylinder = {{ radius = \"50 um\", height = \"3 mm\" }} }}\ninstances = \"{}\"\n",
        places.display()
    );
    let others = [
        ("rough facets", format!("{faceted}roughness = 0.01\n")),
        ("smooth normals", format!("{faceted}normals = \"smooth\"\n")),
        ("exact", shape("")),
        ("exact and rough", format!("{}roughness = 0.01\n", shape(""))),
        ("instances", instances.clone()),
        ("rough instances", format!("{instances}roughness = 0.01\n")),
    ];
    // Rough facets, exact shapes and instances; the others and the second backend with
    // `BEAMLET_ALL`.
    for backend in amount(vec![Backend::Bvh], backends()) {
        let engine = engine(backend);
        let light = |other: &str| {
            let stacks = engine.simulate(&scene(other)).expect("a run");
            stacks.sample
        };
        let alone = light(&faceted);
        for (what, other) in sample(others.iter().collect(), 2) {
            let beside = light(other);
            let mut unlike = 0;
            let mut changed = false;
            for (index, value) in alone.indexed_iter() {
                // Light that normals drawn at a rim reflect may land anywhere.
                let more = beside[index] - value;
                let is_mirrored = what.contains("rough") && (0.0..1e-5).contains(&more);
                let same = value.to_bits() == beside[index].to_bits() || is_mirrored;
                if PLAIN.contains(&index.3) {
                    unlike += usize::from(!same);
                } else {
                    changed |= !same;
                }
            }
            assert_eq!(unlike, 0, "{backend:?}, beside {what}: values of the plain body");
            assert!(changed, "{backend:?}, {what}: the other body makes no difference");
        }
    }
}
