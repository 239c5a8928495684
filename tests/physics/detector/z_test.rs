//! Z-tests of many values at once: scores of standard normal distribution where the claim holds,
//! the worst of which is held to a Sidak-corrected bound.

use crate::reference::normal::quantile;

/// Chance that a family of true claims fails.
const LEVEL: f64 = 1e-3;

/// Bound of the worst of `tests` scores, on either side, so that true claims fail with a chance of
/// [`LEVEL`] together.
pub(crate) fn bound(tests: usize) -> f64 {
    let each = -((-LEVEL).ln_1p() / tests as f64).exp_m1();
    -quantile(0.5 * each)
}

/// Scores of claims.
#[derive(Debug, Default)]
pub(crate) struct Scores(Vec<(String, f64)>);

impl Scores {
    /// Standardised values are of mean 0 and variance 1. `kurtosis`: their fourth moment.
    pub(crate) fn take_moments(&mut self, what: &str, values: &[f64], kurtosis: f64) {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n.sqrt();
        let squares: f64 = values.iter().map(|z| z * z).sum();
        self.take(format!("{what}, mean"), mean);
        self.take(format!("{what}, variance"), (squares - n) / (n * (kurtosis - 1.0)).sqrt());
    }

    /// Standardised values of two frames do not vary together.
    pub(crate) fn take_covariance(&mut self, what: &str, a: &[f64], b: &[f64]) {
        assert_eq!(a.len(), b.len());
        let sum: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        self.take(format!("{what}, covariance"), sum / (a.len() as f64).sqrt());
    }

    pub(crate) fn take(&mut self, what: String, score: f64) {
        self.0.push((what, if score.is_nan() { f64::INFINITY } else { score }));
    }

    /// The worst score over the bound of the family; up to 1 the claims stand.
    pub(crate) fn worst(&self) -> (f64, &str) {
        let worst = self.0.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (what, score) = worst.expect("scores were taken");
        (score.abs() / bound(self.0.len()), what)
    }

    #[allow(clippy::print_stdout, reason = "measured figures are what this is for")]
    pub(crate) fn judge(&self, claim: &str) {
        let (worst, what) = self.worst();
        let (count, bound) = (self.0.len(), bound(self.0.len()));
        println!(
            "measured {claim}: worst score {:.2} of {bound:.2} ({what}; of {count})",
            worst * bound
        );
        assert!(worst <= 1.0, "{claim}: score {:.2} exceeds {bound:.2}: {what}", worst * bound);
    }
}

#[test]
fn family_bound_equals_sidaks() {
    // One test: the two-sided quantile of 1e-3; a thousand: that of 1.0005e-6.
    assert!((bound(1) - 3.290_527).abs() < 1e-3, "{}", bound(1));
    assert!((bound(1000) - 4.891_5).abs() < 2e-3, "{}", bound(1000));
}
