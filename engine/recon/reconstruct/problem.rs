//! Weighted least squares of a volume, and the methods that solve them.

use super::data::Data;
use super::measured::Measured;
use super::model::Model;
use super::preconditioner::Preconditioner;
use super::solver::IterativeOptions;
use super::vectors::{change, dot};
use super::work::Work;
use beamlet_core::numbers::single;
use beamlet_core::{Error, Result};
use ndarray::Array3;

/// Least squares while they are solved. Arrays are `[view][row][column]` and `[z][y][x]`.
#[derive(Debug)]
pub(super) struct Problem<'a> {
    model: &'a Model,
    options: &'a IterativeOptions,
    /// Weights over `unit`.
    weights: Option<Array3<f32>>,
    /// Largest power of two up to the largest weight: weights in any unit are between 0 and 2 of it, and
    /// none is rounded.
    unit: f64,
    mask: Option<Array3<f32>>,
    filter: Option<Preconditioner>,
    /// Number of weights above zero.
    counted: f64,
    volume: Array3<f32>,
    /// Measured less projected.
    residual: Array3<f32>,
    best: (usize, Array3<f32>),
    residuals: Vec<f64>,
}

fn of(array: &Array3<f32>) -> &[f32] {
    array.as_slice().unwrap_or_default()
}

fn of_mut(array: &mut Array3<f32>) -> &mut [f32] {
    array.as_slice_mut().unwrap_or_default()
}

/// Divides weights by the largest power of two up to the largest of them, and returns it.
fn scale(weights: &mut Array3<f32>) -> f64 {
    let most = weights.iter().copied().fold(0.0, f32::max);
    let unit = libm::exp2(libm::log2(most.into()).floor());
    weights.mapv_inplace(|weight| single(f64::from(weight) / unit));
    unit
}

impl<'a> Problem<'a> {
    /// # Errors
    /// [`Error::Memory`].
    pub(super) fn new(
        model: &'a Model,
        measured: &Measured<'_>,
        options: &'a IterativeOptions,
    ) -> Result<Self> {
        let [x, y, z] = model.size();
        let mut weights = measured.weights.map(|weights| weights.as_standard_layout().into_owned());
        let unit = weights.as_mut().map_or(1.0, scale);
        let mask = measured.mask.map(|mask| mask.map(|may| f32::from(u8::from(*may))));
        let mut volume = match measured.start {
            Some(start) => start.as_standard_layout().into_owned(),
            None => Array3::zeros((z, y, x)),
        };
        if let Some(mask) = &mask {
            change(of_mut(&mut volume), of(mask), |value, may| value * may);
        }
        if options.is_non_negative {
            volume.mapv_inplace(|value| value.max(0.0));
        }
        let mut residual = measured.sinograms.as_standard_layout().into_owned();
        let counted = match &weights {
            Some(weights) => {
                let known = |value: f32, weight: f32| if weight > 0.0 { value } else { 0.0 };
                change(of_mut(&mut residual), of(weights), known);
                weights.iter().filter(|weight| **weight > 0.0).count()
            }
            None => residual.len(),
        };
        let filter = (measured.data == Data::Refraction).then(|| Preconditioner::new([x, y]));
        Ok(Self {
            model,
            options,
            weights,
            unit,
            mask,
            filter,
            counted: counted as f64,
            best: (0, volume.clone()),
            volume,
            residual,
            residuals: Vec::new(),
        })
    }

    /// The best volume, all residuals, and the number of the volume among them.
    pub(super) fn finish(self) -> (Array3<f32>, Vec<f64>, usize) {
        (self.best.1, self.residuals, self.best.0)
    }

    /// Takes the projections of the start off the measured values.
    fn begin(&mut self, work: &mut Work<'_>) -> Result<()> {
        if self.volume.iter().any(|value| *value != 0.0) {
            let projected = self.model.forward(self.volume.view(), work)?;
            change(of_mut(&mut self.residual), of(&projected), |r, p| r - p);
        }
        self.note().map(drop)
    }

    /// Sum of the products of two sinograms, weighted.
    fn product(&self, a: &Array3<f32>, b: &Array3<f32>) -> f64 {
        match &self.weights {
            None => dot(of(a), of(b)),
            Some(weights) => {
                let mut weighted = a.clone();
                change(of_mut(&mut weighted), of(weights), |a, w| a * w);
                dot(of(&weighted), of(b))
            }
        }
    }

