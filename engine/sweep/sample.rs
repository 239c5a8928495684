//! Scores at the sample of a design: its first view is simulated without noise, retrieved, and compared with ideal images.

use super::score::{Measure, SampleScore};
use crate::ideal::{IdealRays, coverage, ideal_of};
use crate::{Engine, IdealOptions, check};
use beamlet_core::{Cancel, Error, Result, RowsControl, numbers};
use beamlet_files::{ArraySink, StackFile, Stacks};
use beamlet_model::scene::{Blur, Scan, Scene};
use beamlet_recon::retrieve::{Input, RetrieveOptions, retrieve_arrays};
use beamlet_simulate::run::simulation::designs::light;
use beamlet_simulate::run::{Control, Progress, Simulation};
use ndarray::{Array3, Array4, Axis, s};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Least share of the straight rays of a pixel through an object of which it is a pixel.
const HALF: f32 = 0.5;
/// Standard errors of the ideal images that scores are compared with: of the transmission, and of the angle, rad.
const TRUTH: [f64; 2] = [1e-4, 3e-9];

/// Pixels around the sample in the simulated part of the detector, on each side.
const MARGIN: usize = 16;
/// The same of a blur, in its standard deviations.
const BLUR_MARGIN: f64 = 5.0;

/// Images by name, `[view][row][column]`.
type Images = BTreeMap<String, Array3<f32>>;

/// Light of the first view of a design without noise, and what scores compare it with.
#[derive(Debug)]
pub(super) struct SampleLight {
    /// The scene of the part of the detector that is simulated.
    part: Scene,
    flat: Arc<Array4<f32>>,
    sample: Arc<Array4<f32>>,
    reference: Arc<Reference>,
}

/// Least distance of pixels beside the sample from those that it touches, pixels: refraction at a rim lights the nearest.
const BESIDE: usize = 2;

/// Ideal images and pixels of objects that scores take.
#[derive(Debug)]
struct Reference {
    /// Ideal images; empty where no score needs them.
    truth: Images,
    shares: Shares,
}

/// The scene of the first view of a design, without what does not change its light.
pub(super) fn first_view(scene: &Scene) -> Scene {
    let mut one = scene.clone();
    check::remove_counts(&mut one);
    let scan = &mut one.scan;
    scan.angles.truncate(1);
    scan.motions.truncate(1);
    scan.view_offsets.truncate(1);
    (scan.flats_every, scan.darks_every) = (None, None);
    scan.errors = Scan::default().errors;
    // An audit changes no light.
    one.sampling.audit = 0.0;
    one
}

/// Columns and rows at each end of the detector that scores do not need: beyond the sample, by its share of the rays of
/// each pixel, and a margin. None where light comes from far away, or images have other columns than the detector.
fn trim(scene: &Scene, any: &Array3<f32>) -> [usize; 2] {
    let (_, rows, columns) = any.dim();
    let detector = &scene.detector;
    let blur = match &detector.blur {
        None => [0.0; 2],
        Some(Blur::Gaussian { sigma }) => *sigma,
        Some(Blur::Kernel(_)) => return [0; 2],
    };
    let is_whole = detector.pixels == [columns, rows].map(numbers::count) && scene.group() == 1;
    if !is_whole || detector.scatter.is_some() {
        return [0; 2];
    }
    let mut outer = [columns, rows];
    for ((_, row, column), _) in any.indexed_iter().filter(|(_, share)| **share > 0.0) {
        outer[0] = outer[0].min(column).min(columns - 1 - column);
        outer[1] = outer[1].min(row).min(rows - 1 - row);
    }
    let all = [columns, rows];
    [0, 1].map(|axis| {
        let blur = (BLUR_MARGIN * blur[axis] / detector.pitch[axis]).ceil();
        let margin = MARGIN + numbers::whole::<usize>(blur);
        // Without a sample in view nothing is needed, and nothing is left out.
        if outer[axis] == all[axis] { 0 } else { outer[axis].saturating_sub(margin) }
    })
}

