//! Parts of one mesh that touch or overlap are one solid.

use super::set_up::{Arrays, is_closed, scene};
use beamlet::geometry::{Sample, load};
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Mesh, Object, Shape, ShapeOrMesh};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

/// The sample of a mesh, turned about three axes, with and without `allow_defects`.
fn sample_of(mesh: &Arrays, turn: f64) -> Sample {
    let of = |allowed: bool| {
        let mut object: Object = mesh.clone().object("part");
        object.placement.rotate = vec![([1.0, 2.0, 3.0], turn)];
        object.allow_defects = allowed;
        let scene = scene(vec![object]);
        let (_, refusals) = load_lenient(&scene).unwrap();
        assert!(refusals.is_empty(), "{refusals:?}");
        load(&scene).unwrap()
    };
    let sample = of(false);
    assert_eq!(sample.objects[0].defects, of(true).objects[0].defects);
    assert!(!sample.objects[0].defects.refused());
    sample
}

fn volume_of(sample: &Sample) -> f64 {
    sample.components.iter().map(|it| it.volume).sum()
}

fn assert_volume(sample: &Sample, want: f64, share: f64) {
    let found = volume_of(sample);
    assert!((found - want).abs() <= share * want, "{found:e}, not {want:e}");
    assert!(is_closed(sample));
}

fn cuboid(size: [f64; 3], middle: [f64; 3]) -> Arrays {
    Arrays::of(Shape::Box { size }).moved(middle)
}

/// Vertices as STL and the like hold them.
fn rounded(mut mesh: Arrays) -> Arrays {
    for number in mesh.0.as_flattened_mut() {
        let single = *number as f32;
        *number = f64::from(single);
    }
    mesh
}

#[test]
fn parts_that_share_a_face_an_edge_or_a_volume_are_one_solid() {
    let cube = || Arrays::cube(2e-3);
    let block = 8e-9;
    for (other, volume, components) in [
        // An edge alone: two parts that touch.
        (cube().moved([2e-3, 2e-3, 0.0]), 2.0 * block, 2),
        (cube().moved([2e-3, 0.0, 0.0]), 2.0 * block, 1),
        (cube().moved([2e-3, 0.7e-3, 0.3e-3]), 2.0 * block, 1),
        (cube().moved([1e-3, 0.3e-3, 0.2e-3]), 2.0 * block - 1e-3 * 1.7e-3 * 1.8e-3, 1),
        (cube().moved([1e-3, 0.0, 0.0]), 1.5 * block, 1),
        // The same once more, and a part in a part that lies on its wall.
        (cube(), block, 1),
        (cuboid([1e-3; 3], [0.5e-3, 0.0, 0.0]), block, 1),
        // A bar through it.
        (cuboid([0.3e-3, 0.3e-3, 8e-3], [0.0; 3]), block + 0.09e-6 * 6e-3, 1),
        (cuboid([2e-3, 2e-3, 8e-3], [1e-3, 1e-3, 0.0]), block + 32e-9 - block / 4.0, 1),
    ] {
        for turn in [0.0, 0.7] {
            let sample = sample_of(&cube().and(other.clone()), turn);
            assert_volume(&sample, volume, 1e-9);
            assert_eq!(sample.components.len(), components);
            let warnings = &sample.objects[0].warnings;
            assert_eq!(warnings.len(), 1, "{warnings:?}");
            assert!(warnings[0].starts_with("2 of its parts touch or overlap"), "{warnings:?}");
        }
    }
}

