//! `check` as adviser of a set-up, by the real binary.

use crate::support::program::{done, ended, run, stderr};

const MASKS: &str = include_str!("../support/masks.toml");

#[test]
fn the_illumination_curve_is_told_and_drawn() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let scene = format!(
        "{MASKS}\n[scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 11 }}\n[detector]\n\
         distance = \"1.8 m\"\npixels = [8, 4]\npitch = \"150 um\"\nphotons = 10000\n"
    );
    std::fs::write(here.join("scene.toml"), &scene).unwrap();
    let told = done(here, "check scene.toml --plot curve.svg");
    for line in
        ["illumination curve", "visibility", "9.7", "expected 1 sigma", "-2.56 to 2.56 sigma"]
    {
        assert!(told.contains(line), "{line}: {told}");
    }
    let drawn = std::fs::read_to_string(here.join("curve.svg")).unwrap();
    for word in ["Illumination curve of scene.toml", "mask offset [µm]", "visibility", "dark field"]
    {
        assert!(drawn.contains(word), "{word}");
    }
    // Of the curve's 128 offsets and the eleven of the scan each has its place.
    assert!(drawn.matches("<circle").count() >= 11, "{drawn}");
    // What is there stays, and a name has to say what it is.
    assert!(stderr(&run(here, "check scene.toml --plot curve.svg")).contains("exists already"));
    done(here, "check scene.toml --plot curve.svg --overwrite");
    ended(&run(here, "check scene.toml --plot curve.pdf"), 2);
}

/// Masks with these offsets in um, and a detector of a few pixels.
fn scan(offsets: &[f64]) -> String {
    let offsets: Vec<String> = offsets.iter().map(|offset| format!("\"{offset} um\"")).collect();
    format!(
        "{MASKS}\n[scan]\nmask_offsets = [{}]\n[detector]\ndistance = \"1.8 m\"\npixels = [8, 4]\n\
         pitch = \"150 um\"\n",
        offsets.join(", ")
    )
}

#[test]
fn check_explains_three_offsets_and_a_short_scan() {
    let directory = tempfile::tempdir().unwrap();
    let told = |offsets: &[f64]| {
        std::fs::write(directory.path().join("scene.toml"), scan(offsets)).unwrap();
        done(directory.path(), "check scene.toml")
    };
    let settle = |told: &str| {
        told.lines()
            .find(|line| line.contains("with three offsets") || line.contains("would determine"))
            .map(str::to_owned)
    };
    // Sigma of this set-up is 9.8 um: a reach of 2.2 sigma settles no background for three.
    for reach in [10.0, 22.5] {
        let line = settle(&told(&[-reach, 0.0, reach])).unwrap();
        assert!(line.starts_with("  with three offsets    T, alpha and sigma_DF2"), "{line}");
        assert!(line.contains("without a background of their own"), "{line}");
    }
    let line = settle(&told(&[-10.0, -3.0, 3.0, 10.0])).unwrap();
    assert!(line.starts_with("warning: scan.mask_offsets cover -1.0 to 1.0 sigma"), "{line}");
    assert_eq!(settle(&told(&[-22.5, -7.5, 7.5, 22.5])), None);
    assert_eq!(settle(&told(&[-10.0, 10.0, 10.0])), None, "no method takes two of three");
}

#[test]
fn the_curve_is_drawn_without_an_estimate() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let ball = "[[object]]\nname = \"ball\"\nmaterial = \"water\"\n\
                shape = { sphere = { radius = \"0.3 mm\" } }\n";
    let scene = [&scan(&[-25.0, -8.0, 8.0, 25.0]), ball].concat();
    std::fs::write(here.join("scene.toml"), scene).unwrap();
    let whole = done(here, "check scene.toml --plot whole.svg");
    let told = done(here, "check scene.toml --plot curve.svg --no-estimate");
    let drawn = |name: &str| std::fs::read_to_string(here.join(name)).unwrap();
    assert!(drawn("curve.svg") == drawn("whole.svg"));
    assert!(
        told.contains("no estimate: it was not requested") && !told.contains("about "),
        "{told}"
    );
    // All else is the same, but for the memory that refinement adds.
    let same = |told: &str| told.split_once("\nwork").unwrap().0.to_owned();
    assert_eq!(same(&told), same(&whole));
    done(here, "check scene.toml --plot other.svg --no-estimate --backend bvh");
    let told = ended(&run(here, "check scene.toml --no-estimate --backend bvh"), 2);
    assert!(told.contains("--backend have no effect with --no-estimate"), "{told}");
    let told = ended(&run(here, "check scene.toml --plot none.svg --no-estimate --device none"), 1);
    assert!(told.contains("none"), "{told}");
    assert!(!here.join("none.svg").exists());
}