/// Scenes of [`first_view`] whose light is computed together.
#[derive(Debug)]
pub(super) struct LightGroup {
    pub(super) scenes: Vec<Scene>,
    /// True if their light is that of one walk; else there is one scene.
    pub(super) is_walked: bool,
}

impl LightGroup {
    /// The light of each scene.
    ///
    /// # Errors
    /// As [`Engine::run`] and [`ideal`](crate::ideal); [`Error::Scene`] for an object that a scene has not.
    pub(super) fn light(
        &self,
        engine: &Engine,
        scores: &[&SampleScore],
        cancel: &Cancel,
        report: &mut dyn FnMut(f64),
    ) -> Result<Vec<SampleLight>> {
        let Some(first) = self.scenes.first() else { return Ok(Vec::new()) };
        let mut preparing = Control::default().with_cancel(cancel.clone());
        let lead = engine.prepare_with(first, &mut preparing)?;
        let rays = self.scenes.iter().map(|scene| IdealRays::of(scene, &lead));
        let rays = rays.collect::<Result<Vec<_>>>()?;
        // Place of the first scene with the same rays.
        let alike = |own: &IdealRays| rays.iter().position(|known| known == own).unwrap_or(0);
        let alike: Vec<usize> = rays.iter().map(alike).collect();
        let mut shares = BTreeMap::new();
        for place in &alike {
            if !shares.contains_key(place) {
                shares.insert(*place, Shares::of(&lead, &self.scenes[*place], scores, cancel)?);
            }
        }
        let of_scene = |(scene, place)| trim(scene, &shares[place].any);
        let unneeded = self.scenes.iter().zip(&alike).map(of_scene);
        let unneeded = unneeded.reduce(|[a, b], [c, d]| [a.min(c), b.min(d)]).unwrap_or([0; 2]);
        let parts: Vec<Scene> = self.scenes.iter().map(|scene| cut(scene, unneeded)).collect();
        let stacks = self.stacks(engine, &lead, &parts, cancel, report)?;
        let mut references = BTreeMap::new();
        for (place, shares) in shares {
            let reference =
                Reference::of(&lead, &parts[place], shares.cut(unneeded), scores, cancel)?;
            references.insert(place, Arc::new(reference));
        }
        let lit = parts.into_iter().zip(stacks).zip(alike);
        let of_scene = |((part, stacks), place): ((Scene, Stacks), usize)| SampleLight {
            part,
            flat: Arc::new(stacks.flat.insert_axis(Axis(0))),
            sample: Arc::new(stacks.sample),
            reference: Arc::clone(&references[&place]),
        };
        Ok(lit.map(of_scene).collect())
    }

    /// Stacks of the scenes of a part of the detector. `lead` has their sample.
    fn stacks(
        &self,
        engine: &Engine,
        lead: &Simulation,
        parts: &[Scene],
        cancel: &Cancel,
        report: &mut dyn FnMut(f64),
    ) -> Result<Vec<Stacks>> {
        let mut progress = |progress| {
            if let Progress::Views(views) = progress {
                report(views.share);
            }
        };
        let control = Control::default().with_cancel(cancel.clone()).with_progress(&mut progress);
        if self.is_walked {
            return light(&lead.of_designs(parts, cancel)?, control);
        }
        let mut sink = ArraySink::new();
        engine.run(&parts[0], &mut sink, control)?;
        Ok(vec![sink.into_stacks().ok_or(Error::Interrupted)?])
    }
}

/// Shares of the straight rays of each pixel.
#[derive(Debug)]
struct Shares {
    /// Through any object.
    any: Array3<f32>,
    /// Through an object, by its name.
    objects: BTreeMap<String, Array3<f32>>,
}

