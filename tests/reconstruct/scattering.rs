//! CT of materials that scatter: the dark field per length is their variance of angles per length, given or by bodies.

use crate::set_up::reconstruct;
use crate::support::{Worst, engine};
use beamlet::Backend;
use beamlet::internals::microstructure::variances;
use beamlet::material::{Constants, constants_at};
use beamlet::ndarray::{Array3, Axis, s};
use beamlet::reconstruct::{FbpOptions, Quantity, ScanGeometry, Volume, VolumeGrid};
use beamlet::retrieve::{Method, RetrieveOptions, Retriever};
use beamlet::scene::{MaterialSpec, Scene};

const VIEWS: usize = 40;
const COLUMNS: usize = 96;
/// Scattering of a material.
enum Scattering {
    /// rad2/m.
    Given(f64),
    /// Keys of a microstructure.
    Bodies(&'static str),
}

/// A rod along the axis of rotation.
struct Rod {
    name: &'static str,
    /// g/cm3.
    density: f64,
    /// Variance of angles per length.
    scattering: Scattering,
    /// mm.
    centre: [f64; 2],
    radius: f64,
}

/// The first one is around the others.
const RODS: [Rod; 3] = [
    Rod {
        name: "host",
        density: 1.0,
        scattering: Scattering::Given(8e-9),
        centre: [0.0, 0.0],
        radius: 3.6,
    },
    Rod {
        name: "coarse",
        density: 0.01,
        scattering: Scattering::Bodies(
            "spheres\", diameter = \"20 um\", fraction = 0.4, of = \"PMMA",
        ),
        centre: [1.5, 0.0],
        radius: 1.1,
    },
    Rod {
        name: "fine",
        density: 1.0,
        scattering: Scattering::Bodies(
            "voids\", diameter = \"8 um\", spread = 0.2, fraction = 0.3, of = \"air",
        ),
        centre: [-1.4, 0.7],
        radius: 1.0,
    },
];
/// Voxels nearer to a border, mm, do not count.
const BORDER: f64 = 0.25;

/// Two set-ups by their detectors: distance, m, and pitch, um, for the same field of view.
const SET_UPS: [[f64; 2]; 2] = [[1.8, 150.0], [2.8, 233.333_333]];

fn scene([distance, pitch]: [f64; 2]) -> Scene {
    let rod = |Rod { name, density, scattering, centre: [x, y], radius }: &Rod| {
        let scattering = match scattering {
            Scattering::Given(value) => format!("scattering = \"{value:e} rad^2/m\""),
            Scattering::Bodies(keys) => format!("microstructure = {{ shape = \"{keys}\" }}"),
        };
        format!(
            "[materials.{name}]\nformula = \"H2O\"\ndensity = \"{density} g/cm3\"\n{scattering}\n\
             [[object]]\nname = \"{name}\"\nmaterial = \"{name}\"\n\
             shape = {{ cylinder = {{ radius = \"{radius} mm\", height = \"6 mm\" }} }}\n\
             position = [\"{x} mm\", \"{y} mm\", \"0 mm\"]\n"
        )
    };
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [detector_mask]\ntransmission = 0.0\nprojected_aperture = \"30 um\"\n\
         [detector]\ndistance = \"{distance} m\"\npixels = [{COLUMNS}, 1]\npitch = \"{pitch} um\"\n\
         [scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 7 }}\n\
         angles = {{ from = \"0 deg\", to = \"351 deg\", count = {VIEWS} }}\n{}",
        RODS.iter().map(rod).collect::<String>()
    );
    Scene::from_toml(&text, ".").expect("a scene")
}

/// The same with the constants alone.
fn clear(scene: &Scene) -> Scene {
    let mut clear = scene.clone();
    for Rod { name, .. } in &RODS {
        let Constants { mu, delta, .. } = constants_at(scene, name, 30.0).expect("constants");
        clear.materials.insert((*name).into(), MaterialSpec::Constants { mu, delta });
    }
    clear.scattering.clear();
    clear.microstructures.clear();
    clear
}

