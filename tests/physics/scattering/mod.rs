//! Materials that scatter, against quadratures in f64 and closed forms: each material widens light by its variance of
//! angles per length, times the square of the distance to the analyser.

mod axes;
mod contrasts;
mod fluid;
mod light;
mod microstructure;
mod packings;
mod transports;

use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::scattering::{Medium, Section, SetUp};
use beamlet::reconstruct::{GridChoice, ScanGeometry, Truth};
use beamlet::scene::{MaterialSpec, Object, Scattering, Scene, Shape};
use beamlet::{Cancel, Engine};

const PITCH: f64 = 150e-6;
const SET_UP: SetUp = SetUp {
    axis: 1.21,
    sample_mask: 1.2,
    analyser: 1.8,
    spot: 30e-6 * SIGMA_PER_FWHM,
    apertures: [30e-6; 2],
    pixel: PITCH,
};
const HEIGHT: f64 = 6e-3;

/// A scene of some columns and of mask offsets over the curve, without objects.
fn empty(columns: u32, offsets: &str) -> Scene {
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [detector_mask]\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [{columns}, 1]\npitch = \"150 um\"\n\
         [scan]\nmask_offsets = {offsets}\n[sampling]\ntolerance = 1e-5\n"
    );
    Scene::from_toml(&text, ".").expect("a scene")
}

/// The true values of the voxels of a scene.
fn truth_of(engine: &Engine, scene: &Scene) -> Truth {
    let geometry = ScanGeometry::of_scene(scene);
    let grid = GridChoice::default().grid(&geometry).expect("a grid");
    beamlet::truth(engine, scene, &geometry, &grid, &Cancel::default()).expect("a truth")
}

/// Adds a medium as an object of a material of its own, whose discs are exact or of facets.
fn add(scene: &mut Scene, medium: &Medium, sides: Option<u32>) {
    let name = format!("medium {}", scene.objects.len());
    let constants = MaterialSpec::Constants { mu: medium.mu, delta: 0.0 };
    scene.materials.insert(name.clone(), constants);
    scene.scattering.insert(name.clone(), Scattering::new(medium.scattering));
    let (shape, [x, y]) = match &medium.section {
        Section::Disc(centre, radius) => {
            (Shape::Cylinder { radius: *radius, height: HEIGHT, sides }, *centre)
        }
        Section::Polygon(corners) => {
            (Shape::Extrusion { points: corners.clone(), height: HEIGHT }, [0.0; 2])
        }
    };
    let mut object = Object::new(name.clone(), shape, name);
    object.placement.position = [x, y, 0.0];
    scene.objects.push(object);
}

/// Middle of a column on the detector, m.
fn middle(columns: usize, column: usize) -> f64 {
    (column as f64 + 0.5 - 0.5 * columns as f64) * PITCH
}

/// A plate across the beam, from one place along y to another, wider than any detector here.
fn plate(ends: [f64; 2], mu: f64, scattering: f64) -> Medium {
    let [low, high] = ends;
    let corners = vec![[-0.5, low], [0.5, low], [0.5, high], [-0.5, high]];
    Medium { section: Section::Polygon(corners), mu, scattering, axis: None }
}

fn disc(centre: [f64; 2], radius: f64, mu: f64, scattering: f64) -> Medium {
    Medium { section: Section::Disc(centre, radius), mu, scattering, axis: None }
}

/// Thickness grows from 0 to 1.5 mm over 3 mm.
fn wedge(scattering: f64) -> Medium {
    let corners = vec![[-1.5e-3, 0.0], [1.5e-3, 0.0], [1.5e-3, 1.5e-3]];
    Medium { section: Section::Polygon(corners), mu: 20.0, scattering, axis: None }
}
