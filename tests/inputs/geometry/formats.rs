//! PLY, OBJ and 3MF files, and parts of files by their names: those of other programs (tests/files) and
//! those made here, whole and broken.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use beamlet::geometry::{Sample, load};
use beamlet::scene::{Mesh, Object, Scene};

use super::set_up::{close, object, scene};

fn files() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files")
}

/// A part of a file with its unit; 3MF files tell theirs.
fn part(name: &str, path: &str, group: Option<&str>) -> Object {
    let unit = (!path.ends_with("3mf")).then_some(1e-3);
    let group = group.map(str::to_owned);
    object(name, Mesh::File { path: path.into(), unit, group })
}

fn scene_in(directory: &Path, objects: Vec<Object>) -> Scene {
    let mut scene = scene(objects);
    scene.directory = directory.into();
    scene
}

fn loaded(path: &str, group: Option<&str>) -> Sample {
    load(&scene_in(&files(), vec![part("part", path, group)])).unwrap()
}

/// Reads bytes as a file of that name.
pub(super) fn read(name: &str, bytes: &[u8], group: Option<&str>) -> beamlet::Result<Sample> {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join(name), bytes).unwrap();
    load(&scene_in(directory.path(), vec![part("part", name, group)]))
}

pub(super) fn refused(name: &str, bytes: &[u8]) -> String {
    let text = read(name, bytes, None).unwrap_err().to_string();
    assert!(text.contains("\"part\"") && text.contains(name), "{text}");
    text
}

/// A 3MF file of a model.
pub(super) fn archive(model: &str) -> Vec<u8> {
    archive_of(&[("3D/3dmodel.model", model)])
}

/// A zip archive of named texts.
pub(super) fn archive_of(parts: &[(&str, &str)]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, text) in parts {
        archive.start_file(*name, options).unwrap();
        archive.write_all(text.as_bytes()).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// A tetrahedron with the corners 0 and 1 on each axis: 1/6 of a unit.
pub(super) const VERTICES: &str = "<vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>\n\
    <vertex x=\"0\" y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"/></vertices>";
pub(super) const TRIANGLES: &str = "<triangle v1=\"0\" v2=\"2\" v3=\"1\"/><triangle v1=\"0\" v2=\"1\" v3=\"3\"/>\n\
    <triangle v1=\"0\" v2=\"3\" v3=\"2\"/><triangle v1=\"1\" v2=\"2\" v3=\"3\"/>";

pub(super) fn model(attributes: &str, resources: &str, build: &str) -> Vec<u8> {
    archive(&model_text(attributes, resources, build))
}

pub(super) fn model_text(attributes: &str, resources: &str, build: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<model {attributes}><resources>{resources}</resources>\n\
         <build>{build}</build></model>"
    )
}

pub(super) fn tetrahedron(attributes: &str) -> String {
    format!(
        "<object {attributes}><mesh>{VERTICES}<triangles>{TRIANGLES}</triangles></mesh></object>"
    )
}

#[test]
fn files_of_other_programs_keep_their_volume() {
    // Boxes of 10 x 20 x 30 mm, and a ball of 80 facets with corners at 4 mm.
    let ball = 234.157_581_344_777_8e-9;
    for path in ["trimesh.ply", "trimesh_text.ply", "gmsh.stl", "prusa-slicer.3mf"] {
        let sample = loaded(path, None);
        assert!(close(sample.objects[0].volume, 6000e-9, 1e-6), "{path}");
        assert!(sample.objects[0].warnings.is_empty(), "{path}: {:?}", sample.objects[0].warnings);
    }
    for path in ["trimesh.3mf", "trimesh.obj"] {
        let both = loaded(path, None);
        assert!(close(both.objects[0].volume, 6000e-9 + ball, 1e-6), "{path}");
        let warnings = both.objects[0].warnings.join("\n");
        assert!(
            warnings.contains("2 objects become one object (\"box\", \"ball\"); `group`"),
            "{path}: {warnings}"
        );
        for (name, volume) in [("box", 6000e-9), ("ball", ball)] {
            let one = loaded(path, Some(name));
            assert!(close(one.objects[0].volume, volume, 1e-6), "{path}: {name}");
            assert!(one.objects[0].warnings.is_empty(), "{path}: {name}");
        }
    }
}

#[test]
fn objects_of_one_file_are_the_parts_of_it_and_have_its_hash() {
    let scene = scene_in(
        &files(),
        vec![
            part("a", "trimesh.obj", Some("box")),
            part("b", "trimesh.3mf", Some("ball")),
            part("c", "trimesh.obj", Some("ball")),
        ],
    );
    let sample = load(&scene).unwrap();
    let [a, b, c] = &sample.objects[..] else { panic!("three objects") };
    assert_eq!([a.triangles, b.triangles, c.triangles], [12, 0, 80]);
    assert_eq!(a.hash, c.hash);
    assert_ne!(a.hash, b.hash);
    // Both are the same ball: what comes later covers the other.
    assert_eq!(b.cut_by, [2]);
}

