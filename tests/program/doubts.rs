//! Doubts of `check` about set-ups, by the real binary: each fault has its warning, and the shipped scenes
//! have none.

use crate::support::program::{done, run};
use std::fs;
use std::path::Path;

const MASKS: &str = include_str!("../support/masks.toml");
const ROD: &str = include_str!("../support/rod.toml");
/// Words of every doubt.
const DOUBTS: [&str; 12] = [
    "moire fringes",
    "detector.pitch",
    "pixel borders",
    "blurs the illumination curve away",
    "of vacuum",
    "no filter",
    "are uneven",
    "are radians",
    "density of",
    "is negative",
    "too few for a fit",
    "bits hold",
];

fn checked(here: &Path, text: &str, options: &str) -> String {
    fs::write(here.join("scene.toml"), text).unwrap();
    done(here, &format!("check scene.toml --no-estimate {options}"))
}

fn found(text: &str) -> Vec<&str> {
    let warned =
        |word: &&str| text.lines().any(|it| it.starts_with("warning") && it.contains(word));
    DOUBTS.into_iter().filter(|word| warned(word)).collect()
}

/// Options of a tube without filters.
const TUBE: &str = "--set source.spectrum.anode=\"tungsten\" --set source.spectrum.kvp=40kVp";

/// A scene without faults.
fn plain_scene() -> String {
    format!(
        "{MASKS}\n[scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 11 }}\n[detector]\n\
         distance = \"1.8 m\"\npixels = [96, 2]\npitch = \"150 um\"\n{ROD}"
    )
}

/// The scene for a spectrum: constants hold at one energy.
fn scene_of_formula(plain: &str) -> String {
    plain
        .replace("energy = \"30 keV\"\n", "")
        .replace("mu = \"0.25 /cm\"\ndelta = 2.4e-7", "formula = \"C\"\ndensity = \"1 g/cm3\"")
}

#[test]
fn each_fault_has_its_warning_and_no_other() {
    let directory = tempfile::tempdir().unwrap();
    let plain = plain_scene();
    assert_eq!(found(&checked(directory.path(), &plain, "")), [""; 0]);
    // Weights of rows that widen, from 30 keV on so that air counts little.
    let rows: String = (0..20).map(|n| format!("{},1\n", 30.0 + f64::from(n * n) / 20.0)).collect();
    fs::write(directory.path().join("uneven.csv"), format!("energy_keV,weight\n{rows}")).unwrap();
    let cases = [
        // 0.96 fringes of the masks against one another, which the detector mask alone brings.
        ("--set detector_mask.period=151.5um", vec!["moire fringes", "detector.pitch"]),
        ("--set sample_mask.period=101um", vec!["moire fringes"]),
        ("--set detector_mask.offset=75um", vec!["pixel borders"]),
        ("--set source.spot=400um", vec!["blurs the illumination curve away"]),
        (TUBE, vec!["of vacuum", "no filter"]),
        ("--set source.spectrum=\"uneven.csv\"", vec!["are uneven"]),
        ("--set scan.angles={from=\"0deg\",to=\"6.2832deg\",count=360}", vec!["are radians"]),
        ("--set scan.angles={from=\"0deg\",to=\"3.1416deg\",count=20}", vec!["are radians"]),
        ("--set materials.plastic.delta=-2.4e-7", vec!["is negative"]),
        ("--set detector.photons=3", vec!["too few for a fit"]),
        ("--set detector.photons=400000 --set detector.bit_depth=16", vec!["bits hold"]),
    ];
    for (options, want) in cases {
        let text = match options.contains("source.spectrum") {
            true => scene_of_formula(&plain),
            false => plain.clone(),
        };
        assert_eq!(found(&checked(directory.path(), &text, options)), want, "{options}");
    }
    let hard = format!("{TUBE} --set surroundings.path_material=\"air\"");
    let text = scene_of_formula(&plain);
    assert!(!found(&checked(directory.path(), &text, &hard)).contains(&"of vacuum"));
    // A solid of 2 kg/m3.
    let light = plain.replace(
        "mu = \"0.25 /cm\"\ndelta = 2.4e-7",
        "formula = \"C5H8O2\"\ndensity = \"2 kg/m3\"",
    );
    assert_eq!(found(&checked(directory.path(), &light, "")), ["density of"]);
    // Sound beside the faults: one soft energy, a few degrees, a half turn, a limited range, one slit per two pixels.
    for options in [
        "--set source.energy=15keV",
        "--set scan.angles={from=\"-1.575deg\",to=\"1.575deg\",count=41}",
        "--set scan.angles={from=\"0deg\",to=\"180deg\",count=20}",
        "--set scan.angles={from=\"-5deg\",to=\"5deg\",count=11}",
        "--set detector.photons=300000 --set detector.bit_depth=16",
        "--set detector_mask.period=300um --set detector_mask.offset=75um --set sample_mask.period=200um",
    ] {
        assert_eq!(found(&checked(directory.path(), &plain, options)), [""; 0], "{options}");
    }
}