impl Shares {
    /// Those of the objects of scores.
    fn of(
        simulation: &Simulation,
        scene: &Scene,
        scores: &[&SampleScore],
        cancel: &Cancel,
    ) -> Result<Self> {
        let names: Vec<&str> = scores.iter().filter_map(|score| score.object.as_deref()).collect();
        let index = |name: &&str| object_index(scene, name).map(Some);
        let mut wanted = names.iter().map(index).collect::<Result<Vec<_>>>()?;
        wanted.push(None);
        let mut shares = coverage(simulation, scene, &wanted, cancel)?;
        let any = shares.pop().unwrap_or_default();
        Ok(Self { any, objects: names.into_iter().map(str::to_owned).zip(shares).collect() })
    }

    /// Without columns and rows at each end.
    fn cut(mut self, [columns, rows]: [usize; 2]) -> Self {
        for share in self.objects.values_mut().chain([&mut self.any]) {
            let (_, all_rows, all_columns) = share.dim();
            let inner = s![.., rows..all_rows - rows, columns..all_columns - columns];
            *share = share.slice(inner).to_owned();
        }
        self
    }
}

impl Reference {
    /// The reference of a scene with the sample of a simulation.
    fn of(
        simulation: &Simulation,
        part: &Scene,
        shares: Shares,
        scores: &[&SampleScore],
        cancel: &Cancel,
    ) -> Result<Self> {
        if !scores.iter().any(|score| score.measure.needs_truth()) {
            return Ok(Self { truth: Images::new(), shares });
        }
        let [transmission, angle] = TRUTH;
        let options =
            IdealOptions::default().with_tolerance(transmission).with_angle_tolerance(angle);
        let mut control = RowsControl::default().with_cancel(cancel.clone());
        let truth = ideal_of(simulation, part, &options, &mut control)?.images;
        Ok(Self { truth, shares })
    }
}

/// A scene without columns and rows at each end of its detector.
fn cut(scene: &Scene, unneeded: [usize; 2]) -> Scene {
    let mut part = scene.clone();
    for (pixels, unneeded) in part.detector.pixels.iter_mut().zip(unneeded) {
        *pixels -= 2 * numbers::count(unneeded);
    }
    part
}

impl SampleLight {
    /// Images by the default retrieval with the weights of counts, and their uncertainties at the photons of the design.
    ///
    /// # Errors
    /// As [`retrieve_arrays`].
    pub(super) fn retrieve(
        &self,
        engine: &Engine,
        design: &Scene,
        cancel: &Cancel,
    ) -> Result<Images> {
        let options = match &design.detector.counts {
            // Light without noise scatters by less than counts.
            Some(counts) => check::counting_options(design, counts)?.with_gain_assumed(true),
            None => RetrieveOptions::default().resolved(design)?,
        };
        let (flat, sample) = (stack("flat", &self.flat)?, stack("sample", &self.sample)?);
        let input = Input::simulated(&self.part, flat, sample);
        let mut control = RowsControl::default().with_cancel(cancel.clone());
        Ok(retrieve_arrays(engine, input, &options, &mut control)?.images)
    }

    /// A score of retrieved images; else the reason why they have none.
    pub(super) fn value(
        &self,
        score: &SampleScore,
        images: &Images,
    ) -> std::result::Result<f64, String> {
        let Reference { truth, shares: Shares { any, objects } } = &*self.reference;
        let name = score.contrast.image();
        let none = || Array3::from_elem(any.dim(), f32::NAN);
        let image = |name: &str| images.get(name).cloned().unwrap_or_else(none);
        let (found, sigma) = (image(name), image(&format!("{name}_sigma")));
        let truth = truth.get(name).cloned().unwrap_or_else(none);
        if found.dim() != any.dim() {
            return Err("the retrieved images have other pixels than the ideal ones".into());
        }
        let share = score.object.as_ref().map_or(any, |name| &objects[name]);
        let pixels = |is_meant: &dyn Fn(f32) -> bool, share: &Array3<f32>| -> Vec<Pixel> {
            let all = share.indexed_iter().filter(|(_, share)| is_meant(**share));
            let pixel = |at| {
                let [found, sigma, truth] = [&found, &sigma, &truth].map(|it| f64::from(it[at]));
                Pixel { found, sigma, truth }
            };
            all.map(|(at, _)| pixel(at)).collect()
        };
        let own = select_usable(pixels(&|share| share >= HALF, share), score.measure)?;
        let difference = |pixel: &Pixel| (pixel.found - pixel.truth).powi(2);
        let variance = |pixel: &Pixel| pixel.sigma.powi(2);
        Ok(match score.measure {
            Measure::Bias => mean(&own, difference).sqrt(),
            Measure::Error => mean(&own, |pixel| difference(pixel) + variance(pixel)).sqrt(),
            Measure::ContrastToNoise => {
                let beside = pixels(&|share| share == 0.0, &widened(any));
                if beside.is_empty() {
                    return Err(format!("no pixel {BESIDE} pixels or more beside the sample"));
                }
                let beside = select_usable(beside, score.measure)?;
                let level = median(&beside, |pixel| pixel.found);
                let contrast = mean(&own, |pixel| (pixel.found - level).powi(2));
                let noise = 0.5 * (mean(&own, variance) + mean(&beside, variance));
                (contrast / noise).sqrt()
            }
        })
    }
}

