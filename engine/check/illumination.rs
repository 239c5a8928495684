//! The illumination curve of a set-up, and its sampling by the scan.

use crate::Engine;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::{self, single};
use beamlet_model::optics::{self, Optics, ThinCurve};
use beamlet_model::scene::{Blur, Counts, MaskSpec, Object, Quality, Scan, Scatter, Scene, Scheme};
use beamlet_model::spectrum::{self, Nodes};
use beamlet_recon::retrieve::{
    BackgroundTerm, Fitter, Method, Response, RetrieveOptions, Retriever, RimError, ValueNoise,
    Weights, phase_errors,
};
use beamlet_simulate::run::quality;
use ndarray::{Array2, Array3, ArrayView2, Axis};
use serde::Serialize;
use std::f64::consts::TAU;

/// Offsets over a period at which the curve is taken.
const OFFSETS: u32 = 128;
/// Most columns and rows of the examined part of a detector: light of a pixel without blur is its own,
/// with blur it comes from around it.
const PART: [u32; 2] = [4, 1];
pub(super) const BLURRED_PART: [u32; 2] = [96, 96];
/// Difference from a whole number of periods in a pixel that adds nothing over a detector.
const SAME_PERIOD: f64 = 1e-6;
/// Relative difference of periods that fit one another.
const FITTING_PERIOD: f64 = 1e-3;
/// Least standard deviation of a blur, pixels, beyond which the light of a flat does not depend on it where the masks
/// have periods of up to as many pixels: exp(-2 pi^2) of a wave of that period is left, 3e-9.
const WIDE_BLUR: f64 = 4.0;

/// The illumination curve of a pixel at the centre of the detector without a sample: its light over
/// the offset of the sample mask. Offsets in metres in the plane of that mask.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct IlluminationCurve {
    /// Offsets over a period, ascending, m.
    pub offsets: Vec<f64>,
    /// Light at these offsets, share of open beam.
    pub light: Vec<f64>,
    /// Period of the curve, m of offset.
    pub period: f64,
    /// (greatest − least) / (greatest + least).
    pub visibility: f64,
    /// Mean light over the offsets of a period, share of open beam.
    pub open_fraction: f64,
    /// Offset of the peak that is nearest to the middle of the scan, by the first harmonic of the curve, m.
    pub peak: f64,
    /// Standard deviation of the Gaussian that fits the curve over a period around its peak, m.
    pub sigma: f64,
    /// Full width at the middle between least and greatest light, m.
    pub fwhm: f64,
    /// Mean light of the bars of the sample mask and of the detector mask over the spectrum, share
    /// of what falls on them.
    pub leak: [f64; 2],
    /// Offsets of the scan, m, and the light there, share of open beam.
    pub scan: Vec<[f64; 2]>,
    /// Uncertainties of a pixel without a sample, from flat and sample at the photons of the
    /// scene; nothing without photons, or where the offsets do not settle a fit.
    pub expected: Option<ExpectedUncertainty>,
    /// Method and background of `retrieve` for this scene, and its response; nothing where no method serves the offsets.
    pub retrieval: Option<ExpectedRetrieval>,
}

/// The default of `retrieve` for a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ExpectedRetrieval {
    /// The method.
    pub method: &'static str,
    /// The background of its curves.
    pub background: String,
    /// Small contrasts as they are retrieved; `None` where the curve of the masks is not known.
    pub response: Option<Response>,
    /// Errors of the phase of round bodies, where they are large.
    pub phase: Vec<RimError>,
}

/// One standard deviation of the images of a pixel without a sample by the default method of `retrieve`, with the weights
/// of counts where it has them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ExpectedUncertainty {
    /// Deviation of the transmission.
    pub transmission: f64,
    /// Deviation of the refraction angle, rad.
    pub refraction: f64,
    /// Deviation of the dark field σ², rad².
    pub dark_field: f64,
}

