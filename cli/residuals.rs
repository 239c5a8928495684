//! Residuals of iterations, as a reconstruction has them beside its volumes.

use beamlet::stack::layout::RESIDUALS;
use std::path::Path;

/// Residuals of one quantity.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Residuals {
    /// Name of its volume.
    pub(crate) name: String,
    /// Root mean square of the start and of each iteration, in the unit of the sinograms.
    pub(crate) values: Vec<f64>,
    /// The iteration that was taken.
    pub(crate) best: usize,
}

/// Residuals in a folder; none where no iterations were made.
pub(crate) fn read(folder: &Path) -> Vec<Residuals> {
    let Ok(mut reader) = csv::Reader::from_path(folder.join(RESIDUALS)) else { return Vec::new() };
    let mut all: Vec<Residuals> = Vec::new();
    for line in reader.records().map_while(Result::ok) {
        let [name, iteration, residual, taken] = [0, 1, 2, 3].map(|at| line.get(at).unwrap_or(""));
        if all.last().is_none_or(|last| last.name != name) {
            all.push(Residuals { name: name.to_owned(), ..Residuals::default() });
        }
        if let Some(last) = all.last_mut() {
            last.values.push(residual.parse().unwrap_or(f64::NAN));
            if taken == "1" {
                last.best = iteration.parse().unwrap_or_default();
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_are_read_by_quantity_with_their_best() {
        let place = tempfile::tempdir().unwrap();
        let text = "quantity,iteration,residual,taken\nmu,0,2e0,0\nmu,1,1e-3,1\ndelta,0,3e-7,1\n";
        std::fs::write(place.path().join(RESIDUALS), text).unwrap();
        let found = read(place.path());
        let mu = Residuals { name: "mu".into(), values: vec![2.0, 1e-3], best: 1 };
        let delta = Residuals { name: "delta".into(), values: vec![3e-7], best: 0 };
        assert_eq!(found, [mu, delta]);
        assert!(read(&place.path().join("none")).is_empty());
    }
}