/// A pixel of retrieved and ideal images.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    found: f64,
    sigma: f64,
    truth: f64,
}

/// The pixels that have what a measure compares.
fn select_usable(pixels: Vec<Pixel>, measure: Measure) -> std::result::Result<Vec<Pixel>, String> {
    if pixels.is_empty() {
        return Err("less than half of the light of each pixel passes through it".into());
    }
    let all = pixels.len();
    let has_all = |pixel: &Pixel| {
        pixel.found.is_finite()
            && (pixel.sigma.is_finite() || !measure.needs_photons())
            && (pixel.truth.is_finite() || !measure.needs_truth())
    };
    let usable: Vec<Pixel> = pixels.into_iter().filter(has_all).collect();
    match 2 * usable.len() > all {
        true => Ok(usable),
        false => Err(format!("{} of {all} pixels have no result", all - usable.len())),
    }
}

/// Largest share within [`BESIDE`] pixels, itself not counted, of each pixel.
fn widened(shares: &Array3<f32>) -> Array3<f32> {
    let (_, rows, columns) = shares.dim();
    let around = |at: usize, end: usize| at.saturating_sub(BESIDE - 1)..(at + BESIDE).min(end);
    Array3::from_shape_fn(shares.dim(), |(view, row, column)| {
        let near = s![view, around(row, rows), around(column, columns)];
        shares.slice(near).iter().fold(0.0, |most, share| share.max(most))
    })
}

fn median(pixels: &[Pixel], of: impl Fn(&Pixel) -> f64) -> f64 {
    let mut values: Vec<f64> = pixels.iter().map(of).collect();
    values.sort_by(f64::total_cmp);
    let upper = values.len() / 2;
    f64::midpoint(values[(values.len() - 1) / 2], values[upper])
}

fn mean(pixels: &[Pixel], of: impl Fn(&Pixel) -> f64) -> f64 {
    pixels.iter().map(of).sum::<f64>() / pixels.len() as f64
}

/// Index of an object by its name.
///
/// # Errors
/// [`Error::Argument`] with the names of the scene.
pub(super) fn object_index(scene: &Scene, name: &str) -> Result<u32> {
    let found = scene.objects.iter().position(|object| object.name == name);
    found.map(numbers::count).ok_or_else(|| {
        let names: Vec<&str> = scene.objects.iter().map(|object| object.name.as_str()).collect();
        let allowed = format!("objects of the scene: {}", names.join(", "));
        Error::argument("score", format!("no object {name:?}"), allowed)
    })
}

/// A stack of a retrieval over values in memory.
fn stack(name: &str, values: &Arc<Array4<f32>>) -> Result<StackFile> {
    let (views, steps, rows, columns) = values.dim();
    let values = values.clone();
    StackFile::of_values(name, [views, steps, rows, columns], move |frame, rows| {
        Ok(values.slice(s![frame / steps, frame % steps, rows, ..]).iter().copied().collect())
    })
}
