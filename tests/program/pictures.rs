//! Pictures of real parts: a screw with noise, what is flagged in it, measured stacks, differences.

use crate::screw;
use crate::support::program::{copy_folder, copy_of, done, done_without_driver, ended, run};
use ndarray::{Array3, s};
use ndarray_npy::{read_npy, write_npy};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;
use tiny_skia::Pixmap;

const SIDE: usize = 24;
const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [24, 24]
photons = 20000
[sampling]
tolerance = 0.002
angle_tolerance = "200 nrad"
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 7 }
angles = ["0 deg", "40 deg"]

[[object]]
name = "screw"
mesh = "screw.stl"
unit = "mm"
material = "aluminium"
"#
);

/// A run of the screw with its counts, retrieved from them; made once.
fn made() -> &'static Path {
    static PLACE: OnceLock<TempDir> = OnceLock::new();
    PLACE
        .get_or_init(|| {
            let place = tempfile::tempdir().unwrap();
            fs::write(place.path().join("scene.toml"), SCENE).unwrap();
            fs::write(place.path().join("screw.stl"), screw::stl()).unwrap();
            done(place.path(), "simulate scene.toml -o run --format npy -q");
            done(place.path(), "retrieve run --counts --weights poisson --format npy -o images -q");
            place
        })
        .path()
}

/// A place of its own with the run, its scene and the images.
fn copy() -> TempDir {
    let place = copy_of(made());
    copy_folder(&made().join("images"), &place.path().join("images"));
    fs::copy(made().join("screw.stl"), place.path().join("screw.stl")).unwrap();
    place
}

fn image(place: &Path, name: &str) -> Array3<f32> {
    let path = place.join("images").join(format!("{name}.npy"));
    let whole = |path: &Path| Some(read_npy::<_, Array3<u32>>(path).ok()?.mapv(|it| it as f32));
    whole(&path).unwrap_or_else(|| read_npy(&path).unwrap())
}

fn put(place: &Path, name: &str, values: &Array3<f32>) {
    write_npy(place.join("images").join(format!("{name}.npy")), values).unwrap();
}

/// Words of an SVG picture.
fn words(path: PathBuf) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap();
    let parts = text.split("<text ").skip(1);
    parts
        .map(|part| part.split_once('>').unwrap().1.split_once("</text>").unwrap().0.to_owned())
        .collect()
}

/// Numbers of the bar, which stand between the label of z and that of the bar.
fn bar(words: &[String], label: &str) -> Vec<f64> {
    let numbers = words.iter().rev().skip_while(|word| *word != label).skip(1);
    numbers.map_while(|word| word.replace('−', "-").parse().ok()).collect()
}

/// The colour at a pixel of an image, which is 560 units wide from (90, `top`) on.
fn colour(picture: &Pixmap, top: f64, [column, row]: [usize; 2]) -> [u8; 3] {
    let unit = 560.0 / SIDE as f64;
    let scale = 1.5;
    let at = |start: f64, i: usize| scale * (start + unit * (i as f64 + 0.5));
    let pixel = picture.pixel(at(90.0, column) as u32, at(top, row) as u32).unwrap();
    [pixel.red(), pixel.green(), pixel.blue()]
}

