//! PLY and 3MF files, and parts of files by their names: those of other programs (tests/files) and
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
fn read(name: &str, bytes: &[u8], group: Option<&str>) -> beamlet::Result<Sample> {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join(name), bytes).unwrap();
    load(&scene_in(directory.path(), vec![part("part", name, group)]))
}

fn refused(name: &str, bytes: &[u8]) -> String {
    let text = read(name, bytes, None).unwrap_err().to_string();
    assert!(text.contains("\"part\"") && text.contains(name), "{text}");
    text
}

/// A 3MF file of a model.
fn archive(model: &str) -> Vec<u8> {
    archive_of(&[("3D/3dmodel.model", model)])
}

/// A zip archive of named texts.
fn archive_of(parts: &[(&str, &str)]) -> Vec<u8> {
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
const VERTICES: &str = "<vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>\n\
    <vertex x=\"0\" y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"/></vertices>";
const TRIANGLES: &str = "<triangle v1=\"0\" v2=\"2\" v3=\"1\"/><triangle v1=\"0\" v2=\"1\" v3=\"3\"/>\n\
    <triangle v1=\"0\" v2=\"3\" v3=\"2\"/><triangle v1=\"1\" v2=\"2\" v3=\"3\"/>";

fn model(attributes: &str, resources: &str, build: &str) -> Vec<u8> {
    archive(&model_text(attributes, resources, build))
}

fn model_text(attributes: &str, resources: &str, build: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<model {attributes}><resources>{resources}</resources>\n\
         <build>{build}</build></model>"
    )
}

