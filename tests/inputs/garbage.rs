//! Garbage in: whatever the bytes of a file or the triangles of a mesh, they are read or refused, and
//! what was read holds what it promises.

use crate::fuzz::readers::{ALL, Reader};
use crate::fuzz::{PLACE, damaged};
use crate::geometry::set_up::normal;
use crate::paper::PAPER;
use beamlet::geometry::{Sample, load};
use beamlet::scene::{Mesh, Object, Scene};
use proptest::prelude::*;

/// Damaged files of each reader.
const FILES: u64 = 1000;

/// Each seed is read as it is and damaged; an empty one becomes bytes alone.
#[test]
fn damaged_files_are_read_or_refused() {
    for Reader { name, seeds, read } in ALL {
        let mut seeds = seeds();
        seeds.push(Vec::new());
        seeds.iter().for_each(|seed| read(seed));
        for (number, seed) in (0..FILES).zip(seeds.iter().cycle()) {
            let input = damaged(seed, number);
            let done = std::panic::catch_unwind(|| read(&input));
            assert!(done.is_ok(), "{name} {number}: {:?}", String::from_utf8_lossy(&input));
        }
    }
    std::fs::remove_dir_all(&*PLACE).unwrap();
}

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

const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

proptest! {
    #![proptest_config(ProptestConfig {
        // PROPTEST_CASES=200000 makes it a run of a minute and more.
        cases: ProptestConfig::default().cases.max(2000),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

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
}

proptest! {
    // Each case loads three samples.
    #![proptest_config(ProptestConfig {
        cases: ProptestConfig::default().cases.max(600),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

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