#[test]
fn groups_and_materials_of_an_obj_are_taken_by_name() {
    let cube = |low: i32, names: [&str; 2]| {
        let mut text = String::new();
        for n in 0..8 {
            let at = |bit: i32| low + (n >> bit & 1);
            text += &format!("v {} {} {}\n", at(0), at(1), at(2));
        }
        let faces = [
            "-8 -6 -5 -7",
            "-4 -3 -1 -2",
            "-8 -7 -3 -4",
            "-6 -2 -1 -5",
            "-8 -4 -2 -6",
            "-7 -5 -1 -3",
        ];
        let halves = faces.chunks(3).zip(names);
        text + &halves
            .map(|(f, name)| format!("{name}\nf {}\n", f.join("\nf ")))
            .collect::<String>()
    };
    let text = cube(0, ["g left half\nusemtl iron", ""])
        + &cube(5, ["g right", "usemtl glass"])
        + &cube(8, ["o last\ng\nusemtl iron", ""]);
    let volume = |group| read("cubes.obj", text.as_bytes(), group).unwrap().objects[0].volume;
    assert!(close(volume(None), 3e-9, 1e-9));
    for group in ["left half", "half", "right", "last"] {
        assert!(close(volume(Some(group)), 1e-9, 1e-9), "{group}");
    }
    // Half of the second cube is open, and numbers are those of the file.
    let told = read("cubes.obj", text.as_bytes(), Some("glass")).unwrap_err().to_string();
    assert!(told.contains("open") && told.contains("triangle 19"), "{told}");
    let told = read("cubes.obj", text.as_bytes(), Some("Right")).unwrap_err().to_string();
    assert!(
        told.contains("is named \"Right\"") && told.contains("did you mean \"right\""),
        "{told}"
    );
    let two = text.replace("g right", "g iron");
    let told = read("cubes.obj", two.as_bytes(), Some("iron")).unwrap_err().to_string();
    assert!(told.contains("is a group and a material with other triangles"), "{told}");
    let merged = read("cubes.obj", text.as_bytes(), None).unwrap().objects[0].warnings.join("");
    assert!(merged.contains("2 groups become one object (\"left half\", \"right\")"), "{merged}");
}

/// A corner in the middle of an edge that the face beside it has whole.
#[test]
fn junctions_divide_the_neighbour() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0.5 0.5 0\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 5 4\nf 5 3 4\n";
    let found = read("a.obj", text.as_bytes(), None).unwrap();
    let object = &found.objects[0];
    assert!(close(object.volume, 1e-9 / 6.0, 1e-9) && object.triangles == 6, "{object:?}");
    let warnings = object.warnings.join("");
    assert!(warnings.contains("1 edge with corners of neighbours in the middle"), "{warnings}");
    let apart = refused("a.obj", text.replace("0.5 0.5 0", "0.5 0.501 0").as_bytes());
    assert!(apart.contains("a hole or a gap"), "{apart}");
}

#[test]
fn free_form_surfaces_of_an_obj_are_named() {
    let leaf = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let surfaces = "cstype bezier\ndeg 1 1\nsurf 0 1 0 1 1 2 3 4\nend\n";
    let both = read("a.obj", format!("{leaf}{surfaces}").as_bytes(), None).unwrap();
    assert!(close(both.objects[0].volume, 1e-9 / 6.0, 1e-9));
    let warnings = both.objects[0].warnings.join("");
    assert!(warnings.contains("free-form surfaces of the file (1) are not read"), "{warnings}");
}

/// A name may hold #, which begins a comment only where no name is.
#[test]
fn names_of_an_obj_hold_any_letters() {
    let leaf = |low: i32, head: &str| {
        let at = |[x, y, z]: [i32; 3]| format!("v {} {y} {z} # a corner\n", x + low);
        let corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]].map(at).concat();
        format!("{head}\n{corners}f -4 -2 -3\nf -4 -3 -1#lid\nf -4 -1 -2\nf -3 -2 -1\n")
    };
    let heads =
        ["o part #1\nusemtl steel#2", "o part #2\nusemtl steel#3", "o # 3\n# o 4\ng half#1 #2"];
    let file = (0..).step_by(3).zip(heads).map(|(low, head)| leaf(low, head)).collect::<String>();
    for group in ["part #1", "part #2", "steel#2", "# 3", "half#1", "#2"] {
        let sample = read("a.obj", file.as_bytes(), Some(group)).unwrap();
        assert!(close(sample.objects[0].volume, 1e-9 / 6.0, 1e-9), "{group}");
    }
    let steel = read("a.obj", file.as_bytes(), Some("steel#3")).unwrap();
    assert!(close(steel.objects[0].volume, 2e-9 / 6.0, 1e-9));
    let message = read("a.obj", file.as_bytes(), Some("part")).unwrap_err().to_string();
    assert!(message.contains("\"part #1\", "), "{message}");
}

pub(super) const TEXT_PLY: &str = "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty float x\n\
    property double y\nproperty int z\nproperty uchar red\nelement face 4\n\
    property list uchar int vertex_index\nproperty float quality\nend_header\n\
    0 0 0 9\n1 0 0 9\n0 1 0 9\n0 0 1 9\n3 0 2 1 0.5\n3 0 1 3 0.5\n3 0 3 2 0.5\n3 1 2 3 0.5\n";

