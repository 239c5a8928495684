//! Meshes as seeds, and the repair of STL files.

use crate::{RAW_LENGTHS, put_u32};

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
