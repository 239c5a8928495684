//! Closedness, orientation, voids and odd sizes of a single object.

use beamlet::scene::Shape;

use super::set_up::{Arrays, close, normal};

#[test]
fn triangles_given_twice_are_left_out_with_a_warning() {
    let cube = Arrays::cube(2e-3);
    let again = |numbers: &[usize]| {
        let mut double = cube.clone();
        double.1.extend(numbers.iter().map(|it| cube.1[*it]));
        double
    };
    let mut turned = again(&[0]);
    turned.1[12].swap(0, 1);
    // The first of both is the wrong one.
    let mut first = turned.clone();
    first.1.swap(0, 12);
    // Two apart, two of one face, and one that is there three times.
    for (mesh, count) in [
        (again(&[3]), 1),
        (again(&[0, 5]), 2),
        (again(&[0, 1]), 2),
        (again(&[7, 7]), 2),
        (turned, 1),
        (first, 1),
    ] {
        let sample = mesh.load().unwrap();
        assert!(close(sample.objects[0].volume, 8e-9, 1e-12));
        assert_eq!((sample.components.len(), sample.triangles.len()), (1, 12));
        let object = &sample.objects[0];
        assert_eq!(object.defects.duplicate_triangles.count, count);
        let s = if count == 1 { "" } else { "s" };
        let warning = format!("{count} triangle{s} given twice; the first: triangles ");
        assert!(object.warnings[0].starts_with(&warning), "{:?}", object.warnings);
        assert_eq!(object.warnings.len(), 1);
    }
}

#[test]
fn triangle_given_twice_does_not_close_a_hole() {
    let mut open = Arrays::cube(2e-3);
    open.1.pop();
    open.1.push(open.1[0]);
    let text = open.load().unwrap_err().to_string();
    assert!(text.contains("not closed: 3 edges used by one triangle only"), "{text}");
}

#[test]
fn index_beyond_the_vertices_is_refused() {
    let mut wild = Arrays::cube(2e-3);
    wild.1[3][1] = 8;
    assert!(wild.load().unwrap_err().to_string().contains("8 are given"));
}

#[test]
fn vertices_that_coincide_are_welded_and_degenerate_triangles_left_out() {
    // Every triangle with vertices of its own, as in an STL, and a sliver along an edge.
    let cube = Arrays::cube(2e-3);
    let corners: Vec<[f64; 3]> =
        cube.1.as_flattened().iter().map(|vertex| cube.0[*vertex as usize]).collect();
    let count = u32::try_from(corners.len()).unwrap();
    let mut soup = Arrays(corners, (0..count).step_by(3).map(|k| [k, k + 1, k + 2]).collect());
    let clean = soup.clone().load().unwrap();
    assert_eq!((clean.vertices.len(), clean.triangles.len()), (8, 12));
    soup.1.push([0, 1, 0]);
    let sample = soup.load().unwrap();
    assert_eq!(sample.triangles.len(), 12);
    let warnings = &sample.objects[0].warnings;
    assert!(warnings[0].contains("1 triangle without area"), "{warnings:?}");
}

#[test]
fn mesh_that_is_inside_out_is_turned_and_told() {
    let sample = Arrays::cube(2e-3).turned().load().unwrap();
    assert!(close(sample.objects[0].volume, 8e-9, 1e-12));
    assert!(sample.objects[0].warnings[0].contains("1 of 1"));
    let [a, b, c] = sample.triangles[0].map(|vertex| sample.vertices[vertex as usize]);
    let outwards: f64 = normal([a, b, c]).iter().zip(a).map(|(n, a)| n * a).sum();
    assert!(outwards > 0.0, "the normal points inwards");
}

#[test]
fn part_in_a_part_is_a_void_or_material_by_its_orientation() {
    let [outer, inner] = [2e-3, 1e-3].map(Arrays::cube);
    let hollow = outer.clone().and(inner.clone().turned());
    for (mesh, volume, words) in [
        (hollow.clone(), 7e-9, vec![]),
        // All of it inside out.
        (hollow.turned(), 7e-9, vec!["2 of 2 parts were inside out", "1 of 2 parts became holes"]),
        (outer.clone().and(inner.clone()), 8e-9, vec!["1 of 2 parts inside others"]),
        (inner.clone().and(outer.clone()), 8e-9, vec!["1 of 2 parts inside others"]),
        (
            outer.clone().and(inner.clone()).turned(),
            8e-9,
            vec!["1 of 2 parts were inside out", "1 of 2 parts inside others"],
        ),
        // Up to a micrometre below the wall, across it and on it.
        (
            outer.clone().and(inner.clone().moved([0.499e-3, 0.0, 0.0])),
            8e-9,
            vec!["1 of 2 parts inside others"],
        ),
        (
            outer.clone().and(inner.clone().moved([0.501e-3, 0.0, 0.0])),
            8.001e-9,
            vec!["2 of its parts touch or overlap"],
        ),
        (outer.and(inner.moved([0.5e-3, 0.0, 0.0])), 8e-9, vec!["2 of its parts touch or overlap"]),
    ] {
        let sample = mesh.load().unwrap();
        assert!(close(sample.objects[0].volume, volume, 1e-9), "{words:?}");
        let warnings = &sample.objects[0].warnings;
        assert_eq!(warnings.len(), words.len(), "{warnings:?}");
        assert!(warnings.iter().zip(&words).all(|(it, word)| it.starts_with(word)), "{warnings:?}");
    }
}

