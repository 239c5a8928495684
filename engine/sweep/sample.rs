//! Scores at the sample of a design: its first view is simulated without noise, retrieved, and compared with ideal images.

use super::score::{Measure, SampleScore};
use crate::ideal::coverage;
use crate::{Engine, IdealOptions, check, ideal};
use beamlet_core::{Cancel, Error, Result, RowsControl, numbers};
use beamlet_files::{ArraySink, StackFile, Stacks};
use beamlet_model::scene::{Scan, Scene};
use beamlet_recon::retrieve::{Input, RetrieveOptions, retrieve_arrays};
use beamlet_simulate::run::Control;
use ndarray::{Array3, Array4, Axis, s};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Least share of the straight rays of a pixel through an object of which it is a pixel.
const HALF: f32 = 0.5;
/// Standard errors of the ideal images that scores are compared with: of the transmission, and of the angle, rad.
const TRUTH: [f64; 2] = [1e-4, 3e-9];

/// Images by name, `[view][row][column]`.
type Images = BTreeMap<String, Array3<f32>>;

/// Light of the first view of a design without noise, and what scores compare it with.
#[derive(Debug)]
pub(super) struct SampleLight {
    scene: Scene,
    flat: Arc<Array4<f32>>,
    sample: Arc<Array4<f32>>,
    /// Ideal images; empty where no score needs them.
    truth: Images,
    /// Share of the rays of each pixel through any object.
    any: Array3<f32>,
    /// Share of the rays of each pixel through an object, by its name.
    objects: BTreeMap<String, Array3<f32>>,
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
    one
}

impl SampleLight {
    /// The light of a scene of [`first_view`].
    ///
    /// # Errors
    /// As [`Engine::run`] and [`ideal`]; [`Error::Scene`] for an object that the scene has not.
    pub(super) fn of(
        engine: &Engine,
        scene: Scene,
        scores: &[&SampleScore],
        cancel: &Cancel,
    ) -> Result<Self> {
        let names: Vec<&str> = scores.iter().filter_map(|score| score.object.as_deref()).collect();
        let index = |name: &&str| object_index(&scene, name).map(Some);
        let mut wanted = names.iter().map(index).collect::<Result<Vec<_>>>()?;
        wanted.push(None);
        let mut shares = coverage(engine, &scene, &wanted, cancel)?;
        let any = shares.pop().unwrap_or_default();
        let objects = names.into_iter().map(str::to_owned).zip(shares).collect();
        let truth = match scores.iter().any(|score| score.measure.needs_truth()) {
            false => Images::new(),
            true => {
                let [transmission, angle] = TRUTH;
                let options = IdealOptions::default()
                    .with_tolerance(transmission)
                    .with_angle_tolerance(angle);
                let mut control = RowsControl::default().with_cancel(cancel.clone());
                ideal(engine, &scene, &options, &mut control)?.images
            }
        };
        let mut sink = ArraySink::new();
        engine.run(&scene, &mut sink, Control::default().with_cancel(cancel.clone()))?;
        let Stacks { flat, sample, .. } = sink.into_stacks().ok_or(Error::Interrupted)?;
        let flat = Arc::new(flat.insert_axis(Axis(0)));
        Ok(Self { scene, flat, sample: Arc::new(sample), truth, any, objects })
    }

    /// True if it is the light of this scene of [`first_view`].
    pub(super) fn is_of(&self, scene: &Scene) -> bool {
        self.scene == *scene
    }

    /// Bytes of its arrays.
    pub(super) fn bytes(&self) -> usize {
        let images = self.truth.len() + self.objects.len() + 1;
        4 * (self.flat.len() + self.sample.len() + images * self.any.len())
    }

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
        let input = Input::simulated(&self.scene, flat, sample);
        let mut control = RowsControl::default().with_cancel(cancel.clone());
        Ok(retrieve_arrays(engine, input, &options, &mut control)?.images)
    }

    /// A score of retrieved images; else the reason why they have none.
    pub(super) fn value(
        &self,
        score: &SampleScore,
        images: &Images,
    ) -> std::result::Result<f64, String> {
        let name = score.contrast.image();
        let none = || Array3::from_elem(self.any.dim(), f32::NAN);
        let image = |name: &str| images.get(name).cloned().unwrap_or_else(none);
        let (found, sigma) = (image(name), image(&format!("{name}_sigma")));
        let truth = self.truth.get(name).cloned().unwrap_or_else(none);
        if found.dim() != self.any.dim() {
            return Err("the retrieved images have other pixels than the ideal ones".into());
        }
        let share = score.object.as_ref().map_or(&self.any, |name| &self.objects[name]);
        let pixels = |is_meant: &dyn Fn(f32) -> bool, share: &Array3<f32>| -> Vec<Pixel> {
            let all = share.indexed_iter().filter(|(_, share)| is_meant(**share));
            let pixel = |at| {
                let [found, sigma, truth] = [&found, &sigma, &truth].map(|it| f64::from(it[at]));
                Pixel { found, sigma, truth }
            };
            all.map(|(at, _)| pixel(at)).collect()
        };
        let own = usable(pixels(&|share| share >= HALF, share), score.measure)?;
        let difference = |pixel: &Pixel| (pixel.found - pixel.truth).powi(2);
        let variance = |pixel: &Pixel| pixel.sigma.powi(2);
        Ok(match score.measure {
            Measure::Bias => mean(&own, difference).sqrt(),
            Measure::Error => mean(&own, |pixel| difference(pixel) + variance(pixel)).sqrt(),
            Measure::ContrastToNoise => {
                let beside = pixels(&|share| share == 0.0, &self.any);
                if beside.is_empty() {
                    return Err("no pixel beside the sample".into());
                }
                let beside = usable(beside, score.measure)?;
                let level = mean(&beside, |pixel| pixel.found);
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
fn usable(pixels: Vec<Pixel>, measure: Measure) -> std::result::Result<Vec<Pixel>, String> {
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
