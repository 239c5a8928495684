//! Samples moved by parts of a cell: errors of sampling have no preferred sign.

use super::cases::{self, Case};
use super::classes::Class;
use super::errors::{ANGLE, Errors, classes_of, run, truth_of, with_budget};
use crate::reference::surfaces::Random;
use crate::support::{Checked, engine};
use beamlet::Backend;

/// Moves of each sample.
const SHIFTS: usize = 64;
/// Largest move in x and z, m: 5 um, and half a row of 100 um.
const MOST: [f64; 2] = [5e-6, 50e-6];
/// Tolerance of truth, share of open beam.
const TRUTH: f64 = 2e-5;
/// The tolerance.
const TOLERANCE: f64 = 1e-4;
/// Largest mean error of a class, share of its root mean square.
const BIAS: f64 = 0.25;

/// Errors of the classes of a case over all moves.
fn errors(engine: &Checked, case: &Case) -> [(Class, &'static str, Errors); 2] {
    let mut random = Random::new(64);
    let mut all = [Errors::default(); 2];
    for _ in 0..SHIFTS {
        let [x, z] = MOST.map(|most| random.between(-most, most));
        let moved = case.moved([x, 0.0, z]);
        let truth = run(engine, &truth_of(&moved, TRUTH)).values;
        let got = run(engine, &with_budget(&moved, TOLERANCE, ANGLE)).values;
        let (classes, named) = classes_of(&moved);
        for (sum, (class, _)) in all.iter_mut().zip(named) {
            *sum = sum.with(Errors::of(Some(class), &classes, TOLERANCE, [&got, &truth]));
        }
    }
    let (_, [interior, silhouette]) = classes_of(case);
    [(interior.0, interior.1, all[0]), (silhouette.0, silhouette.1, all[1])]
}

#[test]
#[ignore = "minutes of processor time: errors over 64 moves of samples"]
fn errors_of_moved_samples_have_no_mean() {
    let engine = engine(Backend::Bvh);
    let mut biased = Vec::new();
    for case in cases::small() {
        for (class, name, errors) in errors(&engine, &case) {
            let bias = errors.mean / errors.rms.max(1e-12);
            println!(
                "| {} | {name} | {} | {:.2e} | {:.2e} | {bias:.2} | {:.1} % | {:.1} |",
                case.name,
                errors.count,
                errors.mean,
                errors.rms,
                100.0 * errors.share(),
                errors.worst / TOLERANCE,
            );
            // Smaller errors are those of truth itself.
            let significant = bias.is_nan() || bias.abs() > BIAS;
            if significant && errors.rms > 0.05 * TOLERANCE {
                biased.push((case.name.clone(), class, bias));
            }
        }
    }
    assert!(biased.is_empty(), "{biased:?}");
}
