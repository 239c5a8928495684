//! Experiments of docs/experiments at a small size: tomography from the scene to regions of slices, and
//! the dark field of homogeneous cylinders.

use crate::support::program::{beamlet, done, ended, workplace};
use beamlet::ndarray::{Array3, s};
use beamlet::reconstruct::{OpenVolumes, Quantity};
use ndarray_npy::read_npy;
use std::collections::BTreeMap;
use std::path::Path;

/// x and y of the axis of a cylinder along z, and its radius, mm.
type Cylinder = [f64; 3];

/// Regions of the small scene: inside of the matrix, the rods and the bundle of thin fibres.
const REGIONS: [(&str, Cylinder); 5] = [
    ("matrix", [1.2, -1.6, 0.45]),
    ("nylon", [-1.6, -1.2, 0.35]),
    ("epoxy", [-2.1, 0.5, 0.35]),
    ("carbon", [2.1, 0.3, 0.35]),
    ("bundle", [0.0, 1.6, 0.25]),
];

/// Runs the program; its arguments may hold blanks.
fn program(place: &Path, arguments: &[String]) {
    ended(&beamlet(place).args(arguments).output().expect("the program starts"), 0);
}

/// Means by quantity and region.
fn means(path: &Path, regions: &[(&str, Cylinder)]) -> BTreeMap<(String, String), f64> {
    let volumes = OpenVolumes::open(path).expect("volumes");
    let mut means = BTreeMap::new();
    for quantity in Quantity::ALL {
        let volume = volumes.volume(quantity).expect("a volume");
        for (region, [a, b, radius]) in regions {
            let (mut sum, mut count) = (0.0, 0.0);
            for (at, value) in volume.values.indexed_iter() {
                let [x, y, _] = volume.grid.centre(at).map(|place| 1e3 * place);
                if (x - a).hypot(y - b) <= *radius {
                    (sum, count) = (sum + f64::from(*value), count + 1.0);
                }
            }
            means.insert((quantity.name().to_owned(), (*region).to_owned()), sum / count);
        }
    }
    means
}

/// Simulates the shipped scene with `sets`, retrieves it by both methods and reconstructs it; means by
/// quantity and region of either method.
fn reconstructed(
    place: &Path,
    sets: &[&str],
    regions: &[(&str, Cylinder)],
) -> [BTreeMap<(String, String), f64>; 2] {
    done(place, "example tomography -o scene");
    let mut simulate: Vec<String> =
        ["simulate", "scene/scene.toml", "-o", "run", "-q"].map(Into::into).into();
    simulate.extend(sets.iter().flat_map(|set| ["--set".into(), (*set).into()]));
    program(place, &simulate);
    ["gaussian", "exact-curve"].map(|method| {
        done(place, &format!("retrieve run --method {method} -o {method} -q"));
        let reconstruct: Vec<String> =
            ["reconstruct", method, "-o", "volume", "--overwrite", "-q"].map(Into::into).into();
        program(place, &reconstruct);
        means(&place.join("volume"), regions)
    })
}

/// Contrasts of the experiment: μ and δ rise from polyethylene to nylon, epoxy and carbon; the dark field of
/// the bundle exceeds five times the dark field of the matrix; δ by Gaussian fits is below δ by exact curves.
#[track_caller]
fn contrasts_hold([gaussian, exact]: &[BTreeMap<(String, String), f64>; 2]) {
    let of = |means: &BTreeMap<(String, String), f64>, quantity: &str, region: &str| {
        means[&(quantity.to_owned(), region.to_owned())]
    };
    for means in [gaussian, exact] {
        for quantity in ["mu", "delta"] {
            let rising = ["matrix", "nylon", "epoxy", "carbon"].map(|it| of(means, quantity, it));
            assert!(rising.is_sorted(), "{quantity}: {rising:?}");
        }
        let [bundle, matrix] = ["bundle", "matrix"].map(|it| of(means, "dark-field", it));
        assert!(bundle > 5.0 * matrix.abs(), "{bundle:e} in the bundle, {matrix:e} in the matrix");
    }
    for region in ["matrix", "nylon", "epoxy", "carbon"] {
        let [low, high] = [gaussian, exact].map(|means| of(means, "delta", region));
        assert!(low < high, "{region}: {low:e} by Gaussian fits, {high:e} by exact curves");
    }
}

