//! What holds of the tables of docs/developers/validation.md, "Truth", on small scenes.

use super::cases::{self, Case};
use super::classes::Class;
use super::errors::{ANGLE, Errors, classes_of, displacements, run, truth_of, with_budget};
use crate::support::{engine, everything};
use beamlet::Backend;
use beamlet::scene::{Scene, Transport};

/// Tolerance of truth, share of open beam.
const TRUTH: f64 = 2e-5;

/// Interior pixels hold the default tolerance, pixels with a silhouette one ten times as wide: at
/// tighter ones some rims do not (docs/developers/validation.md). With the default none is beyond what README.md
/// says of silhouettes. The truth without masks takes longer than all others: it is made with `BEAMLET_ALL`
/// (`.ci/long truth`), and [`tight_tolerances_hold_without_a_sample_mask`] holds such scenes in CI;
/// so is that of wide facets, of which [`angles_hold_in_interior_pixels_beside_silhouettes_too`] has the angles.
#[test]
fn values_are_within_the_tolerance_of_much_finer_stacks() {
    let engine = engine(Backend::Bvh);
    let mut compared = [0; 2];
    let long = ["ball, facets of 30 um", "ball, no masks"];
    let is_taken = |case: &Case| everything() || !long.contains(&case.name.as_str());
    for case in cases::small().into_iter().filter(is_taken) {
        let truth = run(&engine, &truth_of(&case, TRUTH)).values;
        let (classes, _) = classes_of(&case);
        let held = [(Class::Interior, 1e-4), (Class::Silhouette, 1e-3)];
        for (k, (class, tolerance)) in held.into_iter().enumerate() {
            let got = run(&engine, &with_budget(&case, tolerance, ANGLE));
            let errors = Errors::of(Some(class), &classes, tolerance, [&got.values, &truth]);
            compared[k] += errors.count;
            println!(
                "measured truth, {}, {class:?} at {tolerance:.0e}: {:.1} % of {} within, rms {:.2}, worst {:.2}",
                case.name,
                100.0 * errors.share(),
                errors.count,
                errors.rms / tolerance,
                errors.worst / tolerance,
            );
            if class == Class::Interior {
                let of = Some(Class::Silhouette);
                let errors = Errors::of(of, &classes, tolerance, [&got.values, &truth]);
                println!("measured truth, {}, silhouettes: {:.1e}", case.name, errors.worst);
                assert!(errors.worst < 1e-3, "{}, silhouettes: {errors:?}", case.name);
            }
            let failures = errors.failures(class, tolerance);
            assert!(failures.is_empty(), "{}, {class:?}: {failures:?}: {errors:?}", case.name);
        }
    }
    assert!(compared.iter().all(|count| *count > 100), "values of each class: {compared:?}");
}

/// Interior pixels hold angle tolerances, those beside a silhouette too, whose rays at their borders
/// differ from the next ones outside, and those whose facets are wider than rays stand apart.
#[test]
fn angles_hold_in_interior_pixels_beside_silhouettes_too() {
    let engine = engine(Backend::Bvh);
    let mut compared = 0;
    let scenes = ["ball, facets of 30 um", "prism slanting by 10 degrees"];
    for case in named(cases::small(), scenes) {
        let (classes, _) = classes_of(&case);
        let angles = |scene: &Scene| displacements(&engine, scene) / case.scene.lever_arm();
        let truth = angles(&truth_of(&case, TRUTH));
        for tolerance in [30e-9, 10e-9, 3e-9] {
            let got = angles(&with_budget(&case, 1e-2, tolerance));
            let class = Class::Interior;
            let errors = Errors::of(Some(class), &classes, tolerance, [&got, &truth]);
            compared += errors.count;
            println!(
                "measured angles, {} at {:.0} nrad: {:.1} % of {} within, rms {:.2}, worst {:.2}",
                case.name,
                tolerance * 1e9,
                100.0 * errors.share(),
                errors.count,
                errors.rms / tolerance,
                errors.worst / tolerance,
            );
            let failures = errors.failures(class, tolerance);
            assert!(failures.is_empty(), "{}: {failures:?}: {errors:?}", case.name);
        }
    }
    assert!(compared > 100, "angles compared: {compared}");
}

/// The cases of these names.
fn named<const N: usize>(cases: Vec<Case>, names: [&str; N]) -> impl Iterator<Item = Case> {
    cases.into_iter().filter(move |case| names.contains(&case.name.as_str()))
}

