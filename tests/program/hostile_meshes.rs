//! Bad meshes given to the program: unreadable, malformed, open or wound the wrong way.

use super::hostile::{Workplace, cube, stl};
use std::fs;
use std::process::Command;

fn text_stl() -> String {
    let (corners, triangles) = cube();
    let mut text = String::from("solid cube\n");
    for triangle in triangles {
        text.push_str("facet normal 0 0 0\nouter loop\n");
        for [x, y, z] in triangle.map(|corner| corners[corner]) {
            text.push_str(&format!("vertex {x} {y} {z}\n"));
        }
        text.push_str("endloop\nendfacet\n");
    }
    text + "endsolid cube\n"
}

fn obj() -> String {
    let (corners, triangles) = cube();
    let vertex = |[x, y, z]: &[f32; 3]| format!("v {x} {y} {z}\n");
    let face = |[a, b, c]: &[usize; 3]| format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    corners.iter().map(vertex).chain(triangles.iter().map(face)).collect()
}

#[test]
fn meshes_that_cannot_be_read_are_named() {
    let place = Workplace::new();
    fs::remove_file(place.directory.path().join("part.stl")).unwrap();
    place.refused(&["part.stl: cannot read the mesh"]);
    fs::create_dir(place.directory.path().join("part.stl")).unwrap();
    place.refused(&["part.stl: cannot read the mesh", "directory"]);
    let hash = "0".repeat(64);
    let recorded = format!("unit = \"mm\"\nsha256 = \"{hash}\"");
    Workplace::new().with("unit = \"mm\"", &recorded).refused(&[
        "\"part\" (part.stl)",
        "is not the mesh",
        &hash,
    ]);
}