fn tetrahedron(attributes: &str) -> String {
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
    let merged = read("cubes.obj", text.as_bytes(), None).unwrap().objects[0].warnings.join("");
    assert!(merged.contains("2 groups become one object (\"left half\", \"right\")"), "{merged}");
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

const CORE: &str = "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"";
const ITEM: &str = "<item objectid=\"1\"/>";

/// Volume of a 3MF file in sixths of a unit, and its warnings.
fn sixths(bytes: &[u8]) -> (f64, String) {
    let sample = read("a.3mf", bytes, None).unwrap();
    (6e9 * sample.objects[0].volume, sample.objects[0].warnings.join("\n"))
}

/// Elements and attributes of other name spaces, with the names of elements of the core.
#[test]
fn elements_of_a_3mf_count_by_their_name_space() {
    let slices = "<s:slicestack id=\"9\"><s:slice ztop=\"1\"><s:vertices><s:vertex x=\"0\" y=\"0\"/>\
                  </s:vertices></s:slice></s:slicestack>";
    let vendor = "<v:note><item objectid=\"1\"/></v:note><v:item objectid=\"1\"/>\
                  <u:item objectid=\"1\"/>";
    let spaces = "xmlns:s=\"http://schemas.microsoft.com/3dmanufacturing/slice/2015/07\" \
                  xmlns:v=\"http://vendor.example/2020\" v:unit=\"mile\"";
    let leaf = tetrahedron("id=\"1\" v:id=\"8\" v:type=\"other\" s:slicestackid=\"9\"");
    let build = format!("{ITEM}{vendor}");
    let (volume, warnings) =
        sixths(&model(&format!("{CORE} {spaces}"), &format!("{slices}{leaf}"), &build));
    assert!(close(volume, 1.0, 1e-9) && warnings.is_empty(), "{volume}: {warnings}");
    // The core may have a prefix.
    let prefixed = model_text(&format!("{CORE} {spaces}"), &leaf, ITEM);
    let prefixed = ["model", "resources", "object", "mesh", "vert", "triangle", "build", "item"]
        .iter()
        .fold(prefixed.replace("xmlns=", "xmlns:c="), |text, name| {
            text.replace(&format!("<{name}"), &format!("<c:{name}"))
                .replace(&format!("</{name}"), &format!("</c:{name}"))
        });
    assert!(close(sixths(&archive(&prefixed)).0, 1.0, 1e-9));
    let coarse = leaf.replace("s:slicestackid", "s:meshresolution=\"lowres\" s:slicestackid");
    let message = refused("a.3mf", &model(&format!("{CORE} {spaces}"), &coarse, ITEM));
    assert!(message.contains("the object 1 has slices"), "{message}");
}

#[test]
fn required_extensions_of_a_3mf_that_change_its_geometry_are_refused_by_name() {
    let lattice = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02";
    let beams = "<b:beamlattice radius=\"1\"><b:beams><b:beam v1=\"0\" v2=\"1\"/></b:beams></b:beamlattice>";
    let leaf = tetrahedron("id=\"1\"").replace("</mesh>", &format!("{beams}</mesh>"));
    let spaces = format!("{CORE} xmlns:b=\"{lattice}\"");
    let required = |spaces: &str, prefixes: &str| {
        model(&format!("{spaces} requiredextensions=\"{prefixes}\""), &leaf, ITEM)
    };
    assert!(refused("a.3mf", &required(&spaces, "b")).contains(lattice));
    let message = refused("a.3mf", &required(&spaces, "q"));
    assert!(message.contains("\"q\", which has no name space"), "{message}");
    // Where a reader may go on without it, it is said.
    let (volume, warnings) = sixths(&model(&spaces, &leaf, ITEM));
    assert!(close(volume, 1.0, 1e-9) && warnings.contains("beamlattice of \"1\""), "{warnings}");
    let plain = format!(
        "{spaces} xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" \
         xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\""
    );
    assert!(close(sixths(&required(&plain, "p m")).0, 1.0, 1e-9));
}

#[test]
fn only_the_model_of_a_3mf_is_read_and_the_rest_is_said() {
    let leaf = tetrahedron("id=\"1\"");
    let other = |kind: &str| tetrahedron(&format!("id=\"2\" name=\"extra\" {kind}"));
    let two = "<item objectid=\"1\"/><item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 3 0 0\"/>";
    let (volume, _) = sixths(&model(CORE, &format!("{leaf}{}", other("type=\"model\"")), two));
    assert!(close(volume, 2.0, 1e-9));
    let setting = |name: &str, text: &str| {
        let data =
            format!("<metadatagroup><metadata name=\"{name}\">{text}</metadata></metadatagroup>");
        other("").replace("<mesh>", &format!("{data}<mesh>"))
    };
    for extra in [
        other("type=\"support\""),
        other("type=\"solidsupport\""),
        other("type=\"other\""),
        other("type=\"surface\""),
        setting("cura:support_mesh", "True"),
        setting("cura:infill_mesh", "true"),
    ] {
        let (volume, warnings) = sixths(&model(CORE, &format!("{leaf}{extra}"), two));
        let said = warnings.contains("left out of the file: \"extra\"");
        assert!(close(volume, 1.0, 1e-9) && said, "{volume}: {warnings}");
        let alone = refused("a.3mf", &model(CORE, &extra, "<item objectid=\"2\"/>"));
        assert!(alone.contains("nothing is left of its objects: \"extra\""), "{alone}");
    }
    let (volume, _) =
        sixths(&model(CORE, &format!("{leaf}{}", setting("cura:support_mesh", "False")), two));
    assert!(close(volume, 2.0, 1e-9));
    let message = refused("a.3mf", &model(CORE, &other("type=\"odd\""), two));
    assert!(message.contains("type is \"odd\""), "{message}");
}

/// Modifiers and negative volumes by the settings of slicers: ranges of triangles of an object, or its
/// components.
#[test]
fn roles_of_slicers_in_a_3mf_are_left_out_and_said() {
    let shifted = VERTICES
        .replace("<vertices>", "")
        .replace("x=\"0\"", "x=\"4\"")
        .replace("x=\"1\"", "x=\"5\"");
    let vertices = VERTICES.replace("</vertices>", "") + &shifted;
    let second = [("\"0\"", "\"4\""), ("\"1\"", "\"5\""), ("\"2\"", "\"6\""), ("\"3\"", "\"7\"")];
    let second =
        second.iter().fold(TRIANGLES.to_owned(), |text, (from, to)| text.replace(from, to));
    let both = format!(
        "<object id=\"1\" name=\"part\"><mesh>{vertices}<triangles>{TRIANGLES}{second}</triangles>\
         </mesh></object>"
    );
    let text = model_text(CORE, &both, ITEM);
    let settings = |kind: &str| {
        format!(
            "<config><object id=\"1\"><volume firstid=\"0\" lastid=\"3\"><metadata type=\"volume\" \
             key=\"volume_type\" value=\"ModelPart\"/></volume><volume firstid=\"4\" lastid=\"7\">\
             <metadata type=\"volume\" key=\"volume_type\" value=\"{kind}\"/></volume></object></config>"
        )
    };
    let with = |text: &str, name: &str, settings: &str| {
        sixths(&archive_of(&[("3D/3dmodel.model", text), (name, settings)]))
    };
    let prusa = "Metadata/Slic3r_PE_model.config";
    assert!(close(with(&text, prusa, &settings("ModelPart")).0, 2.0, 1e-9));
    for (kind, words) in [
        ("NegativeVolume", "a negative volume of a slicer: its hole is not cut"),
        ("ParameterModifier", "modifies settings"),
        ("SupportBlocker", "support"),
    ] {
        let (volume, warnings) = with(&text, prusa, &settings(kind));
        let said = warnings.contains("triangles 4 to 7 of \"part\"") && warnings.contains(words);
        assert!(close(volume, 1.0, 1e-9) && said, "{kind}: {volume}: {warnings}");
    }
    let pair = "<object id=\"8\" name=\"pair\"><components><component objectid=\"1\"/>\
                <component objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 3 0 0\"/></components></object>";
    let leaves = tetrahedron("id=\"1\"") + &tetrahedron("id=\"2\"") + pair;
    let text = model_text(CORE, &leaves, "<item objectid=\"8\"/>");
    for (kind, volume) in [("normal_part", 2.0), ("negative_part", 1.0), ("support_enforcer", 1.0)]
    {
        let settings = format!(
            "<config><object id=\"8\"><part id=\"1\" subtype=\"normal_part\"></part>\
             <part id=\"2\" subtype=\"{kind}\"></part></object></config>"
        );
        let (found, warnings) = with(&text, "Metadata/model_settings.config", &settings);
        let said = warnings.contains("component 2 of \"pair\"");
        assert!(
            close(found, volume, 1e-9) && said == (volume < 2.0),
            "{kind}: {found}: {warnings}"
        );
    }
}

#[test]
fn parts_of_a_3mf_are_found_by_any_spelling_of_their_names() {
    let text = model_text(CORE, &tetrahedron("id=\"1\""), ITEM);
    let relations = |target: &str| {
        format!(
            "<Relationships><Relationship Target=\"{target}\" Id=\"r\" \
             Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>"
        )
    };
    for (name, target) in [
        ("3D\\3dmodel.model", "/3D/3dmodel.model"),
        ("3D/3dmodel.model", "\\3D\\3dmodel.model"),
        ("3D/part.xml", "/3D/part.xml"),
        ("3D/PART.MODEL", "3d/part.model"),
    ] {
        let relations = relations(target);
        for rels in ["_rels/.rels", "_rels\\.rels"] {
            let marked = format!("\u{feff}{text}");
            let (volume, _) = sixths(&archive_of(&[(name, &marked), (rels, &relations)]));
            assert!(close(volume, 1.0, 1e-9), "{name}");
        }
    }
}

#[test]
fn a_3mf_has_its_unit_components_and_materials() {
    let base = "<basematerials id=\"7\"><base name=\"brass\" displaycolor=\"#ffffff\"/>\
                <base name=\"resin\" displaycolor=\"#ffffff\"/></basematerials>";
    let leaf = tetrahedron("id=\"1\" name=\"leaf\" pid=\"7\" pindex=\"1\"");
    let pair = "<object id=\"2\" name=\"pair\"><components>\n<component objectid=\"1\"/>\
                <component objectid=\"1\" transform=\"-2 0 0 0 2 0 0 0 2 -1 5 7\"/></components></object>";
    let item = "<item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 0 0 -3\"/>";
    for (unit, length) in [("unit=\"micron\"", 1e-6_f64), ("", 1e-3), ("unit=\"inch\"", 25.4e-3)] {
        let file = model(unit, &format!("{base}{leaf}{pair}"), item);
        let sample = read("a.3mf", &file, Some("resin")).unwrap();
        let object = &sample.objects[0];
        // The second is mirrored and twice as large: 8 times the volume, and not inside out.
        assert!(close(object.volume, 9.0 / 6.0 * length.powi(3), 1e-6), "{unit}");
        assert!(
            !object.warnings.iter().any(|it| it.contains("inside out")),
            "{:?}",
            object.warnings
        );
        let ends = [[-3.0, 0.0, -3.0], [1.0, 7.0, 6.0]];
        for (found, end) in object.bounds.iter().flatten().zip(ends.as_flattened()) {
            assert!((found - end * length).abs() < 1e-6 * length, "{:?}", object.bounds);
        }
        assert!(read("a.3mf", &file, Some("pair")).is_ok() && read("a.3mf", &file, None).is_ok());
        let told = read("a.3mf", &file, Some("brass")).unwrap_err().to_string();
        assert!(told.contains("it has \"pair\", \"leaf\", \"resin\""), "{told}");
    }
}

#[test]
fn a_broken_3mf_tells_what_and_where() {
    let leaf = tetrahedron("id=\"1\"");
    let item = "<item objectid=\"1\"/>";
    let self_made =
        "<object id=\"1\"><components><component objectid=\"1\"/></components></object>";
    let cases: [(Vec<u8>, &[&str]); 11] = [
        (b"PK nothing".to_vec(), &["not a 3MF file"]),
        (archive("<model><resources/>"), &["nothing to build"]),
        (model("unit=\"mile\"", &leaf, item), &["unit is \"mile\"", "micron", "line 2"]),
        (
            model("", &tetrahedron("id=\"1\" pid=\"4\""), item),
            &["list 4", "has the lists: none", "line 2"],
        ),
        (model("", "", item), &["no object has the id 1"]),
        (model("", self_made, item), &["component of itself"]),
        (model("", &leaf.replace("v3=\"2\"", "v3=\"4\""), item), &["4 is not a vertex", "line 4"]),
        (model("", &leaf.replace("x=\"1\"", "x=\"one\""), item), &["x is \"one\"", "line 2"]),
        (model("", &leaf.replace("y=\"1\"", ""), item), &["attribute y is missing", "line 3"]),
        (model("", &leaf, "<item objectid=\"1\" transform=\"1 2\"/>"), &["transform is \"1 2\""]),
        (model("", &leaf, "<item objectid=\"1\"></thing>"), &["not valid XML"]),
    ];
    for (bytes, words) in cases {
        let told = refused("a.3mf", &bytes);
        assert!(words.iter().all(|word| told.contains(word)), "{words:?}: {told}");
    }
    let two = "<basematerials id=\"4\"><base name=\"tin\"/></basematerials>";
    let beyond =
        model("", &(two.to_owned() + &tetrahedron("id=\"1\" pid=\"4\" pindex=\"1\"")), item);
    assert!(refused("a.3mf", &beyond).contains("material 1 of the list 4 is used; the list has 1"));
}

#[test]
fn a_3mf_that_grows_without_end_is_refused() {
    // Forty levels, each twice the one before: 2^40 tetrahedra, and as many of nothing.
    for leaf in [tetrahedron("id=\"0\""), "<object id=\"0\"><mesh/></object>".to_owned()] {
        let double = |id: u32| {
            let component = format!("<component objectid=\"{}\"/>", id - 1);
            format!("<object id=\"{id}\"><components>{component}{component}</components></object>")
        };
        let objects = leaf + &(1..=40).map(double).collect::<String>();
        let told = refused("a.3mf", &model("", &objects, "<item objectid=\"40\"/>"));
        assert!(told.contains("32 bits") || told.contains("no triangles"), "{told}");
    }
    let deep = |id: u32| {
        format!(
            "<object id=\"{id}\"><components><component objectid=\"{}\"/></components></object>",
            id - 1
        )
    };
    let objects = tetrahedron("id=\"0\"") + &(1..200).map(deep).collect::<String>();
    let told = refused("a.3mf", &model("", &objects, "<item objectid=\"199\"/>"));
    assert!(told.contains("more than 64 deep"), "{told}");
}

const TEXT_PLY: &str = "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty float x\n\
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
        let binary = read("a.ply", &bytes, None).unwrap();
        assert_eq!((&text.vertices, &text.triangles), (&binary.vertices, &binary.triangles));
        let told = refused("a.ply", &bytes[..bytes.len() - 5]);
        assert!(told.contains("end of file") || told.contains("truncated"), "{told}");
    }
}

