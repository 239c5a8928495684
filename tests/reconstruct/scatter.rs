//! Deviations of `beamlet reconstruct --sigma` against the scatter over draws of noise.

use super::verb::{ROD, SCENE, number, place, volume};
use crate::reference::draws::Draws;
use crate::support::program::{done, ended, run, workplace};
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{Quantity, VolumeRecord};
use ndarray_npy::{ReadNpyExt, WriteNpyExt};
use std::fs::{self, File};
use std::path::Path;

/// Volumes with other draws of noise.
const DRAWS: i32 = 10;

fn npy(folder: &Path, name: &str) -> Array3<f32> {
    Array3::read_npy(File::open(folder.join(format!("{name}.npy"))).unwrap()).unwrap()
}

/// Makes the folder `images` from `retrieved`, with clean images plus a draw of the noise of their views
/// and of the flat.
fn draw_images(
    retrieved: &Path,
    clean: &Path,
    images: &Path,
    angle_per_shift: f64,
    normal: &mut impl FnMut() -> f64,
) {
    fs::create_dir(images).unwrap();
    for file in fs::read_dir(retrieved).unwrap().map(Result::unwrap) {
        fs::copy(file.path(), images.join(file.file_name())).unwrap();
    }
    for (name, of_flat) in
        [("transmission", "flat_area_sigma"), ("refraction", "flat_centre_sigma")]
    {
        let mut image = npy(clean, name);
        let sigma = npy(images, &format!("{name}_sigma")).mapv(f64::from);
        let of_flat = npy(images, of_flat).mapv(f64::from);
        let ring = of_flat.mapv(|_| normal());
        for (at, value) in image.indexed_iter_mut() {
            let of_pixel = (0, at.1, at.2);
            let per = if name == "transmission" { f64::from(*value) } else { angle_per_shift };
            let shared = per * of_flat[of_pixel];
            let own = (sigma[at] * sigma[at] - shared * shared).max(0.0).sqrt();
            *value += (shared * ring[of_pixel] + own * normal()) as f32;
        }
        image.write_npy(File::create(images.join(format!("{name}.npy"))).unwrap()).unwrap();
    }
}

/// Root mean square of the stated deviations of a quantity over the scatter of the volumes, within the
/// circle that every view sees.
fn deviation_over_scatter(here: &Path, quantity: &str) -> f64 {
    let read =
        |seed: i32, name: &str| npy(&here.join(format!("volume{seed}")), name).mapv(f64::from);
    let volumes: Vec<Array3<f64>> = (1..=DRAWS).map(|seed| read(seed, quantity)).collect();
    let mean: Array3<f64> =
        volumes.iter().fold(Array3::zeros((3, 32, 32)), |sum, it| sum + it) / f64::from(DRAWS);
    let inside = |y: usize, x: usize| (x as f64 - 15.5).hypot(y as f64 - 15.5) < 14.0;
    let mut scatter = 0.0;
    for volume in &volumes {
        for (((_, y, x), value), mean) in volume.indexed_iter().zip(&mean) {
            if inside(y, x) {
                scatter += (value - mean).powi(2) / f64::from(DRAWS - 1);
            }
        }
    }
    let stated = read(1, &format!("{quantity}_sigma"));
    let variance: f64 = stated
        .indexed_iter()
        .filter(|((_, y, x), _)| inside(*y, *x))
        .map(|(_, sigma)| sigma * sigma)
        .sum();
    (variance / scatter).sqrt()
}

/// Images with other draws of the noise of their views, and of the one flat that they share: the deviations
/// of fbp are the scatter of the volumes, rings among it.
#[test]
fn deviations_of_the_verb_are_the_scatter_over_draws_of_noise() {
    let place = workplace(SCENE);
    let here = place.path();
    done(here, "simulate scene.toml -q -o run --format npy --set detector.photons=20000");
    done(here, "retrieve run -q --format npy --counts --weights poisson");
    let clean = self::place().path().join("run/retrieved");
    let mut draw = Draws(5);
    let mut normal = move || {
        (-2.0 * draw.uniform().ln()).sqrt() * (std::f64::consts::TAU * draw.uniform()).cos()
    };
    let text = fs::read_to_string(here.join("run/retrieved/retrieved.json")).unwrap();
    let retrieved: serde_json::Value = serde_json::from_str(&text).unwrap();
    let angle_per_shift = retrieved["angle_per_shift"].as_f64().unwrap();
    for seed in 1..=DRAWS {
        let images = here.join(format!("images{seed}"));
        draw_images(&here.join("run/retrieved"), &clean, &images, angle_per_shift, &mut normal);
        let usual = "--format npy -q --quantity mu,delta";
        let line = format!("images{seed} -o volume{seed} --sigma --region {ROD} {usual}");
        done(here, &format!("reconstruct {line}"));
    }
    for quantity in ["mu", "delta"] {
        let ratio = deviation_over_scatter(here, quantity);
        println!("measured {quantity}: deviations {ratio:.3} of the scatter");
        // Ten draws of some 600 voxels that share noise with their neighbours and rings; misfits are filled.
        assert!((ratio - 1.0).abs() < 0.15, "{quantity}: {ratio}");
        let table = fs::read_to_string(here.join("volume1/regions.csv")).unwrap();
        let line = format!("rod,{quantity},");
        let of_mean = number(&table, &line, "sigma_of_mean");
        let [voxels, single] =
            ["voxels", "standard_deviation"].map(|column| number(&table, &line, column));
        assert!(of_mean > 0.0 && of_mean < single && voxels > 30.0, "{table}");
    }
    // The record says whether the deviations include the noise of the flat.
    let noise = |name: &str| VolumeRecord::read(&here.join(name)).unwrap().noise_of_flat;
    assert_eq!(noise("volume1").as_deref(), Some("included"));
    fs::remove_file(here.join("images1/flat_area_sigma.npy")).unwrap();
    let out = done(here, "reconstruct images1 -o unknown --sigma --quantity mu --format npy");
    assert!(out.contains("(rings): unknown: the images have no flat_area_sigma"), "{out}");
    assert!(noise("unknown").unwrap().starts_with("unknown"));
    // Iterations weigh by the deviations.
    let line = "--method cgls --iterations 5 --quantity mu -q --format npy";
    done(here, &format!("reconstruct run -o weighed --sigma {line}"));
    done(here, &format!("reconstruct run -o alike {line}"));
    let [weighed, alike] = ["weighed", "alike"].map(|name| volume(&here.join(name), Quantity::Mu));
    assert_ne!(weighed, alike);
    assert!(!here.join("weighed/mu_sigma.npy").exists());
    let refused = run(here, "reconstruct run -o none --method cgls --sigma --phase");
    assert!(ended(&refused, 1).contains("cannot be weights"));
}
