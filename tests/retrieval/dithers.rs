//! Retrieved images of dithered views: five dithers make five columns of each pixel.

use crate::support::program::{Workplace, stderr};
use beamlet::stack::{GeometryFile, Maps};

/// Radius, place, attenuation and delta of the rod.
const ROD: [f64; 4] = [0.3e-3, 60e-6, 300.0, 5e-7];
const SCENE: &str = r#"
source = { distance = "1.2 m", spot = "10 um", energy = "30 keV" }
detector = { distance = "1.8 m", pixels = [6, 1], pitch = "150 um" }
sample_mask = { distance = "1.1 m", projected_aperture = "30 um", transmission = 0.0 }
detector_mask = { distance = "1.8 m", projected_aperture = "30 um", transmission = 0.0 }
sampling = { tolerance = 1e-5 }
materials.rod = { mu = "300 /m", delta = 5e-7 }
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 11 }
angles = ["0 deg", "90 deg"]
dithers = { from = "-40 um", to = "40 um", count = 5 }
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.3 mm", height = "5 mm" } }
material = "rod"
position = ["60 um", "0 mm", "0 mm"]
"#;

#[test]
fn columns_of_dithers_match_geometry_json() {
    let work = Workplace::new(SCENE);
    let simulated = work.simulate(&["--format", "npy"]);
    assert!(simulated.status.success(), "{}", stderr(&simulated));
    assert_eq!(GeometryFile::read(&work.path("run")).unwrap().angles_deg.len(), 10);
    let done = work.beamlet(&["retrieve", "run", "-q", "--method", "exact-curve"]);
    assert!(done.status.success(), "{}", stderr(&done));
    let geometry = GeometryFile::read(&work.path("run/retrieved")).unwrap();
    assert_eq!((geometry.angles_deg.len(), geometry.columns_m.len()), (2, 30));
    assert!((geometry.axis_column.unwrap() - 14.5).abs() < 1e-9, "{:?}", geometry.axis_column);
    let vectors = geometry.astra_cone_vec_mm.clone().unwrap();
    assert!((vectors[0][6] - 0.03).abs() < 1e-9, "a column is 30 um wide: {vectors:?}");
    let maps = Maps::open(work.path("run/retrieved")).unwrap();
    let [transmission, refraction] =
        ["transmission", "refraction"].map(|name| maps.map(name, 0).unwrap());
    assert_eq!(maps.map("flat_centre", 0).unwrap().dim(), (1, 30));
    let [radius, middle, mu, delta] = ROD;
    let mut inner = 0;
    for (column, place) in geometry.columns_m.iter().enumerate() {
        let x = place * 1.2 / 1.8 - middle;
        if x.abs() > 0.8 * radius {
            continue;
        }
        inner += 1;
        let half = (radius * radius - x * x).sqrt();
        let want = (-mu * 2.0 * half).exp();
        let got = f64::from(transmission[[0, column]]);
        // The curvature of the attenuation over an aperture takes 7e-4 in the middle and 4.2e-3 at the
        // sides; it is the same on either side of the rod, where a wrong order is off by 8e-3.
        assert!((got - want).abs() < 5e-3, "column {column}: T {got} for {want}");
        let mirrored = f64::from(transmission[[0, 35 - column]]);
        assert!((got - mirrored).abs() < 1e-4, "column {column}: T {got}, mirrored {mirrored}");
        let want = 2.0 * delta * x / half;
        let got = f64::from(refraction[[0, column]]);
        // Slopes of the attenuation shift curves by 9 % of this refraction (docs/retrieval.md).
        let limit = 0.15 * want.abs() + 2e-8;
        assert!((got - want).abs() < limit, "column {column}: {got} rad for {want}");
    }
    assert!(inner >= 20, "{inner}");
    // At 90 degrees the rod is behind the axis, in the middle of the columns.
    let turned = maps.map("transmission", 1).unwrap();
    for column in 0..15 {
        let pair = [turned[[0, column]], turned[[0, 29 - column]]];
        assert!((pair[0] - pair[1]).abs() < 1e-3, "column {column}: {pair:?}");
    }
}

#[test]
fn measured_stacks_without_some_dithers_are_refused() {
    let work = Workplace::new(SCENE);
    let few =
        ["--format", "npy", "--set", "scan.dithers=[\"0 um\"]", "--set", "sampling.tolerance=1e-3"];
    assert!(work.simulate(&few).status.success());
    let line =
        "retrieve --flat run/flat.npy --sample run/sample.npy --geometry scene.toml -o images";
    let output = work.beamlet(&line.split(' ').collect::<Vec<_>>());
    let message = stderr(&output);
    assert!(message.contains("2 views; each angle has 5"), "{message}");
}