/// Runs at tolerances of 3e-6 and 1e-6 differ by 1e-5 at most, where rectangles at a rim are many and
/// thin: cells of several of them have their mean, also along z (they had that of one: 1.9e-5).
#[test]
fn values_settle_as_the_tolerance_falls() {
    let engine = engine(Backend::Bvh);
    let mut compared = 0;
    for case in named(cases::small(), ["ball, facets of 30 um", "ball, no masks"]) {
        let stack = |tolerance: f64| {
            let mut scene = with_budget(&case, tolerance, ANGLE);
            // Sums over facets alone, which are exact where they are fine enough.
            scene.sampling.transport = Transport::FirstOrder;
            run(&engine, &scene).values
        };
        let (classes, _) = classes_of(&case);
        let errors = Errors::of(None, &classes, 1e-5, [&stack(3e-6), &stack(1e-6)]);
        println!("measured truth, {}, 3e-6 against 1e-6: {:.1e}", case.name, errors.worst);
        compared += errors.count;
        assert!(errors.worst < 1e-5, "{}: {errors:?}", case.name);
    }
    assert!(compared > 100, "{compared} values");
}

/// Rays that are all followed in order find what facets between them throw into windows far off: light
/// of a rim that no ray beside it shows (5.2e-4 of open beam were missed at a tolerance of 1e-4, and
/// truths with them). Three times the tolerance: both runs err, at windows that no spot blurs.
#[test]
fn rays_alone_miss_no_facet_between_them() {
    let engine = engine(Backend::Bvh);
    let mut compared = 0;
    for case in named(cases::all(), ["detector mask alone", "point spot"]) {
        let (classes, _) = classes_of(&case);
        let means = run(&engine, &with_budget(&case, 3e-6, ANGLE)).values;
        let rays = run(&engine, &truth_of(&case, 1e-4)).values;
        let errors = Errors::of(None, &classes, 1e-4, [&rays, &means]);
        println!("measured truth, {}, rays alone: {:.1e}", case.name, errors.worst);
        compared += errors.count;
        assert!(errors.worst < 3e-4, "{}: {errors:?}", case.name);
    }
    assert!(compared > 100, "{compared} values");
}

/// A tolerance of 3e-5 holds at rims where no sample mask is there, and the estimated error is within a
/// factor of two of the true one. Before errors of pieces were raised, errors were 0.6 and 0.75 of the
/// tolerance (root mean square), and the estimate was a third of them.
#[test]
fn tight_tolerances_hold_without_a_sample_mask() {
    let engine = engine(Backend::Bvh);
    let tolerance = 3e-5;
    for case in named(cases::all(), ["no masks", "detector mask alone"]) {
        let (classes, _) = classes_of(&case);
        // Sums over facets, which rays alone confirm to 5e-6.
        let fine = run(&engine, &with_budget(&case, 1e-6, ANGLE)).values;
        let got = run(&engine, &with_budget(&case, tolerance, ANGLE));
        for class in [Class::Interior, Class::Silhouette] {
            let errors = Errors::of(Some(class), &classes, tolerance, [&got.values, &fine]);
            println!(
                "measured truth, {}, {class:?} at 3e-5: {:.1} % of {} within, rms {:.2}, worst {:.2}",
                case.name,
                100.0 * errors.share(),
                errors.count,
                errors.rms / tolerance,
                errors.worst / tolerance,
            );
            let failures = errors.failures(class, tolerance);
            assert!(failures.is_empty(), "{}, {class:?}: {failures:?}: {errors:?}", case.name);
        }
        let errors = Errors::of(None, &classes, tolerance, [&got.values, &fine]);
        let ratio = got.sampling.expect("cells").rms_error / errors.of_pixels;
        println!("measured truth, {}: told {ratio:.2} of the error", case.name);
        assert!((0.5..2.0).contains(&ratio), "{}: {ratio}", case.name);
    }
}

/// Estimated errors are of pixels, not of the parts of them that take the light where the detector blurs
/// (16 times as much was told, and refined for).
#[test]
fn estimated_errors_are_of_pixels_where_the_detector_blurs() {
    let engine = engine(Backend::Bvh);
    for case in named(cases::all(), ["detector blur of 100 um"]) {
        let (classes, _) = classes_of(&case);
        let fine = run(&engine, &with_budget(&case, 2e-5, ANGLE)).values;
        let got = run(&engine, &with_budget(&case, 1e-3, ANGLE));
        let errors = Errors::of(None, &classes, 1e-3, [&got.values, &fine]);
        let ratio = got.sampling.expect("cells").rms_error / errors.of_pixels;
        println!(
            "measured truth, {}: told {ratio:.2} of the error, {:.1} % within, rms {:.2}, worst {:.2}",
            case.name,
            100.0 * errors.share(),
            errors.rms / 1e-3,
            errors.worst / 1e-3,
        );
        assert!((0.5..4.0).contains(&ratio), "{ratio}: {errors:?}");
        assert!(errors.share() > 0.99 && errors.worst < 5e-3, "{errors:?}");
    }
}