#[test]
fn parts_that_are_inside_out_are_turned_and_voids_stay_voids() {
    let cube = || Arrays::cube(2e-3);
    let small = |middle| cuboid([1e-3; 3], middle);
    for (others, volume, warnings) in [
        // One that is inside out.
        (small([1e-3, 0.0, 0.0]).turned(), 8.5e-9, vec!["2 of its", "1 of these were inside out"]),
        // A notch: a void that lies on the wall.
        (small([0.5e-3, 0.0, 0.0]).turned(), 7e-9, vec!["2 of its"]),
        // A void and, beside it, a bar that overlaps the cube.
        (
            small([0.0; 3]).turned().and(cuboid([1e-3, 0.2e-3, 0.2e-3], [1e-3, 0.9e-3, 0.0])),
            7e-9 + 0.02e-9,
            vec!["2 of its"],
        ),
        // A bar that stands in the cube and ends in its void.
        (
            small([0.0; 3]).turned().and(cuboid([2e-3, 0.2e-3, 0.2e-3], [1e-3, 0.0, 0.0])),
            7e-9 + 0.04e-6 * 1e-3 + 0.04e-6 * 0.5e-3,
            vec!["3 of its"],
        ),
    ] {
        for turn in [0.0, 1.1] {
            let sample = sample_of(&cube().and(others.clone()), turn);
            assert_volume(&sample, volume, 1e-9);
            let found = &sample.objects[0].warnings;
            assert_eq!(found.len(), warnings.len(), "{found:?}");
            assert!(
                found.iter().zip(&warnings).all(|(it, want)| it.starts_with(want)),
                "{found:?}"
            );
        }
    }
}

/// A cylinder along z around `middle`; its caps are fans of triangles.
fn drum(radius: f64, height: f64, sides: u32, middle: [f64; 3]) -> Arrays {
    let of = Shape::Cylinder { radius, height, sides: Some(sides) };
    Arrays::of(of).moved(middle)
}

#[test]
fn holes_as_parts_that_are_inside_out_stay_holes_whatever_touches() {
    let cube = || Arrays::cube(2e-3);
    // Faceted shapes have the volume of the circle.
    let area = std::f64::consts::PI * 0.36e-6;
    for (name, mesh, volume) in [
        ("through", cube().and(drum(0.6e-3, 2e-3, 24, [0.0; 3]).turned()), 8e-9 - area * 2e-3),
        (
            "blind",
            cube().and(drum(0.6e-3, 1e-3, 24, [0.0, 0.0, 0.5e-3]).turned()),
            8e-9 - area * 1e-3,
        ),
        ("corner", cube().and(cuboid([1e-3; 3], [0.5e-3; 3]).turned()), 7e-9),
        // A pin that is inside out and fills the hole of a plate.
        (
            "pin",
            cube().and(drum(0.6e-3, 1e-3, 24, [0.0, 0.0, 0.5e-3]).turned()).and(drum(
                0.6e-3,
                1e-3,
                24,
                [0.0, 0.0, 0.5e-3],
            )),
            8e-9,
        ),
        // Two parts that are inside out and share a face, and all of a file that is.
        ("both", cube().and(cube().moved([2e-3, 0.0, 0.0])).turned(), 16e-9),
        ("all", cube().and(cuboid([1e-3; 3], [0.5e-3, 0.0, 0.0]).turned()).turned(), 7e-9),
        // Two voids that share a face, in a box that they do not touch.
        (
            "voids",
            Arrays::of(Shape::Box { size: [6e-3; 3] })
                .and(cube().moved([1e-3, 0.0, 0.0]).and(cube().moved([-1e-3, 0.0, 0.0])).turned()),
            216e-9 - 16e-9,
        ),
        // A part in the overlap of two others, touching neither.
        (
            "covered",
            cube().and(cube().moved([1e-3, 0.0, 0.0])).and(cuboid([0.5e-3; 3], [0.5e-3, 0.0, 0.0])),
            12e-9,
        ),
    ] {
        for turn in [0.0, 0.4, 1.1, 1.9, 2.7] {
            let sample = sample_of(&rounded(mesh.clone()), turn);
            let found = volume_of(&sample);
            assert!((found / volume - 1.0).abs() < 1e-6, "{name}, {turn}: {found:e}, {volume:e}");
            assert!(is_closed(&sample));
        }
    }
}

