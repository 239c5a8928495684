//! Findings as lines for the log and the record: the fault, its likely cause, the remedy.

use super::below_zero::BelowZero;
use super::collected::Findings;
use super::empty_beam::{EmptyBeam, EmptyBeamOfView};
use super::excess::Excess;
use super::exchanged::Exchanged;
use super::light::LightCounts;
use super::moments::MomentsErrors;
use crate::retrieve::misfit::median;

/// Share of the pixels from which on a transmission above 1 is no edge.
const MANY: f64 = 0.01;
/// Pixels above 1 for each one below from which on the sample is brighter than the flat.
const RATIO: u64 = 3;
/// Reduced chi squared from which on values scatter by more than photons do.
const CHI_SQUARE: f64 = 2.0;
/// Reduced chi squared below which values scatter by less than photons do.
const QUIET: f64 = 0.5;
/// Standard deviations from which on a value of the empty beam is another.
const SIGMAS: f64 = 4.0;
/// Least differences in the empty beam: of transmission and dose, and of the centre in widths of the
/// flat's curve.
const LEAST: f64 = 1e-3;

/// Warnings, the gravest first. `of_misfit`: residuals of the flat beyond noise, over the height, and residuals of the
/// method on the curve of the masks, where the first are too large.
pub(super) fn of(
    found: &Findings,
    of_misfit: Option<[f64; 2]>,
    empty: Option<&EmptyBeam>,
) -> Vec<String> {
    if found.measured && found.transposed.is_likely() {
        return vec![found.transposed.warning()];
    }
    if found.divided > 0 {
        // Nothing else that was retrieved from such values means anything.
        return vec![format!(
            "{}the sample does not change with the mask offset as the flat does: give frames of the \
             detector, not frames that were divided by the flat",
            place(found, found.divided, None)
        )];
    }
    let measured = found.measured;
    [
        below_zero(found, 0),
        below_zero(found, 1),
        excess(found),
        exchanged(found),
        brighter(found).filter(|_| measured),
        fainter(found).filter(|_| measured),
        dose(found),
        drift(found, 0),
        drift(found, 1),
        // Curves of another shape leave other residuals in the sample than in the flat.
        of_misfit.and_then(|of| misfit(found, of)).or_else(|| unsteady(found)),
        moments(found),
        scatter(found),
        quiet(found),
    ]
    .into_iter()
    .flatten()
    .chain(empty.map(|empty| empty_beam(found, empty)).unwrap_or_default())
    .collect()
}

/// Begins a message where only some of several views are concerned. `worst`: the view of the numbers.
fn place(found: &Findings, count: usize, worst: Option<usize>) -> String {
    match (found.views, worst) {
        (0 | 1, _) => String::new(),
        (all, None) => format!("{count} of {all} views: "),
        (all, Some(view)) => format!("{count} of {all} views, most in view {view}: "),
    }
}

/// Frames of the flat (0) or of the sample (1).
fn below_zero(found: &Findings, stack: usize) -> Option<String> {
    let all = found.below_zero[stack].iter().copied();
    let (count, view, BelowZero { step, share }) = worst(all, |of| of.share)?;
    Some(format!(
        "{}{:.0} % of the values of the {} at mask step {step} are negative, where noise about zero has 50 %: a dark or \
         a pedestal was subtracted twice, or is not that of these frames",
        place(found, count, Some(view)),
        100.0 * share,
        ["flat", "sample"][stack]
    ))
}

fn excess(found: &Findings) -> Option<String> {
    let (count, view, of) = worst(found.excesses.iter().copied(), |of| of.ratio)?;
    let Excess { ratio, residual } = of;
    Some(format!(
        "{}the curves of the sample are not those of the masks: reduced chi squared is {ratio:.0} times that of the flat, \
         residuals are {:.1} % of the height (rms, median of the pixels); check that the dark, the exposure and the \
         order of the frames of the sample are those of the flat",
        place(found, count, Some(view)),
        100.0 * residual
    ))
}

fn exchanged(found: &Findings) -> Option<String> {
    let (count, view, of) = worst(found.exchanged.iter().copied(), |of| of.lower)?;
    let Exchanged { step, of_flat, lower } = of;
    let (whose, remedy) = match of_flat {
        true => ("flat and sample", "exchange their offsets"),
        false => ("the sample", "exchange its frames"),
    };
    Some(format!(
        "{}mask steps {step} and {} of {whose} may be exchanged: in the other order the squares of the residuals are {:.0} % \
         smaller; {remedy}",
        place(found, count, Some(view)),
        step + 1,
        100.0 * lower
    ))
}

fn brighter(found: &Findings) -> Option<String> {
    let LightCounts { above, below, pixels, .. } = found.light;
    let share = above as f64 / pixels.max(1) as f64;
    (share > MANY && above > RATIO * below).then(|| {
        format!(
            "transmission exceeds 1 in {:.0} % of the pixels and is below 1 in {:.0} %: flat and sample \
             may be swapped (check --flat and --sample), or the dose of the sample may be higher",
            100.0 * share,
            100.0 * below as f64 / pixels.max(1) as f64
        )
    })
}

