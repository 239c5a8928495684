//! Weighted least squares of a volume, and the methods that solve them.

use super::data::Data;
use super::measured::Measured;
use super::model::Model;
use super::preconditioner::Preconditioner;
use super::sinograms::Sinograms;
use super::solver::IterativeOptions;
use super::vectors::{Dot, Vector, Vectors};
use super::work::Work;
use beamlet_core::numbers::single;
use beamlet_core::{Error, Result, reserve};
use ndarray::Array3;

/// Least squares while they are solved.
#[derive(Debug)]
pub(super) struct Problem<'a> {
    model: Sinograms<'a>,
    options: &'a IterativeOptions,
    vectors: Vectors,
    /// Weights over `unit`.
    weights: Option<Vector>,
    /// Largest power of two up to the largest weight: weights in any unit are between 0 and 2 of it, and
    /// none is rounded.
    unit: f64,
    mask: Option<Vector>,
    filter: Option<Preconditioner>,
    /// Number of weights above zero.
    counted: f64,
    volume: Vector,
    /// Measured less projected.
    residual: Vector,
    projected: Vector,
    best: (usize, Vector),
    /// The volume to begin with is not zero.
    has_start: bool,
    residuals: Vec<f64>,
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
    /// [`Error::Memory`], [`Error::Device`].
    pub(super) fn new(
        model: &'a Model,
        measured: &Measured<'_>,
        options: &'a IterativeOptions,
    ) -> Result<Self> {
        let [x, y, z] = model.size();
        let (views, rows, columns) = measured.sinograms.dim();
        let [voxels, values] = [x * y * z, views * rows * columns];
        let device = model.projector().device();
        let mut vectors = Vectors::new(device, voxels.max(values))?;
        let mut unit = 1.0;
        let mut counted = values;
        let given = measured.sinograms.as_standard_layout();
        let residual = vectors.with(given.as_slice().unwrap_or_default(), "residuals")?;
        let mut weights = None;
        if let Some(given) = measured.weights {
            let mut own = given.as_standard_layout().into_owned();
            unit = scale(&mut own);
            counted = own.iter().filter(|weight| **weight > 0.0).count();
            let own = vectors.with(own.as_slice().unwrap_or_default(), "weights")?;
            vectors.keep_where(&residual, &own, 0.0);
            weights = Some(own);
        }
        let mut mask = None;
        if let Some(given) = measured.mask {
            let own: Vec<f32> = given.iter().map(|may| f32::from(u8::from(*may))).collect();
            mask = Some(vectors.with(&own, "a mask of voxels")?);
        }
        let volume = vectors.vector(voxels, "a volume")?;
        match measured.start.as_ref().map(|start| start.as_standard_layout()) {
            Some(start) => volume.write(0, start.as_slice().unwrap_or_default())?,
            None => vectors.fill(&volume, 0.0),
        }
        if let Some(mask) = &mask {
            vectors.multiply(&volume, mask);
        }
        if options.is_non_negative {
            vectors.bound(&volume);
        }
        let best = vectors.vector(voxels, "the best volume")?;
        vectors.copy(&best, &volume);
        let is_filtered = measured.data == Data::Refraction;
        let filter = is_filtered.then(|| Preconditioner::new(device, model.size())).transpose()?;
        Ok(Self {
            model: Sinograms::new(model)?,
            options,
            weights,
            unit,
            mask,
            filter,
            counted: counted as f64,
            best: (0, best),
            volume,
            residual,
            projected: vectors.vector(values, "projections")?,
            has_start: measured.start.is_some_and(|start| start.iter().any(|value| *value != 0.0)),
            residuals: Vec::new(),
            vectors,
        })
    }

    /// The best volume, all residuals, and the number of the volume among them.
    ///
    /// # Errors
    /// [`Error::Memory`], [`Error::Device`].
    pub(super) fn finish(mut self, shape: [usize; 3]) -> Result<(Array3<f32>, Vec<f64>, usize)> {
        let mut values = reserve::zeroed(shape.iter().product(), "a volume")?;
        self.vectors.stream.submit(&mut [])?;
        self.best.1.read_into(0, &mut values)?;
        let shape = (shape[2], shape[1], shape[0]);
        let values = Array3::from_shape_vec(shape, values).unwrap_or_else(|_| Array3::zeros(shape));
        Ok((values, self.residuals, self.best.0))
    }

    /// A volume more, of undefined values.
    fn another(&self) -> Result<Vector> {
        self.vectors.vector(self.model.voxels(), "a volume")
    }

    /// Takes the projections of the start off the measured values.
    fn begin(&mut self, work: &mut Work<'_>) -> Result<()> {
        if self.has_start {
            self.model.project(&self.volume, &self.projected, &mut self.vectors, work)?;
            self.vectors.sum(&self.residual, &self.residual, (-1.0, &self.projected));
        }
        self.note().map(drop)
    }

    /// Notes the residual of the volume; true where iterations end.
    ///
    /// # Errors
    /// [`Error::Argument`] for a residual that is not finite.
    fn note(&mut self) -> Result<bool> {
        self.vectors.dot(&self.residual, &self.residual, self.weights.as_ref());
        let [squares] = self.vectors.dots()?;
        let now = (self.unit * squares.sum / self.counted).sqrt();
        self.refuse_infinite("residual", now)?;
        if self.residuals.iter().all(|earlier| now < *earlier) && !self.residuals.is_empty() {
            self.best.0 = self.residuals.len();
            self.vectors.copy(&self.best.1, &self.volume);
        }
        self.residuals.push(now);
        Ok(self.options.discrepancy.is_some_and(|bound| now <= bound))
    }

    /// Square of projections, weighted.
    fn curvature(&mut self) -> Result<f64> {
        self.vectors.dot(&self.projected, &self.projected, self.weights.as_ref());
        let [squares] = self.vectors.dots()?;
        Ok(squares.sum)
    }

    /// The negative gradient, and its filtered form where there is a filter.
    fn descend(
        &mut self,
        gradient: &Vector,
        filtered: Option<&Vector>,
        work: &mut Work<'_>,
    ) -> Result<()> {
        let residual = (&self.residual, self.weights.as_ref());
        self.model.gather(residual, gradient, &mut self.vectors, work)?;
        self.masked(gradient);
        if let (Some(filter), Some(filtered)) = (&self.filter, filtered) {
            filter.apply(gradient, filtered, &mut self.vectors, &work.cancel)?;
            self.masked(filtered);
        }
        Ok(())
    }

    fn masked(&mut self, volume: &Vector) {
        if let Some(mask) = &self.mask {
            self.vectors.multiply(volume, mask);
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
        let (gradient, direction) = (self.another()?, self.another()?);
        let own = self.filter.is_some().then(|| self.another()).transpose()?;
        self.begin(work)?;
        self.descend(&gradient, own.as_ref(), work)?;
        let filtered = own.as_ref().unwrap_or(&gradient);
        self.vectors.copy(&direction, filtered);
        self.vectors.dot(&gradient, filtered, None);
        let [Dot { sum: mut size, .. }] = self.vectors.dots()?;
        self.met(size)?;
        for n in 0..self.options.iterations {
            work.stage(self.part(n, [0.0, 0.5]), |work| {
                self.model.project(&direction, &self.projected, &mut self.vectors, work)
            })?;
            let curvature = self.curvature()?;
            if size <= 0.0 || curvature <= 0.0 {
                break;
            }
            let step = single(size / curvature);
            self.vectors.sum(&self.volume, &self.volume, (step, &direction));
            self.vectors.sum(&self.residual, &self.residual, (-step, &self.projected));
            if self.note()? || n + 1 == self.options.iterations {
                break;
            }
            work.stage(self.part(n, [0.5, 1.0]), |work| {
                self.descend(&gradient, own.as_ref(), work)
            })?;
            let filtered = own.as_ref().unwrap_or(&gradient);
            self.vectors.dot(&gradient, filtered, None);
            let [now] = self.vectors.dots()?;
            let before = std::mem::replace(&mut size, now.sum);
            self.vectors.sum(&direction, filtered, (single(size / before), &direction));
        }
        Ok(())
    }

    /// Sets voxels below zero to zero, with that option.
    fn bounded(&mut self, volume: &Vector) {
        if self.options.is_non_negative {
            self.vectors.bound(volume);
        }
    }

    /// Moves to a volume, with a projection, and leaves the change in its place.
    fn move_to(&mut self, volume: &mut Vector, work: &mut Work<'_>, n: usize) -> Result<bool> {
        std::mem::swap(&mut self.volume, volume);
        self.vectors.sum(volume, &self.volume, (-1.0, volume));
        work.stage(self.part(n, [0.5, 1.0]), |work| {
            self.model.project(volume, &self.projected, &mut self.vectors, work)
        })?;
        self.vectors.sum(&self.residual, &self.residual, (-1.0, &self.projected));
        self.note()
    }

    /// Gradient descent with steps of Barzilai and Borwein.
    pub(super) fn bb(&mut self, work: &mut Work<'_>) -> Result<()> {
        let (mut moved, mut gradient, mut old) =
            (self.another()?, self.another()?, self.another()?);
        let is_filtered = self.filter.is_some();
        let mut own = if is_filtered { Some([self.another()?, self.another()?]) } else { None };
        self.begin(work)?;
        let mut step = 0.0;
        for n in 0..self.options.iterations {
            work.stage(self.part(n, [0.0, 0.5]), |work| {
                self.descend(&gradient, own.as_ref().map(|[own, _]| own), work)
            })?;
            let filtered = own.as_ref().map_or(&gradient, |[own, _]| own);
            self.vectors.dot(&gradient, filtered, None);
            if n == 0 {
                let [size] = self.vectors.dots()?;
                self.met(size.sum)?;
                // The step to the least residual along the gradient.
                work.stage(self.part(n, [0.5, 0.5]), |work| {
                    self.model.project(filtered, &self.projected, &mut self.vectors, work)
                })?;
                let curvature = self.curvature()?;
                step = if curvature > 0.0 { size.sum / curvature } else { 0.0 };
            } else {
                // The fall of the gradient.
                self.vectors.sum(&old, &old, (-1.0, &gradient));
                self.vectors.dot(&moved, &old, None);
                let [a, b] = match &own {
                    Some([own, own_old]) => [own_old, own].map(|own| (own, &old)),
                    None => [(&moved, &moved); 2],
                };
                self.vectors.dot(a.0, a.1, None);
                if is_filtered {
                    self.vectors.dot(b.0, b.1, None);
                }
                let [size, along, first, second] = self.vectors.dots()?.map(|dot| dot.sum);
                self.met(size)?;
                let next = if is_filtered { along / (first - second) } else { first / along };
                step = if next.is_finite() && next > 0.0 { next } else { step };
            }
            if step <= 0.0 {
                break;
            }
            self.vectors.sum(&moved, &self.volume, (single(step), filtered));
            self.bounded(&moved);
            if self.move_to(&mut moved, work, n)? {
                break;
            }
            std::mem::swap(&mut old, &mut gradient);
            if let Some(own) = &mut own {
                own.swap(0, 1);
            }
        }
        Ok(())
    }

    /// Residuals over the sums of coefficients of their rays, and over the sums of voxels.
    pub(super) fn sirt(&mut self, work: &mut Work<'_>) -> Result<()> {
        let (mut moved, per_voxel) = (self.another()?, self.another()?);
        let per_ray = self.vectors.vector(self.model.values(), "sinograms")?;
        self.begin(work)?;
        self.vectors.fill(&moved, 1.0);
        self.masked(&moved);
        self.model.project(&moved, &per_ray, &mut self.vectors, work)?;
        self.vectors.dot(&per_ray, &per_ray, None);
        let [Dot { most, .. }] = self.vectors.dots()?;
        // Rays that touch a corner alone count for nothing.
        let least = |most: f32| 1e-6 * most;
        match &self.weights {
            Some(weights) => self.vectors.copy(&self.projected, weights),
            None => self.vectors.fill(&self.projected, 1.0),
        }
        self.vectors.keep_where(&self.projected, &per_ray, least(most));
        self.model.gather((&self.projected, None), &per_voxel, &mut self.vectors, work)?;
        self.vectors.dot(&per_voxel, &per_voxel, None);
        let [Dot { most: largest, .. }] = self.vectors.dots()?;
        self.met(f64::from(most.min(largest)))?;
        self.vectors.invert(&per_ray, least(most));
        self.vectors.multiply(&per_ray, &self.projected);
        self.vectors.invert(&per_voxel, least(largest));
        self.masked(&per_voxel);
        for n in 0..self.options.iterations {
            work.stage(self.part(n, [0.0, 0.5]), |work| {
                let scaled = (&self.residual, Some(&per_ray));
                self.model.gather(scaled, &moved, &mut self.vectors, work)
            })?;
            self.vectors.multiply(&moved, &per_voxel);
            self.vectors.sum(&moved, &self.volume, (1.0, &moved));
            self.bounded(&moved);
            if self.move_to(&mut moved, work, n)? {
                break;
            }
        }
        Ok(())
    }
}
