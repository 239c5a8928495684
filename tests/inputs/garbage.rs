//! Garbage in: whatever the bytes, a scene or a mesh is read or refused, and what was read holds
//! what it promises. The same properties are fuzzed (tests/fuzz); what fuzzing found is kept
//! here.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::path::Path;

use crate::geometry::set_up::normal;
use crate::paper::PAPER;
use beamlet::geometry::{Sample, load};
use beamlet::internals::geometry::diagnose;
use beamlet::scene::{Mesh, Object, Scene};
use proptest::prelude::*;

fn paper_json() -> String {
    let value: toml::Table = PAPER.parse().unwrap();
    serde_json::to_string_pretty(&value).unwrap()
}

/// Asserts that the own text of a scene reads back to an equal scene.
fn read_scene(text: &str) {
    for scene in [Scene::from_toml(text, "."), Scene::from_json(text, ".")].into_iter().flatten() {
        let again = scene.to_toml(".", &BTreeMap::new(), &[]).unwrap();
        assert_eq!(Scene::from_toml(&again, ".").unwrap(), scene);
    }
}

fn read_mesh(bytes: &[u8]) {
    for name in ["a.stl", "a.obj"] {
        let _ = diagnose(Path::new(name), bytes, 1e-3);
    }
}

/// An edit of a text: where (as a share of it), how many bytes go, and what comes.
type Edit = (f64, usize, String);

/// Words that readers trip over.
fn words() -> impl Strategy<Value = String> {
    let hostile = [
        "nan",
        "-inf",
        "1e999",
        "-0",
        "1e-400",
        "18446744073709551616",
        "-9223372036854775808",
        "4294967295",
        "4294967297",
        "0",
        "\"",
        "\"\"",
        "'",
        "[",
        "]",
        "[[",
        "]]",
        "{",
        "}",
        "=",
        ",",
        ".",
        "#",
        "\n",
        "\r",
        "\u{feff}",
        "\u{b5}m",
        "\0",
        "\\",
        "\\u0000",
        " m",
        "\"1 m\"",
        "\"-1 mm\"",
        "\"0 um\"",
        "true",
        "null",
        "1979-05-27",
        "v ",
        "f ",
        "f 1 2 3\n",
        "/",
        "//",
        "-1",
        "vertex",
        "endloop",
        "endsolid",
        "solid",
        "facet",
        "o x\n",
        "g\n",
        "usemtl x\n",
        "mtllib a.mtl\n",
        "[[object]]\n",
        "name = \"x\"\n",
        "count = 0",
        "from",
        "\u{1f600}",
    ];
    prop_oneof![
        4 => prop::sample::select(hostile.to_vec()).prop_map(str::to_owned),
        1 => "\\PC{0,6}",
        1 => Just(String::new()),
    ]
}

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    prop::collection::vec((0.0..1.0_f64, 0..12_usize, words()), 1..5)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a share of a length is an index"
)]
fn edited(text: &str, edits: &[Edit]) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for (share, gone, word) in edits {
        let at = (bytes.len() as f64 * share) as usize;
        let end = bytes.len().min(at + gone);
        bytes.splice(at..end, word.bytes());
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A tetrahedron as text: STL or OBJ.
const STL: &str = "solid a\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\n\
    endsolid a\n";
const OBJ: &str = "# a\nmtllib a.mtl\no a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\n\
    g one\nusemtl x\nf 1/1/1 3/1/1 2/1/1\nf 1//1 2//1 4//1\ng two\nf -4 -1 -2\nf 2 3 4\nl 1 2\np 1\n";

/// Vertices and triangles.
type Arrays = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Meshes of arrays as the objects of a scene.
fn arrays(meshes: &[Arrays], allow_defects: bool) -> Scene {
    let mut scene = Scene::from_toml(PAPER, ".").unwrap();
    scene.objects = meshes
        .iter()
        .enumerate()
        .map(|(number, (vertices, triangles))| {
            let (vertices, triangles) = (vertices.clone(), triangles.clone());
            let mesh = Mesh::Arrays { vertices, triangles };
            let mut object = Object::new(format!("part {number}"), mesh, "carbon");
            object.allow_defects = allow_defects;
            object
        })
        .collect();
    scene
}

/// Asserts that a closed sample is sound: each component bounds a volume, and the areas of its triangles,
/// as vectors, cancel.
fn closed(sample: &Sample) {
    let mut sums = vec![[0.0_f64; 3]; sample.components.len()];
    for (triangle, component) in sample.triangles.iter().zip(&sample.triangle_component) {
        let [a, b, c] = triangle.map(|vertex| sample.vertices[vertex as usize]);
        let area = normal([a, b, c]);
        let sum = &mut sums[*component as usize];
        sum.iter_mut().zip(area).for_each(|(sum, area)| *sum += area);
    }
    for (component, sum) in sample.components.iter().zip(sums) {
        assert!(component.volume.abs() > 0.0);
        assert!(sum.iter().all(|sum| sum.abs() <= 1e-9 * component.area), "{sum:?}");
    }
}

/// A point on a coarse grid, so that things coincide, in mm.
fn grid() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-2..3_i8).prop_map(|point| point.map(|x| f64::from(x) * 1e-3))
}