fn fainter(found: &Findings) -> Option<String> {
    let LightCounts { faint, pixels, .. } = found.light;
    let share = faint as f64 / pixels.max(1) as f64;
    (share > 0.5).then(|| {
        format!(
            "transmission is below 0.001 in {:.0} % of the pixels: flat and sample may have different units \
             or exposures, or the sample is opaque",
            100.0 * share
        )
    })
}

/// The view that differs most, with the number of views that differ.
fn worst<T: Copy>(
    all: impl Iterator<Item = (usize, T)>,
    size: impl Fn(&T) -> f64,
) -> Option<(usize, usize, T)> {
    let mut count = 0;
    let most = all.inspect(|_| count += 1).max_by(|a, b| size(&a.1).total_cmp(&size(&b.1)))?;
    Some((count, most.0, most.1))
}

const NAME_IT: &str = "--empty-beam C0:C1 measures it in columns that are empty";

fn dose(found: &Findings) -> Option<String> {
    let all = found.borders.iter().copied().filter(|(_, borders)| borders.has_other_dose);
    let (count, view, borders) = worst(all, |b| (b.transmission.value - 1.0).abs())?;
    Some(format!(
        "{}transmission is {} in the {} columns at either side, with no structure: unless a slab fills \
         the field, the dose of the sample is {:+.1} % of the flat's; {NAME_IT}",
        place(found, count, Some(view)),
        with_sigma(borders.transmission.value, borders.transmission.sigma, 4),
        borders.width,
        100.0 * (borders.transmission.value - 1.0)
    ))
}

/// Drift along an axis: 0 is x, 1 is z.
fn drift(found: &Findings, axis: usize) -> Option<String> {
    let all = found.borders.iter().filter(|(_, borders)| borders.has_drift[axis]);
    let all = all.filter_map(|(view, of)| Some((*view, (of.refraction[axis]?, of.width))));
    let (count, view, (refraction, width)) = worst(all, |(of, _)| of.value.abs())?;
    Some(format!(
        "{}refraction{} is {} urad in the {width} columns at either side, with no structure: unless a prism \
         fills the field, {} by {:.2} um between flat and sample; {NAME_IT}",
        place(found, count, Some(view)),
        ALONG[axis],
        with_sigma(1e6 * refraction.value, 1e6 * refraction.sigma, 3),
        moved(found),
        1e6 * refraction.value / found.angle_per_shift
    ))
}

/// Ends of the name of a refraction by its axis.
const ALONG: [&str; 2] = ["", " along z"];

const fn moved(found: &Findings) -> &'static str {
    if found.is_beamlet { "the beamlets moved on the detector" } else { "a mask drifted" }
}

fn unsteady(found: &Findings) -> Option<String> {
    let (count, view, unsteady) = worst(found.unsteady.iter().copied(), |of| of.dose)?;
    let borders = found.borders.iter().find(|(of, _)| *of == view);
    let dark_field = borders
        .and_then(|(_, borders)| borders.dark_field)
        .filter(|of| of.differs(0.0, SIGMAS, 0.0));
    let dark_field = dark_field.map_or_else(String::new, |of| {
        let [value, sigma] = [of.value, of.sigma].map(|value| 1e12 * value);
        format!(", and air has a dark field of {} urad^2", with_sigma(value, sigma, 1))
    });
    let offsets: Vec<String> = ["x", "z"]
        .into_iter()
        .zip(unsteady.offsets)
        .zip(found.widths)
        .filter(|((_, by), _)| *by > 0.0)
        .map(|((axis, by), width)| format!("{:.2} um along {axis}", 1e6 * by * width))
        .collect();
    let offsets = match offsets.is_empty() {
        true => String::new(),
        false => format!(", or the mask offsets are off by {}", offsets.join(" or ")),
    };
    Some(format!(
        "{}the steps deviate from the fitted curves in all pixels alike: the dose varies by {:.1} \
         % (rms) from \
         step to step{}{}; monitor the dose, or check --offsets; \
         --correct dose (or steps) corrects it by an empty beam",
        place(found, count, Some(view)),
        100.0 * unsteady.dose,
        offsets,
        dark_field
    ))
}

fn misfit(found: &Findings, [misfit, of_masks]: [f64; 2]) -> Option<String> {
    let own = median(found.chi_squares.iter().map(|pair| pair[0]).collect());
    let own = own.filter(|_| found.is_noise_known);
    let chi_square = own.map_or_else(String::new, |own| format!("; reduced chi squared {own:.1}"));
    Some(format!(
        "the curves of flat and sample differ from the fitted ones by {:.1} % of their height (rms{chi_square}), \
         alike in all pixels, where the curve of the masks leaves {:.1} %: a frame may be missing or the offsets may \
         have another order; check --offsets, and distances, masks and spot of the geometry",
        100.0 * misfit,
        100.0 * of_masks
    ))
}

