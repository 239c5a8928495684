//! `beamlet convert --to astra`: what is written is where the vectors say, by a projector of its own.

use crate::support::program::{Workplace, stderr};
use beamlet::Cancel;
use beamlet::reconstruct::{Input, Quantity};
use beamlet::scene::Scene;
use beamlet::stack::{Maps, StackFile};
use ndarray::Array3;
use ndarray_npy::{read_npy, write_npy};
use serde_json::Value;

/// Radius (mm) and centre (mm) of the balls; the attenuation is 0.4 /mm.
const BALLS: [(f64, [f64; 3]); 2] = [(0.22, [0.25, 0.1, 0.12]), (0.15, [-0.3, 0.05, -0.15])];
const SCENE: &str = r#"
[source]
distance = "1.2 m"
spot = "0 um"
energy = "30 keV"
[detector]
distance = "1.8 m"
pixels = [8, 6]
pitch = ["150 um", "100 um"]
[sample_mask]
distance = "1.1 m"
projected_aperture = "30 um"
transmission = 0.0
[detector_mask]
distance = "1.8 m"
projected_aperture = "40 um"
transmission = 0.0
[sampling]
tolerance = 1e-4
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 7 }
angles = ["0 deg", "50 deg", "160 deg"]
travel = ["0 mm", "0 mm", "0.2 mm"]
axis = { shift = ["0.05 mm", "-3 mm", "0 mm"], tilt_x = "4 deg" }
[materials.resin]
mu = "4 /cm"
delta = 0.0
[[object]]
name = "large"
shape = { sphere = { radius = "0.22 mm" } }
material = "resin"
position = ["0.25 mm", "0.1 mm", "0.12 mm"]
[[object]]
name = "small"
shape = { sphere = { radius = "0.15 mm" } }
material = "resin"
position = ["-0.3 mm", "0.05 mm", "-0.15 mm"]
"#;