/// A box between bounds in mm, and the bits of `diagonals` say which way its faces are cut.
fn brick(bounds: [[i8; 2]; 3], diagonals: u64) -> Arrays {
    let corner =
        |number: usize| [0, 1, 2].map(|axis| f64::from(bounds[axis][number >> axis & 1]) * 1e-3);
    let faces =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6_u32]];
    let cut = |(face, [a, b, c, d]): (usize, [u32; 4])| match diagonals >> face & 1 {
        0 => [[a, b, c], [a, c, d]],
        _ => [[b, c, d], [b, d, a]],
    };
    ((0..8).map(corner).collect(), faces.into_iter().enumerate().flat_map(cut).collect())
}

const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

proptest! {
    #![proptest_config(ProptestConfig {
        // PROPTEST_CASES=200000 makes it a run of a minute and more.
        cases: ProptestConfig::default().cases.max(2000),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn edited_scenes_are_read_or_refused(edits in edits()) {
        read_scene(&edited(PAPER, &edits));
        read_scene(&edited(&paper_json(), &edits));
    }

    #[test]
    fn any_text_is_a_scene_or_none(text in "\\PC{0,80}") {
        read_scene(&text);
    }

    #[test]
    fn edited_mesh_files_are_read_or_refused(edits in edits()) {
        for text in [STL, OBJ] {
            read_mesh(edited(text, &edits).as_bytes());
        }
    }

    #[test]
    fn any_bytes_are_a_mesh_or_none(
        mut bytes in prop::collection::vec(any::<u8>(), 0..400),
        honest in any::<bool>(),
    ) {
        if honest && bytes.len() >= 84 {
            // A binary STL whose count is true, of random triangles.
            let count = (bytes.len() - 84) / 50;
            bytes.truncate(84 + 50 * count);
            bytes[80..84].copy_from_slice(&u32::try_from(count).unwrap().to_le_bytes());
        }
        read_mesh(&bytes);
    }

    #[test]
    fn random_triangles_make_a_closed_sample_or_are_refused(
        vertices in prop::collection::vec(grid(), 1..9),
        triangles in prop::collection::vec(prop::array::uniform3(0..9_u32), 0..16),
    ) {
        let meshes = [(vertices, triangles)];
        if let Ok(sample) = load(&arrays(&meshes, false)) {
            closed(&sample);
        }
        let _ = load(&arrays(&meshes, true));
    }

    #[test]
    fn tetrahedra_on_a_grid_are_closed_or_refused(corners in prop::collection::vec(grid(), 8)) {
        let second = TETRAHEDRON.map(|triangle| triangle.map(|vertex| vertex + 4));
        let triangles = [TETRAHEDRON, second].concat();
        if let Ok(sample) = load(&arrays(&[(corners, triangles)], false)) {
            closed(&sample);
        }
    }

    /// On a grid everything coincides that can: faces, edges, and corners of the two.
    #[test]
    fn boxes_on_a_grid_are_one_solid_where_they_meet_and_clean_where_they_do_not(
        low in prop::array::uniform2(prop::array::uniform3(-2..3_i8)),
        size in prop::array::uniform2(prop::array::uniform3(1..5_i8)),
        diagonals in any::<u64>(),
    ) {
        let side = |which: usize, axis: usize| {
            [low[which][axis], low[which][axis] + size[which][axis]]
        };
        let (a, b) = (|axis| side(0, axis), |axis| side(1, axis));
        let all = |holds: &dyn Fn(usize) -> bool| (0..3).all(holds);
        let overlap = all(&|axis| a(axis)[0] < b(axis)[1] && b(axis)[0] < a(axis)[1]);
        let apart = !all(&|axis| a(axis)[0] <= b(axis)[1] && b(axis)[0] <= a(axis)[1]);
        let nested = all(&|axis| a(axis)[0] < b(axis)[0] && b(axis)[1] < a(axis)[1])
            || all(&|axis| b(axis)[0] < a(axis)[0] && a(axis)[1] < b(axis)[1]);
        let mut mesh = brick([a(0), a(1), a(2)], diagonals);
        let (vertices, triangles) = brick([b(0), b(1), b(2)], diagonals >> 32);
        mesh.0.extend(vertices);
        mesh.1.extend(triangles.iter().map(|triangle| triangle.map(|vertex| vertex + 8)));
        let sample = load(&arrays(&[mesh], false)).unwrap();
        let object = &sample.objects[0];
        let united = object.warnings.iter().any(|it| it.contains("touch or overlap"));
        if nested || apart {
            prop_assert_eq!(&object.defects, &Default::default());
            prop_assert!(!united);
            return Ok(());
        }
        prop_assert!(!object.defects.refused() && (united || !overlap));
        let product = |of: &dyn Fn(usize) -> i8| (0..3).map(|axis| f64::from(of(axis))).product();
        let volume: [f64; 2] = [0, 1].map(|which| product(&|axis| size[which][axis]));
        let shared: f64 =
            product(&|axis| (a(axis)[1].min(b(axis)[1]) - a(axis)[0].max(b(axis)[0])).max(0));
        let want = (volume[0] + volume[1] - shared) * 1e-9;
        prop_assert!((object.volume / want - 1.0).abs() < 1e-6, "{} {want}", object.volume);
    }

    /// Crossing within one object is found by other code than crossing between two.
    #[test]
    fn parts_of_one_mesh_cross_where_two_objects_would(
        a in prop::array::uniform4(prop::array::uniform3(-2e-3..2e-3_f64)),
        b in prop::array::uniform4(prop::array::uniform3(-2e-3..2e-3_f64)),
    ) {
        let triangles = TETRAHEDRON.to_vec();
        let second = TETRAHEDRON.map(|triangle| triangle.map(|vertex| vertex + 4));
        // What only lies in the other is covered in one order, and stands in it in the other.
        let cut = |first: &[[f64; 3]], second: &[[f64; 3]]| {
            let apart = [(first.to_vec(), triangles.clone()), (second.to_vec(), triangles.clone())];
            load(&arrays(&apart, false)).is_ok_and(|sample| !sample.objects[0].cut_by.is_empty())
        };
        let meet = cut(&a, &b) && cut(&b, &a);
        let both = [(([a, b].concat()), [triangles, second.to_vec()].concat())];
        let one = load(&arrays(&both, false)).unwrap();
        let united = one.objects[0].warnings.iter().any(|it| it.contains("touch or overlap"));
        prop_assert_eq!(united, meet);
    }
}

#[test]
fn the_good_ones_are_read() {
    assert!(Scene::from_toml(PAPER, ".").is_ok() && Scene::from_json(&paper_json(), ".").is_ok());
    for (name, text) in [("a.stl", STL), ("a.obj", OBJ)] {
        let defects = diagnose(Path::new(name), text.as_bytes(), 1e-3).unwrap();
        assert!(!defects.refused(), "{name}: {defects:?}");
    }
}