fn picture(path: PathBuf) -> Pixmap {
    Pixmap::decode_png(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_flagged_pixel_sets_no_scale_and_is_counted() {
    let place = copy();
    let mut refraction = image(place.path(), "refraction");
    let mut flags = image(place.path(), "flags");
    flags.fill(0.0);
    let most = 1e6 * refraction.slice(s![0, .., ..]).iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    assert!(most < 20.0, "{most}");
    refraction[[0, 3, 4]] = 77e-6;
    // sample ill_conditioned
    flags[[0, 3, 4]] = 32768.0;
    put(place.path(), "refraction", &refraction);
    put(place.path(), "flags", &flags);
    done(place.path(), "view images -o svg --format svg --show retrieved");
    let words = words(place.path().join("svg/refraction_view_0000.svg"));
    let ends = bar(&words, "refraction angle [µrad]");
    let highest = ends.iter().fold(0.0_f64, |m, v| m.max(*v));
    assert!(highest > 0.3 && highest <= f64::from(most), "{ends:?}, {most}");
    let counted = "flagged: 1 pixel of 576: 1 sample ill-conditioned";
    assert!(words.iter().any(|word| word == counted), "{words:?}");
    // Without its flag the pixel is a spike, which sets no scale either; where all are flagged,
    // flags tell nothing.
    put(place.path(), "flags", &Array3::from_elem((2, SIDE, SIDE), 32768.0));
    done(place.path(), "view images -o all --format svg --show retrieved");
    let words = self::words(place.path().join("all/refraction_view_0000.svg"));
    assert!(words.iter().any(|word| word.starts_with("flagged: 576 pixels of 576")), "{words:?}");
    let ends = bar(&words, "refraction angle [µrad]");
    assert!(ends.iter().all(|end| end.abs() <= f64::from(most)), "{ends:?}, {most}");
}

#[test]
fn the_dark_field_of_a_noisy_run_has_diverging_colours_about_zero() {
    let dark_field = image(made(), "dark_field");
    let place = tempfile::tempdir().unwrap();
    let images = made().join("images");
    done(place.path(), &format!("view {} -o png --show retrieved", images.display()));
    done(place.path(), &format!("view {} -o svg --format svg --show retrieved", images.display()));
    let words = words(place.path().join("svg/dark_field_view_0000.svg"));
    // More than a hundredth of the values is negative: colours diverge about 0.
    let ends = bar(&words, "dark field σ² [µrad²]");
    let [low, high] =
        [f64::min, f64::max].map(|of| ends.iter().copied().reduce(of).expect("ticks"));
    assert!(low + high == 0.0 && ends.contains(&0.0), "{ends:?}");
    assert!(!words.iter().any(|word| word.contains("drawn black")), "{words:?}");
    let drawn = picture(place.path().join("png/dark_field_view_0000.png"));
    let flags = image(made(), "flags");
    let lowest = dark_field
        .indexed_iter()
        .filter(|((view, row, column), _)| *view == 0 && flags[[0, *row, *column]] == 0.0)
        .min_by(|(_, a), (_, b)| a.total_cmp(b));
    let ((_, row, column), _) = lowest.unwrap();
    let [red, _, blue] = colour(&drawn, 62.0, [column, row]);
    assert!(red.abs_diff(blue) > 60, "a colour of the lower end: {red} {blue}");
}

#[test]
fn pictures_name_method_weights_and_counts_and_values_have_the_digits_of_their_error() {
    let place = tempfile::tempdir().unwrap();
    let (run, images) = (made().join("run"), made().join("images"));
    let line = format!(
        "view {} --retrieved {} -o svg --format svg --pixel 9,12",
        run.display(),
        images.display()
    );
    done(place.path(), &line);
    let of = |name: &str| words(place.path().join("svg").join(name));
    let how = "method exact-curve · weights poisson · from counts";
    let transmission = of("transmission_view_0000.svg");
    assert!(transmission.iter().any(|word| word.ends_with(how)), "{transmission:?}");
    let profile = of("profile_view_0000_row_0012.svg");
    assert!(profile.iter().any(|word| word.ends_with(how)), "{profile:?}");
    assert_eq!(profile.iter().filter(|word| *word == "± 1σ").count(), 3, "{profile:?}");
    let curve = of("curve_view_0000_column_0009_row_0012.svg");
    let told = curve.iter().find_map(|word| word.strip_prefix("T = ")).unwrap();
    let (value, sigma) = told.split_once(" ± ").unwrap();
    let [wanted, error] = ["transmission", "transmission_sigma"]
        .map(|name| f64::from(image(made(), name)[[0, 12, 9]]));
    // Two digits of the error, and the value to the same place.
    let decimals = sigma.split_once('.').unwrap().1.len();
    assert_eq!(value.split_once('.').unwrap().1.len(), decimals);
    let unit = 10.0_f64.powf(-(decimals as f64));
    assert!((10.0..100.0).contains(&(sigma.parse::<f64>().unwrap() / unit + 1e-6)), "{told}");
    assert!((value.parse::<f64>().unwrap() - wanted).abs() <= 0.501 * unit, "{told} {wanted}");
    assert!((sigma.parse::<f64>().unwrap() - error).abs() <= 0.501 * unit, "{told} {error}");
    let angle = curve.iter().find(|word| word.starts_with("α = (")).unwrap();
    assert!(angle.ends_with(") µrad"), "{angle}");
}

#[test]
fn range_width_and_format_are_as_asked() {
    let place = copy();
    let line = "view images --show retrieved --map refraction,transmission -o png --width 900 \
                --range refraction=-10..30 --range transmission=0..2";
    done(place.path(), line);
    done(place.path(), &line.replace("png", "svg --format svg"));
    for name in ["refraction", "transmission"] {
        let drawn = picture(place.path().join(format!("png/{name}_view_0000.png")));
        assert_eq!(drawn.width(), 900);
        let text =
            fs::read_to_string(place.path().join(format!("svg/{name}_view_0000.svg"))).unwrap();
        assert!(text.contains(" width=\"900\" ") && text.contains("image/png;base64"), "{name}");
    }
    let ends =
        bar(&words(place.path().join("svg/refraction_view_0000.svg")), "refraction angle [µrad]");
    assert_eq!((ends[0], ends[ends.len() - 1]), (30.0, -10.0), "{ends:?}");
}

#[test]
fn every_material_of_the_sample_has_a_colour_of_its_own() {
    let place = tempfile::tempdir().unwrap();
    let mut scene = SCENE.split("[[object]]").next().unwrap().to_owned();
    for (at, material) in ["water", "aluminium", "gold", "nylon 66"].into_iter().enumerate() {
        let shift = 0.45 * at as f64 - 0.7;
        writeln!(
            scene,
            "[[object]]\nname = \"ball {at}\"\nmaterial = \"{material}\"\n\
             shape = {{ sphere = {{ radius = \"0.2 mm\" }} }}\nposition = [\"0 mm\", \"0 mm\", \"{shift} mm\"]"
        )
        .unwrap();
    }
    fs::write(place.path().join("scene.toml"), scene).unwrap();
    done(place.path(), "view scene.toml -o svg --format svg --elevation 0 --azimuth 0");
    done(place.path(), "view scene.toml -o png --elevation 0 --azimuth 0");
    let told = words(place.path().join("svg/sample.svg"));
    let drawn = picture(place.path().join("png/sample.png"));
    // From the lowest to the highest ball, on the middle of the picture: 1.12 times as high.
    let unit = 760.0 / 1.12 / 1.75;
    let seen: Vec<[u8; 3]> = (0..4)
        .map(|at| {
            let z = 0.45 * f64::from(at) - 0.7 + 0.025;
            let pixel = drawn.pixel(585, (1.5 * (390.0 - z * unit)) as u32).unwrap();
            [pixel.red(), pixel.green(), pixel.blue()]
        })
        .collect();
    for (at, material) in ["water", "aluminium", "gold", "nylon 66"].iter().enumerate() {
        assert!(told.iter().any(|word| word == material), "{told:?}");
        for other in 0..at {
            let apart = |i: usize| seen[at][i].abs_diff(seen[other][i]);
            assert!((0..3).map(apart).max() > Some(40), "{seen:?}");
        }
    }
}

#[test]
fn measured_stacks_are_looked_at_like_a_run() {
    let place = copy();
    fs::create_dir(place.path().join("lab")).unwrap();
    for (from, to) in [("counts/flat", "flat"), ("counts/sample", "sample"), ("dark", "dark")] {
        let [from, to] = [format!("run/{from}.npy"), format!("lab/{to}.npy")];
        fs::rename(place.path().join(from), place.path().join(to)).unwrap();
    }
    fs::remove_dir_all(place.path().join("run")).unwrap();
    done(
        place.path(),
        "retrieve --flat lab/flat.npy --sample lab/sample.npy --dark lab/dark.npy --geometry \
         scene.toml --weights poisson --format npy -o lab/images -q",
    );
    let printed = done(place.path(), "view lab/images -o whole --pixel 9,12 --format svg");
    let names: Vec<&str> = printed.lines().map(|l| l.strip_prefix("whole/").unwrap()).collect();
    assert_eq!(names.len(), 10, "{names:?}");
    for name in ["flat_step_003.svg", "profile_view_0000_row_0012.svg"] {
        assert!(names.contains(&name), "{names:?}");
    }
    // Axes are in mm, and the flat is shown less its dark.
    let flat = words(place.path().join("whole/flat_step_003.svg"));
    for word in ["x on the detector [mm]", "detector number less dark"] {
        assert!(flat.iter().any(|found| found == word), "{word}: {flat:?}");
    }
    done_without_driver(place.path(), "report lab/images");
    let page = fs::read_to_string(place.path().join("lab/images.html")).unwrap();
    for word in ["id=\"data-sample\"", "dark.npy", "Set-up from above", "[detector]"] {
        assert!(page.contains(word), "{word}");
    }
    // From elsewhere, and when the stacks are gone, the images are still there to be seen.
    done(&place.path().join("lab"), "view images -o elsewhere");
    fs::remove_file(place.path().join("lab/flat.npy")).unwrap();
    let printed = done(place.path(), "view lab/images -o bare");
    assert_eq!(printed.lines().count(), 7, "{printed}");
    done_without_driver(place.path(), "report lab/images -o bare.html");
    let page = fs::read_to_string(place.path().join("bare.html")).unwrap();
    assert!(page.contains("The frames of these images are not shown") && page.contains("flat.npy"));
    let output = run(place.path(), "view lab/images -o none --show frames");
    assert!(ended(&output, 1).contains("flat.npy"));
    let output = run(place.path(), "view lab/images --retrieved images -o none");
    assert!(ended(&output, 2).contains("it has no run.json"));
}

#[test]
fn images_elsewhere_are_drawn_as_those_in_the_run() {
    let place = copy();
    done(place.path(), "view run --retrieved images -o elsewhere");
    done_without_driver(place.path(), "report run --retrieved images -o elsewhere.html");
    fs::rename(place.path().join("images"), place.path().join("run/retrieved")).unwrap();
    done(place.path(), "view run -o inside");
    for entry in fs::read_dir(place.path().join("inside")).unwrap() {
        let name = entry.unwrap().file_name();
        let read = |folder: &str| fs::read(place.path().join(folder).join(&name)).unwrap();
        assert_eq!(read("inside"), read("elsewhere"), "{name:?}");
    }
    let page = fs::read_to_string(place.path().join("elsewhere.html")).unwrap();
    assert!(page.contains("id=\"data-refraction_sigma\""));
    let output = run(place.path(), "view run --retrieved nowhere -o none");
    assert!(ended(&output, 1).contains("nowhere"));
}

#[test]
fn differences_are_drawn_where_they_are_largest() {
    let place = copy();
    done(place.path(), "compare images images -o same");
    copy_folder(&place.path().join("images"), &place.path().join("other"));
    let path = place.path().join("other/refraction.npy");
    let mut changed: Array3<f32> = read_npy(&path).unwrap();
    changed[[1, 20, 2]] += 3e-6;
    write_npy(&path, &changed).unwrap();
    let output = run(place.path(), "compare images other -o pictures");
    assert!(ended(&output, 1).contains("refraction"));
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("pictures/difference_refraction_view_0001.png"), "{printed}");
    let drawn = picture(place.path().join("pictures/difference_refraction_view_0001.png"));
    let [r, _, b] = colour(&drawn, 62.0, [2, 20]);
    assert!(r > b && b < 60, "B is larger there: red {r}, blue {b}");
    assert!(colour(&drawn, 62.0, [12, 12]).iter().all(|part| *part > 235), "white elsewhere");
    let output = run(place.path(), "compare images other -o pictures");
    // 1 would be an answer.
    assert!(ended(&output, 2).contains("--overwrite"));
    // Of two runs, frames too.
    let printed = done(place.path(), "compare run run -o runs");
    assert!(printed.contains("runs/difference_flat_step_000.png"), "{printed}");
}
