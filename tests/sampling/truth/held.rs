//! What holds of the tables of docs/validation.md, "Truth", on small scenes.

use super::cases;
use super::classes::Class;
use super::errors::{ANGLE, Errors, classes_of, run, truth_of, with_budget};
use crate::support::engine;
use beamlet::Backend;

/// Base rays of a pixel in x and z, of truth: it differs from finer ones by less than 2e-5.
const LATTICE: [u32; 2] = [100, 24];

/// Interior pixels hold the default tolerance, pixels with a silhouette one ten times as wide: at
/// tighter ones some rims do not (docs/validation.md). With the default none is beyond what README.md
/// says of silhouettes.
#[test]
fn values_are_within_the_tolerance_of_much_finer_stacks() {
    let engine = engine(Backend::Bvh);
    let mut compared = [0; 2];
    for case in cases::small() {
        let truth = run(&engine, &truth_of(&case, LATTICE)).values;
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