    /// Notes the residual of the volume; true where iterations end.
    ///
    /// # Errors
    /// [`Error::Argument`] for a residual that is not finite.
    fn note(&mut self) -> Result<bool> {
        let squares = self.unit * self.product(&self.residual, &self.residual);
        let now = (squares / self.counted).sqrt();
        self.refuse_infinite("residual", now)?;
        if self.residuals.iter().all(|earlier| now < *earlier) && !self.residuals.is_empty() {
            self.best.0 = self.residuals.len();
            self.best.1.assign(&self.volume);
        }
        self.residuals.push(now);
        Ok(self.options.discrepancy.is_some_and(|bound| now <= bound))
    }

    /// The negative gradient, and its filtered form.
    fn descent(&self, work: &mut Work<'_>) -> Result<(Array3<f32>, Array3<f32>)> {
        let mut gradient = match &self.weights {
            None => self.model.back(self.residual.view(), work)?,
            Some(weights) => {
                let mut weighted = self.residual.clone();
                change(of_mut(&mut weighted), of(weights), |r, w| r * w);
                self.model.back(weighted.view(), work)?
            }
        };
        self.masked(&mut gradient);
        let mut filtered = gradient.clone();
        if let Some(filter) = &self.filter {
            filter.apply(&mut filtered, &work.cancel)?;
            self.masked(&mut filtered);
        }
        Ok((gradient, filtered))
    }

    fn masked(&self, volume: &mut Array3<f32>) {
        if let Some(mask) = &self.mask {
            change(of_mut(volume), of(mask), |value, may| value * may);
        }
    }

    /// A part of the n-th iteration, as shares of all of them.
    fn part(&self, n: usize, shares: [f64; 2]) -> [f64; 2] {
        shares.map(|share| (n as f64 + share) / self.options.iterations as f64)
    }

    /// # Errors
    /// [`Error::Argument`] for a residual or gradient that is not finite.
    fn refuse_infinite(&self, what: &str, value: f64) -> Result<()> {
        if value.is_finite() {
            return Ok(());
        }
        let found =
            format!("values with a {what} of {value} in iteration {}", self.residuals.len());
        let allowed =
            "values and a start whose projections and their sums are finite 32-bit numbers";
        Err(Error::argument("sinograms", found, allowed))
    }

    /// # Errors
    /// [`Error::Argument`] if no weighted ray passes a voxel, but there is something to explain, or the
    /// gradient is not finite.
    fn met(&self, descent: f64) -> Result<()> {
        self.refuse_infinite("gradient", descent)?;
        if descent > 0.0 || self.residuals[0] <= 0.0 {
            return Ok(());
        }
        let found = "no weighted ray through any voxel";
        Err(Error::argument("grid", found, "voxels in the beam of some views"))
    }

    /// Conjugate gradients.
    pub(super) fn cgls(&mut self, work: &mut Work<'_>) -> Result<()> {
        self.begin(work)?;
        let (gradient, mut direction) = self.descent(work)?;
        let mut size = dot(of(&gradient), of(&direction));
        drop(gradient);
        self.met(size)?;
        for n in 0..self.options.iterations {
            let projected = work.stage(self.part(n, [0.0, 0.5]), |work| {
                self.model.forward(direction.view(), work)
            })?;
            let curvature = self.product(&projected, &projected);
            if size <= 0.0 || curvature <= 0.0 {
                break;
            }
            let step = single(size / curvature);
            change(of_mut(&mut self.volume), of(&direction), |x, p| x + step * p);
            change(of_mut(&mut self.residual), of(&projected), |r, q| r - step * q);
            if self.note()? || n + 1 == self.options.iterations {
                break;
            }
            let (gradient, filtered) =
                work.stage(self.part(n, [0.5, 1.0]), |work| self.descent(work))?;
            let before = std::mem::replace(&mut size, dot(of(&gradient), of(&filtered)));
            let share = single(size / before);
            change(of_mut(&mut direction), of(&filtered), |p, z| z + share * p);
        }
        Ok(())
    }

    /// Sets voxels below zero to zero, with that option.
    fn bounded(&self, volume: &mut Array3<f32>) {
        if self.options.is_non_negative {
            volume.mapv_inplace(|value| value.max(0.0));
        }
    }

