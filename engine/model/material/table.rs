//! Material tables: CSV with the columns `energy_keV,mu_per_cm,delta`. An energy that comes twice is an
//! absorption edge: the first row holds below it, the second from it on.

use std::path::{Path, PathBuf};

use super::number_table::{Column, Fault, NumberTable};
use super::{Constants, within};
use beamlet_core::error::{Error, Result};
use beamlet_core::interpolation::log_log;

const TABLE: NumberTable<3> = NumberTable {
    noun: "material table",
    columns: [
        Column { name: "energy_keV", may_be_zero: false },
        Column { name: "mu_per_cm", may_be_zero: false },
        Column { name: "delta", may_be_zero: false },
    ],
};

/// Rows of (energy keV, mu 1/cm, delta), energies ascending, each at most twice; everything above 0.
pub(super) struct ConstantsTable {
    path: PathBuf,
    rows: Vec<[f64; 3]>,
}

impl ConstantsTable {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let follows = |rows: &[[f64; 3]], row: &[f64; 3]| {
            let before = rows.len().checked_sub(2).map(|index| rows[index][0]);
            let falls = rows.last().is_some_and(|last| last[0] > row[0])
                || before.is_some_and(|e| e >= row[0]);
            let allowed = "energies in ascending order, each once, or twice at an absorption edge";
            falls.then_some(Fault { column: 0, allowed })
        };
        let rows = TABLE.read(path, follows, |_| None)?;
        Ok(Self { path: path.to_owned(), rows })
    }

    /// Constants at `energy` keV, interpolated linearly in the logarithms. `outside` makes the error of
    /// an energy beyond the table, from found and allowed values.
    pub(super) fn at(
        &self,
        name: &str,
        energy: f64,
        outside: impl Fn(String, String) -> Error,
    ) -> Result<Constants> {
        let (first, last) = (self.rows[0], self.rows[self.rows.len() - 1]);
        let Some(energy) = within([first[0], last[0]], energy) else {
            return Err(outside(
                format!("{energy} keV"),
                format!(
                    "{} keV to {} keV, the range of {} for \"{name}\"",
                    first[0],
                    last[0],
                    self.path.display()
                ),
            ));
        };
        // The last row at the energy or below it, and the next: an edge belongs to the energies above it.
        let above = self.rows.partition_point(|row| row[0] <= energy);
        let (a, b) = (self.rows[above - 1], self.rows[above.min(self.rows.len() - 1)]);
        let between = |column: usize| log_log(energy, [a[0], a[column]], [b[0], b[column]]);
        Ok(Constants { mu: between(1) * 100.0, delta: between(2), ..Constants::default() })
    }
}

impl ConstantsTable {
    /// Least and greatest energy, keV.
    pub(super) fn range(&self) -> [f64; 2] {
        [self.rows[0][0], self.rows[self.rows.len() - 1][0]]
    }

    /// Energies, keV, between rows across which mu rises: only an edge does that. Of an energy that comes
    /// twice, that energy.
    pub(super) fn edges(&self) -> Vec<f64> {
        let rises = |pair: &&[[f64; 3]]| pair[1][1] > pair[0][1];
        let between = |pair: &[[f64; 3]]| (pair[0][0] * pair[1][0]).sqrt();
        self.rows.windows(2).filter(rises).map(between).collect()
    }
}