impl IlluminationCurve {
    /// Least and greatest offset of the scan from the peak of the curve, over its σ.
    #[must_use]
    pub fn reach(&self) -> [f64; 2] {
        reach(self.scan.iter().map(|[offset, _]| *offset - self.peak), self.sigma)
    }

    /// True if the scan has three different offsets and no more: they settle area, centre and width
    /// of a curve without background, and nothing is left to judge it by.
    #[must_use]
    pub(crate) fn has_three_offsets(&self) -> bool {
        let [a, b, c] = self.scan[..] else { return false };
        let differ = |p: [f64; 2], q: [f64; 2]| p[0].to_bits() != q[0].to_bits();
        differ(a, b) && differ(b, c) && differ(a, c)
    }
}

/// The curve of a scene with both masks; nothing where a mask is missing.
///
/// # Errors
/// As [`Engine::simulate`].
pub(super) fn illumination(
    engine: &Engine,
    scene: &Scene,
    nodes: &Nodes,
) -> Result<Option<IlluminationCurve>> {
    let masks = scene;
    // The curve of a period is that of masks without shifts.
    let scene = &scene.of_groups();
    let optics = Optics::of(scene);
    // Light behind apertures that end along z depends on the row, too.
    if optics.sample_mask.is_none() || optics.detector_mask.is_none() || optics.has_heights() {
        return Ok(None);
    }
    let leak = optics::mean_leaks(scene, &optics, (&nodes.energies, &nodes.weights))?;
    let period = optics.curve_period();
    let step = period / f64::from(OFFSETS);
    let offsets = offsets_of_period(&optics);
    let [light, scanned] = lights(engine, masks, offsets.clone())?;
    let peak = peak(&offsets, &light, period);
    let Some(sigma) = fitted_sigma(engine, &offsets, &around(peak, &offsets, &light))? else {
        return Ok(None);
    };
    let [least, most] = ends(&light);
    let scan: Vec<[f64; 2]> =
        scene.scan.mask_offsets.iter().zip(&scanned).map(|(a, b)| [*a, *b]).collect();
    let expected = match &scene.detector.counts {
        Some(counts) => expected(engine, masks, counts, &scanned)?,
        None => None,
    };
    let retrieval = retrieval(engine, masks)?;
    Ok(Some(IlluminationCurve {
        period,
        peak: nearest(peak, &scene.scan.mask_offsets, period),
        visibility: visibility(&light),
        open_fraction: light.iter().sum::<f64>() / light.len() as f64,
        sigma,
        fwhm: width_above(&light, f64::midpoint(least, most)) * step,
        leak,
        scan,
        expected,
        retrieval,
        offsets,
        light,
    }))
}

/// Visibility, leaks, error of rays and uncertainties of a design.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct DesignCurve {
    /// Mean light of the bars of the sample mask and of the detector mask, share of what falls on them; 0 of a mask that
    /// is missing.
    pub(crate) leak: [f64; 2],
    /// Greatest difference of the flat by waves and by rays with thin masks, over the peak; `None` where it is unknown.
    pub(crate) ray_error: Option<f64>,
    /// (greatest − least) / (greatest + least); `None` where [`IlluminationCurve`] is nothing.
    pub(crate) visibility: Option<f64>,
    /// Uncertainties along x; `None` without photons, and where the offsets do not settle a fit.
    pub(crate) expected: Option<ExpectedUncertainty>,
}

