//! Meshes as seeds, and the repair of STL files.

use super::{RAW_HEADER, RAW_LENGTHS, put_u32};
use std::io::{Cursor, Write};

/// Where a binary STL file counts its triangles, and where they begin.
const COUNT: usize = 80;
const RECORDS: usize = 84;
/// Bytes of a triangle of a binary STL file.
const RECORD: usize = 50;

/// Faces of a box whose corner `n` lies at the bits of `n`.
const FACES: [[usize; 4]; 6] =
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/// Triangles of a box from `low` to `high`.
fn block(low: f32, high: f32) -> Vec<[[f32; 3]; 3]> {
    let corner = |n: usize| [n & 1, n >> 1 & 1, n >> 2].map(|bit| [low, high][bit]);
    let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
    FACES.into_iter().flat_map(halves).map(|it| it.map(corner)).collect()
}

fn binary(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut file = vec![0; RECORDS];
    for triangle in triangles {
        file.extend([0; 12]);
        file.extend(triangle.as_flattened().iter().flat_map(|number| number.to_le_bytes()));
        file.extend([0; 2]);
    }
    with_count(file)
}

fn with_count(mut file: Vec<u8>) -> Vec<u8> {
    if file.len() >= RECORDS {
        let count = (file.len() - RECORDS) / RECORD;
        file.truncate(RECORDS + RECORD * count);
        put_u32(&mut file, COUNT, u32::try_from(count).unwrap_or(u32::MAX));
    }
    file
}

/// A binary STL file whose length is what it counts, unless its control leaves lengths alone.
/// Texts stay as they are.
pub fn stl(input: &[u8]) -> Vec<u8> {
    let Some((control, file)) = input.split_first() else { return Vec::new() };
    let text = file.trim_ascii_start().get(..5).is_some_and(|it| it.eq_ignore_ascii_case(b"solid"));
    if control & RAW_LENGTHS != 0 || text {
        return file.to_vec();
    }
    with_count(file.to_vec())
}