#[test]
fn parts_that_pass_through_themselves_or_are_open_stay_refused_beside_others_that_meet() {
    let pair = || Arrays::cube(2e-3).and(Arrays::cube(2e-3).moved([2e-3, 0.0, 0.0]));
    // A cube whose top is turned round: it has no volume, and is no folded sheet.
    let mut bow = Arrays::cube(2e-3);
    for [x, _, z] in &mut bow.0 {
        *x = if *z > 0.0 { -*x } else { *x };
    }
    let mut open = Arrays::cube(2e-3);
    open.1.pop();
    for (other, message) in [(bow, "crosses itself"), (open, "not closed")] {
        let mesh = pair().and(other.moved([0.0, 6e-3, 0.0]));
        let text = mesh.load().unwrap_err().to_string();
        assert!(text.contains(message), "{text}");
    }
}

#[test]
fn random_boxes_on_a_lattice_have_the_volume_of_their_union() {
    // Nearly all faces coincide with others, and edges with edges.
    let mut state = 5_u32;
    let mut random = |below: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) % below
    };
    for round in 0..60 {
        let mut mesh = Arrays::default();
        let mut filled = BTreeSet::new();
        for _ in 0..2 + random(6) {
            let low = [random(5), random(5), random(5)];
            let size = [1 + random(3), 1 + random(3), 1 + random(3)];
            let middle =
                [0, 1, 2].map(|k| 1e-3 * (f64::from(low[k]) + 0.5 * f64::from(size[k]) - 3.0));
            mesh = mesh.and(cuboid(size.map(|it| 1e-3 * f64::from(it)), middle));
            for x in 0..size[0] {
                for y in 0..size[1] {
                    for z in 0..size[2] {
                        filled.insert([low[0] + x, low[1] + y, low[2] + z]);
                    }
                }
            }
        }
        let turn = 0.37 * f64::from(round % 3);
        let sample = sample_of(&rounded(mesh), turn);
        assert_volume(&sample, 1e-9 * filled.len() as f64, 1e-6);
    }
}

/// Parts of an assembly of a CAD program that lie on each other and overlap, as one binary STL file.
fn assembly() -> (Vec<u8>, Vec<&'static str>) {
    let names = vec!["lower", "upper", "gasket", "tube", "nut", "bolt"];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assembly");
    let mut records = Vec::new();
    for name in &names {
        let bytes = std::fs::read(folder.join(format!("{name}.stl"))).unwrap();
        records.extend_from_slice(&bytes[84..]);
    }
    let count = u32::try_from(records.len() / 50).unwrap();
    let file = [[0; 80].as_slice(), &count.to_le_bytes(), &records].concat();
    (file, names)
}

#[test]
fn an_assembly_exported_as_one_file_is_the_union_of_its_parts() {
    let directory = tempfile::tempdir().unwrap();
    let (file, names) = assembly();
    std::fs::write(directory.path().join("all.stl"), file).unwrap();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assembly");
    for (turn, shift) in [(0.0, 0.0), (0.8, 0.0), (2.1, 0.05)] {
        let object = |name: &str, path: &Path| {
            let geometry = ShapeOrMesh::Mesh(Mesh::file(path.to_path_buf(), 1e-3));
            let mut object = Object::new(name, geometry, "water");
            object.placement.rotate = vec![([3.0, 1.0, -2.0], turn)];
            object.placement.position = [shift, -shift, 0.3 * shift];
            object
        };
        let one = load(&scene(vec![object("all", &directory.path().join("all.stl"))])).unwrap();
        let apart: Vec<Object> =
            names.iter().map(|it| object(it, &folder.join(format!("{it}.stl")))).collect();
        let apart = load(&scene(apart)).unwrap();
        let want: f64 = apart.components.iter().map(|it| it.volume).sum();
        let mut told = String::new();
        write!(told, "{:?}", one.objects[0].warnings).unwrap();
        assert!(told.contains("6 of its parts touch or overlap"), "{told}");
        assert_volume(&one, want, 1e-6);
    }
}