/// Visibility and uncertainties of a scene, as [`super::CheckReport`] has them but for the error of energy nodes.
///
/// # Errors
/// As [`Engine::simulate`].
pub(crate) fn design_curve(engine: &Engine, scene: &Scene) -> Result<DesignCurve> {
    let mut scene = scene.clone();
    // Materials of the sample need more energy nodes, and are not in a flat.
    scene.objects.clear();
    let scene = &scene;
    let optics = Optics::of(scene);
    let nodes = spectrum::nodes(scene)?;
    let leak = optics::mean_leaks(scene, &optics, (&nodes.energies, &nodes.weights))?;
    let ray_error = super::waves::flat_error(scene, &nodes)?;
    let known = DesignCurve { leak, ray_error, ..DesignCurve::default() };
    if optics.has_heights() {
        let found = super::two_directions::uncertainty(engine, scene)?;
        let along_x = |of: super::PlanarUncertainty| ExpectedUncertainty {
            transmission: of.transmission,
            refraction: of.refraction[0],
            dark_field: of.dark_field.map_or(f64::NAN, |dark| dark[0]),
        };
        return Ok(DesignCurve { expected: found.map(along_x), ..known });
    }
    if optics.sample_mask.is_none() || optics.detector_mask.is_none() {
        return Ok(known);
    }
    let mut sharp = scene.clone();
    if has_even_flat(scene) {
        sharp.detector.blur = None;
    }
    let [light, scanned] = lights(engine, &sharp, offsets_of_period(&optics))?;
    let expected = match &scene.detector.counts {
        Some(counts) => expected(engine, scene, counts, &scanned)?,
        None => None,
    };
    Ok(DesignCurve { visibility: Some(visibility(&light)), expected, ..known })
}

/// Light of masks without shifts at offsets, m, and of the masks as they are at the offsets of the scan, share of open
/// beam: with shifts of each column of a group, offset after offset.
fn lights(engine: &Engine, scene: &Scene, mut offsets: Vec<f64>) -> Result<[Vec<f64>; 2]> {
    let (count, scanned) = (offsets.len(), &scene.scan.mask_offsets);
    if scene.group() == 1 {
        offsets.extend(scanned);
    }
    let mut light = flat(engine, &scene.of_groups(), offsets)?;
    let of_scan = match scene.group() {
        1 => light.split_off(count),
        _ => flat(engine, scene, scanned.clone())?,
    };
    Ok([light, of_scan])
}

/// True if each pixel has whole periods of each mask of slits: all pixels of a flat then have the same light, with and
/// without blur.
fn has_even_flat(scene: &Scene) -> bool {
    scene.group() == 1
        && scene.masks().all(|(_, mask)| {
            let periods =
                scene.detector.pitch[0] * mask.distance / scene.detector.distance / mask.period;
            periods > 0.5 && (periods - periods.round()).abs() < SAME_PERIOD
        })
}

/// Offsets over a period of the curve, m.
fn offsets_of_period(optics: &Optics) -> Vec<f64> {
    let period = optics.curve_period();
    let step = period / f64::from(OFFSETS);
    (0..OFFSETS).map(|i| f64::from(i) * step - 0.5 * period).collect()
}

/// Least and greatest light of a curve.
fn ends(light: &[f64]) -> [f64; 2] {
    let ends = [f64::INFINITY, f64::NEG_INFINITY];
    light.iter().fold(ends, |[least, most], light| [least.min(*light), most.max(*light)])
}

/// Place of the first harmonic of light over a period, m.
fn peak(offsets: &[f64], light: &[f64], period: f64) -> f64 {
    let [sine, cosine] = offsets.iter().zip(light).fold([0.0; 2], |[s, c], (offset, light)| {
        let (sine, cosine) = libm::sincos(TAU * offset / period);
        [s + light * sine, c + light * cosine]
    });
    libm::atan2(sine, cosine) * period / TAU
}

/// The light of a period, moved by whole steps so that the place nearest to its peak is in the middle of the offsets.
fn around(peak: f64, offsets: &[f64], light: &[f64]) -> Vec<f64> {
    let place = offsets.partition_point(|offset| *offset < peak).min(light.len() - 1);
    let middle = offsets.partition_point(|offset| *offset < 0.0);
    let mut moved = light.to_vec();
    moved.rotate_left((place + light.len() - middle) % light.len());
    moved
}

/// A peak moved by whole periods to the middle of a scan.
fn nearest(peak: f64, scan: &[f64], period: f64) -> f64 {
    let [low, high] = ends(scan);
    let middle = f64::midpoint(low, high);
    middle + libm::remainder(peak - middle, period)
}

