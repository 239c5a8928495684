//! Simulated runs of two-dimensional masks, retrieved by their scene: both directions of the refraction behind a
//! wedge, with a plate that absorbs.

use crate::retrieve_cli::{bad, good};
use crate::support::{Worst, sample as taken};
use ndarray::Array3;
use ndarray_npy::read_npy;
use std::fs;
use std::path::Path;

const DELTA: f64 = 4e-6;
/// Change of the wedge's thickness per length, along x and z.
const SLOPES: [f64; 2] = [0.3, -0.4];
const TRANSMISSION: f64 = 0.8;

/// Wedge with a plate behind it. The section of the wedge becomes thicker along x by 0.5, and is turned about the
/// beam so that thickness changes along z as well.
fn sample() -> String {
    let slope = SLOPES[0].hypot(SLOPES[1]);
    // A turn about +y moves +x towards -z.
    let turn = -SLOPES[1].atan2(SLOPES[0]).to_degrees();
    let thick = 2.0 + 2.0 * slope;
    let thin = 2.0 - 2.0 * slope;
    let mu = -TRANSMISSION.ln() / 0.1;
    format!(
        "[[object]]\nname = \"wedge\"\nmaterial = \"light\"\n\
         shape = {{ extrusion = {{ points = [[\"-2 mm\", \"0 mm\"], [\"2 mm\", \"0 mm\"], [\"2 mm\", \"{thick} mm\"], \
         [\"-2 mm\", \"{thin} mm\"]], height = \"4 mm\" }} }}\n\
         rotate = [{{ axis = [0, 1, 0], angle = \"{turn} deg\" }}]\n\
         position = [\"0 mm\", \"-2 mm\", \"0 mm\"]\n\
         [[object]]\nname = \"plate\"\nmaterial = \"dark\"\nshape = {{ box = {{ size = [\"9 mm\", \"1 mm\", \"9 mm\"] }} }}\n\
         position = [\"0 mm\", \"5 mm\", \"0 mm\"]\n\
         [materials.light]\nmu = \"0 /cm\"\ndelta = {DELTA:e}\n[materials.dark]\nmu = \"{mu} /cm\"\ndelta = 0.0\n"
    )
}

/// Largest differences of the images of a run from the wedge: of the transmission, and of both angles over the
/// angle.
fn compare(run: &Path, what: &str, limits: [f64; 2]) {
    let image = |name: &str| -> Array3<f32> {
        read_npy(run.join(format!("retrieved/{name}.npy"))).unwrap()
    };
    let flags: Array3<u32> = read_npy(run.join("retrieved/flags.npy")).unwrap();
    let angle = DELTA * SLOPES[0].hypot(SLOPES[1]);
    let truths = [
        ("transmission", TRANSMISSION, limits[0]),
        ("refraction", -DELTA * SLOPES[0], limits[1] * angle),
        ("refraction_z", -DELTA * SLOPES[1], limits[1] * angle),
    ];
    for (name, truth, limit) in truths {
        let mut worst = Worst::new("wedge in two directions", limit);
        let image = image(name);
        // Places without a beamlet of a hexagonal lattice are NaN without a flag.
        let known = |at: &(usize, usize, usize)| flags[*at] != 0 || image[*at].is_finite();
        let places: Vec<_> = ndarray::indices(image.dim()).into_iter().filter(known).collect();
        assert!(places.len() >= 9, "{} of {:?}", places.len(), image.dim());
        for place in places {
            let value = image[place];
            worst.take(f64::from(value) - truth, || {
                format!("{what}, {name} at {place:?}: {value} for {truth}")
            });
        }
        worst.holds();
    }
    for name in ["dark_field", "dark_field_z", "dark_field_xz"] {
        let mut worst = Worst::new("wedge in two directions", 0.02 * angle * angle);
        let image = image(name);
        for (place, value) in image.indexed_iter() {
            if flags[place] != 0 || value.is_finite() {
                worst.take(f64::from(*value), || format!("{what}, {name} at {place:?}"));
            }
        }
        worst.holds();
    }
}

const SET_UP: &str = "[source]\ndistance = \"1 m\"\nspot = [\"20 um\", \"26 um\"]\nenergy = \"20 keV\"\n\
    [sampling]\ntolerance = 1e-5\nangle_tolerance = \"1 nrad\"\n";