/// Volume of the dark field of a scan.
fn volume(scene: &Scene) -> Volume {
    let engine = engine(Backend::Bvh);
    let stacks = engine.simulate(scene).expect("a run");
    let options = RetrieveOptions::default().with_method(Method::ExactCurve);
    let mut retriever = Retriever::new(&engine, scene, &options).expect("a retriever");
    retriever.set_flat_array(stacks.flat.view()).expect("a flat");
    let mut sinogram = Array3::zeros((VIEWS, 1, COLUMNS));
    for view in 0..VIEWS {
        let of_view = stacks.sample.index_axis(Axis(0), view);
        let images = retriever.retrieve_array(of_view).expect("images");
        let image = images.get("dark_field").expect("an image");
        sinogram.slice_mut(s![view, .., ..]).assign(image);
    }
    let geometry = ScanGeometry::of_scene(scene);
    let grid =
        VolumeGrid { size: [96, 96, 1], voxel: [1e-4; 3], origin: [-4.75e-3, -4.75e-3, 0.0] };
    reconstruct(&geometry, &sinogram, Quantity::DarkField, &grid, &FbpOptions::default())
        .expect("a volume")
}

/// Scattering of each material by CT: edges have a dark field of their own, that of the same bodies without scattering.
fn scattering(scene: &Scene) -> Vec<f64> {
    let [with, without] = [scene, &clear(scene)].map(volume);
    let of_rod = |(index, rod): (usize, &Rod)| {
        let from = |at: [f64; 2], rod: &Rod| (at[0] - rod.centre[0]).hypot(at[1] - rod.centre[1]);
        let is_inside = |at: (usize, usize, usize)| {
            let [x, y, _] = with.grid.centre(at).map(|place| 1e3 * place);
            from([x, y], rod) < rod.radius - BORDER
                && RODS.iter().skip(index + 1).all(|it| from([x, y], it) > it.radius + BORDER)
        };
        let pairs = with.values.indexed_iter().zip(&without.values);
        let values: Vec<f64> = pairs
            .filter(|((at, _), _)| is_inside(*at))
            .map(|((_, with), without)| f64::from(with - without))
            .collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    RODS.iter().enumerate().map(of_rod).collect()
}

/// Variance of angles per length of a material of a scene whose bodies have another diameter, m.
fn expected(scene: &Scene, rod: &Rod, diameter: Option<f64>) -> f64 {
    if let Scattering::Given(value) = rod.scattering {
        return value;
    }
    let mut scene = scene.clone();
    let structure = scene.microstructures.get_mut(rod.name).expect("bodies");
    structure.diameter = diameter.unwrap_or(structure.diameter);
    variances(&scene, rod.name, &[30.0]).expect("constants").expect("bodies")[0]
}

/// The ratio of the variances of two set-ups falls with the diameter, whatever the strength of the scattering: 0.1 % of it
/// are up to 4 % of the diameter.
#[test]
fn ct_in_two_set_ups_returns_scattering_and_sizes_of_three_materials() {
    let scenes = SET_UPS.map(scene);
    let found = scenes.each_ref().map(scattering);
    let mut worst = Worst::new("scattering by CT over that of the scene", 0.02);
    for (scene, found) in scenes.iter().zip(&found) {
        for (rod, found) in RODS.iter().zip(found) {
            let expected = expected(scene, rod, None);
            println!("{}: {found:e} of {expected:e}", rod.name);
            worst.take(found / expected - 1.0, || rod.name.to_owned());
        }
    }
    worst.holds();
    let mut worst = Worst::new("diameter from two set-ups, relative", 0.05);
    for (index, rod) in RODS.iter().enumerate() {
        let Some(structure) = scenes[0].microstructures.get(rod.name) else { continue };
        let ratio = found[1][index] / found[0][index];
        let too_small = |diameter: f64| {
            let [near, far] = scenes.each_ref().map(|scene| expected(scene, rod, Some(diameter)));
            far / near < ratio
        };
        // The shear of the farther set-up is larger: small bodies lose less of their contrast there.
        let mut ends = [0.1 * structure.diameter, 10.0 * structure.diameter];
        for _ in 0..30 {
            let middle = (ends[0] * ends[1]).sqrt();
            ends[usize::from(!too_small(middle))] = middle;
        }
        println!("{}: {:e} of {:e}", rod.name, ends[0], structure.diameter);
        worst.take(ends[0] / structure.diameter - 1.0, || rod.name.to_owned());
    }
    worst.holds();
}