fn visibility(light: &[f64]) -> f64 {
    let [least, most] = ends(light);
    (most - least) / (most + least)
}

/// Light of a pixel at the centre at these offsets, share of open beam; of each column of a group there.
fn flat(engine: &Engine, scene: &Scene, offsets: Vec<f64>) -> Result<Vec<f64>> {
    let part = if scene.detector.blur.is_some() { BLURRED_PART } else { PART };
    let group = scene.group();
    let part = [part[0].max(2 * numbers::count(group)), part[1]];
    let (bare, scattered) = bare(scene, Scan::new(offsets, vec![0.0]), part);
    let [columns, rows] = bare.detector.pixels.map(|n| n as usize);
    let stacks = engine.simulate(&bare)?;
    // Groups begin with column 0.
    let first = (columns - group) / 2 / group * group;
    let light = |frame: ArrayView2<'_, f32>| {
        let of_column =
            |at: usize| f64::from(frame[[(rows - 1) / 2, first + at]]) * (1.0 + scattered);
        (0..group).map(of_column).collect::<Vec<_>>()
    };
    Ok(stacks.flat.axis_iter(Axis(0)).flat_map(light).collect())
}

/// The scene without a sample and without noise, with a scan of one view, before the middle of its detector: about this
/// number of columns and rows. Second value: scattered light, share of the light, that its flat lacks.
pub(super) fn bare(scene: &Scene, scan: Scan, part: [u32; 2]) -> (Scene, f64) {
    let mut bare = scene.clone();
    bare.objects = Vec::<Object>::new();
    bare.scan = scan;
    bare.sampling.scheme = Scheme::Cells;
    remove_counts(&mut bare);
    let detector = &mut bare.detector;
    // In a flat all pixels around have the light of this one, and a kernel may be as large as the detector.
    let scattered = match detector.scatter.take() {
        Some(Scatter::Kernel { fraction, .. }) => fraction,
        Some(Scatter::Image(_)) | None => 0.0,
    };
    // The same holds of wide blurs.
    let periods = scene.masks().map(|(_, mask)| {
        let longest = mask.period.max(mask.period_z.unwrap_or(0.0));
        longest / mask.distance * scene.detector.distance / detector.pitch[0]
    });
    let wide = periods.fold(WIDE_BLUR, f64::max);
    if let Some(Blur::Gaussian { sigma }) = &mut detector.blur {
        *sigma = [0, 1].map(|axis| sigma[axis].min(wide * detector.pitch[axis]));
    }
    for (pixels, part) in detector.pixels.iter_mut().zip(part) {
        // Apertures lie in the middle of odd numbers of pixels and beside the middle of even ones.
        *pixels = (*pixels).min(part + (*pixels + part) % 2);
    }
    (bare, scattered)
}

/// Removes photons from a scene, and what needs them.
pub(crate) fn remove_counts(scene: &mut Scene) {
    scene.detector.counts = None;
    scene.source.current = None;
    if scene.sampling.quality == Some(Quality::Noise) {
        scene.sampling.quality = None;
    }
}

/// Number of offsets of a curve over a period at which it is above a level, interpolated.
fn width_above(light: &[f64], level: f64) -> f64 {
    let next = |i: usize| light[(i + 1) % light.len()];
    let above = |i: usize| {
        let (a, b) = (light[i] - level, next(i) - level);
        if a >= 0.0 && b >= 0.0 {
            1.0
        } else if a < 0.0 && b < 0.0 {
            0.0
        } else {
            a.max(b) / (a - b).abs()
        }
    };
    (0..light.len()).map(above).sum()
}