fn moments(found: &Findings) -> Option<String> {
    let size = |of: &MomentsErrors| of.angle.abs().max(0.2 * of.dark_field.abs());
    let (count, view, errors) = worst(found.moments.iter().copied(), size)?;
    Some(format!(
        "{}at these mask offsets the method moments errs by {:+.1} % of an angle that moves the curve by \
         a tenth of its width, and by {:+.0} % of a small dark field: steps are too wide for the curve, \
         or the scan ends within it; the method exact-curve has no such error",
        place(found, count, Some(view)),
        100.0 * errors.angle,
        100.0 * errors.dark_field
    ))
}

fn scatter(found: &Findings) -> Option<String> {
    let beyond = median(found.chi_squares.iter().map(|pair| pair[1]).collect())?;
    (found.is_noise_known && beyond > CHI_SQUARE).then(|| {
        format!(
            "reduced chi squared of the sample is {beyond:.1} beyond the residuals of the flat \
             (median of the pixels): values scatter by more than the noise of counts; check --gain and \
             --read-noise, and whether dose and offsets were steady"
        )
    })
}

fn quiet(found: &Findings) -> Option<String> {
    let own = median(found.chi_squares.iter().map(|pair| pair[0]).collect())?;
    (found.is_noise_known && own < QUIET).then(|| {
        format!(
            "reduced chi squared of the sample is {own:.2} (median of the pixels): values scatter by less \
             than the noise of counts, so that uncertainties are too large; check --gain and --read-noise"
        )
    })
}

fn empty_beam(found: &Findings, empty: &EmptyBeam) -> Vec<String> {
    let views = || empty.views.iter().enumerate();
    let other = |of: [f64; 2], expected: f64, least: f64| {
        ((of[0] - expected).abs() > (SIGMAS * of[1]).max(least)).then_some(of)
    };
    let mut lines = Vec::new();
    let without = views().filter(|(_, of)| of.transmission.is_none()).count();
    if without > 0 {
        let begin = place(found, without, None);
        lines.push(format!("{begin}fewer than two pixels of the empty beam have a result"));
    }
    let all = views().filter_map(|(view, of)| Some((view, other(of.transmission?, 1.0, LEAST)?)));
    if let Some((count, view, [value, sigma])) = worst(all, |[value, _]| (value - 1.0).abs()) {
        lines.push(format!(
            "{}transmission of the empty beam is {}: the dose of the sample is {:+.2} % of the flat's, \
             or something is in the beam",
            place(found, count, Some(view)),
            with_sigma(value, sigma, 4),
            100.0 * (value - 1.0)
        ));
    }
    for axis in [0, 1] {
        let least = LEAST * found.widths[axis];
        let drift = |of: &EmptyBeamOfView| [of.drift, of.drift_z][axis];
        let all = views().filter_map(|(view, of)| Some((view, other(drift(of)?, 0.0, least)?)));
        if let Some((count, view, [value, sigma])) = worst(all, |[value, _]| value.abs()) {
            let angle = found.angle_per_shift;
            lines.push(format!(
                "{}refraction{} of the empty beam is {} urad: {} by {} um between flat and sample",
                place(found, count, Some(view)),
                ALONG[axis],
                with_sigma(1e6 * value * angle, (1e6 * sigma * angle).abs(), 3),
                moved(found),
                with_sigma(1e6 * value, 1e6 * sigma, 3)
            ));
        }
    }
    let all = views().filter_map(|(view, of)| Some((view, dose_scatter(&of.dose)?)));
    if let Some((count, view, scatter)) = worst(all, |scatter| *scatter) {
        lines.push(format!(
            "{}the dose of the empty beam varies by {:.1} % (rms) from step to step: the source is not \
             steady, or mask offsets are off where curves are steep; --correct dose (or steps) corrects it",
            place(found, count, Some(view)),
            100.0 * scatter
        ));
    }
    lines
}

/// Standard deviation of the doses of steps beyond their noise; `None` where noise explains it.
pub(super) fn dose_scatter(doses: &[[f64; 2]]) -> Option<f64> {
    let weight = |[_, sigma]: &[f64; 2]| sigma.max(LEAST).powi(-2);
    let weights: f64 = doses.iter().map(weight).sum();
    let mean = doses.iter().map(|dose| weight(dose) * dose[0]).sum::<f64>() / weights;
    let squares: f64 = doses.iter().map(|dose| weight(dose) * (dose[0] - mean).powi(2)).sum();
    let freedom = doses.len().saturating_sub(1) as f64;
    if freedom < 1.0 || squares < freedom + SIGMAS * (2.0 * freedom).sqrt() {
        return None;
    }
    Some(((squares - freedom) / weights).sqrt())
}

/// A value with its uncertainty.
fn with_sigma(value: f64, sigma: f64, digits: usize) -> String {
    format!("{value:.digits$} ± {sigma:.digits$}")
}
