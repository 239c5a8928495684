//! Closedness, orientation, voids and odd sizes of a single object.

use beamlet::scene::Shape;

use super::set_up::{Arrays, close, normal};

#[test]
fn open_cube_is_refused_with_the_number_of_open_edges() {
    let mut open = Arrays::cube(2e-3);
    open.1.pop();
    let text = open.load().unwrap_err().to_string();
    assert!(text.contains("not closed") && text.contains("3 edges"), "{text}");
    assert!(text.contains("mm"), "{text}");
}

#[test]
fn one_triangle_the_wrong_way_round_is_refused() {
    let mut twisted = Arrays::cube(2e-3);
    twisted.1[5].swap(0, 1);
    let text = twisted.load().unwrap_err().to_string();
    assert!(text.contains("wind opposite ways"), "{text}");
}

#[test]
fn triangle_given_twice_is_refused() {
    let mut double = Arrays::cube(2e-3);
    double.1.push(double.1[0]);
    let text = double.load().unwrap_err().to_string();
    assert!(text.contains("more than two triangles"), "{text}");
    assert!(text.contains("duplicate triangles, 1:\n    triangles 1 and 13 at"), "{text}");
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
fn void_is_kept_and_its_volume_is_negative() {
    for inner in [Arrays::cube(1e-3).turned(), Arrays::cube(1e-3)] {
        let sample = Arrays::cube(2e-3).and(inner).load().unwrap();
        assert_eq!(sample.components.len(), 2);
        assert!(close(sample.components[1].volume, -1e-9, 1e-12));
        assert!(close(sample.objects[0].volume, 7e-9, 1e-12));
    }
}

#[test]
fn solid_in_a_void_in_a_solid_is_a_solid() {
    let nested = Arrays::cube(1e-3)
        .and(Arrays::cube(4e-3))
        .and(Arrays::sphere(1.2e-3))
        .and(Arrays::cube(1e-3).moved([6e-3, 0.0, 0.0]));
    let sample = nested.load().unwrap();
    let signs: Vec<bool> = sample.components.iter().map(|part| part.volume > 0.0).collect();
    assert_eq!(signs, [true, true, false, true]);
    assert!(sample.objects[0].warnings[0].contains("1 of 4"), "{:?}", sample.objects[0].warnings);
}

#[test]
fn parts_that_share_only_a_corner_are_two_components() {
    let pair = Arrays::cube(2e-3).and(Arrays::cube(2e-3).moved([2e-3, 2e-3, 2e-3]));
    let sample = pair.load().unwrap();
    assert_eq!(sample.components.len(), 2);
    assert_eq!(sample.vertices.len(), 15);
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