/// Standard deviation of a Gaussian through a curve, m; `None` where there is none.
fn fitted_sigma(engine: &Engine, offsets: &[f64], light: &[f64]) -> Result<Option<f64>> {
    let curve = Array2::from_shape_fn((light.len(), 1), |(step, _)| single(light[step]));
    let fitter = Fitter::new(engine, offsets, ValueNoise::default(), BackgroundTerm::Free)?;
    let width = f64::from(fitter.fit(curve.view(), &Cancel::default())?[0].width);
    Ok((width.is_finite() && width > 0.0).then_some(width))
}

/// The default retrieval of a scene; `None` where no method serves its offsets.
fn retrieval(engine: &Engine, scene: &Scene) -> Result<Option<ExpectedRetrieval>> {
    let options = RetrieveOptions::default().resolved(scene)?;
    let Ok(retriever) = Retriever::new(engine, scene, &options) else { return Ok(None) };
    Ok(Some(ExpectedRetrieval {
        method: options.method().name(),
        background: options.background().to_string(),
        response: retriever.response()?,
        phase: phase_errors(scene),
    }))
}

/// Uncertainties of T, α and σ² where flat and sample have these counts (docs/retrieval.md, "Uncertainties"). `light`: of
/// a pixel at the offsets of the scan, share of open beam.
fn expected(
    engine: &Engine,
    scene: &Scene,
    counts: &Counts,
    light: &[f64],
) -> Result<Option<ExpectedUncertainty>> {
    let options = counting_options(scene, counts)?;
    // Offsets that are no scan, such as five times the same, settle nothing.
    let Ok(mut retriever) = Retriever::new(engine, scene, &options) else { return Ok(None) };
    let frames = Array3::from_shape_fn((light.len(), 1, 1), |(step, ..)| single(light[step]));
    retriever.set_flat_array(frames.view())?;
    let images = retriever.retrieve_array(frames.view())?;
    let sigma = |name: &str| images.get(name).map_or(f64::NAN, |map| f64::from(map[[0, 0]]));
    let expected = ExpectedUncertainty {
        transmission: sigma("transmission_sigma"),
        refraction: sigma("refraction_sigma"),
        dark_field: sigma("dark_field_sigma"),
    };
    Ok(expected.transmission.is_finite().then_some(expected))
}

/// The default retrieval of light, shares of open beam, with the weights and the variance of counts.
///
/// # Errors
/// Errors of the beam; offsets that no method takes.
pub(crate) fn counting_options(scene: &Scene, counts: &Counts) -> Result<RetrieveOptions> {
    let variance = quality::open_variance(scene, counts)?;
    let options = RetrieveOptions::default().resolved(scene)?;
    let weights = match options.method() {
        Method::Gaussian | Method::ExactCurve => Weights::Poisson,
        _ => Weights::None,
    };
    Ok(options
        .with_gain(variance.per_light)
        .with_read_noise(variance.read_noise)
        .with_weights(weights))
}

/// Doubts about the masks and the offsets, in words: by the curve, or without one by the curve of thin
/// masks in closed form.
///
/// # Errors
/// Errors of the materials of masks and beam.
pub(super) fn warnings(
    scene: &Scene,
    nodes: &Nodes,
    curve: Option<&IlluminationCurve>,
) -> Result<Vec<String>> {
    let groups = scene.of_groups();
    let scene = &*optics::straightened(&groups, (&nodes.energies, &nodes.weights))?;
    let optics = Optics::of(scene);
    let leaks = optics::mean_leaks(scene, &optics, (&nodes.energies, &nodes.weights))?;
    let thin = || ThinCurve::of(&optics, leaks).and_then(|curve| curve.fitted_sigma());
    let mut warnings = leak_warnings(leaks);
    let offsets = &scene.scan.mask_offsets;
    let by_places =
        || peak_by_places(scene).map(|peak| nearest(peak, offsets, optics.curve_period()));
    let peak = curve.map(|curve| curve.peak).or_else(by_places);
    let missed = peak.and_then(|peak| missed_peak(offsets, peak));
    if missed.is_none()
        && let Some(sigma) = curve.map(|curve| curve.sigma).or_else(thin)
    {
        let peak = peak.unwrap_or_default();
        warnings.extend(scan_warning(offsets, [peak, sigma], optics.curve_period()));
    }
    warnings.extend(missed);
    let retrieval = curve.and_then(|curve| curve.retrieval.as_ref());
    if let Some((retrieval, response)) = retrieval.and_then(|it| Some((it, it.response?))) {
        let own =
            format!("`retrieve` ({} with background {})", retrieval.method, retrieval.background);
        warnings.extend(response.warning(&own, None));
    }
    Ok(warnings)
}