fn simulate(folder: &Path, scene: &str) {
    fs::write(folder.join("scene.toml"), format!("{SET_UP}{scene}{}", sample())).unwrap();
    good(folder, &["simulate", "scene.toml", "-o", "run", "--format", "npy", "-q"]);
}

/// Apertures on a lattice before pixels of an eighth of the period, one exposure. Sampling may err by 1e-5 of the
/// open beam in a pixel, the cone of the beam sees other thicknesses by 2e-3. The hexagonal lattice; all with `BEAMLET_ALL`.
#[test]
fn beamlets_of_a_scene_give_both_angles_of_a_wedge_within_1_percent() {
    let place = tempfile::tempdir().unwrap();
    let apertures = vec![
        "shape = \"round\"\nlattice = \"hexagonal\"\naperture = \"16 um\"",
        "shape = \"rectangle\"\naperture = \"16 um\"\naperture_z = \"20 um\"",
        "shape = \"round\"\naperture = \"16 um\"",
    ];
    for (index, aperture) in taken(apertures, 3).enumerate() {
        let folder = place.path().join(index.to_string());
        fs::create_dir(&folder).unwrap();
        let scene = format!(
            "[sample_mask]\ndistance = \"0.95 m\"\nperiod = \"38 um\"\n{aperture}\ntransmission = 0.0\n\
             [detector]\ndistance = \"1.5 m\"\npixels = [60, 52]\npitch = \"8 um\"\n"
        );
        simulate(&folder, &scene);
        let summary = good(&folder, &["retrieve", "run", "--format", "npy"]);
        assert!(summary.contains("method   beamlet"), "{summary}");
        // The lattice of the scene counts as one that is named.
        let part = ["retrieve", "run", "--method", "gaussian", "--columns", "0::2", "-o", "part"];
        bad(&folder, &part, 1, "every pixel: beamlets are found among all of them");
        compare(&folder.join("run"), aperture, [2e-3, 0.01]);
    }
}

/// Rectangles before the sample and the detector, 25 steps on a grid.
#[test]
fn a_grid_of_steps_gives_both_angles_of_a_wedge_within_1_percent() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let pair =
        |step: i32| format!("[\"{} um\", \"{} um\"]", 9 * (step % 5) - 18, 9 * (step / 5) - 18);
    let pairs: Vec<String> = (0..25).map(pair).collect();
    let scan = format!("[scan]\nmask_offsets = [{}]\n", pairs.join(", "));
    let masks = "[sample_mask]\ndistance = \"0.95 m\"\nprojected_aperture = \"30 um\"\naperture_z = \"21 um\"\n\
                 transmission = 0.0\n\
                 [detector_mask]\naperture = \"28 um\"\naperture_z = \"30 um\"\ntransmission = 0.0\n\
                 [detector]\ndistance = \"1.5 m\"\npixels = [4, 4]\npitch = \"100 um\"\n";
    simulate(folder, &format!("{scan}{masks}"));
    good(folder, &["retrieve", "run", "--format", "npy", "--method", "exact-curve", "--phase"]);
    compare(&folder.join("run"), "steps", [1e-5, 1e-3]);
    // The mean angle of a row is subtracted: it is the wedge's, and no phase is left over four pixels.
    let record = fs::read_to_string(folder.join("run/retrieved/retrieved.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&record).unwrap();
    let angle = DELTA * SLOPES[0];
    let mean = record["drift"]["rms_rad"].as_f64().unwrap();
    assert!((mean / angle - 1.0).abs() < 2e-3, "{mean:e}");
    let phase: Array3<f32> = read_npy(folder.join("run/retrieved/phase.npy")).unwrap();
    let left = phase.iter().fold(0.0_f64, |most, at| most.max(f64::from(*at).abs()));
    assert!(left < 2e-3 * angle * 4e-4, "{left:e}");
    // A line along x and a point beside it do not determine the curve along z.
    bad(
        folder,
        &["retrieve", "run", "--method", "exact-curve", "--omit-steps", &omitted(), "-o", "line"],
        1,
        "do not determine the dark field along z",
    );
}

/// Steps off the middle line along x, but for one.
fn omitted() -> String {
    let off: Vec<String> =
        (0..25).filter(|step| step / 5 != 2 && *step != 0).map(|step| step.to_string()).collect();
    off.join(",")
}