#[test]
fn a_ply_in_text_or_of_either_byte_order_is_the_same() {
    let text = read("a.ply", TEXT_PLY.as_bytes(), None).unwrap();
    assert!(close(text.objects[0].volume, 1e-9 / 6.0, 1e-9));
    for (word, big) in [("binary_big_endian", true), ("binary_little_endian", false)] {
        let order = |mut bytes: Vec<u8>| {
            if !big {
                bytes.reverse();
            }
            bytes
        };
        let header = &TEXT_PLY[..TEXT_PLY.find("0 0 0 9").unwrap()];
        let mut bytes = header.replace("ascii", word).into_bytes();
        for [x, y, z] in [[0_u8, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]] {
            bytes.extend(order(f32::from(x).to_be_bytes().to_vec()));
            bytes.extend(order(f64::from(y).to_be_bytes().to_vec()));
            bytes.extend(order(i32::from(z).to_be_bytes().to_vec()));
            bytes.push(9);
        }
        for corners in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            bytes.push(3);
            corners.iter().for_each(|it: &i32| bytes.extend(order(it.to_be_bytes().to_vec())));
            bytes.extend([0; 4]);
        }
        // A comment in the encoding of Windows.
        let place = bytes.windows(7).position(|part| part == b"by hand").unwrap();
        bytes[place] = 0xf6;
        let binary = read("a.ply", &bytes, None).unwrap();
        assert_eq!((&text.vertices, &text.triangles), (&binary.vertices, &binary.triangles));
        let told = refused("a.ply", &bytes[..bytes.len() - 5]);
        assert!(told.contains("end of file") || told.contains("truncated"), "{told}");
    }
}

/// Right in all of these files: 1/6 of a unit.
#[test]
fn text_has_any_line_ends_and_any_words_where_nothing_is_read() {
    let stl = "solid a\nfacet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\n\
        endloop\nendfacet\nfacet normal nan\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\n\
        endloop\nendfacet\nendsolid a\nsolid b\nfacet normal x\nouter loop\nvertex 0 0 0\nvertex 0 0 1\n\
        vertex 0 1 0\nendloop\nendfacet\nfacet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\n\
        vertex 0 0 1\nendloop\nendfacet\nendsolid b\n";
    let obj = "f 1 3 2\nf 1//1 2//1 4//1\nfo 1 4 3\nl 1 2\nvn 0 0 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf -3 -2 -1\n";
    let body = TEXT_PLY.find("0 0 0 9").unwrap();
    let (head, rows) = TEXT_PLY.split_at(body);
    for (name, text) in [
        ("lines.stl", stl.to_owned()),
        ("line.stl", stl.replace('\n', " ")),
        ("tabs.stl", stl.replace('\n', "\r\n\t")),
        ("comments.stl", format!("# by hand\n\n; twice\n{stl}")),
        ("faces_first.obj", obj.to_owned()),
        ("line.ply", format!("{head}{}", rows.replace('\n', " "))),
        ("words.ply", TEXT_PLY.replace("0.5", "nan").replace(" 9\n", " -1.#IND\n")),
    ] {
        let found = read(name, text.as_bytes(), None).unwrap();
        assert!(close(found.objects[0].volume, 1e-9 / 6.0, 1e-9), "{name}");
    }
    for (text, words) in [
        (stl.replacen("vertex 0 1 0", "vertex 0 1", 1), &["found \"vertex 0 1\"", "line 5"][..]),
        (stl.replacen("vertex 0 1 0", "vertex 0 1 0 4", 1), &["vertex 0 1 0 4", "line 5"]),
        (stl.replace('\n', " ").replacen("0 1 0", "0 1 u", 1), &["vertex 0 1 u", "line 1"]),
        (stl.replacen("vertex 0 1 0", "", 1), &["2 vertices, not 3", "line 7"]),
        (stl.replace("endsolid b", ""), &["before \"endsolid\"", "line 31"]),
        (stl.replacen("outer", "inner", 1), &["\"inner\" is not part", "line 3"]),
        (format!("by hand\n{stl}"), &["begins with \"by hand", "begins with \"solid\""]),
    ] {
        let told = refused("a.stl", text.as_bytes());
        assert!(words.iter().all(|word| told.contains(word)), "{text}: {told}");
    }
}

#[test]
fn names_of_groups_come_back_from_the_resolved_scene() {
    let base = "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
                [detector]\ndistance = \"2 m\"\npixels = [8, 8]\npitch = \"1 mm\"\n\
                [[object]]\nname = \"part\"\nmaterial = \"carbon\"\n";
    for keys in ["mesh = \"trimesh.3mf\"", "mesh = \"trimesh.obj\"\nunit = \"mm\""] {
        let keys = format!("{base}{keys}\ngroup = \"the \\\"box\\\"\"\n");
        let scene = Scene::from_toml(&keys, files()).unwrap();
        let text = scene.to_toml(files(), &std::collections::BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&text, files()).unwrap(), scene);
    }
}
