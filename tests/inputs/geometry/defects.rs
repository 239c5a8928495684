//! What is found wrong with a mesh, where, and what of it is refused.

use beamlet::geometry::{Defects, Sample, load};
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Object, Shape};

use super::set_up::{Arrays, at, close, normal, scene, shape};

/// The sample and the message of its refusal, if it is refused; defects allowed if `allowed`.
fn try_load(mesh: Arrays, allowed: bool) -> (beamlet::Result<Sample>, Defects) {
    let mut object = mesh.object("part");
    object.allow_defects = allowed;
    let scene = scene(vec![object]);
    let (inspected, refusals) = load_lenient(&scene).unwrap();
    let loaded = load(&scene);
    assert_eq!(loaded.is_err(), !refusals.is_empty());
    (loaded, inspected.objects[0].defects.clone())
}

/// Refused as it is, and accepted where defects are allowed; the message offers that where no trial ray is
/// wrong.
fn refused(mesh: &Arrays) -> (String, Defects, Sample) {
    let (loaded, defects) = try_load(mesh.clone(), false);
    let text = loaded.unwrap_err().to_string();
    let offers = text.contains("accept it with allow_defects = true");
    assert!(offers != text.contains("enter and leave it unequally often"), "{text}");
    assert_eq!(offers, text.contains("4096 trial rays found no wrong path"), "{text}");
    assert!(defects.refused());
    let sample = try_load(mesh.clone(), true).0.unwrap();
    assert_eq!(sample.objects[0].defects, defects);
    let warning = &sample.objects[0].warnings[0];
    assert!(warning.contains("accepted: allow_defects"), "{warning}");
    (text, defects, sample)
}

fn clean(mesh: Arrays) -> Sample {
    let (loaded, defects) = try_load(mesh, false);
    assert_eq!(defects, Defects::default());
    loaded.unwrap()
}

/// A cube whose faces are grids of squares, cut into triangles.
fn subdivided_cube(edge: f64, n: u32) -> Arrays {
    let mut cube = Arrays::default();
    let step = edge / f64::from(n);
    for axis in 0..3 {
        for top in [false, true] {
            for i in 0..n {
                for j in 0..n {
                    let corner = |di: u32, dj: u32| {
                        let mut point = [0.0; 3];
                        point[axis] = if top { edge } else { 0.0 };
                        point[(axis + 1) % 3] = f64::from(i + di) * step;
                        point[(axis + 2) % 3] = f64::from(j + dj) * step;
                        point.map(|x| x - edge / 2.0)
                    };
                    let first = u32::try_from(cube.0.len()).unwrap();
                    cube.0.extend([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]);
                    let square = [[0, 1, 2], [0, 2, 3]];
                    cube.1.extend(square.map(|[a, b, c]| {
                        let [b, c] = if top { [b, c] } else { [c, b] };
                        [a, b, c].map(|it| it + first)
                    }));
                }
            }
        }
    }
    cube
}

#[test]
fn cube_without_a_face_has_four_open_edges_at_their_places() {
    let mut open = Arrays::cube(2e-3);
    let lids: Vec<usize> = (0..12)
        .filter(|t| open.1[*t].iter().all(|vertex| open.0[*vertex as usize][2] > 0.0))
        .collect();
    for lid in lids.into_iter().rev() {
        open.1.remove(lid);
    }
    let (text, defects, sample) = refused(&open);
    assert!(text.contains("not closed: 4 edges used by one triangle only"), "{text}");
    assert!(text.contains("open edges, 4:\n"), "{text}");
    assert_eq!((defects.open_edges.count, defects.open_edges.places.len()), (4, 4));
    for spot in &defects.open_edges.places {
        assert!(close(spot.position_mm.unwrap()[2], 1.0, 1e-12), "{spot:?}");
        assert_eq!(spot.triangles.len(), 1);
    }
    assert_eq!(sample.triangles.len(), 10);
}

#[test]
fn ten_places_are_told_of_many() {
    let mut scan = Arrays::of(Shape::Sphere { radius: 1e-3, sides: Some(60) });
    let before = scan.1.len();
    // Twenty single triangles missing, none beside another, as in a scan.
    let mut number = 0;
    scan.1.retain(|_| {
        number += 1;
        number % 77 != 40 || number > 77 * 20
    });
    assert_eq!(before - scan.1.len(), 20);
    let (text, defects, sample) = refused(&scan);
    assert_eq!((defects.open_edges.count, defects.open_edges.places.len()), (60, 10));
    assert!(text.contains("open edges, 60, the first 10:\n"), "{text}");
    assert_eq!(sample.components.len(), 1);
    assert!(close(sample.objects[0].volume, 4.0 / 3.0 * std::f64::consts::PI * 1e-9, 0.02));
}

