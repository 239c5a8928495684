//! Pair distribution of spheres from a table, as their structure factor (docs/physics.md, "Microstructure").

use crate::material::{Column, Fault, NumberTable};
use crate::scene::{Microstructure, Scene, path as keys};
use beamlet_core::{Error, Result, numbers};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Least distance of the last row, diameters, and the most that its distribution differs from that of independent
/// spheres.
const LEAST_REACH: f64 = 2.0;
const END: f64 = 0.1;
/// Largest distance, diameters, and distribution of a row: the sums of a table take time in proportion to the square of its
/// last distance, a second at this one.
const MOST_REACH: f64 = 100.0;
const MOST_PAIRS: f64 = 1000.0;
/// A structure factor below this, which rounding and noise do not explain, belongs to another fraction.
const LEAST_FACTOR: f64 = -0.2;
/// Largest wavenumber times the diameter, twice the `LAST` of losses, and points of it for each radian of the last row.
const LAST: f64 = 80.0;
const POINTS_PER_RADIAN: f64 = 10.0;
/// Largest interval of distance that three points of Gauss and Legendre integrate, diameters: 1.6 rad at `LAST`.
const PART: f64 = 0.02;
/// Places and weights of three points of Gauss and Legendre over a unit.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_31, 5.0 / 18.0),
    (0.5, 4.0 / 9.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

const TABLE: NumberTable<2> = NumberTable {
    noun: "pair distribution",
    columns: [Column { name: "r", may_be_zero: true }, Column { name: "g", may_be_zero: true }],
};

/// Rows of distance, diameters, and distribution; a distance that comes twice is a step.
fn read(path: &Path) -> Result<Vec<[f64; 2]>> {
    let follows = |rows: &[[f64; 2]], row: &[f64; 2]| {
        let [last, before] = [1, 2]
            .map(|back| rows.len().checked_sub(back).map_or(f64::NEG_INFINITY, |at| rows[at][0]));
        let falls = row[0] < last || (row[0] <= last && row[0] <= before);
        let fault = |column, allowed| Some(Fault { column, allowed });
        match row {
            _ if falls => fault(0, "distances in ascending order, each once, or twice at a step"),
            [r, g] if *r <= 0.0 && *g > 0.0 => fault(1, "0 at a distance of 0"),
            [r, _] if *r > MOST_REACH => fault(0, "distances up to 100 diameters"),
            [_, g] if *g > MOST_PAIRS => fault(1, "a number up to 1000"),
            _ => None,
        }
    };
    let ends = |rows: &[[f64; 2]]| {
        let fault = |column, allowed| Some(Fault { column, allowed });
        match rows.last() {
            Some([r, _]) if *r < LEAST_REACH => fault(0, "rows up to 2 diameters at least"),
            Some([_, g]) if (g - 1.0).abs() > END => {
                fault(1, "a last row within 0.1 of 1: rows up to where bodies are independent")
            }
            _ => None,
        }
    };
    TABLE.read(path, follows, ends)
}

/// Structure factor of spheres of one size by their pair distribution.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pairs {
    /// Its table, as the scene names it.
    pub(super) path: PathBuf,
    /// Distance of its last row, diameters: farther spheres are independent.
    pub(super) reach: f64,
    /// Structure factor at wavenumbers times the diameter, from 0 in steps of `step`.
    factors: Vec<f64>,
    step: f64,
}

impl Pairs {
    /// The table of a material of a scene; `None` where it has none.
    ///
    /// # Errors
    /// [`Error::File`] where it cannot be read; [`Error::Scene`] with line and column where it is no pair distribution,
    /// or with the key where it does not belong to the fraction.
    pub(super) fn of(scene: &Scene, name: &str, of: &Microstructure) -> Result<Option<Self>> {
        let Some(path) = &of.pair_distribution else { return Ok(None) };
        let rows = read(&scene.checked(path)?)?;
        let pairs = Self::new(path, &rows, of.fraction);
        let lowest = pairs.factors.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        match lowest {
            Some((at, factor)) if factor < LEAST_FACTOR => {
                let key = keys::join(&keys::join("materials", name), "microstructure");
                let found = format!(
                    "{}: with a fraction of {} a structure factor of {factor:.2} at {:.1} per diameter",
                    path.display(),
                    of.fraction,
                    at as f64 * pairs.step
                );
                let allowed = "a pair distribution of bodies of this fraction, whose structure factor is not below 0";
                Err(Error::scene(keys::join(&key, "pair_distribution"), found, allowed))
            }
            _ => Ok(Some(pairs)),
        }
    }

