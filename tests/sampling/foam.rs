//! Structure that rays do not resolve and that differs along z, against random rays.

use crate::support::{amount, engine};
use beamlet::Backend;
use beamlet::scene::{RandomRays, Scene, Scheme};

/// Spheres of 8 um without absorption, about 15 crossings of a ray: they throw light over the borders of rows.
const FOAM: &str = "[source]\ndistance = \"1.2 m\"\nspot = \"20 um\"\nenergy = \"25 keV\"\n\
    [detector]\ndistance = \"1.8 m\"\npixels = [8, 3]\npitch = \"75 um\"\n\
    [sample_mask]\ndistance = \"1.19 m\"\nmaterial = \"gold\"\nthickness = \"200 um\"\n\
    projected_aperture = \"20 um\"\n\
    [detector_mask]\nmaterial = \"gold\"\nthickness = \"200 um\"\nprojected_aperture = \"25 um\"\n\
    [scan]\nmask_offsets = [\"-4 um\", \"3 um\"]\n\
    [sampling]\ntolerance = 1e-3\n\
    [materials.light]\nmu = \"0 /cm\"\ndelta = 6e-7\n\
    [[object]]\nname = \"foam\"\nmaterial = \"light\"\nshape = { sphere = { radius = \"8 um\" } }\n\
    [object.instances]\npacking = \"spheres\"\nfill = 0.2\nseed = 1\n\
    region = { cylinder = { radius = \"0.3 mm\", height = \"0.3 mm\" } }\n";

/// The standard deviation of a pixel by 160,000 rays is 7e-4, by 40,000 rays 1.4e-3, which the root mean square over 12
/// pixels has within a fifth: the limit is four deviations of it. Rays on four lines of a row would err by 3.8e-3.
#[test]
fn light_of_foams_is_that_of_random_rays() {
    let engine = engine(Backend::Bvh);
    let mut scene = Scene::from_toml(FOAM, ".").expect("a scene");
    let (columns, rays, most) = amount((4, 40_000, 2.5e-3), (8, 160_000, 1.1e-3));
    scene.detector.pixels[0] = columns;
    let cells = engine.simulate(&scene).expect("stacks").sample;
    scene.sampling.scheme = Scheme::Random;
    scene.sampling.rays = RandomRays::Count(rays);
    let random = engine.simulate(&scene).expect("stacks").sample;
    let off = || cells.iter().zip(&random).map(|(a, b)| f64::from(a - b));
    let count = cells.len() as f64;
    let rms = (off().map(|it| it * it).sum::<f64>() / count).sqrt();
    let mean = off().sum::<f64>() / count;
    println!("measured foam: rms {rms:.2e}, mean {mean:.1e}");
    // Values of the steps of a pixel have the same rays and count as one.
    let deviation = rms / (count / 2.0).sqrt();
    assert!(rms < most && mean.abs() < 4.0 * deviation, "{rms:e} {mean:e}");
}
