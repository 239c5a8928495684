//! Shells that touch themselves along edges, and triangles that are folded within a plane.

use super::set_up::{Arrays, close, is_closed};

/// The surface of full voxels of 1 mm, a square for each face between full and empty ones; corners are
/// shared.
fn voxels(full: &[[i32; 3]]) -> Arrays {
    let mut mesh = Arrays::default();
    let mut known: Vec<[i32; 3]> = Vec::new();
    for place in full {
        for axis in 0..3 {
            for side in [0, 1] {
                let mut other = *place;
                other[axis] += 2 * side - 1;
                if full.contains(&other) {
                    continue;
                }
                let mut square = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                    let mut corner = *place;
                    corner[axis] += side;
                    corner[(axis + 1) % 3] += u;
                    corner[(axis + 2) % 3] += v;
                    let number = known.iter().position(|it| *it == corner).unwrap_or(known.len());
                    if number == known.len() {
                        known.push(corner);
                    }
                    u32::try_from(number).unwrap()
                });
                if side == 0 {
                    square.reverse();
                }
                let [a, b, c, d] = square;
                mesh.1.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh.0 = known.iter().map(|corner| corner.map(|it| f64::from(it) * 1e-3)).collect();
    mesh
}

/// A box of 4 × 4 × 2 mm whose top is cut at the points `p` and `q`.
fn box_with_top(p: [f64; 2], q: [f64; 2]) -> Arrays {
    let mut mesh = Arrays::default();
    for z in [0.0, 2e-3] {
        mesh.0.extend([[0.0, 0.0, z], [4e-3, 0.0, z], [4e-3, 4e-3, z], [0.0, 4e-3, z]]);
    }
    mesh.0.extend([p, q].map(|[x, y]| [x * 1e-3, y * 1e-3, 2e-3]));
    mesh.1 = vec![[4, 5, 9], [5, 6, 9], [6, 7, 8], [7, 4, 8], [4, 9, 8], [6, 8, 9]];
    mesh.1.extend([[0, 2, 1], [0, 3, 2]]);
    for a in 0..4 {
        let b = (a + 1) % 4;
        mesh.1.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
    }
    mesh
}

#[test]
fn shell_that_touches_itself_along_edges_is_accepted() {
    // A bar that bends back to its own edge, and two such edges in one shell.
    let ring = [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 1]];
    let ring: Vec<[i32; 3]> = ring.iter().map(|[x, y]| [*x, *y, 0]).collect();
    let mut twice = ring.clone();
    twice.push([3, 0, 0]);
    twice.extend(ring.iter().map(|[x, y, z]| [x + 4, *y, *z]));
    let random: Vec<[i32; 3]> = (0..216)
        .filter(|k| (k * 7919 + 13 * (k / 6)) % 101 < 50)
        .map(|k| [k % 6, k / 6 % 6, k / 36])
        .collect();
    for (full, edges) in [(ring, Some(1)), (twice, Some(2)), (random, None)] {
        for turned in [false, true] {
            let mesh = voxels(&full);
            let mesh = if turned { mesh.turned() } else { mesh };
            let sample = mesh.clone().load().unwrap();
            let object = &sample.objects[0];
            assert!(close(object.volume, 1e-9 * full.len() as f64, 1e-9), "{:e}", object.volume);
            assert!(is_closed(&sample));
            if let Some(edges) = edges {
                let words = format!(
                    "{edges} edge{} along which it touches itself (harmless)",
                    &"s"[..edges - 1]
                );
                assert_eq!(object.warnings[0], words);
                assert_eq!((sample.components.len(), sample.triangles.len()), (1, mesh.1.len()));
            }
        }
    }
}

#[test]
fn triangles_folded_within_a_plane_enclose_nothing() {
    // Neither order of the points crosses; between two points of the other diagonal they fold.
    let sound = box_with_top([1.5, 2.5], [2.9, 1.5]);
    assert!(sound.load().unwrap().objects[0].warnings.is_empty());
    for (p, q) in [([2.9, 2.5], [1.5, 1.5]), ([2.2, 1.2], [1.0, 0.9]), ([3.0, 1.0], [1.0, 3.0])] {
        for turn in [0.0, 0.7] {
            let mut object = box_with_top(p, q).object("box");
            object.placement.rotate = vec![([1.0, 2.0, 3.0], turn)];
            let sample = beamlet::geometry::load(&super::set_up::scene(vec![object])).unwrap();
            let object = &sample.objects[0];
            assert!(close(object.volume, 32e-9, 1e-9), "{p:?}, {q:?}: {:e}", object.volume);
            let warning = "of triangles folded within a plane (harmless)";
            assert!(object.warnings[0].ends_with(warning), "{p:?}, {q:?}: {:?}", object.warnings);
            assert!(is_closed(&sample));
        }
    }
    // Beside a part that it touches, and round a void.
    let fold = || box_with_top([2.9, 2.5], [1.5, 1.5]);
    let beside = fold().and(Arrays::cube(2e-3).moved([5e-3, 2e-3, 1e-3]));
    assert!(close(beside.load().unwrap().objects[0].volume, 40e-9, 1e-9));
    let around = Arrays::cube(20e-3).and(fold().turned());
    assert!(close(around.load().unwrap().objects[0].volume, 8e-6 - 32e-9, 1e-9));
}

#[test]
fn fold_off_its_plane_is_an_overhang() {
    let mut mesh = box_with_top([2.9, 2.5], [1.5, 1.5]);
    mesh.0[8][2] += 1e-5;
    let sample = mesh.load().unwrap();
    // A third of the height over half of the face.
    assert!(close(sample.objects[0].volume, 32e-9 + 8e-6 * 1e-5 / 3.0, 1e-9));
    assert!(sample.objects[0].warnings.is_empty());
}
