//! Ideal images: the contrasts of a retrieval without noise, blur and bias.

mod columns;
mod coverage;
mod sums;

use crate::Engine;
use beamlet_core::numbers::{count, single, whole};
use beamlet_core::options::Need::{Default as Usual, Without};
use beamlet_core::options::{ABOVE_ZERO, Kind, Refusal, WHOLE};
use beamlet_core::random::GOLDEN;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::units::Dimension;
use beamlet_core::{Error, Result, options, parallel, reserve, setters};
use beamlet_files::GeometryFile;
use beamlet_interface::{FLAG_NOT_FINITE, Ray, RayResult};
use beamlet_model::optics::{Optics, modulated};
use beamlet_model::scene::Scene;
use beamlet_simulate::run::{Control, Simulation};
use beamlet_simulate::trace::Tracer;
use columns::{IdealColumns, half_period};
pub(crate) use coverage::coverage;
use ndarray::Array3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use sums::{PixelSums, RayLight};

/// Rays of a pixel to begin with, and by how much their number grows.
const FIRST_RAYS: usize = 64;
const GROWTH: usize = 4;
/// Rays that are on the host at once.
const RAYS_AT_ONCE: usize = 1 << 18;
/// Pixels that are sampled one with another.
const AT_ONCE: usize = RAYS_AT_ONCE / FIRST_RAYS;
/// The next such number after the golden ratio, 1/ρ with ρ³ = ρ + 1: an even order that is independent of the first.
const SECOND_GOLDEN: f64 = 0.754_877_666_246_692_7;

options! {
    /// How ideal images are made; what differs from the default is set in a chain.
    #[non_exhaustive]
    IdealOptions;
    reach: Option<f64> = REACH,
        Without("the angle that moves light by half a period of the sample mask; without a sample mask no bound"), [],
        "Largest refraction angle that counts in refraction and dark field, rad";
    tolerance: f64 = ABOVE_ZERO, Usual("1e-3"), [],
        "Standard error of the transmission below which a pixel gets no more rays";
    angle_tolerance: f64 = ABOVE_ZERO, Usual("3e-8"), [],
        "Standard error of the refraction and of the root of the dark field below which a pixel gets no more rays, rad";
    most_rays: usize = WHOLE, Usual("4096"), [], "Most rays of a pixel and view, at least 64";
}

/// An angle above 0, rad.
const REACH: Kind<f64> =
    Kind::new("ANGLE", "str | float", "a number above 0, rad, or text as \"30 urad\"", |given| {
        let angle = match given.text() {
            Some(text) => Dimension::Angle.parse(text)?,
            None => given.number().ok_or(Refusal::Form)?,
        };
        if angle > 0.0 { Ok(angle) } else { Err(Refusal::Form) }
    });

impl IdealOptions {
    setters! {
        /// Sets the largest refraction angle that counts, rad.
        with_reach(reach: impl Into<Option<f64>>);
        /// Sets the standard error of the transmission.
        with_tolerance(tolerance: f64);
        /// Sets the standard error of the angles, rad.
        with_angle_tolerance(angle_tolerance: f64);
        /// Sets the most rays of a pixel.
        with_most_rays(most_rays: usize);
    }

    fn check(&self) -> Result<()> {
        let positive = |name: &str, value: f64| match value > 0.0 {
            true => Ok(()),
            false => Err(Error::argument(name, value.to_string(), "a number above zero")),
        };
        self.reach.map_or(Ok(()), |reach| positive("reach", reach))?;
        positive("tolerance", self.tolerance)?;
        positive("angle_tolerance", self.angle_tolerance)?;
        if self.most_rays < FIRST_RAYS {
            let allowed = format!("at least {FIRST_RAYS}");
            return Err(Error::argument("most_rays", self.most_rays.to_string(), allowed));
        }
        Ok(())
    }
}

/// Ideal images of a scene.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct IdealImages {
    /// `transmission`, `refraction` (rad), `dark_field` (rad²) and the standard errors of sampling,
    /// `transmission_error` and so on, each `[view][row][column]` as retrieved images are. NaN where a
    /// pixel lies behind bars, or no light is within reach.
    pub images: BTreeMap<String, Array3<f32>>,
    /// Text of geometry.json.
    pub geometry: String,
    /// Largest refraction angle that counts, rad; infinite without a bound.
    pub reach: f64,
    /// Rays that were traced.
    pub rays: u64,
    /// Pixels whose errors exceed the tolerances with the most rays.
    pub beyond_tolerance: u64,
}

/// Images of a scene as an ideal set-up would show them: from the moments of the refraction angles of all
/// light that passes the aligned masks before a pixel (docs/retrieval.md, "Ideal images"). No focal spot, blur,
/// leak or noise counts.
///
/// # Errors
/// As [`Engine::prepare`]; [`Error::Argument`] for options that cannot be; [`Error::Interrupted`].
///
/// # Example
///
/// ```no_run
/// use beamlet::{Engine, EngineOptions, IdealOptions, RowsControl, ideal, scene::Scene};
///
/// let engine = Engine::open(&EngineOptions::default())?;
/// let scene = Scene::load("scene.toml")?;
/// let truth = ideal(&engine, &scene, &IdealOptions::default(), &mut RowsControl::default())?;
/// println!("{:?}", truth.images["dark_field"].dim());
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn ideal(
    engine: &Engine,
    scene: &Scene,
    options: &IdealOptions,
    control: &mut RowsControl<'_>,
) -> Result<IdealImages> {
    options.check()?;
    refuse_heights(scene)?;
    parallel::start_threads()?;
    let mut preparing = Control::default().with_cancel(control.cancel.clone());
    ideal_of(&engine.prepare_with(scene, &mut preparing)?, scene, options, control)
}