/// Path (mm) of a line from `from` through `to` in a ball.
fn chord(from: [f64; 3], to: [f64; 3], (radius, centre): (f64, [f64; 3])) -> f64 {
    let line = [0, 1, 2].map(|k| to[k] - from[k]);
    let away = [0, 1, 2].map(|k| centre[k] - from[k]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let along = dot(away, line) / dot(line, line).sqrt();
    let beside = dot(away, away) - along * along;
    2.0 * (radius * radius - beside).max(0.0).sqrt()
}

/// Mean of exp(-0.4 path) over what a pixel sees of the sample: the aperture of 20 um by its row.
fn transmission(vector: &[f64], row: f64, column: f64) -> f64 {
    let mut sum = 0.0;
    let parts = 8;
    for across in 0..parts {
        for up in 0..parts {
            let part = |at: i32| (f64::from(at) + 0.5) / f64::from(parts) - 0.5;
            // The window of the detector mask is 40 um of the pixel of 150.
            let (u, v) = (column + part(across) * 30.0 / 150.0, row + part(up));
            let to = [0, 1, 2].map(|k| vector[3 + k] + u * vector[6 + k] + v * vector[9 + k]);
            let path: f64 =
                BALLS.iter().map(|ball| chord([vector[0], vector[1], vector[2]], to, *ball)).sum();
            sum += (-0.4 * path).exp();
        }
    }
    sum / f64::from(parts * parts)
}

#[test]
fn projections_match_a_projector_along_their_vectors() {
    let work = Workplace::new(SCENE);
    let simulated = work.simulate(&["--format", "exr"]);
    assert!(simulated.status.success(), "{}", stderr(&simulated));
    let early = work.beamlet(&["convert", "run", "--to", "astra", "-o", "astra"]);
    assert!(stderr(&early).contains("holds no retrieved images"), "{}", stderr(&early));
    let done = work.beamlet(&["retrieve", "run", "-q"]);
    assert!(done.status.success(), "{}", stderr(&done));
    // Filled pixels of rims within two pixels of each other have the values of their neighbours.
    let words = ["convert", "run", "--to", "astra", "--as-retrieved", "-o", "astra"];
    let done = work.beamlet(&words);
    assert!(done.status.success(), "{}", stderr(&done));
    let again = work.beamlet(&words);
    assert!(stderr(&again).contains("--overwrite"), "{}", stderr(&again));
    assert!(work.beamlet(&[&words[..], &["--overwrite"]].concat()).status.success());
    let about: Value =
        serde_json::from_slice(&std::fs::read(work.path("astra/astra.json")).unwrap()).unwrap();
    assert_eq!(about["shape"], serde_json::json!([6, 3, 8]));
    assert!(about["units"]["flat_centre"].is_null() && about["units"]["refraction"] == "rad");
    let volume: Vec<f64> = serde_json::from_value(about["volume_mm"].clone()).unwrap();
    // The axis is 3 mm nearer to the source; the travel along the tilted axis adds to it, on average over the
    // views.
    let travel = 0.2 * (50.0 + 160.0) / 3.0 / 360.0;
    let scale = (1197.0 - travel * 4.0_f64.to_radians().sin()) / 1800.0;
    let [across, up] = [4.0 * 0.15 * scale, 3.0 * 0.1 * scale];
    assert!((volume[1] - across).abs() < 1e-9 && (volume[5] - up).abs() < 1e-9, "{volume:?}");
    assert!(work.path("astra/load_astra.py").is_file());
    let stack = StackFile::open(work.path("astra/transmission.npy")).unwrap();
    assert_eq!(stack.shape(), [1, 6, 3, 8]);
    let vectors: Vec<Vec<f64>> = serde_json::from_value(about["cone_vec_mm"].clone()).unwrap();
    let (mut darkest, mut worst) = (1.0_f64, 0.0_f64);
    for row in 0..6 {
        for (view, vector) in vectors.iter().enumerate() {
            let values = stack.frame(0, row, 0..3).unwrap();
            for column in 0..8_usize {
                let got = f64::from(values[[view, column]]);
                let want = transmission(vector, row as f64 - 2.5, column as f64 - 3.5);
                darkest = darkest.min(want);
                worst = worst.max((got - want).abs());
                // Rims of balls within a pixel: the fit of a curve weighs the aperture.
                assert!(
                    (got - want).abs() < 0.01,
                    "row {row}, view {view}, {column}: {got} for {want}"
                );
            }
        }
    }
    assert!(darkest < 0.87, "{darkest} {worst}");
}

/// Pixels without a value, a row of them among them, have the values that `reconstruct` gives them; all others
/// and all other images are as retrieved, and with `--as-retrieved` every pixel is.
#[test]
fn gaps_of_exported_images_are_filled_as_by_reconstruct() {
    let work = Workplace::new(SCENE);
    let simulated = work.simulate(&["--format", "npy", "--set", "sampling.tolerance=1e-2"]);
    assert!(simulated.status.success(), "{}", stderr(&simulated));
    let row: String = (0..8).map(|column| format!("3,{column}\n")).collect();
    std::fs::write(work.path("bad.txt"), row + "1,2\n0,7\n").unwrap();
    let done =
        work.beamlet(&["retrieve", "run", "--bad-pixels", "bad.txt", "--format", "npy", "-q"]);
    assert!(done.status.success(), "{}", stderr(&done));
    // A misfit, a transmission of 0, and an angle that is a misfit.
    let retrieved = work.path("run/retrieved");
    let read = |name: &str| -> Array3<f32> { read_npy(retrieved.join(name)).unwrap() };
    let mut transmission = read("transmission.npy");
    let mut flags: Array3<u32> = read_npy(retrieved.join("flags.npy")).unwrap();
    transmission[[1, 2, 4]] = 0.0;
    flags.fill(0);
    flags[[2, 4, 5]] = 1_048_576;
    write_npy(retrieved.join("transmission.npy"), &transmission).unwrap();
    write_npy(retrieved.join("flags.npy"), &flags).unwrap();
    let input = Input::of_images(std::slice::from_ref(&retrieved)).unwrap();
    let maps = Maps::open(&retrieved).unwrap();
    let done = work.beamlet(&["convert", "run", "--to", "astra", "-o", "filled"]);
    let printed = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(printed.contains("dark_field 30, refraction 30, transmission 32 of 144"), "{printed}");
    let bare = ["convert", "run", "--to", "astra", "--as-retrieved", "-o", "bare"];
    let done = work.beamlet(&bare);
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(!String::from_utf8_lossy(&done.stdout).contains("filled"));
    let about: Value =
        serde_json::from_slice(&std::fs::read(work.path("filled/astra.json")).unwrap()).unwrap();
    assert_eq!(about["filled_pixels"]["transmission"], 32);
    for name in maps.names().filter(|name| !name.contains("flat")) {
        let open = |folder: &str| StackFile::open(work.path(folder).join(format!("{name}.npy")));
        let stacks = [open("filled").unwrap(), open("bare").unwrap()];
        let quantity = Quantity::ALL.into_iter().find(|quantity| quantity.image() == name);
        let sinograms = quantity.map(|it| input.sinograms(it, &Cancel::default()).unwrap().0);
        for view in 0..3 {
            let map = maps.map(name, view).unwrap();
            for row in 0..6 {
                let [filled, bare] =
                    [0, 1].map(|index: usize| stacks[index].frame(0, row, 0..3).unwrap());
                for column in 0..8_usize {
                    let at = format!("{name}, view {view}, row {row}, column {column}");
                    let (kept, got) = (map[[row, column]], filled[[view, column]]);
                    assert_eq!(bare[[view, column]].to_bits(), kept.to_bits(), "{at}");
                    let Some(sinograms) = &sinograms else {
                        assert_eq!(got.to_bits(), kept.to_bits(), "{at}");
                        continue;
                    };
                    let is_transmission = quantity == Some(Quantity::Mu);
                    let is_misfit = [view, row, column] == [2, 4, 5];
                    let is_gap = kept.is_nan() || is_transmission && (kept == 0.0 || is_misfit);
                    if !is_gap {
                        assert_eq!(got.to_bits(), kept.to_bits(), "{at}");
                    }
                    let wanted = f64::from(sinograms[[view, row, column]]);
                    let wanted = if is_transmission { (-wanted).exp() } else { wanted };
                    // Rounding to f32, of the transmission and of its -ln.
                    let off = (f64::from(got) - wanted).abs();
                    assert!(off <= 3e-7 * wanted.abs(), "{at}: {got} for {wanted}");
                }
            }
        }
    }
}

#[test]
fn vectors_of_a_run_are_the_motions_of_another() {
    let work = Workplace::new(SCENE);
    let scene = Scene::load(work.path("scene.toml")).unwrap();
    let mut lines = String::new();
    for view in scene.views() {
        let all = [view.source, view.detector, view.column, view.row];
        let numbers: Vec<String> =
            all.as_flattened().iter().map(|it| format!("{}", it * 1e3)).collect();
        lines += &format!("{}\n", numbers.join(" "));
    }
    std::fs::write(work.path("vectors.txt"), &lines).unwrap();
    let scan = "[scan]\nmask_offsets = { from = \"-25 um\", to = \"25 um\", count = 7 }\n";
    let (head, rest) = SCENE.split_once("[scan]").unwrap();
    let (_, tail) = rest.split_once("[materials").unwrap();
    let with = |keys: &str| format!("{head}{scan}{keys}\n[materials{tail}");
    let of = |text: &str| Scene::from_toml(text, work.path("scene.toml").parent().unwrap());
    let found = of(&with("cone_vec = \"vectors.txt\"")).unwrap();
    assert_eq!(found.views().count(), 3);
    for (found, wanted) in found.views().zip(scene.views()) {
        for point in [[0.0; 3], [1e-3, 0.0, 0.0], [0.0, 1e-3, 2e-3]] {
            let [a, b] = [found.motion.point(point), wanted.motion.point(point)];
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} for {b:?}");
        }
    }
    let refused = |keys: &str, words: [&str; 2]| {
        let error = of(&with(keys)).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    refused("cone_vec = \"vectors.txt\"\nangles = [\"0 deg\"]", ["scan.cone_vec", "both"]);
    refused("cone_vec = \"none.txt\"", ["scan.cone_vec", "none.txt"]);
    let second = lines.lines().nth(1).unwrap();
    let short = second.rsplit_once(' ').unwrap().0;
    std::fs::write(work.path("vectors.txt"), lines.replace(second, short)).unwrap();
    refused("cone_vec = \"vectors.txt\"", ["line 2", "11 numbers"]);
    let far: Vec<String> = second
        .split(' ')
        .enumerate()
        .map(|(at, word)| {
            let value: f64 = word.parse().unwrap();
            format!("{}", if at < 3 { value * 1.001 } else { value })
        })
        .collect();
    std::fs::write(work.path("vectors.txt"), lines.replace(second, &far.join(" "))).unwrap();
    refused("cone_vec = \"vectors.txt\"", ["view 1", "detector"]);
}

/// geometry.json of other views, rows or columns than the images is refused by `convert` and `reconstruct`
/// alike.
#[test]
fn geometry_of_other_images_is_refused_with_its_list() {
    let work = Workplace::new(SCENE);
    let simulated = work.simulate(&["--format", "npy", "--set", "sampling.tolerance=1e-2"]);
    assert!(simulated.status.success(), "{}", stderr(&simulated));
    assert!(work.beamlet(&["retrieve", "run", "-q"]).status.success());
    let path = work.path("run/retrieved/geometry.json");
    let whole: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let list = |name: &str, length: usize| {
        let mut changed = whole.clone();
        let values = changed[name].as_array_mut().unwrap();
        let last = values.last().unwrap().clone();
        values.resize(length, last);
        changed
    };
    let mut fewer = whole.clone();
    for name in ["angles_rad", "angles_deg", "astra_cone_vec_mm", "sample_motions"] {
        fewer[name].as_array_mut().unwrap().pop();
    }
    // One verb for each, by turns: both read the geometry.
    let mut verbs =
        [["convert", "run", "--to", "astra"], ["reconstruct", "run", "--method", "cgls"]]
            .into_iter()
            .cycle();
    for (geometry, words) in [
        (list("astra_cone_vec_mm", 0), "astra_cone_vec_mm: found 0 views; allowed: 3"),
        (list("sample_motions", 2), "sample_motions: found 2 views; allowed: 3"),
        (list("angles_deg", 4), "angles_deg: found 4 views; allowed: 3"),
        (list("columns_m", 0), "columns_m: found an empty list"),
        (list("columns_m", 4), "images of 8 columns; geometry.json has 4 columns_m"),
        (list("columns_m", 9), "images of 8 columns; geometry.json has 9 columns_m"),
        (list("rows_m", 0), "rows_m: found an empty list"),
        (list("rows_m", 7), "images of 6 rows; geometry.json has 7 rows_m"),
        (fewer, "images of 3 views; geometry.json has 2 angles"),
    ] {
        std::fs::write(&path, geometry.to_string()).unwrap();
        let verb = verbs.next().unwrap();
        let refused = work.beamlet(&[&verb[..], &["-o", "made"]].concat());
        let message = stderr(&refused);
        assert!(message.contains(words) && refused.status.code() == Some(1), "{verb:?}: {message}");
        assert!(!work.path("made").exists());
    }
}