/// STL files: boxes in each other and through each other, a fan, a text.
pub fn stl_seeds() -> Vec<(u8, Vec<u8>)> {
    let two = |low, high| [block(0.0, 4.0), block(low, high)].concat();
    let mut text = "solid s\n".to_owned();
    for [a, b, c] in block(-1.0, 1.0) {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in [a, b, c] {
            text += &format!("vertex {x:e} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text += "endsolid s\n";
    let fan = |k: u8| {
        let at = |k: u8| [f32::from(k), f32::from(k).powi(2), 0.0];
        [[0.0, 100.0, 0.0], at(k), at(k + 1)]
    };
    let fan: Vec<_> = (0..20).map(fan).collect();
    let files = [
        binary(&block(0.0, 1.0)),
        binary(&two(1.0, 2.0)),
        binary(&two(3.0, 5.0)),
        binary(&two(4.0, 5.0)),
        binary(&two(5.0, 6.0)),
        binary(&fan),
        text.into_bytes(),
    ];
    let mut seeds: Vec<_> = files.into_iter().map(|file| (0, file)).collect();
    seeds.push((RAW_LENGTHS, binary(&block(0.0, 1.0))));
    seeds
}

/// OBJ files: a box of triangles, of rectangles counted backwards, with textures and normals;
/// caps with many corners; lines that go on.
pub fn obj_seeds() -> Vec<Vec<u8>> {
    let mut corners = String::new();
    for n in 0..8 {
        corners += &format!("v {} {} {}\n", n & 1, n >> 1 & 1, n >> 2);
    }
    let box_of = |face: &dyn Fn([usize; 4]) -> String| {
        corners.clone() + &FACES.into_iter().map(face).collect::<String>()
    };
    let halves = |[a, b, c, d]: [usize; 4]| {
        let [a, b, c, d] = [a, b, c, d].map(|n| n + 1);
        format!("f {a} {b} {c}\nf {a} {c} {d}\n")
    };
    let backwards = |face: [usize; 4]| {
        let words: Vec<String> = face.iter().map(|n| format!("-{}", 8 - n)).collect();
        format!("f {}\n", words.join(" "))
    };
    let dressed = |face: [usize; 4]| {
        let words: Vec<String> = face.iter().map(|n| format!("{0}/1/{0}", n + 1)).collect();
        format!("g part\nusemtl m\nf {}\n", words.join(" \\\n "))
    };
    // A prism with caps of this outline.
    let prism = |outline: &[[f64; 2]]| {
        let n = outline.len();
        let mut text = String::new();
        for z in [0, 2] {
            for [x, y] in outline {
                text += &format!("v {x} {y} {z}\n");
            }
        }
        let ring = |range: &mut dyn Iterator<Item = usize>| {
            let words: Vec<String> = range.map(|k| k.to_string()).collect();
            format!("f {}\n", words.join(" "))
        };
        text += &ring(&mut (1..=n).rev());
        text += &ring(&mut (n + 1..=2 * n));
        for k in 0..n {
            let (a, b) = (k + 1, (k + 1) % n + 1);
            text += &format!("f {a} {b} {} {}\n", b + n, a + n);
        }
        text
    };
    let star: Vec<[f64; 2]> = (0..40_u32)
        .map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / 40.0;
            let radius = if k % 2 == 0 { 3.0 } else { 1.0 };
            [radius * angle.cos(), radius * angle.sin()]
        })
        .collect();
    let comb = [
        [0.0, 0.0],
        [5.0, 0.0],
        [5.0, 3.0],
        [4.0, 3.0],
        [4.0, 1.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [0.0, 3.0],
    ];
    let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
    [box_of(&halves), box_of(&backwards), box_of(&dressed), prism(&star), prism(&comb), prism(&bow)]
        .map(String::into_bytes)
        .to_vec()
}

/// PLY files: boxes in text and of either byte order, with what is passed over and without.
pub fn ply_seeds() -> Vec<Vec<u8>> {
    let header = |format: &str, more: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment a box\nelement vertex 8\nproperty float x\n\
             property float y\nproperty float z\n{more}element face 6\n\
             property list uchar int vertex_indices\nend_header\n"
        )
    };
    let corner = |n: usize| [n & 1, n >> 1 & 1, n >> 2];
    let mut text = header("ascii", "property uchar red\n");
    for [x, y, z] in (0..8).map(corner) {
        text += &format!("{x} {y} {z} 255\n");
    }
    for [a, b, c, d] in FACES {
        text += &format!("4 {a} {b} {c} {d}\n");
    }
    let binary = |format: &str, word: fn(u32) -> [u8; 4]| {
        let mut bytes = header(format, "").into_bytes();
        let number = |n: usize| f32::from(u8::try_from(n).unwrap_or(0)).to_bits();
        bytes.extend((0..8).flat_map(corner).flat_map(|n| word(number(n))));
        for face in FACES {
            bytes.push(4);
            bytes.extend(face.iter().flat_map(|n| word(u32::try_from(*n).unwrap_or(0))));
        }
        bytes
    };
    vec![
        text.into_bytes(),
        binary("binary_little_endian", u32::to_le_bytes),
        binary("binary_big_endian", u32::to_be_bytes),
    ]
}

/// A 3MF file of a model, unless its control says that it is the file.
pub fn threemf(input: &[u8]) -> Vec<u8> {
    let Some((control, model)) = input.split_first() else { return Vec::new() };
    if control & RAW_HEADER != 0 {
        return model.to_vec();
    }
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    archive.start_file("3D/3dmodel.model", stored).expect("memory");
    archive.write_all(model).expect("memory");
    archive.finish().expect("memory").into_inner()
}

/// Models: a tetrahedron, components of it with materials, and an archive.
pub fn threemf_seeds() -> Vec<(u8, Vec<u8>)> {
    let mesh = "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>\
        <vertex x=\"0\" y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"/></vertices><triangles>\
        <triangle v1=\"0\" v2=\"2\" v3=\"1\"/><triangle v1=\"0\" v2=\"1\" v3=\"3\"/>\
        <triangle v1=\"0\" v2=\"3\" v3=\"2\" pid=\"5\" p1=\"1\"/>\
        <triangle v1=\"1\" v2=\"2\" v3=\"3\"/></triangles></mesh>";
    let base = "<basematerials id=\"5\"><base name=\"a\"/><base name=\"b\"/></basematerials>";
    let one = format!(
        "<model unit=\"inch\"><resources>{base}<object id=\"1\" name=\"n\" pid=\"5\" pindex=\"0\">\
         {mesh}</object></resources><build><item objectid=\"1\"/></build></model>"
    );
    let two = one.replace(
        "</resources>",
        "<object id=\"2\"><components><component objectid=\"1\" \
         transform=\"-1 0 0 0 1 0 0 0 1 5 0 0\"/><component objectid=\"1\"/></components></object>\
         </resources>",
    );
    let two = two.replace("<item objectid=\"1\"/>", "<item objectid=\"2\"/>");
    let file = threemf(&[&[0], one.as_bytes()].concat());
    vec![(0, one.into_bytes()), (0, two.into_bytes()), (RAW_HEADER, file)]
}
