//! Mask offsets that differ from view to view.

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cuboid};
use crate::support::{CARBON, engine};
use beamlet::Backend;
use beamlet::scene::{RandomRays, Scene, Scheme};
use ndarray::Axis;

/// Lists that reach as far as each other.
const LISTS: [[f64; 2]; 2] = [[-16e-6, 7e-6], [16e-6, -5e-6]];

/// A small block in three views.
fn scene() -> Scene {
    let block = body(cuboid([0.2e-3, 0.3e-3, 0.25e-3]), CARBON[0], CARBON[1]);
    let mut scene = scenes::scene(&Setup::paper([4, 3]), &[block], &LISTS[0]);
    scene.scan.angles = vec![0.0, 0.8, 1.6];
    scene
}

#[test]
fn views_with_offsets_of_their_own_have_the_bits_of_scans_with_these() {
    let engine = engine(Backend::Bvh);
    for scheme in [Scheme::Cells, Scheme::Random] {
        let mut one = scene();
        one.sampling.scheme = scheme;
        one.sampling.rays = RandomRays::Count(40);
        let mut many = one.clone();
        many.scan.view_offsets = [0, 1, 0].map(|list: usize| LISTS[list].to_vec()).to_vec();
        let got = engine.simulate(&many).expect("stacks");
        let wants = LISTS.map(|list| {
            one.scan.mask_offsets = list.to_vec();
            engine.simulate(&one).expect("stacks")
        });
        assert_ne!(wants[0].sample, wants[1].sample);
        assert_eq!(got.flat, wants[0].flat, "{scheme:?}");
        for (view, list) in [0, 1, 0].into_iter().enumerate() {
            let [got, want] =
                [&got, &wants[list]].map(|stacks| stacks.sample.index_axis(Axis(0), view));
            assert_eq!(got, want, "{scheme:?}, view {view}");
        }
    }
}

#[test]
fn errors_of_a_scan_are_in_its_frames_and_not_in_the_flat() {
    let engine = engine(Backend::Bvh);
    let mut asked = scene();
    asked.scan.errors.mask_offsets = vec![vec![0.0, 2e-6], vec![-3e-6, 0.0], vec![0.0, 0.0]];
    let mut applied = scene();
    applied.scan.view_offsets = (0..3).map(|view| asked.applied_offsets(view)).collect();
    asked.scan.errors.intensities = vec![vec![1.0, 0.5], vec![1.0, 1.0], vec![0.97, 1.0]];
    let [got, want] = [&asked, &applied].map(|scene| engine.simulate(scene).expect("stacks"));
    assert_eq!(got.flat, want.flat);
    for ((view, step, row, column), want) in want.sample.indexed_iter() {
        let light = asked.scan.errors.intensities[view][step];
        let got = f64::from(got.sample[[view, step, row, column]]);
        assert!((got - light * f64::from(*want)).abs() < 1e-7, "view {view}, step {step}");
    }
}