/// A fifth of the width, with 1,800 fibres: seconds.
#[test]
fn small_experiment_has_the_contrasts_of_the_paper() {
    let directory = workplace("");
    let sets = [
        "detector.pixels=[72, 1]",
        "scan.angles.count=48",
        "object.matrix.shape.cylinder.radius=3 mm",
        "object.fibres.instances.count=1800",
        "object.fibres.instances.region.cylinder.radius=0.375 mm",
        "object.fibres.position=[\"0 mm\", \"1.6 mm\", \"0 mm\"]",
        "object[2].shape.cylinder.radius=20 um",
        "object[2].position=[\"0 mm\", \"-1 mm\", \"0 mm\"]",
        "object[3].position=[\"2.1 mm\", \"0.3 mm\", \"0 mm\"]",
        "object[4].position=[\"-2.1 mm\", \"0.5 mm\", \"0 mm\"]",
        "object[5].position=[\"-1.6 mm\", \"-1.2 mm\", \"0 mm\"]",
    ];
    contrasts_hold(&reconstructed(directory.path(), &sets, &REGIONS));
}

/// 64 views of the whole width, with 8,000 fibres.
#[test]
#[ignore = "minutes"]
fn experiment_of_64_views_has_the_contrasts_of_the_paper() {
    let directory = workplace("");
    let sets = [
        "scan.angles.count=64",
        "object.fibres.instances.count=8000",
        "object.fibres.instances.region.cylinder.radius=0.4 mm",
    ];
    let regions = [
        ("matrix", [5.0, -4.5, 1.0]),
        ("nylon", [-6.0, -4.0, 0.35]),
        ("epoxy", [-5.0, 0.0, 0.35]),
        ("carbon", [5.0, 0.0, 0.35]),
        ("bundle", [0.0, 5.0, 0.25]),
    ];
    contrasts_hold(&reconstructed(directory.path(), &sets, &regions));
}

/// Homogeneous water has a dark field off the axis behind thick bars under a spectrum, and none behind sheets
/// or at one energy: hardened light passes the slanted edges of the bars.
#[test]
fn homogeneous_water_has_a_dark_field_where_hardened_light_passes_slanted_edges() {
    let place = workplace("");
    let here = place.path();
    done(here, "example cylinders -o scene");
    let small = "--set detector.pixels=[256,1] --set sampling.tolerance=1e-2 \
                 --set sampling.angle_tolerance=50nrad --format npy --overwrite -q";
    let found = [
        "",
        "--set sample_mask.transmission=0.0 --set detector_mask.transmission=0.0",
        "--set source.energy=30keV",
    ]
    .map(|sets| {
        done(here, &format!("simulate scene/scene.toml -o run {small} {sets}"));
        done(here, "retrieve run --method gaussian --background free --overwrite -q");
        let image: Array3<f32> =
            read_npy(here.join("run/retrieved/dark_field.npy")).expect("an image");
        // Water is 8 mm beside the axis, polyethylene on it: 79 columns, magnified by 1.49.
        [8..88, 88..168].map(|columns| {
            let middle = columns.start + 25..columns.end - 25;
            let part = image.slice(s![0, 0, middle]);
            let mut values: Vec<f32> = part.iter().map(|value| 1e12 * value).collect();
            values.sort_by(f32::total_cmp);
            values[values.len() / 2]
        })
    });
    println!("measured: {found:?} urad2, water and polyethylene");
    let [[water, polyethylene], sheets, one_energy] = found;
    assert!((1.0..1.8).contains(&water) && polyethylene.abs() < 0.2, "{found:?}");
    assert!(sheets.into_iter().chain(one_energy).all(|value| value.abs() < 0.2), "{found:?}");
}