    /// From rows of distance (diameters) and distribution; `fraction`: of the volume.
    pub(super) fn new(path: &Path, rows: &[[f64; 2]], fraction: f64) -> Self {
        let reach = rows.last().map_or(0.0, |row| row[0]);
        let nodes = nodes(rows);
        let step = 1.0 / (POINTS_PER_RADIAN * reach.max(LEAST_REACH));
        let count: u32 = numbers::whole((LAST / step).ceil() + 2.0);
        let factor = |at: u32| {
            let x = step * f64::from(at);
            let sum: f64 = nodes
                .iter()
                .map(|[r, weight]| weight * r * if x > 0.0 { libm::sin(x * r) / x } else { *r })
                .sum();
            1.0 + 24.0 * fraction * sum
        };
        Self {
            path: path.to_owned(),
            reach,
            factors: (0..count).into_par_iter().map(factor).collect(),
            step,
        }
    }

    /// Structure factor. `x`: wavenumber times the diameter.
    pub(super) fn structure_factor(&self, x: f64) -> f64 {
        let place = (x / self.step).clamp(0.0, (self.factors.len() - 2) as f64);
        let low = numbers::whole::<usize>(place);
        let [a, b] = [self.factors[low], self.factors[low + 1]];
        a + (b - a) * (place - low as f64)
    }
}

/// Distances, diameters, and weights times g − 1, for sums over a table; nearer than its first row there are no pairs.
fn nodes(rows: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let Some(first) = rows.first() else { return Vec::new() };
    let core = [[0.0, 0.0], [first[0], 0.0]];
    std::iter::once(core)
        .chain(rows.windows(2).map(|pair| [pair[0], pair[1]]))
        .flat_map(|[[a, low], [b, high]]| {
            let parts: u32 = numbers::whole(((b - a) / PART).ceil());
            let width = (b - a) / f64::from(parts.max(1));
            (0..parts).flat_map(move |part| {
                GAUSS.map(|(at, weight)| {
                    let r = a + width * (f64::from(part) + at);
                    let g = low + (high - low) * (r - a) / (b - a);
                    [r, weight * width * (g - 1.0)]
                })
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::hard_spheres::HardSpheres;
    use super::*;
    use std::f64::consts::PI;

    /// Pair distribution of hard spheres by the transform of their structure factor, in steps of a fiftieth of a
    /// diameter up to eight; 0 within the diameter.
    fn table(fraction: f64) -> Vec<[f64; 2]> {
        let spheres = HardSpheres::new(fraction);
        let density = 6.0 * fraction / PI;
        // The factor falls as 1/x², so that the sum converges by a smooth end.
        const END: f64 = 1500.0;
        let points: Vec<[f64; 2]> = (0..60_000)
            .map(|at| {
                let x = END * (f64::from(at) + 0.5) / 60_000.0;
                let end = libm::exp(-8.0 * (x / END).powi(2));
                [x, (spheres.structure_factor(x) - 1.0) * x * end]
            })
            .collect();
        let g = |r: f64| {
            let sum: f64 = points.iter().map(|[x, part]| part * libm::sin(x * r)).sum();
            1.0 + sum * END / 60_000.0 / (2.0 * PI * PI * density * r)
        };
        (0..=350)
            .map(|at| 1.0 + 0.02 * f64::from(at))
            .map(|r| [r, g(r.max(1.004)).max(0.0)])
            .collect()
    }

    /// Rows of 0 within a diameter change nothing.
    #[test]
    fn tables_may_begin_at_no_distance() {
        let rows = table(0.3);
        let longer = [[[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]].as_slice(), &rows].concat();
        let [short, long] = [&rows, &longer].map(|rows| Pairs::new(Path::new("t.csv"), rows, 0.3));
        for x in [0.0, 0.5, 4.0, 7.0, 20.0] {
            let off = long.structure_factor(x) - short.structure_factor(x);
            assert!(off.abs() < 1e-9, "{x}: {off}");
        }
    }

    /// A table of the pair distribution of hard spheres has their structure factor.
    #[test]
    fn tables_have_the_structure_factor_of_their_spheres() {
        for fraction in [0.1, 0.3, 0.5] {
            let pairs = Pairs::new(Path::new("table.csv"), &table(fraction), fraction);
            let spheres = HardSpheres::new(fraction);
            for x in [0.5, 2.0, 4.0, 6.0, 7.0, 9.0, 13.0, 20.0, 40.0] {
                let off = pairs.structure_factor(x) - spheres.structure_factor(x);
                assert!(off.abs() < 0.03, "{fraction}, {x}: {off}");
            }
        }
    }
}
