//! Light of rough bodies: cells against many random rays, within the noise of these.

use crate::detector::z_test::Scores;
use crate::support::{Checked, engine, sample};
use beamlet::Backend;
use beamlet::scene::{Scene, Scheme};
use ndarray::Array3;

/// Runs of random rays that are compared with cells.
const RUNS: u64 = 12;

pub(super) const MONO: &str = "energy = \"5 keV\"";
pub(super) const SPECTRUM: &str = "spectrum = \"soft.csv\"";
const ROWS: &str = "4.5,1\n5,2\n6,2\n7,1\n";

/// The paper's set-up with soft X-rays before a row of pixels that are high, so that light stays in it.
fn scene(beam: &str, object: &str) -> Scene {
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = [\"20 um\", \"20 um\"]\n{beam}\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [24, 1]\npitch = [\"150 um\", \"5 mm\"]\n\
         [sample_mask]\ndistance = \"1.2 m\"\ntransmission = 0\nprojected_aperture = \"30 um\"\n\
         [detector_mask]\ntransmission = 0\nprojected_aperture = \"30 um\"\n\
         [scan]\nmask_offsets = [\"-12 um\", \"0 um\", \"15 um\"]\n\
         [sampling]\nrays = [400, 1]\nmax_rays = 5000\n\
         [materials.matter]\nformula = \"Be\"\ndensity = \"1.85 g/cm3\"\n\
         [[object]]\nname = \"rough\"\nmaterial = \"matter\"\n{object}\n"
    );
    let directory = std::env::temp_dir().join("beamlet-rough-light");
    std::fs::create_dir_all(&directory).expect("a folder");
    std::fs::write(directory.join("soft.csv"), ROWS).expect("a file");
    Scene::from_toml(&text, directory).expect("a scene")
}

/// Forty plates of 8 um that a spine beside the field of view holds.
pub(super) fn plates(beam: &str) -> Scene {
    let [wide, thick, period] = [3.0, 0.008, 0.1]; // mm
    let mut points = vec![];
    for tooth in 0..40 {
        let y = f64::from(tooth) * period;
        points.extend([[-wide, y], [wide, y], [wide, y + thick], [-wide, y + thick]]);
    }
    points.extend([[-wide - 0.2, 39.0 * period + thick], [-wide - 0.2, 0.0]]);
    let corner = |[x, y]: &[f64; 2]| format!("[\"{x} mm\", \"{} mm\"]", y - 2.0);
    let points: Vec<String> = points.iter().map(corner).collect();
    let shape = format!(
        "shape = {{ extrusion = {{ points = [{}], height = \"12 mm\" }} }}\nroughness = 0.05\n\
         rotate = [{{ axis = [0, 0, 1], angle = \"10 deg\" }}]",
        points.join(", ")
    );
    scene(beam, &shape)
}

fn cylinder(beam: &str) -> Scene {
    scene(
        beam,
        "shape = { cylinder = { radius = \"0.9 mm\", height = \"12 mm\" } }\nroughness = 0.03",
    )
}

fn light(engine: &Checked, scene: &Scene) -> Array3<f64> {
    let stacks = engine.simulate(scene).expect("a run");
    stacks.sample.index_axis(ndarray::Axis(0), 0).mapv(f64::from)
}

/// Scores of cells against the mean of random runs: of each pixel and step, and how far all are off by
/// what the mean is uncertain.
fn compare(engine: &Checked, what: &str, scene: &Scene, scores: &mut Scores, found: bool) {
    let mut random = scene.clone();
    random.sampling.scheme = Scheme::Random;
    let runs: Vec<Array3<f64>> = (1..=RUNS)
        .map(|seed| {
            random.sampling.seed = seed;
            light(engine, &random)
        })
        .collect();
    let n = RUNS as f64;
    let mean = runs.iter().fold(Array3::<f64>::zeros(runs[0].raw_dim()), |sum, run| sum + run) / n;
    let squares = |sum: Array3<f64>, run: &Array3<f64>| sum + (run - &mean).mapv(|off| off * off);
    let variance: Array3<f64> =
        runs.iter().fold(Array3::zeros(mean.raw_dim()), squares) / (n - 1.0) / n;
    let against = |scene: &Scene| {
        let off = light(engine, scene) - &mean;
        let parts = off.iter().zip(&variance).filter(|(_, variance)| **variance > 0.0);
        let ratios: Vec<f64> = parts.map(|(off, variance)| off * off / variance).collect();
        // Squares of Student's t of n - 1 degrees of freedom.
        let free = n - 1.0;
        let one = free / (free - 2.0);
        let fourth = 3.0 * free * free / ((free - 2.0) * (free - 4.0));
        let count = ratios.len() as f64;
        (ratios.iter().sum::<f64>() - count * one) / (count * (fourth - one * one)).sqrt()
    };
    scores.take(what.to_owned(), against(scene));
    if found {
        let mut smooth = scene.clone();
        smooth.objects[0].roughness = 0.0;
        let wrong = against(&smooth);
        assert!(wrong > 10.0, "{what}: roughness makes no difference: {wrong}");
    }
}

#[test]
fn cells_have_the_light_of_random_rays() {
    let engine = engine(Backend::Bvh);
    let mut scores = Scores::default();
    let cases = vec![
        ("plates, one energy", plates(MONO), true),
        ("plates, a spectrum", plates(SPECTRUM), true),
        ("cylinder, one energy", cylinder(MONO), false),
        ("cylinder, a spectrum", cylinder(SPECTRUM), false),
    ];
    // Each body and each beam once; all of them with `BEAMLET_ALL`.
    for (what, scene, found) in sample(cases, 3) {
        compare(&engine, what, &scene, &mut scores, found);
    }
    scores.judge("cells of rough bodies against random rays");
}
