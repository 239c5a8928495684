//! Rough surfaces: slopes of single rays, and light of rough bodies.

mod grazing;
mod keys;
mod light;
mod local;
mod origin;
mod slopes;
mod smooth;

use crate::reference::scenes;
use crate::reference::stack::Setup;
use beamlet::scene::{MaterialSpec, Object, Scene, Scheme, Shape};

/// A scene without masks in which a rough face stands under an angle of incidence to rays along the
/// axis; they leave it through one that stands across them.
fn face(sigma: f64, incidence: f64, [mu, delta]: [f64; 2]) -> Scene {
    let mut setup = Setup::paper([16, 16]);
    setup.sample_mask = None;
    let mut scene = scenes::scene(&setup, &[], &[0.0]);
    scene.materials.insert("matter".to_owned(), MaterialSpec::Constants { mu, delta });
    let (sin, cos) = incidence.sin_cos();
    let [x, y] = [5e-3 * cos, 5e-3 * sin];
    let (left, back) = (-x - 2e-3, 8e-3);
    let points = vec![[-x, -y], [x, y], [x, back], [left, back], [left, -y]];
    let mut rough = Object::new("rough", Shape::Extrusion { points, height: 4e-3 }, "matter");
    rough.roughness = sigma;
    scene.objects = vec![rough];
    scene.sampling.scheme = Scheme::Random;
    scene
}
