//! The comparison of the other tests can fail.

use crate::support::Worst;

#[test]
fn a_deviation_within_the_tolerance_holds() {
    let mut worst = Worst::new("within", 1e-3);
    worst.take(-1e-3, || "here".into());
    worst.holds();
}

#[test]
#[should_panic(expected = "beyond: 2e-3 exceeds 1e-3 at there")]
fn a_deviation_beyond_the_tolerance_fails() {
    let mut worst = Worst::new("beyond", 1e-3);
    worst.take(1e-3, || "here".into());
    worst.take(-2e-3, || "there".into());
    worst.holds();
}

#[test]
#[should_panic(expected = "unknown: inf exceeds 1e-3 at here")]
fn a_deviation_that_is_not_a_number_fails() {
    let mut worst = Worst::new("unknown", 1e-3);
    worst.take(f64::NAN, || "here".into());
    worst.holds();
}

#[test]
#[should_panic(expected = "empty: nothing was compared")]
fn a_comparison_of_nothing_fails() {
    Worst::new("empty", 1e-3).holds();
}

#[test]
#[should_panic(expected = "forgotten: ended without `holds`")]
fn a_comparison_that_is_forgotten_fails() {
    let mut worst = Worst::new("forgotten", 1e-3);
    worst.take(0.0, || "here".into());
}