#[test]
fn a_scan_that_settles_nothing_is_told_once_with_what_would() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let scene = format!(
        "{MASKS}\n[scan]\nmask_offsets = [\"-9 um\", \"-3 um\", \"3 um\", \"9 um\"]\n[detector]\n\
         distance = \"1.8 m\"\npixels = [8, 4]\npitch = \"150 um\"\nphotons = 10000\n"
    );
    std::fs::write(here.join("scene.toml"), scene).unwrap();
    done(here, "simulate scene.toml -o run -q");
    let told = done(here, "retrieve run --method gaussian --background free");
    let notes: Vec<&str> = told.lines().filter(|line| line.contains("ill")).collect();
    let [note] = notes[..] else { panic!("{told}") };
    // Sigma of this set-up is 9.8 um; the fit of so few steps finds it about.
    assert!(note.contains("every pixel is ill-conditioned: 4 offsets cover"), "{note}");
    assert!(note.contains("would determine width and background"), "{note}");
    assert!(told.contains("the run also has counts: --counts --weights poisson"), "{told}");
    let told = done(here, "retrieve run --counts --weights poisson --overwrite");
    assert!(!told.contains("also has counts"), "{told}");
}

#[test]
fn edges_far_from_the_rotation_centre_are_named_without_a_device() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let told = |name: &str, y: &str, more: &str| {
        let scene = format!(
            "[source]\ndistance = \"0.2 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n[detector]\n\
             distance = \"1 m\"\npixels = [40, 4]\npitch = \"50 um\"\n{more}\n[[object]]\nname = \"rod\"\n\
             shape = {{ box = {{ size = [\"0.1 mm\", \"1 mm\", \"0.02 mm\"] }} }}\nmaterial = \"gold\"\n\
             position = [\"0 mm\", \"{y}\", \"0 mm\"]\n"
        );
        std::fs::write(here.join(name), scene).unwrap();
        done(here, &format!("check {name} --no-estimate"))
    };
    // From 4 to 1 / 0.1795 - 1 = 4.571 of the spot: 0.143 of the blur, which is as wide as a pixel.
    let far = told("far.toml", "-20 mm", "");
    let amount = "err by up to 3.5e-2 of open beam where they take all light";
    assert!(far.contains("\"rod\", up to 20.5 mm before it") && far.contains(amount), "{far}");
    let behind = told("behind.toml", "20 mm", "");
    assert!(behind.contains("\"rod\", up to 20.5 mm behind it"), "{behind}");
    for quiet in [
        told("near.toml", "0 mm", ""),
        told("random.toml", "-20 mm", "[sampling]\nscheme = \"random\"\n"),
    ] {
        assert!(!quiet.contains("rotation centre"), "{quiet}");
    }
}

#[test]
fn random_rays_on_one_line_before_a_sample_are_warned_of() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let ball = "[sampling]\nscheme = \"random\"\nrays = [4, 1]\n[[object]]\nname = \"ball\"\n\
                material = \"water\"\nshape = { sphere = { radius = \"0.3 mm\" } }\n";
    std::fs::write(here.join("scene.toml"), [&scan(&[0.0]), ball].concat()).unwrap();
    let warned = |command: &str| {
        let output = run(here, command);
        ended(&output, 0);
        let all = [output.stdout, output.stderr].concat();
        String::from_utf8(all).unwrap().contains("sampling.rays = [4, 1]: all targets of a pixel")
    };
    for (set, told) in [("[4, 1]", true), ("4", false), ("[4, 2]", false)] {
        let set = format!("--set sampling.rays={}", set.replace(' ', ""));
        assert_eq!(warned(&format!("check scene.toml --no-estimate {set}")), told, "{set}");
        // Runs warn by the same rule.
        if set.contains("rays=[") {
            let simulate = format!("simulate scene.toml -o run --format npy --overwrite {set}");
            assert_eq!(warned(&simulate), told, "{set}");
        }
    }
    assert!(!warned("check scene.toml --no-estimate --set sampling.scheme=cells"));
    let resolved = std::fs::read_to_string(here.join("run/scene.toml")).unwrap();
    assert!(resolved.contains("\nrays = [4, 2]\n"), "{resolved}");
}