#[test]
fn odd_values_are_warned_of_in_words() {
    let directory = tempfile::tempdir().unwrap();
    let plain = plain_scene();
    for (options, words) in [
        ("--set surroundings.path_material=\"water\"", "of the photons of the source"),
        ("--set sample_mask.projected_aperture=1um", "are the units of aperture and period right"),
        ("--set detector.photons=2e7", "is more than an open pixel gets in a frame"),
        ("--set detector.pitch=2cm", "is wider than any pixel of an X-ray detector"),
        ("--set scan.angles={from=\"0rad\",to=\"360rad\",count=24}", "cover 54.9 turns"),
        ("--set sample_mask.thickness=1.2mm", "sample_mask.thickness of 1.2 mm"),
        ("--set scan.mask_offsets=[\"0um\"]", "different values of scan.mask_offsets: 1"),
        ("--set scan.errors.offset_sigma=2mm", "scan.errors displace the sample mask by up to"),
        ("--set scan.errors.intensity_sigma=5", "intensity errors are shares"),
        (
            "--set detector.photons=20000 --set detector.electronic_noise=1e5",
            "it is a standard deviation, in detector numbers",
        ),
        ("--set object.rod.scale=1e-9", "are its unit and `scale` right?"),
        ("--set object.rod.shape.cylinder.radius=0.5um", "are its unit and `scale` right?"),
        ("--set detector.pixels=[60000,60000]", "of the disk"),
        ("--set sample_mask.period=200um", "is 2 times that of detector_mask"),
        (
            "--set detector.absorber={material=\"CsI\",thickness=\"100nm\"}",
            "of the photons that reach it",
        ),
        ("--set sample_mask.offset=40um", "peak at a mask offset of -40.000 um, outside"),
        ("--set materials.plastic.delta=2.4e-5", "the densest solid has at 30 keV, about 4.4e-6"),
        (
            "--set detector.photons=20000 --set detector.bit_depth=16 --set detector.gain=1e-4",
            "a larger detector.gain avoids it",
        ),
    ] {
        let report = checked(directory.path(), &plain, options);
        let warned = report.lines().any(|it| it.starts_with("warning") && it.contains(words));
        assert!(warned, "{options}: {report}");
    }
}

#[test]
fn shipped_scenes_leave_no_doubt() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/experiments");
    let mut scenes = 0;
    for entry in fs::read_dir(&root).unwrap() {
        let folder = entry.unwrap().path();
        if folder.join("scene.toml").is_file() {
            scenes += 1;
            assert_eq!(
                found(&done(&folder, "check scene.toml --no-estimate")),
                [""; 0],
                "{folder:?}"
            );
        }
    }
    assert!(scenes >= 4, "{scenes} scenes");
}

#[test]
fn check_warns_without_an_estimate_as_with_one() {
    let directory = tempfile::tempdir().unwrap();
    let scene = format!(
        "{MASKS}\n[scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 11 }}\n[detector]\n\
         distance = \"1.8 m\"\npixels = [16, 1]\npitch = \"150 um\"\n{ROD}"
    );
    fs::write(directory.path().join("scene.toml"), scene).unwrap();
    let warnings = |options: &str| -> Vec<String> {
        let text = done(directory.path(), &format!("check scene.toml {options}"));
        // Sigma by a fit of light in f32 and by the closed form: to two digits.
        let rounded = |line: &str| line.split("(sigma").next().unwrap_or_default().to_owned();
        text.lines().filter(|line| line.starts_with("warning")).map(rounded).collect()
    };
    for (options, words) in [
        ("--set scan.mask_offsets={from=\"-12um\",to=\"12um\",count=5}", "cover -1."),
        ("--set scan.mask_offsets={from=\"-60um\",to=\"60um\",count=13}", "beyond half a period"),
        ("--set sample_mask.thickness=70um", "the bars of sample_mask transmit 2.4 %"),
        ("--set detector_mask.thickness=70um", "the bars of detector_mask transmit 2.4 %"),
    ] {
        let without = warnings(&format!("{options} --no-estimate"));
        assert!(without.iter().any(|warning| warning.contains(words)), "{options}: {without:?}");
        // One of the offsets, and one of the bars.
        if words.starts_with("cover") || words.contains("detector_mask") {
            assert_eq!(warnings(options), without, "{options}");
        }
    }
}