#[test]
fn flipped_triangle_is_named_with_its_three_edges() {
    let mut flipped = Arrays::cube(2e-3);
    flipped.1[5].swap(0, 1);
    let (text, defects, _) = refused(&flipped);
    assert!(text.contains("3 edges between triangles that wind opposite ways"), "{text}");
    assert_eq!(defects.flipped_edges.count, 3);
    assert!(defects.flipped_edges.places.iter().all(|spot| spot.triangles.contains(&6)));
}

#[test]
fn crossing_exactly_along_edges_is_found() {
    // Every face of the small box lies in a grid plane of the big one's faces: no edge passes
    // through the inside of a triangle. Were the crossing not found, the parts would stay two.
    let big = subdivided_cube(4e-3, 4);
    let small = Arrays::of(Shape::Box { size: [2e-3, 2e-3, 8e-3] });
    let sample = clean(big.clone().and(small));
    assert_eq!(sample.components.len(), 1);
    clean(big);
}

#[test]
fn parts_that_touch_in_a_vertex_or_stand_apart_do_not_cross() {
    let pair = Arrays::cube(2e-3).and(Arrays::cube(2e-3).moved([2e-3, 2e-3, 2e-3]));
    let (loaded, defects) = try_load(pair, false);
    assert_eq!(defects.non_manifold_vertices.count, 1);
    assert_eq!(defects.non_manifold_vertices.places[0].position_mm, Some([1.0; 3]));
    let sample = loaded.unwrap();
    assert_eq!((sample.components.len(), sample.vertices.len()), (2, 15));
    let warnings = &sample.objects[0].warnings;
    assert!(warnings[0].contains("1 vertex where parts touch"), "{warnings:?}");
    // A corner that stands on a face.
    let mut turned = shape("x", Shape::Box { size: [1e-3; 3] });
    turned.placement.rotate =
        vec![([0.0, 0.0, 1.0], 45_f64.to_radians()), ([1.0, 0.0, 0.0], 2.0_f64.sqrt().atan())];
    let cube = Arrays::of_object(at(turned, [0.0, 0.0, 1e-3 + 0.5e-3 * 3.0_f64.sqrt()]));
    clean(Arrays::cube(2e-3).and(cube));
    clean(Arrays::cube(2e-3).and(Arrays::cube(1e-3).moved([1.6e-3, 0.0, 0.0])));
}

#[test]
fn shapes_read_back_as_meshes_are_clean() {
    for of in [
        Shape::Cylinder { radius: 4e-3, height: 16e-3, sides: Some(2048) },
        Shape::Sphere { radius: 1e-3, sides: Some(320) },
        Shape::Prism { radius: 4e-3, height: 16e-3, sides: 7 },
        Shape::Box { size: [1e-3, 2e-3, 3e-6] },
    ] {
        let mut object: Object = Arrays::of(of.clone()).object("part");
        object.placement.rotate = vec![([1.0, 2.0, 3.0], 0.7)];
        let sample = load(&scene(vec![object])).unwrap();
        assert_eq!(sample.objects[0].defects, Defects::default(), "{of:?}");
    }
}

#[test]
fn rounding_to_f32_far_from_the_origin_makes_no_crossings() {
    for of in [
        Shape::Cylinder { radius: 4e-3, height: 16e-3, sides: Some(2048) },
        Shape::Sphere { radius: 1e-3, sides: Some(100) },
        Shape::Box { size: [1e-3, 2e-3, 3e-6] },
    ] {
        for (turn, far) in [(0.0, 0.0), (0.7, 0.0), (0.7, 0.1), (1.3, 1.0)] {
            let mut object = Arrays::of(of.clone()).object("part");
            object.placement.rotate = vec![([1.0, 2.0, 3.0], turn)];
            object.placement.position = [far, 0.7 * far, 0.0];
            let mut mesh = Arrays::of_object(object);
            for number in mesh.0.as_flattened_mut() {
                let rounded = *number as f32;
                *number = f64::from(rounded);
            }
            let (loaded, defects) = try_load(mesh, false);
            assert!(loaded.is_ok(), "{of:?}, {turn}, {far} m: {:?}", loaded.map(|_| ()));
            assert_eq!(defects.self_intersections.count, 0, "{of:?}, {turn}, {far} m");
        }
    }
}

