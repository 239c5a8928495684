//! Bad meshes in binary given to the program, and meshes that are accepted with their defects. `tests/refusals/` has
//! the texts.

use crate::support::program::{done, ended, run, workplace};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A scene with the object of part.stl.
const SCENE: &str = include_str!("../refusals/files/masks.toml");

/// A cube of 0.4 mm around the origin: corners, then triangles.
fn cube() -> (Vec<[f32; 3]>, Vec<[usize; 3]>) {
    let side = |bit: usize, corner: usize| if corner >> bit & 1 == 1 { 0.2 } else { -0.2 };
    let corners = (0..8).map(|corner| [side(0, corner), side(1, corner), side(2, corner)]);
    let faces =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    (corners.collect(), halves.collect())
}

fn stl() -> Vec<u8> {
    let (corners, triangles) = cube();
    let mut bytes = vec![b' '; 80];
    bytes.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|c| corners[*c]).flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A place with the scene and this mesh as part.stl.
fn with_mesh(bytes: impl AsRef<[u8]>) -> TempDir {
    let place = workplace(SCENE);
    fs::write(place.path().join("part.stl"), bytes).unwrap();
    place
}

#[test]
fn stl_files_that_lie_are_refused() {
    let good = stl();
    let mut wrong_count = good.clone();
    wrong_count[80] += 1;
    let mut huge_count = good.clone();
    huge_count[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let nan = |record: &[u8]| [&record[..12], &[0xff; 36], &record[48..]].concat();
    let nan = [&good[..84], &good[84..].chunks(50).flat_map(nan).collect::<Vec<_>>()].concat();
    let text = include_bytes!("../refusals/files/cube.stl");
    for (bytes, words) in [
        (&good[..good.len() - 20], "12 triangles has 684 bytes, this file has 664"),
        (&wrong_count, "13 triangles has 734 bytes, this file has 684"),
        (&huge_count, "4294967295 triangles has"),
        (&good[..90], "this file has 90"),
        (&nan, "12 triangles are not finite"),
        (&open_cube(), "not closed: 4 edges used by one triangle only"),
        (&[&text[..], &good].concat(), "part.stl"),
    ] {
        let place = with_mesh(bytes);
        let message = ended(&run(&place, "check scene.toml --no-estimate"), 1);
        assert!(message.contains("\"part\" (part.stl)") && message.contains(words), "{message}");
    }
}

#[test]
fn good_meshes_of_every_format_pass_where_the_bad_ones_fail() {
    let place = with_mesh(stl());
    for (name, bytes) in [
        ("b.stl", &include_bytes!("../refusals/files/cube.stl")[..]),
        ("c.obj", include_bytes!("../refusals/files/cube.obj")),
        ("d.ply", include_bytes!("../refusals/files/tetrahedron.ply")),
        ("part.stl", &stl()),
    ] {
        fs::write(place.path().join(name), bytes).unwrap();
        done(place.path(), &format!("check scene.toml --no-estimate --set object[0].mesh={name}"));
    }
}

#[cfg(unix)]
#[test]
fn files_without_permission_are_named() {
    use std::os::unix::fs::PermissionsExt;
    let place = with_mesh(stl());
    let path = place.path().join("part.stl");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o000)).unwrap();
    // The superuser may read everything.
    if fs::read(&path).is_err() {
        let message = ended(&run(&place, "check scene.toml --no-estimate"), 1);
        assert!(message.contains("part.stl: cannot read the mesh: Permission"), "{message}");
    }
}

#[test]
fn scene_without_objects_is_the_flat_twice() {
    let place = workplace(&SCENE[..SCENE.find("[[object]]").unwrap()]);
    done(place.path(), "simulate scene.toml -o run -q --format npy");
    assert!(place.path().join("run/sample.npy").exists());
}

/// The record of a run.
fn record(place: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(place.join("run/run.json")).unwrap()).unwrap()
}

/// The cube without two of its triangles.
fn open_cube() -> Vec<u8> {
    let good = stl();
    [&good[..80], &10_u32.to_le_bytes(), &good[184..]].concat()
}

#[test]
fn open_mesh_is_reported_by_check_in_text_and_json() {
    let place = with_mesh(open_cube());
    let output = run(&place, "check scene.toml");
    let message = ended(&output, 1);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("    open edges: 4:\n") && text.contains("triangle 4 at ("), "{text}");
    assert!(message.contains("error: \"part\" (part.stl): the surface is not closed"), "{message}");
    let report = done(place.path(), "check scene.toml --json --set object[0].allow_defects=true");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let found = &report["objects"][0]["defects"]["open_edges"];
    assert_eq!((found["count"].as_u64(), found["places"].as_array().unwrap().len()), (Some(4), 4));
    assert_eq!(found["places"][0]["position_mm"].as_array().unwrap().len(), 3);
    assert!(report["warnings"].to_string().contains("allow_defects"), "{report}");
    assert_eq!(report["refusals"].as_array().unwrap().len(), 0);
}

#[test]
fn open_mesh_runs_where_defects_are_allowed_and_the_tally_says_so() {
    let place = with_mesh(open_cube());
    let output = run(&place, "simulate scene.toml -o run --set object[0].allow_defects=true");
    let message = ended(&output, 0);
    assert!(message.contains("warn"), "{message}");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("1 objects with defects"), "{text}");
    let record = record(place.path());
    assert_eq!(record["tally"]["defective_objects"], 1);
    assert!(record["tally"]["unbalanced"].as_u64().unwrap() > 0, "{record}");
    let resolved = fs::read_to_string(place.path().join("run/scene.toml")).unwrap();
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
    let place = with_mesh(turned);
    let message = ended(&run(&place, "simulate scene.toml -o run"), 1);
    assert!(message.contains("wind opposite ways"), "{message}");
    assert!(message.contains("of 4096 trial rays") && message.contains("negative paths, to -"));
    assert!(!message.contains("allow_defects"), "{message}");
    let output = run(&place, "simulate scene.toml -o run --set object[0].allow_defects=true");
    let message = ended(&output, 0);
    assert!(message.contains("(accepted: allow_defects)"), "{message}");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("rays with negative paths"), "{text}");
    let record_of_turned = record(place.path());
    let count = |key: &str| record_of_turned["tally"][key].as_u64().unwrap();
    // Of the rays at 0 degrees, most through the cube; none is out of balance there.
    assert!(count("negative") > 0 && count("negative") < count("rays"), "{record_of_turned}");
    // The cube without defects has none.
    let sound = with_mesh(stl());
    done(sound.path(), "simulate scene.toml -o run -q");
    assert_eq!(record(sound.path())["tally"]["negative"], 0);
}
