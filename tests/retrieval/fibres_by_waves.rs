//! Dark field of bundles of fibres by waves, over the dark field of the same fibres by rays.

use crate::reference::fit::fit;
use crate::support::engine;
use beamlet::Backend;
use beamlet::scene::Scene;

const RADIUS: f64 = 2.5e-6;
/// Crossings of a ray, on average.
const CROSSINGS: f64 = 50.0;
const COLUMNS: u32 = 48;
/// Offsets of the mask, m: seven over ±30 um.
const OFFSETS: [f64; 7] = [-30e-6, -20e-6, -10e-6, 0.0, 10e-6, 20e-6, 30e-6];

/// Fibres of a tenth of the section of a block, upright over one row.
fn scene([fibre, block]: [&str; 2], transport: &str) -> Scene {
    let width = 100e-6 * 1.22 / 1.2 * f64::from(COLUMNS + 4);
    let number = CROSSINGS * (width - 2.0 * RADIUS) / (2.0 * RADIUS);
    let depth = number * std::f64::consts::PI * RADIUS * RADIUS / (0.1 * width);
    let offsets: Vec<String> = OFFSETS.iter().map(|f| format!("\"{} um\"", f * 1e6)).collect();
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = [\"30 um\", \"0 um\"]\nenergy = \"30 keV\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\naperture = \"20 um\"\nperiod = \"100 um\"\ntransmission = 0.0\n\
         [detector_mask]\ndistance = \"1.8 m\"\naperture = \"30 um\"\ntransmission = 0.0\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [{COLUMNS}, 1]\npitch = \"150 um\"\n\
         [scan]\nmask_offsets = [{}]\n[sampling]\ntolerance = 1e-3\ntransport = \"{transport}\"\n\
         [[object]]\nname = \"block\"\nmaterial = \"{block}\"\n\
         shape = {{ box = {{ size = [\"{} m\", \"{} m\", \"10 mm\"] }} }}\n\
         [[object]]\nname = \"fibres\"\nmaterial = \"{fibre}\"\n\
         shape = {{ cylinder = {{ radius = \"{RADIUS} m\", height = \"8 mm\" }} }}\n\
         instances = {{ packing = \"parallel-fibres\", count = {number:.0}, seed = 1, \
         region = {{ box = {{ size = [\"{width} m\", \"{depth} m\", \"8 mm\"] }} }} }}\n",
        offsets.join(", "),
        width + 1e-3,
        depth + 0.2e-3,
    );
    Scene::from_toml(&text, ".").unwrap()
}

/// Dark field, rad², by Gaussian fits: mean over the columns of carbon in polyethylene and of the reverse, by which
/// refraction of odd order falls out; and its standard deviation.
fn dark_field(transport: &str) -> [f64; 2] {
    let materials = [["carbon", "polyethylene"], ["polyethylene", "carbon"]];
    let stacks = materials.map(|of| engine(Backend::Bvh).simulate(&scene(of, transport)).unwrap());
    let arm = 0.59 / 1.5;
    let of_column = |column: usize| {
        let of = |stacks: &beamlet::stack::Stacks| {
            let steps = 0..OFFSETS.len();
            let flat: Vec<f64> =
                steps.clone().map(|it| stacks.flat[[it, 0, column]].into()).collect();
            let sample: Vec<f64> =
                steps.map(|it| stacks.sample[[0, it, 0, column]].into()).collect();
            let [flat, sample] = [flat, sample].map(|curve| fit(&OFFSETS, &curve));
            (sample[2].powi(2) - flat[2].powi(2)) / (arm * arm)
        };
        0.5 * (of(&stacks[0]) + of(&stacks[1]))
    };
    let values: Vec<f64> = (1..COLUMNS as usize - 1).map(of_column).collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    [mean, (square / count).sqrt()]
}

#[test]
fn dark_field_of_fibres_of_5_um_by_waves_is_two_fifths_of_rays() {
    let [waves, of_waves] = dark_field("wave");
    let [rays, of_rays] = dark_field("auto");
    let ratio = waves / rays;
    let deviation = ratio * (of_waves / waves).hypot(of_rays / rays);
    println!("waves {waves:e} ± {of_waves:e}, rays {rays:e} ± {of_rays:e}: {ratio} ± {deviation}");
    // Structure functions of carbon fibres in polyethylene: 0.42.
    assert!(deviation < 0.03, "{deviation}");
    assert!((ratio - 0.42).abs() < 0.05, "{ratio} ± {deviation}");
}