#[test]
fn stl_files_that_lie_are_refused() {
    let good = stl();
    let mut wrong_count = good.clone();
    wrong_count[80] += 1;
    let mut huge_count = good.clone();
    huge_count[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let nan: Vec<u8> = good[..84]
        .iter()
        .copied()
        .chain(good[84..].chunks(50).flat_map(|record| {
            let nans = [f32::NAN.to_le_bytes(); 9].concat();
            [&record[..12], &nans, &record[48..]].concat()
        }))
        .collect();
    let open = [&good[..80], &10_u32.to_le_bytes(), &good[184..]].concat();
    for (name, bytes, words) in [
        (
            "a.stl",
            good[..good.len() - 20].to_vec(),
            &["12 triangles has 684 bytes, this file has 664"][..],
        ),
        ("a.stl", wrong_count, &["13 triangles has 734 bytes, this file has 684"]),
        ("a.stl", huge_count, &["4294967295 triangles", "this file has 684"]),
        ("a.stl", vec![], &["0 bytes are too few"]),
        ("a.stl", good[..90].to_vec(), &["this file has 90"]),
        ("a.stl", nan, &["12 triangles are not finite", "triangle 1\n", "the first 10"]),
        ("a.stl", open, &["not closed", "4 edges used by one triangle only", "trial rays", "mm"]),
        (
            "a.stl",
            text_stl().replacen("endloop", "vertex 0 0 0\nendloop", 1).into(),
            &["line 8", "4 vertices, not 3"],
        ),
        (
            "a.stl",
            text_stl().replace("endsolid cube\n", "").into(),
            &["the file ends before \"endsolid\""],
        ),
        ("a.stl", text_stl().replacen("vertex", "vertex 1", 1).into(), &["line 4", "vertex x y z"]),
        ("a.stl", text_stl().replacen("0.2", "O.2", 1).into(), &["line 4", "O.2"]),
        ("a.stl", [text_stl().as_bytes(), &good].concat(), &["a.stl"]),
        ("a.stl", b"solid only\nendsolid\n".to_vec(), &["no triangles"]),
        ("a.stl", b"<html>404 not found</html>".to_vec(), &["too few for an STL file"]),
        ("a.obj", good.clone(), &["a.obj"]),
        ("a.step", b"ISO-10303-21;".to_vec(), &["must end in .stl, .obj, .ply or .3mf"]),
    ] {
        let words = [&["\"part\" (", name], words].concat();
        Workplace::new().mesh(name, bytes).refused(&words);
    }
}

#[test]
fn obj_files_with_bad_indices_are_refused() {
    let good = obj();
    for (text, words) in [
        (good.replacen("f 1 5 7", "f 1 5 99", 1), &["a.obj"][..]),
        (good.replacen("f 1 5 7", "f 0 5 7", 1), &["a.obj"]),
        (good.replacen("f 1 5 7", "f 1 5 -99", 1), &["a.obj"]),
        (
            good.replacen("f 1 5 7", "f 1 5 99999999999999999999", 1),
            &["line 9", "99999999999999999999"],
        ),
        (good.replacen("f 1 5 7", "f 1 5 -9223372036854775808", 1), &["a.obj"]),
        (good.replacen("f 1 5 7", "f 1 5 x", 1), &["line 9: \"f 1 5 x\""]),
        (good.replacen("v -0.2 -0.2 -0.2", "v -0.2 -0.2", 1), &["line 1"]),
        (good.replacen("v -0.2 -0.2 -0.2", "v nan nan nan", 1), &["not finite", "triangle 1\n"]),
        (good.replacen("f 1 5 7", "f 1 5", 1), &["line 9", "at least 3 corners"]),
        (String::new(), &["no triangles"]),
        ("v 0 0 0\n".into(), &["no triangles"]),
    ] {
        let words = [&["\"part\" (a.obj)"], words].concat();
        Workplace::new().mesh("a.obj", text).refused(&words);
    }
}

#[test]
fn good_meshes_of_every_format_pass_where_the_bad_ones_fail() {
    for (name, bytes) in [("a.stl", stl()), ("b.stl", text_stl().into()), ("c.obj", obj().into())] {
        let place = Workplace::new().mesh(name, bytes);
        let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
        command.current_dir(place.directory.path()).args(["check", "scene.toml"]);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

/// The cube without two of its triangles.
fn open_cube() -> Vec<u8> {
    let good = stl();
    [&good[..80], &10_u32.to_le_bytes(), &good[184..]].concat()
}

#[test]
fn open_mesh_is_reported_by_check_in_text_and_json() {
    let place = Workplace::new().mesh("open.stl", open_cube());
    let check = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
        command.current_dir(place.directory.path()).args(["check", "scene.toml"]);
        command.args(arguments).output().unwrap()
    };
    let output = check(&[]);
    let (text, message) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(1));
    assert!(text.contains("    open edges: 4:\n") && text.contains("triangle 4 at ("), "{text}");
    assert!(message.contains("error: \"part\" (open.stl): the surface is not closed"), "{message}");
    let output = check(&["--json", "--set", "object[0].allow_defects=true"]);
    assert_eq!(output.status.code(), Some(0));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let found = &report["objects"][0]["defects"]["open_edges"];
    assert_eq!((found["count"].as_u64(), found["places"].as_array().unwrap().len()), (Some(4), 4));
    assert_eq!(found["places"][0]["position_mm"].as_array().unwrap().len(), 3);
    assert!(report["warnings"].to_string().contains("allow_defects"), "{report}");
    assert_eq!(report["refusals"].as_array().unwrap().len(), 0);
}

#[test]
fn open_mesh_runs_where_defects_are_allowed_and_the_tally_says_so() {
    let place = Workplace::new().mesh("open.stl", open_cube());
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
    command.current_dir(place.directory.path());
    command.args(["simulate", "scene.toml", "-o", "run", "--set", "object[0].allow_defects=true"]);
    let output = command.output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    assert!(message.contains("warning") || message.contains("warn"), "{message}");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("1 objects with defects"), "{text}");
    let record = fs::read(place.directory.path().join("run/run.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    assert_eq!(record["tally"]["defective_objects"], 1);
    assert!(record["tally"]["unbalanced"].as_u64().unwrap() > 0, "{record}");
    let resolved = fs::read_to_string(place.directory.path().join("run/scene.toml")).unwrap();
    assert!(resolved.contains("allow_defects = true"), "{resolved}");
}

#[test]
fn mesh_with_negative_paths_is_accepted_by_name_alone_and_its_rays_are_counted() {
    // Both faces across the beam are turned round: a ray leaves the cube before it enters it.
    let mut turned = stl();
    for triangle in 4..8 {
        let corners = 84 + 50 * triangle + 12;
        let (second, third) = turned[corners + 12..corners + 36].split_at_mut(12);
        second.swap_with_slice(third);
    }
    let place = Workplace::new().mesh("turned.stl", turned);
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
        command.current_dir(place.directory.path()).args(arguments).output().unwrap()
    };
    let refused = run(&["simulate", "scene.toml", "-o", "run"]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(message.contains("wind opposite ways"), "{message}");
    assert!(message.contains("of 4096 trial rays") && message.contains("negative paths, to -"));
    assert!(!message.contains("allow_defects"), "{message}");
    let allowed = ["simulate", "scene.toml", "-o", "run", "--set", "object[0].allow_defects=true"];
    let output = run(&allowed);
    let (text, message) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{message}");
    assert!(message.contains("(accepted: allow_defects)"), "{message}");
    assert!(text.contains("rays with negative paths"), "{text}");
    let record = fs::read(place.directory.path().join("run/run.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    let count = |key: &str| record["tally"][key].as_u64().unwrap();
    // Of the rays at 0 degrees, most through the cube; none is out of balance there.
    assert!(count("negative") > 0 && count("negative") < count("rays"), "{record}");
    // The cube without defects has none.
    let sound = Workplace::new();
    let mut command = Command::new(env!("CARGO_BIN_EXE_beamlet"));
    command.current_dir(sound.directory.path()).args(["simulate", "scene.toml", "-o", "run"]);
    assert!(command.output().unwrap().status.success());
    let record = fs::read(sound.directory.path().join("run/run.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    assert_eq!(record["tally"]["negative"], 0);
}