/// Rays of the pixels of ideal images: with one sample, scenes with the same rays have the same images.
#[derive(Debug, PartialEq)]
pub(crate) struct IdealRays {
    openings: Vec<Vec<[f64; 2]>>,
    /// Share of the modulated light of each energy node.
    weights: Vec<f64>,
    reach: f64,
}

impl IdealRays {
    /// Rays of a scene with the energy nodes of a simulation.
    ///
    /// # Errors
    /// The scene.
    pub(crate) fn of(scene: &Scene, simulation: &Simulation) -> Result<Self> {
        let media = simulation.media();
        let weights = modulated(scene, (&media.energies, &media.weights))?;
        let IdealColumns { openings, .. } = IdealColumns::of(scene)?;
        Ok(Self { openings, weights, reach: half_period(scene) })
    }
}

/// As [`ideal`], of a scene whose sample a simulation has; `options` are valid.
pub(crate) fn ideal_of(
    simulation: &Simulation,
    scene: &Scene,
    options: &IdealOptions,
    control: &mut RowsControl<'_>,
) -> Result<IdealImages> {
    let reach = options.reach.unwrap_or_else(|| half_period(scene));
    let mut tracer = simulation.tracer(&control.cancel)?;
    let media = simulation.media();
    let pixels = Pixels::of(scene, modulated(scene, (&media.energies, &media.weights))?)?;
    let total = pixels.count();
    let mut found: Vec<Found> = reserve::room(total, "ideal images")?;
    let mut beyond = 0;
    while found.len() < total {
        let mut part = vec![PixelSums::default(); (total - found.len()).min(AT_ONCE)];
        beyond += pixels.sample(&mut tracer, found.len(), &mut part, reach, options)?;
        found.extend(part.iter().map(|sums| [sums.contrasts(), sums.errors()].map(of_pixel)));
        if let Some(progress) = &mut control.progress {
            progress(found.len() as u64, total as u64);
        }
    }
    simulation.check_tally(&tracer.tally())?;
    Ok(IdealImages {
        images: pixels.images(&found)?,
        geometry: pixels.geometry()?,
        reach,
        rays: tracer.rays_traced(),
        beyond_tolerance: beyond,
    })
}

/// Refuses apertures that end along z.
fn refuse_heights(scene: &Scene) -> Result<()> {
    match scene.has_heights() {
        false => Ok(()),
        true => {
            let found = "apertures that end along z";
            Err(Error::scene("shape", found, "slits: ideal images average over columns"))
        }
    }
}

/// Contrasts of a pixel, and their errors.
type Found = [[f32; 3]; 2];

fn of_pixel(values: [f64; 3]) -> [f32; 3] {
    values.map(single)
}

/// Pixels of all views, `[view][row][column]`.
struct Pixels<'a> {
    scene: &'a Scene,
    optics: Optics,
    /// Share of the modulated light of each energy node.
    weights: Vec<f64>,
    columns: IdealColumns,
}

impl<'a> Pixels<'a> {
    /// Pixels of a scene whose energy nodes have these shares of the modulated light.
    fn of(scene: &'a Scene, weights: Vec<f64>) -> Result<Self> {
        let columns = IdealColumns::of(scene)?;
        Ok(Self { scene, optics: Optics::of(scene), weights, columns })
    }

    /// True if a pixel does not lie behind bars.
    fn is_open(&self, pixel: usize) -> bool {
        !self.columns.openings[pixel % self.columns.places.len()].is_empty()
    }

    fn rows(&self) -> usize {
        self.scene.detector.pixels[1] as usize
    }

    fn count(&self) -> usize {
        self.scene.scan.views() * self.rows() * self.columns.places.len()
    }

    /// Adds rays to pixels from `first` on until their errors are below the tolerances. Returns the number
    /// of pixels that stay above.
    fn sample(
        &self,
        tracer: &mut Tracer,
        first: usize,
        part: &mut [PixelSums],
        reach: f64,
        options: &IdealOptions,
    ) -> Result<u64> {
        let mut open: Vec<usize> = (0..part.len()).filter(|at| self.is_open(first + at)).collect();
        let mut rays = FIRST_RAYS;
        loop {
            for some in open.chunks((RAYS_AT_ONCE / rays).max(1)) {
                let found = self.trace(tracer, first, some, rays, reach)?;
                some.iter().zip(found).for_each(|(at, sums)| part[*at] = sums);
            }
            open.retain(|at| is_open(&part[*at], options));
            if open.is_empty() || rays * GROWTH > options.most_rays {
                return Ok(open.len() as u64);
            }
            rays *= GROWTH;
        }
    }

