//! An assembly as a CAD program exports it: parts face to face, a gasket, a tube and a bolt in
//! bores of other facets, a thread that overlaps its nut (`tests/assembly/make.py`).

use super::{Bench, random_rays};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, Mesh, Random, body};
use crate::support::{backends, engine, everything, root, sample};
use beamlet::geometry::load;
use beamlet::internals::geometry::load_lenient;
use beamlet::scene::{Scene, ShapeOrMesh, Transport};
use std::path::PathBuf;

const PARTS: [&str; 6] = ["lower", "upper", "gasket", "tube", "nut", "bolt"];

/// The assembly, turned, with a material for each part.
fn assembly(turn: ([f64; 3], f64)) -> Scene {
    let mut setup = Setup::paper([48, 48]);
    setup.sample_mask = None;
    setup.detector_mask = None;
    let tetrahedron = Mesh {
        vertices: vec![[0.0; 3], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    };
    let constants = [
        [51.0, 4.6e-7],
        [51.0, 4.6e-7],
        [25.0, 2.4e-7],
        [38.0, 2.6e-7],
        [60.0, 5e-7],
        [60.0, 5e-7],
    ];
    let bodies = constants.map(|[mu, delta]| body(tetrahedron.clone(), mu, delta));
    let mut scene = scenes::scene(&setup, &bodies, &[0.0]);
    scene.directory = root().join("tests/assembly");
    for (object, name) in scene.objects.iter_mut().zip(PARTS) {
        object.name = name.to_owned();
        let path = PathBuf::from(format!("{name}.stl"));
        object.geometry = ShapeOrMesh::Mesh(beamlet::scene::Mesh::file(path, 1e-3));
        object.placement.rotate = vec![turn];
    }
    scene
}

/// The parts as they stand, uncut.
fn bodies_of(scene: &Scene) -> Vec<Body> {
    let alone = |k: usize| {
        let mut scene = scene.clone();
        let object = scene.objects.swap_remove(k);
        scene.objects = vec![object];
        let sample = load(&scene).expect("a part");
        let vertices = sample.vertices.clone();
        let k = k as f64;
        body(Mesh { vertices, triangles: sample.triangles }, 20.0 + k, 1e-7 * (1.0 + k))
    };
    (0..scene.objects.len()).map(alone).collect()
}

fn turns() -> Vec<([f64; 3], f64)> {
    let mut random = Random::new(11);
    let turn = |_| {
        let axis = [0; 3].map(|_| random.between(-1.0, 1.0));
        (axis, random.between(0.0, 6.0))
    };
    [([0.0, 0.0, 1.0], 0.0)].into_iter().chain((0..3).map(turn)).collect()
}

#[test]
fn cad_assembly_as_exported_runs_in_balance_at_any_angle() {
    let pairs = backends()
        .into_iter()
        .flat_map(|backend| turns().into_iter().map(move |turn| (backend, turn)));
    for (backend, turn) in sample(pairs.collect(), 5) {
        let mut scene = assembly(turn);
        if !everything() {
            // The balance is that of each ray: fewer rays than a fine picture takes try it.
            scene.sampling.tolerance = Some(1e-3);
        }
        let stacks = engine(backend).simulate(&scene).expect("a stack");
        let tally = &stacks.record.tally;
        let failed = [tally.unbalanced, tally.dropped, tally.not_finite];
        assert_eq!(failed, [0; 3], "{backend}, {turn:?}");
        // Rays are traced near grazing incidence alone, some of them along faces that touch.
        assert!(50 * tally.unordered <= tally.rays, "{backend}, {turn:?}: {tally:?}");
        println!("measured {backend}: {} rays, {} again", tally.rays, tally.retraced);
    }
}

#[test]
fn rays_through_the_cad_assembly_are_in_the_part_listed_last() {
    let bench = Bench::new();
    for turn in turns() {
        let mut scene = assembly(turn);
        scene.sampling.transport = Transport::FirstOrder;
        let bodies = bodies_of(&scene);
        // A material of its own for each part.
        let own = scenes::scene(&Setup::paper([16, 16]), &bodies, &[0.0]);
        scene.materials = own.materials;
        for (object, own) in scene.objects.iter_mut().zip(own.objects) {
            object.material = own.material;
        }
        let rays = random_rays(2000, &mut Random::new(7));
        let wrong = bench.wrong_rays(beamlet::Backend::Bvh, &scene, &rays, &bodies);
        assert!(wrong.is_empty(), "{} differ: {:#?}", wrong.len(), &wrong[..wrong.len().min(3)]);
    }
    bench.end();
}

#[test]
fn the_thread_of_the_cad_assembly_overlaps_its_nut() {
    let (sample, refusals) = load_lenient(&assembly(([1.0, 0.0, 0.0], 0.5))).expect("a sample");
    assert!(refusals.is_empty());
    // Lower and upper are 0.1 mm apart; the gasket lies on both; the thread is in the nut.
    assert_eq!(sample.overlaps, [[4, 5]]);
}
