//! Mask offsets that differ from view to view.

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cuboid};
use crate::support::{CARBON, engine};
use beamlet::Backend;
use beamlet::scene::{Exposure, RandomRays, Scene, Scheme};
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
    applied.scan.view_offsets =
        (0..3).map(|view| asked.applied_offsets(Exposure::Sample(view))[0].clone()).collect();
    asked.scan.errors.intensities = vec![vec![1.0, 0.5], vec![1.0, 1.0], vec![0.97, 1.0]];
    let [got, want] = [&asked, &applied].map(|scene| engine.simulate(scene).expect("stacks"));
    assert_eq!(got.flat, want.flat);
    for ((view, step, row, column), want) in want.sample.indexed_iter() {
        let light = asked.scan.errors.intensities[view][step];
        let got = f64::from(got.sample[[view, step, row, column]]);
        assert!((got - light * f64::from(*want)).abs() < 1e-7, "view {view}, step {step}");
    }
}

/// Flats before views 0 and 2 and behind the last, against scans whose one flat has the offsets as they are
/// with the errors of mask and source, and the light by f64 arithmetic.
#[test]
fn flats_between_views_have_the_errors_of_the_view_that_follows() {
    let engine = engine(Backend::Bvh);
    let mut one = scene();
    one.scan.errors.mask_offsets = vec![vec![1e-6, 2e-6], vec![0.0; 2], vec![-3e-6, 5e-6]];
    one.scan.errors.source = vec![[4e-6, 0.0], [0.0; 2], [-9e-6, 3e-6]];
    one.scan.errors.intensities = vec![vec![0.9, 1.0], vec![1.0; 2], vec![1.1, 0.8]];
    let mut many = one.clone();
    many.scan.flats_every = Some(2);
    let [got, still] = [&many, &one].map(|scene| engine.simulate(scene).expect("stacks"));
    assert_eq!(got.sample, still.sample);
    assert_eq!(got.later_flats.dim().0, 2);
    assert!(still.later_flats.is_empty());
    let share = 1.0 - 1.0 / one.magnification();
    let mut moved = 0.0_f32;
    for (flat, view) in [0, 2, 2].into_iter().enumerate() {
        let found = match flat {
            0 => got.flat.view(),
            later => got.later_flats.index_axis(Axis(0), later - 1),
        };
        let errors = &one.scan.errors;
        let mut alone = scene();
        alone.scan.mask_offsets = LISTS[0]
            .iter()
            .zip(&errors.mask_offsets[view])
            .map(|(offset, error)| offset + error - share * errors.source[view][0])
            .collect();
        alone.objects.clear();
        let wanted = engine.simulate(&alone).expect("stacks").flat;
        for ((step, row, column), wanted) in wanted.indexed_iter() {
            let light = errors.intensities[view][step] * f64::from(*wanted);
            let found = found[[step, row, column]];
            // f32 of the light, and offsets that differ by their last digit: 1e-7.
            assert!((f64::from(found) - light).abs() < 1e-6, "flat {flat}, step {step}");
            moved = moved.max((found - still.flat[[step, row, column]]).abs());
        }
    }
    assert!(moved > 5e-3, "{moved}");
}