#[test]
fn a_broken_ply_tells_what_and_where() {
    for (from, to, words) in [
        ("ply\n", "plx\n", &["not a valid PLY", "line 1"][..]),
        ("float x", "float u", &["vertices have no coordinate x"]),
        ("vertex_index", "corners", &["no faces"]),
        ("face 4", "tristrips 4", &["strips of triangles"]),
        ("face 4", "face 4000000000", &["\"face\" need", "are left"]),
        ("vertex 4", "vertex 99999999999999999999", &["not a valid PLY", "line 4"]),
        ("3 1 2 3", "3 1 2 4", &["4 is not a vertex", "face 4"]),
        ("3 1 2 3", "3 1 2 -3", &["-3 is not a vertex", "face 4"]),
        ("3 1 2 3", "2 1 2", &["has 2", "face 4"]),
        ("1 0 0 9", "1 zero 0 9", &["not a valid PLY", "line 14"]),
        ("1 0 0 9", "inf 0 0 9", &["not a valid PLY", "line 14"]),
        ("end_header\n", "element other 4000000000\nend_header\n", &["\"other\" need"]),
    ] {
        assert!(TEXT_PLY.contains(from));
        let told = refused("a.ply", TEXT_PLY.replacen(from, to, 1).as_bytes());
        assert!(words.iter().all(|word| told.contains(word)), "{from}: {told}");
    }
}