    /// Moves to a volume, with a projection.
    fn move_to(&mut self, volume: Array3<f32>, work: &mut Work<'_>, n: usize) -> Result<bool> {
        let mut moved = volume.clone();
        change(of_mut(&mut moved), of(&self.volume), |new, old| new - old);
        let projected =
            work.stage(self.part(n, [0.5, 1.0]), |work| self.model.forward(moved.view(), work))?;
        change(of_mut(&mut self.residual), of(&projected), |r, q| r - q);
        self.volume = volume;
        self.note()
    }

    /// Gradient descent with steps of Barzilai and Borwein.
    pub(super) fn bb(&mut self, work: &mut Work<'_>) -> Result<()> {
        self.begin(work)?;
        let mut before: Option<[Array3<f32>; 3]> = None;
        let mut step = 0.0;
        for n in 0..self.options.iterations {
            let (gradient, filtered) =
                work.stage(self.part(n, [0.0, 0.5]), |work| self.descent(work))?;
            let size = dot(of(&gradient), of(&filtered));
            self.met(size)?;
            step = match &before {
                // The step to the least residual along the gradient.
                None => {
                    let projected = self.model.forward(filtered.view(), work)?;
                    let curvature = self.product(&projected, &projected);
                    if curvature > 0.0 { size / curvature } else { 0.0 }
                }
                Some([volume, old, old_filtered]) => {
                    let mut moved = self.volume.clone();
                    change(of_mut(&mut moved), of(volume), |new, old| new - old);
                    let mut fall = old.clone();
                    change(of_mut(&mut fall), of(&gradient), |old, new| old - new);
                    let along = dot(of(&moved), of(&fall));
                    let next = if self.filter.is_none() {
                        dot(of(&moved), of(&moved)) / along
                    } else {
                        let filtered_fall =
                            dot(of(old_filtered), of(&fall)) - dot(of(&filtered), of(&fall));
                        along / filtered_fall
                    };
                    if next.is_finite() && next > 0.0 { next } else { step }
                }
            };
            let mut volume = self.volume.clone();
            let length = single(step);
            change(of_mut(&mut volume), of(&filtered), |x, z| x + length * z);
            self.bounded(&mut volume);
            before = Some([self.volume.clone(), gradient, filtered]);
            if step <= 0.0 || self.move_to(volume, work, n)? {
                break;
            }
        }
        Ok(())
    }

    /// Residuals over the sums of coefficients of their rays, and over the sums of voxels.
    pub(super) fn sirt(&mut self, work: &mut Work<'_>) -> Result<()> {
        self.begin(work)?;
        let mut ones = Array3::ones(self.volume.dim());
        self.masked(&mut ones);
        let mut per_ray = self.model.forward(ones.view(), work)?;
        let most = per_ray.iter().copied().fold(0.0, f32::max);
        // Rays that touch a corner alone count for nothing.
        let inverse = |sum: f32, most: f32| if sum > 1e-6 * most { 1.0 / sum } else { 0.0 };
        let mut counted = match &self.weights {
            Some(weights) => weights.clone(),
            None => Array3::ones(self.residual.dim()),
        };
        change(
            of_mut(&mut counted),
            of(&per_ray),
            |w, sum| if sum > 1e-6 * most { w } else { 0.0 },
        );
        let mut per_voxel = self.model.back(counted.view(), work)?;
        let largest = per_voxel.iter().copied().fold(0.0, f32::max);
        self.met(f64::from(most.min(largest)))?;
        change(of_mut(&mut per_ray), of(&counted), |sum, w| w * inverse(sum, most));
        per_voxel.mapv_inplace(|sum| inverse(sum, largest));
        self.masked(&mut per_voxel);
        for n in 0..self.options.iterations {
            let mut scaled = self.residual.clone();
            change(of_mut(&mut scaled), of(&per_ray), |r, per| r * per);
            let mut volume =
                work.stage(self.part(n, [0.0, 0.5]), |work| self.model.back(scaled.view(), work))?;
            change(of_mut(&mut volume), of(&per_voxel), |step, per| step * per);
            change(of_mut(&mut volume), of(&self.volume), |step, x| x + step);
            self.bounded(&mut volume);
            if self.move_to(volume, work, n)? {
                break;
            }
        }
        Ok(())
    }
}