/// Offset of the peak of the illumination curve by the places of slits, m, where slits and pixels have one period.
fn peak_by_places(scene: &Scene) -> Option<f64> {
    let [sample, detector] = [&scene.sample_mask, &scene.detector_mask].map(Option::as_ref);
    let [sample, detector] = [sample?, detector?];
    let is_plain = |mask: &MaskSpec| mask.apertures.is_empty() && mask.shifts.is_empty();
    let pitch = scene.detector.pitch[0] / scene.detector.distance;
    let fits = |mask: &MaskSpec| (mask.period / mask.distance / pitch - 1.0).abs() < FITTING_PERIOD;
    let is_aligned = [sample, detector].into_iter().all(|mask| is_plain(mask) && fits(mask));
    scene.peak_offset().filter(|_| is_aligned)
}

/// Offsets beside the peak of the illumination curve, m.
fn missed_peak(offsets: &[f64], peak: f64) -> Option<String> {
    let [low, high] = ends(offsets);
    (low < high && !(low..=high).contains(&peak)).then(|| {
        format!(
            "the illumination curve has its peak at a mask offset of {:.3} um, outside scan.mask_offsets \
             ({:.3} to {:.3} um): sample_mask.offset and detector_mask.offset displace it",
            peak * 1e6,
            low * 1e6,
            high * 1e6
        )
    })
}

/// Bars that pass too much light.
fn leak_warnings(leaks: [f64; 2]) -> Vec<String> {
    let mut warnings = Vec::new();
    for (name, leak) in ["sample_mask", "detector_mask"].into_iter().zip(leaks) {
        if leak > 0.01 {
            warnings.push(format!(
                "the bars of {name} transmit {:.1} % of the light; above 1 % they reduce visibility: are material and thickness right?",
                leak * 100.0
            ));
        }
    }
    warnings
}

/// Least and greatest of these offsets over the σ of a curve.
fn reach(offsets: impl Iterator<Item = f64>, sigma: f64) -> [f64; 2] {
    let ends = [f64::INFINITY, f64::NEG_INFINITY];
    let ends = offsets.fold(ends, |[low, high], offset| [low.min(offset), high.max(offset)]);
    ends.map(|offset| offset / sigma)
}

/// Offsets that say little of a curve with this peak and σ, m, and this period, m.
fn scan_warning(offsets: &[f64], [peak, sigma]: [f64; 2], period: f64) -> Option<String> {
    let [low, high] = reach(offsets.iter().map(|offset| offset - peak), sigma);
    let half = 0.5 * period;
    let farthest = low.abs().max(high.abs()) * sigma;
    let [peak, sigma] = [peak, sigma].map(|length| length * 1e6);
    // Half a period to the digits of a scene file.
    if farthest > half * (1.0 + 1e-6) {
        return Some(format!(
            "scan.mask_offsets reach {:.3} um, beyond half a period of the sample mask ({:.3} um): there \
             the next aperture lights the pixel",
            farthest * 1e6,
            half * 1e6
        ));
    }
    // Three offsets settle no background however far they reach: the report says so.
    (offsets.len() > 3 && (low > -2.2 || high < 2.2)).then(|| {
        format!(
            "scan.mask_offsets cover {low:.1} to {high:.1} sigma of the illumination curve (sigma \
             {sigma:.2} um); {:.0} to {:.0} um, 2.5 sigma, would determine width and background",
            peak - 2.5 * sigma,
            peak + 2.5 * sigma
        )
    })
}
