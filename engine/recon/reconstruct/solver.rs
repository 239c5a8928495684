//! Iterative methods and their options.

use super::data::Data;
use beamlet_core::{Error, Result, setters};
use serde::Serialize;

/// How the squares of weighted residuals are made small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Solver {
    /// Conjugate gradients of the normal equations: the fewest iterations; no bounds.
    #[default]
    Cgls,
    /// Simultaneous iterative reconstruction: residuals over the sums of rows and columns.
    Sirt,
    /// Gradient descent with the steps of Barzilai and Borwein. Residuals do not fall at each step.
    Bb,
}

impl Solver {
    /// Name on the command line and in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cgls => "cgls",
            Self::Sirt => "sirt",
            Self::Bb => "bb",
        }
    }
}

/// How volumes are iterated; what differs from the default is set in a chain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct IterativeOptions {
    /// The method.
    #[serde(skip)]
    pub solver: Solver,
    /// Most iterations, at least 1.
    pub iterations: usize,
    /// Root mean square of the weighted residuals at which iterations end: 1 where the weights are one
    /// over the variances; in the unit of the sinograms without weights.
    pub discrepancy: Option<f64>,
    /// Voxels below zero are set to zero in each iteration.
    #[serde(rename = "non_negative")]
    pub is_non_negative: bool,
}

impl Default for IterativeOptions {
    fn default() -> Self {
        let (solver, iterations) = (Solver::default(), 20);
        Self { solver, iterations, discrepancy: None, is_non_negative: false }
    }
}

impl IterativeOptions {
    setters! {
        /// Chooses the method.
        with_solver(solver: Solver);
        /// Sets the most iterations.
        with_iterations(iterations: usize);
        /// Sets the residual at which iterations end.
        with_discrepancy(discrepancy: impl Into<Option<f64>>);
        /// Keeps voxels at or above zero.
        with_non_negative(is_non_negative: bool);
    }
}

impl IterativeOptions {
    /// # Errors
    /// [`Error::Argument`] for options that cannot be, and methods that do not fit the data.
    pub(super) fn check(&self, data: Data) -> Result<()> {
        let options = self;
        let wrong =
            |name: &str, found: &str, allowed: &str| Err(Error::argument(name, found, allowed));
        if data == Data::Refraction && options.solver == Solver::Sirt {
            let allowed = "cgls or bb, or sirt for integrated phase: SIRT divides by the sums of \
                           coefficients along rays, which are zero for derivatives";
            return wrong("method", "sirt for refraction angles", allowed);
        }
        if options.is_non_negative && options.solver == Solver::Cgls {
            let allowed = "sirt or bb: conjugate gradients have no bounds";
            return wrong("method", "cgls with voxels at or above zero", allowed);
        }
        if options.iterations == 0 {
            return wrong("iterations", "0", "1 or more");
        }
        match options.discrepancy {
            Some(bound) if !(bound.is_finite() && bound > 0.0) => {
                wrong("discrepancy", &bound.to_string(), "a number above zero")
            }
            _ => Ok(()),
        }
    }
}
