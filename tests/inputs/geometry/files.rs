//! Mesh files: the formats agree, and broken files say what is wrong.

use std::fmt::Write;
use std::path::Path;

use beamlet::geometry::{Sample, load};
use beamlet::internals::geometry::file_hash;
use beamlet::scene::{Mesh, Shape, ShapeOrMesh};

use super::formats::{TEXT_PLY, refused};
use super::set_up::{Arrays, close, object, scene};

fn read(directory: &Path, name: &str, bytes: &[u8]) -> beamlet::Result<Sample> {
    std::fs::write(directory.join(name), bytes).unwrap();
    let mesh = Mesh::file(name, 1e-3);
    let mut scene = scene(vec![object("part", ShapeOrMesh::Mesh(mesh))]);
    scene.directory = directory.into();
    load(&scene)
}

/// A cylinder in mm, in f32 so that every format can hold it exactly.
fn part() -> Arrays {
    let mut part = Arrays::of(Shape::Cylinder { radius: 4e-3, height: 16e-3, sides: Some(60) });
    for number in part.0.as_flattened_mut() {
        let rounded = (*number * 1e3) as f32;
        *number = f64::from(rounded);
    }
    part
}

fn binary(Arrays(vertices, triangles): &Arrays, header: &[u8]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for vertex in triangle {
            for number in vertices[*vertex as usize] {
                bytes.extend((number as f32).to_le_bytes());
            }
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn ascii(Arrays(vertices, triangles): &Arrays) -> String {
    let mut text = String::from("solid part of mine\n");
    for triangle in triangles {
        text.push_str("  facet normal 0 0 0\n    outer loop\n");
        for vertex in triangle {
            let [x, y, z] = vertices[*vertex as usize];
            writeln!(text, "      vertex {x:e} {y} {z}").unwrap();
        }
        text.push_str("    endloop\n  endfacet\n");
    }
    text + "endsolid part of mine\n"
}

fn obj(Arrays(vertices, triangles): &Arrays) -> String {
    let mut text = String::from("# made here\nmtllib missing.mtl\no part\nusemtl red\n");
    for [x, y, z] in vertices {
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for [a, b, c] in triangles {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
    }
    text
}

#[test]
fn binary_stl_ascii_stl_and_obj_give_the_same_sample() {
    let directory = tempfile::tempdir().unwrap();
    let part = part();
    let read = |name: &str, bytes: &[u8]| read(directory.path(), name, bytes).unwrap();
    let first = read("a.stl", &binary(&part, b"made here"));
    assert!(close(first.objects[0].volume, std::f64::consts::PI * 256e-9, 1e-6));
    assert_eq!(first.triangles.len(), part.1.len());
    assert_eq!(first.vertices.len(), part.0.len());
    let solid = read("b.STL", &binary(&part, b"solid but binary"));
    let text = read("c.stl", ascii(&part).as_bytes());
    let windows = read("d.stl", ascii(&part).replace('\n', "\r\n").to_uppercase().as_bytes());
    let named = ascii(&part);
    let latin = [&b"solid pi\xe8ce\n"[..], &named.as_bytes()["solid part of mine\n".len()..]];
    let latin = read("f.stl", &latin.concat());
    let wavefront = read("e.obj", obj(&part).as_bytes());
    for other in [solid, text, windows, latin, wavefront] {
        assert_eq!(first.triangles.len(), other.triangles.len());
        assert_eq!(first.vertices.len(), other.vertices.len());
        for (a, b) in first.triangles.iter().zip(&other.triangles) {
            let corners = |sample: &Sample, triangle: &[u32; 3]| {
                triangle.map(|vertex| sample.vertices[vertex as usize])
            };
            assert_eq!(corners(&first, a), corners(&other, b));
        }
        assert!(other.objects[0].warnings.is_empty());
    }
}

/// Byte order marks, line ends of old Macs, and ends of file of old systems.
#[test]
fn text_of_any_editor_is_the_same_mesh() {
    let directory = tempfile::tempdir().unwrap();
    let volume = |name: &str, bytes: &[u8]| {
        let sample = read(directory.path(), name, bytes).unwrap();
        assert!(sample.objects[0].warnings.is_empty(), "{:?}", sample.objects[0].warnings);
        sample.objects[0].volume.to_bits()
    };
    // A first vertex that is lost moves all others by one.
    let wavefront =
        obj(&part()).replace("# made here\nmtllib missing.mtl\no part\nusemtl red\n", "");
    for (name, text) in
        [("a.stl", ascii(&part())), ("a.obj", wavefront), ("a.ply", TEXT_PLY.to_owned())]
    {
        let plain = volume(name, text.as_bytes());
        for changed in [
            format!("\u{feff}{text}"),
            text.replace('\n', "\r"),
            format!("\u{feff}{}", text.replace('\n', "\r\n")),
            format!("{text}\u{1a}"),
            format!("{text}\0\0"),
        ] {
            assert_eq!(volume(name, changed.as_bytes()), plain, "{name}: {:?}", &changed[..20]);
        }
        let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        if !name.ends_with("ply") {
            let message = refused(name, &[&[0xff, 0xfe][..], &wide].concat());
            assert!(message.contains("UTF-16"), "{message}");
        }
    }
}

#[test]
fn attributes_of_binary_stl_are_passed_over_and_bytes_behind_it_are_said() {
    let directory = tempfile::tempdir().unwrap();
    let bytes = binary(&part(), b"solid");
    let plain = read(directory.path(), "a.stl", &bytes).unwrap();
    // Two bytes of colour, and the length of the bytes that follow: 0 to 3.
    let mut colours = bytes[..84].to_vec();
    let mut attributes = colours.clone();
    for (index, record) in bytes[84..].chunks(50).enumerate() {
        colours.extend(&record[..48]);
        colours.extend([0x1f, 0x84]);
        attributes.extend(&record[..48]);
        let count = u8::try_from(index % 4).unwrap();
        attributes.extend([count, 0]);
        attributes.extend(std::iter::repeat_n(7, count.into()));
    }
    for (bytes, warning) in [
        (colours.clone(), None),
        (attributes, None),
        ([&colours[..], &[0; 128]].concat(), Some("128 bytes behind the last triangle")),
        ([&bytes[..], b"tail"].concat(), Some("4 bytes behind the last triangle")),
    ] {
        let sample = read(directory.path(), "b.stl", &bytes).unwrap();
        assert_eq!((&sample.vertices, &sample.triangles), (&plain.vertices, &plain.triangles));
        let warnings = sample.objects[0].warnings.join("; ");
        assert_eq!(
            warnings.contains(warning.unwrap_or("nothing")),
            warning.is_some(),
            "{warnings}"
        );
        assert_eq!(warnings.is_empty(), warning.is_none(), "{warnings}");
    }
}

#[test]
fn solids_behind_one_another_in_a_binary_stl_are_read() {
    let directory = tempfile::tempdir().unwrap();
    let bytes = binary(&part(), b"solid");
    let plain = read(directory.path(), "a.stl", &bytes).unwrap();
    let both = [bytes, binary(&part().moved([128.0, 0.0, 0.0]), b"another")].concat();
    let sample = read(directory.path(), "b.stl", &both).unwrap();
    assert_eq!(sample.triangles.len(), 2 * plain.triangles.len());
    let volumes = [&sample, &plain].map(|it| it.objects[0].volume);
    assert!((volumes[0] / volumes[1] - 2.0).abs() < 1e-6, "{volumes:?}");
    assert!(sample.objects[0].warnings.is_empty(), "{:?}", sample.objects[0].warnings);
}

#[test]
fn hash_of_an_object_is_that_of_its_file() {
    let directory = tempfile::tempdir().unwrap();
    let bytes = binary(&part(), b"");
    let sample = read(directory.path(), "a.stl", &bytes).unwrap();
    let hash = &sample.objects[0].hash;
    assert_eq!(hash.len(), 64);
    assert_eq!(*hash, file_hash(&directory.path().join("a.stl")).unwrap());
    let mut changed = bytes;
    changed[0] ^= 1;
    assert_ne!(*hash, read(directory.path(), "b.stl", &changed).unwrap().objects[0].hash);
}

#[test]
fn truncated_stl_is_refused_with_its_lengths() {
    let bytes = binary(&part(), b"solid");
    for bytes in [&bytes[..bytes.len() - 7], &bytes[..84]] {
        let text = refused("a.stl", bytes);
        assert!(
            text.contains("triangles has") && text.contains(&bytes.len().to_string()),
            "{text}"
        );
    }
    assert!(refused("a.stl", b"short").contains("too few"));
    assert!(refused("a.stl", b"").contains("too few"));
    let none = [&bytes[..80], &[0; 4], &bytes[84..]].concat();
    assert!(refused("a.stl", &none).contains("of 0 triangles"));
    let text = ascii(&part());
    let cut = text.lines().take(40).collect::<Vec<_>>().join("\n");
    let told = refused("a.stl", cut.as_bytes());
    assert!(told.contains("ends before") && told.contains("line 40"), "{told}");
}

#[test]
fn weights_of_1_and_colours_of_obj_vertices_change_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let plain = obj(&part());
    let volume = |behind: &str| {
        let text = plain.replace("v ", "V ").lines().fold(String::new(), |mut text, line| {
            match line.strip_prefix("V ") {
                Some(vertex) => writeln!(text, "v {vertex}{behind}").unwrap(),
                None => writeln!(text, "{line}").unwrap(),
            }
            text
        });
        read(directory.path(), "a.obj", text.as_bytes()).unwrap().objects[0].volume
    };
    for behind in [" 1", " 1.0 # a comment", " 0.5 0.25 1", " 0.5 0.25 1 0.5"] {
        assert_eq!(volume(behind).to_bits(), volume("").to_bits(), "{behind}");
    }
}