#[test]
fn units_and_groups_that_a_format_does_not_have_are_refused_at_their_line() {
    let base = "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n\
                [detector]\ndistance = \"2 m\"\npixels = [8, 8]\npitch = \"1 mm\"\n\
                [[object]]\nname = \"part\"\nmaterial = \"carbon\"\n";
    let told = |keys: &str| {
        let scene = Scene::from_toml(&format!("{base}{keys}\n"), files());
        scene.unwrap_err().to_string()
    };
    let unit = told("mesh = \"trimesh.3mf\"\nunit = \"mm\"");
    assert!(unit.contains("object[0].unit") && unit.contains("3MF files state it"), "{unit}");
    assert!(told("mesh = \"trimesh.ply\"").contains("object[0].unit"));
    let group = told("mesh = \"gmsh.stl\"\nunit = \"mm\"\ngroup = \"a\"");
    assert!(
        group.contains("object[0].group") && group.contains("only OBJ and 3MF files"),
        "{group}"
    );
    let shape = told("shape = { sphere = { radius = \"1 mm\" } }\ngroup = \"a\"");
    assert!(shape.contains("object[0].group"), "{shape}");
    // What is allowed comes back from the resolved scene.
    for keys in ["mesh = \"trimesh.3mf\"", "mesh = \"trimesh.obj\"\nunit = \"mm\""] {
        let keys = format!("{base}{keys}\ngroup = \"the \\\"box\\\"\"\n");
        let scene = Scene::from_toml(&keys, files()).unwrap();
        let text = scene.to_toml(files(), &std::collections::BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&text, files()).unwrap(), scene);
    }
}