#[test]
fn standing_rods_are_named_once_and_angles_are_numbers() {
    let directory = tempfile::tempdir().unwrap();
    let text = format!(
        "{MASKS}\n[scan]\nmask_offsets = [\"0 um\"]\nangles = [\"0 deg\", \"30 deg\"]\n[detector]\n\
         distance = \"1.8 m\"\npixels = [64, 1]\npitch = \"150 um\"\n\
         [[object]]\nname = \"first\"\nshape = {{ cylinder = {{ radius = \"1 mm\", height = \"16 mm\" }} }}\n\
         material = \"water\"\n[[object]]\nname = \"second\"\nmaterial = \"water\"\n\
         shape = {{ cylinder = {{ radius = \"0.2 mm\", height = \"16 mm\" }} }}\n\
         position = [\"2 mm\", \"0 mm\", \"0 mm\"]\n"
    );
    let report = checked(directory.path(), &text, "");
    assert_eq!(report.matches("along z through the field: first (").count(), 1, "{report}");
    // Of their height the field shows its own, 150 um at the magnification of the rotation centre.
    let of_field = report.split("field of view").nth(1).and_then(|it| it.split(" x ").nth(1));
    let seen: f64 = of_field.unwrap().split(" um").next().unwrap().trim().parse().unwrap();
    let share: f64 =
        report.split("first (").nth(1).unwrap().split(" %").next().unwrap().parse().unwrap();
    assert!((share / (seen / 160.0) - 1.0).abs() < 1e-3, "{share} % of 16 mm for {seen} um");
    assert_eq!(report.matches(" % of its 16 mm").count(), 2, "{report}");
    assert!(!report.contains("outside the field"), "{report}");
    let json = checked(directory.path(), &text, "--json");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let setup = &json["setup"];
    assert_eq!(setup["angles_deg"], serde_json::json!([0.0, 30.0]));
    assert_eq!(setup["angles_rad"][1].as_f64(), Some(30_f64.to_radians()));
    done(directory.path(), "simulate scene.toml -o run -q --set detector.pixels=[4,1]");
    let run = fs::read_to_string(directory.path().join("run/run.json")).unwrap();
    let run: serde_json::Value = serde_json::from_str(&run).unwrap();
    assert_eq!(
        [&run["angles_deg"], &run["angles_rad"]],
        [&setup["angles_deg"], &setup["angles_rad"]]
    );
}

/// What `check` says of the field is said by the run, too, and kept in its record.
#[test]
fn runs_warn_of_a_sample_outside_the_field() {
    let directory = tempfile::tempdir().unwrap();
    let text = format!(
        "{MASKS}\n[scan]\nmask_offsets = [\"0 um\"]\n[detector]\ndistance = \"1.8 m\"\npixels = [16, 2]\n\
         pitch = \"150 um\"\n[[object]]\nname = \"ball\"\nmaterial = \"water\"\n\
         shape = {{ sphere = {{ radius = \"0.2 mm\" }} }}\nposition = [\"20 mm\", \"0 mm\", \"0 mm\"]\n"
    );
    let report = checked(directory.path(), &text, "");
    assert!(report.contains("lies in all views outside the field of view"), "{report}");
    let run = run(directory.path(), "simulate scene.toml -o run");
    let told = String::from_utf8_lossy(&run.stderr);
    assert!(told.contains("\"ball\" lies in all views outside the field of view"), "{told}");
    let record = fs::read_to_string(directory.path().join("run/run.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&record).unwrap();
    let [warning] = record["warnings"].as_array().unwrap().as_slice() else { panic!("{record}") };
    assert!(report.contains(warning.as_str().unwrap()), "{warning}");
}