#[test]
fn folded_fin_encloses_nothing() {
    // A triangle of the cube cut in three at a point in it; then the point leaves it.
    let mut cube = Arrays::cube(2e-3);
    let [a, b, c] = cube.1.remove(0);
    let [p, q] = [a, b].map(|vertex| cube.0[vertex as usize]);
    let r = cube.0[c as usize];
    let inner = |f: f64| [0, 1, 2].map(|k| (p[k] + q[k]) / 2.0 * (1.0 - f) + r[k] * f);
    // A point on the line from the middle of ab to c; beyond c the triangles turn over.
    let d = u32::try_from(cube.0.len()).unwrap();
    cube.0.push(inner(0.5));
    cube.1.extend([[a, b, d], [b, c, d], [c, a, d]]);
    clean(cube.clone());
    cube.0[d as usize] = inner(1.2);
    let sample = cube.load().unwrap();
    assert!(close(sample.objects[0].volume, 8e-9, 1e-12));
    let warnings = &sample.objects[0].warnings;
    assert!(warnings[0].contains("of triangles folded within a plane (harmless)"), "{warnings:?}");
}

#[test]
fn soup_of_crossing_triangles_ends_in_finite_time() {
    // 3000 big triangles all through one point.
    let mut soup = Arrays::cube(2e-3);
    for k in 0..3000_u32 {
        let turn = f64::from(k) * 2.399_963;
        let tilt = f64::from(k) * 1.1e-3;
        let first = u32::try_from(soup.0.len()).unwrap();
        for corner in 0..3 {
            let angle = turn + f64::from(corner) * 2.0944;
            soup.0.push([9e-3 * angle.cos(), 9e-3 * angle.sin(), 9e-3 * (angle.sin() * tilt)]);
        }
        soup.1.push([first, first + 1, first + 2]);
    }
    let (_, defects, _) = refused(&soup);
    assert!(defects.self_intersections.count > 100_000);
    assert_eq!(defects.self_intersections.places.len(), 10);
}

#[test]
fn nan_vertices_are_counted_and_refused_even_where_defects_are_allowed() {
    let mut mesh = Arrays::cube(2e-3);
    let first = u32::try_from(mesh.0.len()).unwrap();
    for k in 0..12_u32 {
        mesh.0.push([f64::NAN, f64::from(k) * 1e-3, f64::INFINITY]);
        mesh.1.push([0, 1, first + k]);
    }
    for allowed in [false, true] {
        let (loaded, defects) = try_load(mesh.clone(), allowed);
        let text = loaded.unwrap_err().to_string();
        assert!(text.contains("12 triangles are not finite"), "{text}");
        assert!(text.contains("not finite, 12, the first 10:\n    triangle 13\n"), "{text}");
        assert_eq!(defects.not_finite.count, 12);
        assert_eq!(defects.not_finite.places[0].position_mm, None);
    }
}

#[test]
fn pieces_of_an_open_mesh_keep_their_orientation_to_each_other() {
    // A cube whose triangles have gaps between them, and the same inside out.
    let cube = Arrays::cube(2e-3);
    let mut apart = Arrays::default();
    for corners in cube.1.iter().map(|it| it.map(|vertex| cube.0[vertex as usize])) {
        let middle = |k: usize| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0;
        let first = u32::try_from(apart.0.len()).unwrap();
        apart.0.extend(corners.map(|it| [0, 1, 2].map(|k| middle(k) + 0.99 * (it[k] - middle(k)))));
        apart.1.push([first, first + 1, first + 2]);
    }
    for mesh in [apart.clone(), apart.turned()] {
        let (text, _, sample) = refused(&mesh);
        assert!(text.contains("of 4096 trial rays enter and leave it unequally often"), "{text}");
        assert!(
            text.contains("its nearest corners without an edge ") && text.contains(" um apart")
        );
        assert_eq!((sample.components.len(), sample.triangles.len()), (1, 12));
        for corners in sample.triangles.iter().map(|it| it.map(|v| sample.vertices[v as usize])) {
            let outwards: f64 = normal(corners).iter().zip(corners[0]).map(|(n, a)| n * a).sum();
            assert!(outwards > 0.0, "{corners:?}");
        }
    }
}

#[test]
fn message_offers_allow_defects_only_where_no_trial_ray_is_wrong() {
    let mut open = Arrays::cube(2e-3);
    open.1.pop();
    // Turned faces across z: rays leave the cube before they enter it.
    let mut negative = Arrays::cube(2e-3);
    let flat = |it: &[u32; 3]| {
        let [a, b, c] = it.map(|vertex| negative.0[vertex as usize][2]);
        (a - b).abs() + (b - c).abs() < 1e-9
    };
    let across: Vec<usize> = (0..12).filter(|it| flat(&negative.1[*it])).collect();
    across.iter().for_each(|it| negative.1[*it].swap(0, 1));
    for (mesh, words) in [
        (open, "trial rays enter and leave it unequally often: repair the mesh"),
        (negative, "have negative paths, to -"),
    ] {
        let text = mesh.load().unwrap_err().to_string();
        assert!(text.contains(words) && !text.contains("allow_defects"), "{text}");
    }
}