/// A tetrahedron in a cube: both have a corner or an edge in common.
#[test]
fn parts_that_share_corners_or_edges_with_the_part_around_them_are_inside() {
    let [far, low, high] =
        [[-0.2e-3, -0.6e-3, 0.2e-3], [-0.6e-3, -0.4e-3, 0.8e-3], [-0.6e-3, -0.2e-3, 0.2e-3]];
    let corner = [-1e-3; 3];
    for points in [[corner, low, far, high], [corner, [-1e-3, -1e-3, 1e-3], far, high]] {
        let [a, b, c, d] = points.map(glam::DVec3::from_array);
        let volume = (b - a).cross(c - a).dot(d - a) / 6.0;
        let inwards = Arrays(points.to_vec(), vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]]);
        let inwards = if volume > 0.0 { inwards } else { inwards.turned() };
        for (part, want) in [(inwards.clone(), 8e-9 - volume.abs()), (inwards.turned(), 8e-9)] {
            let sample = Arrays::cube(2e-3).and(part).load().unwrap();
            let object = &sample.objects[0];
            assert!(
                close(object.volume, want, 1e-9),
                "{} {want} {:?}",
                object.volume,
                object.warnings
            );
        }
    }
}

#[test]
fn parts_in_voids_and_in_material_are_sorted_out_at_any_depth() {
    let core = || Arrays::cube(0.5e-3);
    let (ball, block) = (|| Arrays::sphere(1.2e-3), || Arrays::cube(4e-3));
    let apart = || Arrays::cube(1e-3).moved([6e-3, 0.0, 0.0]);
    let hole = Arrays::sphere(1.2e-3).load().unwrap().objects[0].volume;
    for (mesh, volume, components, words) in [
        // A core in a void; the same with the core inside out.
        (core().and(block()).and(ball().turned()).and(apart()), 65.125e-9 - hole, 4, vec![]),
        (
            core().turned().and(block()).and(ball().turned()).and(apart()),
            65.125e-9 - hole,
            4,
            vec!["1 of 4 parts were inside out"],
        ),
        // Inserts in inserts, and one with a void in it, which the block covers.
        (
            core().and(block()).and(ball()).and(apart()),
            65e-9,
            2,
            vec!["2 of 4 parts inside others"],
        ),
        (
            core().turned().and(block()).and(ball()).and(apart()),
            65e-9,
            2,
            vec!["2 of 4 parts inside others"],
        ),
        // A part apart that is inside out has no effect on the others.
        (
            block().and(ball().turned()).and(apart().turned()),
            65e-9 - hole,
            3,
            vec!["1 of 3 parts were inside out"],
        ),
    ] {
        let sample = mesh.load().unwrap();
        assert!(close(sample.objects[0].volume, volume, 1e-9), "{words:?}");
        assert_eq!(sample.components.len(), components);
        let warnings = &sample.objects[0].warnings;
        assert_eq!(warnings.len(), words.len(), "{warnings:?}");
        assert!(warnings.iter().zip(&words).all(|(it, word)| it.starts_with(word)), "{warnings:?}");
    }
}

#[test]
fn folded_sheet_without_volume_is_left_out() {
    let mut folded = Arrays::cube(2e-3);
    let first = u32::try_from(folded.0.len()).unwrap();
    folded.0.extend([[9e-3, 0.0, 0.0], [9e-3, 1e-3, 0.0], [9e-3, 0.0, 1e-3]]);
    folded.1.extend([[first, first + 1, first + 2], [first, first + 2, first + 1]]);
    let sample = folded.clone().load().unwrap();
    assert_eq!((sample.components.len(), sample.triangles.len()), (1, 12));
    assert!(sample.objects[0].bounds[1][0] < 2e-3);
    folded.1.drain(..12);
    assert!(folded.load().unwrap_err().to_string().contains("no volume"));
}

#[test]
fn suspicious_size_is_a_warning_that_names_the_unit() {
    for (edge, odd) in [(2.0, true), (1e-7, true), (1e-2, false), (1e-5, false)] {
        let sample = Arrays::of(Shape::Box { size: [edge; 3] }).load().unwrap();
        let warned = sample.objects[0].warnings.iter().any(|text| text.contains("`unit`"));
        assert_eq!(warned, odd, "{edge} m");
    }
}

#[test]
fn bounds_area_and_components_are_those_of_the_parts() {
    let pair = Arrays::cube(2e-3).and(Arrays::cube(1e-3).moved([4e-3, 0.0, 0.0]));
    let sample = pair.load().unwrap();
    assert!(close(sample.components[0].area, 24e-6, 1e-12));
    assert!(close(sample.components[1].area, 6e-6, 1e-12));
    assert!(close(sample.components[1].bounds[0][0], 3.5e-3, 1e-12));
    assert_eq!(sample.triangle_component.len(), sample.triangles.len());
    assert_eq!(sample.triangle_component[0], 0);
    assert_eq!(*sample.triangle_component.last().unwrap(), 1);
}
