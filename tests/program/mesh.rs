//! `mesh` and `mask`: what is written is what a scene takes again.

use crate::support::program::{Workplace, ended, stderr};
use std::fs;

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [8, 2]
[[object]]
name = "rod"
shape = { cylinder = { radius = "0.2 mm", height = "4 mm" } }
material = "carbon"

[[object]]
name = "ball"
shape = { sphere = { radius = "0.3 mm" } }
material = "water"
position = ["6 mm", "0 mm", "0 mm"]
"#
);

fn done(place: &Workplace, words: &[&str]) -> String {
    let output = place.beamlet(words);
    assert!(output.status.success(), "{words:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Triangles and volume (mm3) that `mesh` prints of an object.
fn printed(text: &str, name: &str) -> (u32, f64) {
    let line = text.lines().find(|line| line.trim_start().starts_with(&format!("{name}:")));
    let words: Vec<&str> = line.expect("the object").split_whitespace().collect();
    let number = |at: usize| words[words.len() - at];
    (number(4).parse().expect("a count"), number(2).parse().expect("a volume"))
}

#[test]
fn objects_of_a_scene_become_a_file_and_that_file_others() {
    let place = Workplace::new(SCENE);
    let text = done(&place, &["mesh", "scene.toml", "-o", "all.obj", "--error", "0.1 um"]);
    // pi r2 h and 4/3 pi r3, less what facets within 0.1 um cut off: 2 e / r and 3 e / r of it.
    for (name, exact, share) in [("rod", 0.502_655, 1e-3), ("ball", 0.113_097, 1e-3)] {
        let (_, volume) = printed(&text, name);
        assert!(volume < exact && volume > exact * (1.0 - share), "{name}: {volume}");
    }
    let coarse = done(
        &place,
        &["mesh", "scene.toml", "-o", "ball.stl", "--object", "ball", "--error", "20 um"],
    );
    assert!(printed(&coarse, "ball").0 < printed(&text, "ball").0);
    assert!(!coarse.contains("rod"));
    // OBJ to PLY to STL, the lot and one of it.
    let one = done(&place, &["mesh", "all.obj", "--group", "ball", "-o", "one.ply"]);
    assert_eq!(printed(&one, "ball"), printed(&text, "ball"));
    let last = done(&place, &["mesh", "one.ply", "-o", "last.stl"]);
    assert_eq!(printed(&last, "one"), printed(&text, "ball"));
    let both = place.beamlet(&["mesh", "scene.toml", "-o", "both.ply"]);
    assert!(both.status.success() && stderr(&both).contains("2 objects are written as one mesh"));
}

#[test]
fn what_cannot_be_written_is_refused_and_nothing_is_lost() {
    let place = Workplace::new(SCENE);
    fs::write(place.path("kept.obj"), "mine").expect("a file");
    let message = ended(&place.beamlet(&["mesh", "scene.toml", "-o", "kept.obj"]), 1);
    assert!(message.contains("--overwrite"), "{message}");
    assert_eq!(fs::read(place.path("kept.obj")).expect("a file"), b"mine");
    done(&place, &["mesh", "scene.toml", "-o", "kept.obj", "--overwrite"]);
    let message = ended(&place.beamlet(&["mesh", "kept.obj", "-o", "kept.obj", "--overwrite"]), 1);
    assert!(message.contains("which this command reads"), "{message}");
}

#[test]
fn a_mask_is_written_with_the_object_that_it_is_in_a_scene() {
    let place = Workplace::new(SCENE);
    let words =
        ["mask", "scene.toml", "-o", "mask.obj", "--frame", "2 mm", "--substrate", "0.5 mm"];
    let text = done(&place, &words);
    let (_, objects) = text.split_once("\n\n").expect("objects after the list");
    let start = SCENE.find("[sample_mask]").expect("the mask");
    let end = SCENE.find("[detector_mask]").expect("the other mask");
    let scene = format!("{}{}{objects}", &SCENE[..start], &SCENE[end..]);
    fs::write(place.path("as_mesh.toml"), scene).expect("a scene");
    let check = done(&place, &["check", "as_mesh.toml", "--no-estimate"]);
    for name in ["sample_mask bars", "sample_mask frame", "sample_mask substrate"] {
        assert!(check.contains(name), "{check}");
    }
    let bars = done(&place, &["mask", "scene.toml", "--mask", "detector", "-o", "bars.stl"]);
    assert!(bars.contains("detector_mask bars") && bars.contains("\"589.8875 mm\""), "{bars}");
}

#[test]
fn check_names_a_wrong_unit_and_the_one_that_was_meant() {
    let scene = SCENE.replace(
        "shape = { cylinder = { radius = \"0.2 mm\", height = \"4 mm\" } }",
        "mesh = \"rod.stl\"\nunit = \"UNIT\"",
    );
    let place = Workplace::new(&scene.replace("UNIT", "mm"));
    fs::write(place.path("made.toml"), SCENE).expect("a scene");
    done(&place, &["mesh", "made.toml", "--object", "rod", "-o", "rod.stl"]);
    let good = done(&place, &["check", "scene.toml", "--no-estimate"]);
    assert!(!good.contains("would be"), "{good}");
    // In metres the rod is 400 m wide and meets the masks: that error tells it, too.
    for (unit, told, code) in [
        ("um", "pixels at the rotation centre", 0),
        ("cm", "fields of view", 0),
        ("m", "fields of view", 1),
    ] {
        fs::write(place.path("scene.toml"), scene.replace("UNIT", unit)).expect("a scene");
        let output = place.beamlet(&["check", "scene.toml", "--no-estimate"]);
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{text}");
        assert!(text.contains(told) && text.contains("unit = \"mm\" it would be 4 mm"), "{text}");
    }
}
