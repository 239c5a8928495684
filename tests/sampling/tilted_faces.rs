//! Edges between the faces of tilted prisms before a long lever arm: rectangles that are known by rays, as of rough and
//! smooth surfaces, against the sums over facets of flat ones, which have the same light: edges of more than 30 degrees
//! stay sharp.

use crate::support::{Worst, amount, engine, sample};
use beamlet::Backend;
use beamlet::scene::{Normals, Scene};

/// Largest difference, share of open beam: the tolerance.
const APART: f64 = 1e-4;

fn scene(tilts: [f64; 2], sides: u32, distance: f64) -> Scene {
    let [a, b] = tilts;
    let [columns, rows] = amount([20, 3], [32, 6]);
    let text = format!(
        "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"{distance} m\"\npixels = [{columns}, {rows}]\npitch = \"100 um\"\n\
         [sampling]\ntolerance = 1e-4\n\
         [[object]]\nname = \"prism\"\nmaterial = \"Al\"\n\
         shape = {{ prism = {{ radius = \"180 um\", height = \"120 um\", sides = {sides} }} }}\n\
         rotate = [{{ axis = [1, 0, 0], angle = \"{a} deg\" }}, {{ axis = [0, 1, 0], angle = \"{b} deg\" }}]\n"
    );
    Scene::from_toml(&text, std::path::Path::new(".")).expect("a scene")
}

/// Two of the prisms, and the middle of them along z; all with `BEAMLET_ALL`.
#[test]
fn edges_between_tilted_faces_have_the_light_of_their_facets() {
    let engine = engine(Backend::Bvh);
    let mut worst = Worst::new("rays less facets at edges of tilted prisms", APART);
    let cases = vec![([7.78, 26.55], 3, 4.0), ([45.69, 36.41], 3, 4.0), ([68.5, 18.9], 4, 2.0)];
    for (tilts, sides, distance) in sample(cases, 2) {
        let mut scene = scene(tilts, sides, distance);
        let facets = engine.simulate(&scene).expect("a run").sample;
        let mut rough = scene.clone();
        rough.objects[0].roughness = 1e-6;
        scene.objects[0].normals = Normals::Smooth;
        for (name, scene) in [("smooth", scene), ("rough", rough)] {
            let found = engine.simulate(&scene).expect("a run").sample;
            for (found, facets) in found.iter().zip(&facets) {
                worst.take(f64::from(found - facets), || format!("{tilts:?}, {name}"));
            }
        }
    }
    worst.holds();
}