    /// Sums of `n` rays through each of some pixels.
    fn trace(
        &self,
        tracer: &mut Tracer,
        first: usize,
        some: &[usize],
        n: usize,
        reach: f64,
    ) -> Result<Vec<PixelSums>> {
        let rays: Vec<Ray> = some
            .par_iter()
            .flat_map_iter(|at| (0..n).map(move |number| self.ray(first + at, number, n)))
            .collect();
        let mut sums = vec![PixelSums::default(); some.len()];
        for (node, weight) in self.weights.iter().enumerate() {
            tracer.set_node((self.weights.len() > 1).then_some(node));
            let results = tracer.trace(&rays)?;
            let lever = self.optics.lever_arm;
            sums.par_iter_mut().zip(results.par_chunks(n)).for_each(|(sums, results)| {
                for (number, result) in results.iter().enumerate() {
                    if let Some(light) = light(result, *weight, lever) {
                        sums.add(number, &light, reach);
                    }
                }
            });
        }
        Ok(sums)
    }

    /// Ray of a pixel, `n` of which cover its openings evenly. Poses of a fly scan share them.
    fn ray(&self, pixel: usize, number: usize, n: usize) -> Ray {
        let across = self.columns.places.len();
        let (line, column) = (pixel / across, pixel % across);
        let (view, row) = (line / self.rows(), line % self.rows());
        let poses = self.scene.scan.poses_of_view();
        let place = (number as f64 + 0.5) / n as f64;
        let x = self.columns.at(column, place).unwrap_or_default();
        let down = row as f64 + ((number as f64 + 0.5) * GOLDEN).fract();
        let detector = &self.optics.detector;
        let slopes = [x / detector.distance, detector.slope_of_row(down)];
        let [at_x, at_z] = slopes.map(|slope| single(slope * self.optics.rotation));
        let [slope_x, slope_z] = slopes.map(single);
        // Few rays cover the whole sweep, and both halves of the sums by poses of their own.
        let share = (number as f64 * SECOND_GOLDEN + 0.5).fract();
        let own = whole::<usize>(share * poses as f64).min(poses - 1);
        let pose = count(view * poses + own);
        Ray { x: at_x, z: at_z, slope_x, slope_z, pose, key: 0 }
    }

    fn images(&self, found: &[Found]) -> Result<BTreeMap<String, Array3<f32>>> {
        let mut images = BTreeMap::new();
        for (at, name) in ["transmission", "refraction", "dark_field"].into_iter().enumerate() {
            for (kind, ending) in ["", "_error"].into_iter().enumerate() {
                images
                    .insert(format!("{name}{ending}"), self.image(|pixel| found[pixel][kind][at])?);
            }
        }
        Ok(images)
    }

    /// The image of values of the pixels.
    fn image(&self, value: impl Fn(usize) -> f32) -> Result<Array3<f32>> {
        let (rows, across) = (self.rows(), self.columns.places.len());
        let dithers = self.scene.scan.dithers_of_angle();
        let joined: Vec<[usize; 2]> = match &self.columns.joined {
            Some(joined) => joined.order().to_vec(),
            None => (0..across).map(|column| [column, 0]).collect(),
        };
        let shape = (self.scene.scan.angles.len(), rows, joined.len());
        let values = reserve::zeroed(shape.0 * shape.1 * shape.2, "ideal images")?;
        let mut image = Array3::from_shape_vec(shape, values)
            .map_err(|error| Error::argument("images", error.to_string(), "one shape"))?;
        for ((angle, row, to), to_value) in image.indexed_iter_mut() {
            let [column, dither] = joined[to];
            let line = (angle * dithers + dither) * rows + row;
            *to_value = value(line * across + column);
        }
        Ok(image)
    }

    fn geometry(&self) -> Result<String> {
        let mut scene = self.scene.clone();
        scene.scan.dithers.clear();
        let places = self.columns.places_of_images();
        GeometryFile::with_columns(&scene, places, scene.scan.angles.len()).text()
    }
}

/// True if errors of a pixel exceed the tolerances.
fn is_open(sums: &PixelSums, options: &IdealOptions) -> bool {
    let [_, mean, variance] = sums.contrasts();
    let [transmission, angle, dark] = sums.errors();
    let tolerance = options.angle_tolerance;
    // One half alone has light within reach.
    if angle.is_nan() && mean.is_finite() {
        return true;
    }
    // The root of the dark field is right to the tolerance, too.
    let of_variance = (variance.sqrt() + tolerance).powi(2) - variance;
    transmission > options.tolerance || angle > tolerance || dark > of_variance
}

/// Light of a ray, whose angle is that at the axis of rotation which moves light as far on the analyser.
fn light(result: &RayResult, weight: f64, lever: f64) -> Option<RayLight> {
    (result.flags & FLAG_NOT_FINITE == 0).then(|| RayLight {
        weight,
        transmission: (-f64::from(result.optical_depth)).exp(),
        angle: f64::from(result.displacement_x) / lever,
        variance: f64::from(result.displacement_variance) / (lever * lever),
    })
}
