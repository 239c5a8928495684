//! Doubts about a set-up: values that are allowed, and unlikely.

use super::CheckReport;
use beamlet_core::printed::number;
use beamlet_model::optics::{Mask, Optics};
use beamlet_model::scene::{
    Beam, Counts, MaskSpec, MaterialSpec, Scan, Scene, SpectrumOrigin, limits,
};
use beamlet_model::spectrum::Spectrum;
use beamlet_model::{material, spot};
use beamlet_recon::retrieve::{Method, different_offsets};
use std::f64::consts::PI;

/// Fringes across the detector from which on periods do not fit.
const FRINGES: f64 = 0.1;
/// Energy, keV, below which air counts, and the share of the light that it has to take.
const SOFT: f64 = 30.0;
const TAKEN_BY_AIR: f64 = 0.1;
/// Mean energy over the tube voltage below which a beam is hardly filtered, keV/kV.
const SOFT_TUBE: f64 = 0.45;
/// Rows of a file that is a continuous spectrum, and no list of lines, nor joined.
const CONTINUOUS: std::ops::Range<usize> = 10..8192;
/// Density of a gas at most, g/cm3.
const GAS: f64 = 0.01;
/// Share of the photons that filters and path leave, below which one of them is probably too thick.
const DARK: f64 = 1e-3;
/// Share of a mask that is open, below which its aperture or period is probably wrong.
const CLOSED: f64 = 0.01;
/// Photons of an open pixel in a frame that no set-up has.
const MANY_PHOTONS: f64 = 1e7;
/// Photons of an open pixel below which no curve can be fitted.
const FEW_PHOTONS: f64 = 50.0;
/// Blur of the projected apertures over the period beyond which visibility is below 9 %.
const BLURRED_AWAY: f64 = 0.4;
/// Relative difference from whole turns of angles that were meant as radians.
const TURN: f64 = 1e-3;
/// Turns of a scan without travel beyond which angles were meant in another unit.
const MANY_TURNS: f64 = 2.0;
/// Distance of pixels beyond any detector, m.
const WIDE_PIXELS: f64 = 5e-3;
/// Delta of the free electrons of osmium, the densest solid, times the squared energy, keV2.
const DENSEST: f64 = 4e-3;
/// Detector numbers of the brightest pixel behind the masks, below which rounding takes the signal.
const FEW_NUMBERS: f64 = 2.0;
/// Relative difference of periods that fit one another.
const SAME_PERIOD: f64 = 1e-3;
/// Light of a frame over the nominal one, or its inverse, beyond which a share was meant as per cent.
const UNSTEADY: f64 = 2.0;

/// The doubts about a scene.
pub(super) fn doubts(scene: &Scene, report: &CheckReport) -> Vec<String> {
    let optics = Optics::of(scene);
    let masks = [&optics.sample_mask, &optics.detector_mask].map(Option::as_ref);
    let mut doubts: Vec<String> = [
        periods_of_masks(&optics, masks),
        wide_pixels(&optics),
        period_of_pixels(&optics),
        slits_on_borders(&optics),
        blurred_away(scene, &optics),
        air(scene, report.setup.nodes.mean_energy()),
        dark_beam(scene),
        unfiltered(scene, report.setup.nodes.mean_energy()),
        uneven_spectrum(scene),
        radians(&scene.scan.angles),
        many_turns(&scene.scan),
        few_offsets(scene),
        curve_beside_scan(scene, &optics),
    ]
    .into_iter()
    .flatten()
    .collect();
    doubts.extend(super::angles::doubts(&scene.scan));
    doubts.extend(thick_bars(scene));
    doubts.extend(masks.into_iter().flatten().filter_map(closed_mask));
    doubts.extend(displaced_mask(scene));
    doubts.extend(unsteady_light(&scene.scan));
    doubts.extend(odd_materials(scene, report.setup.energy));
    let passed = masks.into_iter().flatten().map(Mask::open_share).fold(1.0, f64::min);
    doubts.extend(scene.detector.counts.iter().flat_map(|counts| photons(counts, passed)));
    doubts
}

/// Fringes across the columns of two periods whose ratio, or its inverse, is nearly whole.
fn fringes(a: f64, b: f64, columns: f64) -> f64 {
    let ratio = (a / b).max(b / a);
    (ratio - ratio.round()).abs() / ratio.round() * columns
}

/// Projected periods of the two masks that do not fit one another.
fn periods_of_masks(optics: &Optics, masks: [Option<&Mask>; 2]) -> Option<String> {
    let [Some(first), Some(second)] = masks else { return None };
    let plane = optics.detector.distance;
    let [a, b] = [first, second].map(|mask| mask.without_shifts(plane).period[0]);
    let fringes = fringes(a, b, f64::from(optics.detector.pixels[0]));
    (fringes > FRINGES).then(|| {
        format!(
            "the projected periods of the masks, {:.3} um and {:.3} um, differ so that {fringes:.1} moire \
             fringes cross the detector; periods that fit are in proportion to the distances",
            a * 1e6,
            b * 1e6
        )
    })
}

/// Pixels that no detector has.
fn wide_pixels(optics: &Optics) -> Option<String> {
    let [x, z] = optics.detector.pitch;
    let pitch = x.max(z);
    (pitch > WIDE_PIXELS).then(|| {
        format!(
            "detector.pitch of {} mm is wider than any pixel of an X-ray detector: is its unit right?",
            number(pitch * 1e3)
        )
    })
}

/// Projected period of the detector mask that does not fit the pixels.
fn period_of_pixels(optics: &Optics) -> Option<String> {
    let detector = &optics.detector;
    let period = optics.detector_mask.as_ref()?.without_shifts(detector.distance).period[0];
    let fringes = fringes(period, detector.pitch[0], f64::from(detector.pixels[0]));
    (fringes > FRINGES).then(|| {
        format!(
            "the projected period of detector_mask, {:.3} um, and detector.pitch, {:.3} um, differ so that \
             {fringes:.1} fringes cross the detector: set detector_mask.period to {:.4} um, or omit it",
            period * 1e6,
            detector.pitch[0] * 1e6,
            detector.pitch[0] * 1e6 * (period / detector.pitch[0]).round().max(1.0)
                / (detector.distance / optics.analyser)
        )
    })
}

/// Slits of the detector mask on the border of two pixels.
fn slits_on_borders(optics: &Optics) -> Option<String> {
    let detector = &optics.detector;
    let mask = optics.detector_mask.as_ref()?;
    let openings = mask.openings(detector.distance);
    let slit = openings.narrowest(0);
    let middle = if detector.pixels[0].is_multiple_of(2) { 0.0 } else { 0.5 };
    let crossed = [middle, middle + 1.0].into_iter().any(|border| {
        let slope = border * detector.pitch[0] / detector.distance;
        let place = mask.off_centre(slope, detector.distance);
        openings.ends().any(|[low, high]| low < place && place < high)
    });
    // A slit of a pixel's width crosses borders wherever it is.
    (crossed && slit < 0.9 * detector.pitch[0]).then(|| {
        "slits of detector_mask are in front of pixel borders, so that two pixels share the light of a slit: \
         detector_mask.offset moves the slits in front of pixel centres"
            .into()
    })
}

/// A spot that leaves next to no illumination curve.
fn blurred_away(scene: &Scene, optics: &Optics) -> Option<String> {
    let mask = optics.sample_mask.as_ref().filter(|_| optics.detector_mask.is_some())?;
    let period = mask.without_shifts(optics.analyser).period[0];
    let blur = (scene.magnification() - 1.0) * spot::deviation(scene.source.spot.fwhm()[0]);
    (blur > BLURRED_AWAY * period).then(|| {
        format!(
            "the spot blurs the illumination curve away: its standard deviation is {:.1} um on the detector \
             mask, where the sample mask has a period of {:.1} um; a smaller source.spot or sample_mask nearer \
             to the sample keeps the curve",
            blur * 1e6,
            period * 1e6
        )
    })
}

/// A long path of a soft spectrum in vacuum; a single energy is not hardened.
fn air(scene: &Scene, energy: f64) -> Option<String> {
    let spectrum = matches!(scene.source.beam, Beam::Spectrum(_));
    if !spectrum || scene.path_material != "vacuum" || energy >= SOFT {
        return None;
    }
    let air = material::constants_at(scene, "air", energy).ok()?;
    let taken = 1.0 - (-air.mu * scene.detector.distance).exp();
    (taken > TAKEN_BY_AIR).then(|| {
        format!(
            "the beam of {} keV on average runs through {} m of vacuum; air takes {:.0} % of it and hardens \
             the spectrum: surroundings.path_material = \"air\" unless the path is evacuated",
            number(energy),
            number(scene.detector.distance),
            100.0 * taken
        )
    })
}

/// Filters or a path that absorb nearly all light.
fn dark_beam(scene: &Scene) -> Option<String> {
    let (what, left) = match &scene.source.beam {
        Beam::Energy(energy) => {
            let path = material::constants_at(scene, &scene.path_material, *energy).ok()?;
            ("surroundings.path_material", (-path.mu * scene.detector.distance).exp())
        }
        Beam::Spectrum(spec) => {
            let before = Spectrum::before_filters(scene, spec).ok()?.total();
            let after = Spectrum::after_filters(scene, spec).ok()?.total();
            ("source.spectrum.filters and surroundings.path_material", after / before)
        }
    };
    (left < DARK).then(|| {
        format!(
            "{what} leave {left:.1e} of the photons of the source: are thickness, unit and material right?"
        )
    })
}

/// A mask with next to no openings.
fn closed_mask(mask: &Mask) -> Option<String> {
    let open = mask.open_share();
    (open < CLOSED).then(|| {
        format!(
            "the apertures of {} are {:.2} % of it: are the units of aperture and period right?",
            mask.name(),
            100.0 * open
        )
    })
}

/// A tube without a filter.
fn unfiltered(scene: &Scene, energy: f64) -> Option<String> {
    let Beam::Spectrum(spectrum) = &scene.source.beam else { return None };
    let SpectrumOrigin::Tube { kvp, .. } = &spectrum.origin else { return None };
    (spectrum.filters.is_empty() && energy < SOFT_TUBE * kvp).then(|| {
        format!(
            "the beam of the tube has no filter besides its window, and a mean energy of {} keV: \
             most set-ups have a filter (source.spectrum.filters), at least of air",
            number(energy)
        )
    })
}

/// A file of a continuous spectrum with uneven energies, whose weights may be meant per keV. Long files were
/// joined and have uneven means.
fn uneven_spectrum(scene: &Scene) -> Option<String> {
    let Beam::Spectrum(spec) = &scene.source.beam else { return None };
    let SpectrumOrigin::File { path } = &spec.origin else { return None };
    let spectrum = Spectrum::before_filters(scene, spec).ok()?;
    let is_continuous = CONTINUOUS.contains(&spectrum.energies_kev.len());
    (is_continuous && !spectrum.is_even()).then(|| {
        format!(
            "the energies of {} are uneven: each weight counts as the photons of its row; multiply weights per \
             keV by the width of their row",
            beamlet_core::printed::path(path)
        )
    })
}

/// Angles that cover half a turn or a turn if their degrees are radians.
fn radians(angles: &[f64]) -> Option<String> {
    let [first, .., last] = angles else { return None };
    let count = angles.len() as f64;
    let degrees = (last - first).abs().to_degrees();
    // With the end and without it.
    let spans = [degrees, degrees * count / (count - 1.0)];
    let whole = [PI, 2.0 * PI];
    let odd = whole.iter().any(|turn| spans.iter().any(|span| (span / turn - 1.0).abs() < TURN));
    (odd && angles.len() > 2).then(|| {
        format!(
            "scan.angles cover {} deg, which is {} turns if the numbers are radians: is their unit right?",
            number(degrees),
            if degrees > 4.0 { "1" } else { "1/2" }
        )
    })
}

/// Angles of several turns about a sample that does not move otherwise.
fn many_turns(scan: &Scan) -> Option<String> {
    let low = scan.angles.iter().copied().fold(f64::INFINITY, f64::min);
    let high = scan.angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let turns = (high - low) / (2.0 * PI);
    (scan.is_circle() && turns > MANY_TURNS).then(|| {
        format!(
            "scan.angles cover {turns:.1} turns of a sample that does not travel: is their unit right?"
        )
    })
}

/// Too few mask offsets for any retrieval with both masks.
fn few_offsets(scene: &Scene) -> Option<String> {
    let different = different_offsets(&scene.offsets_of_group(&scene.scan.mask_offsets));
    let methods = [Method::TwoStep, Method::ThreeStep, Method::Gaussian, Method::ExactCurve];
    let [two_step, three_step, gaussian, exact_curve] = methods.map(Method::least_offsets);
    (scene.masks().count() == 2 && different < three_step).then(|| {
        format!(
            "different values of scan.mask_offsets: {different}; `retrieve` needs {three_step} of them \
             (method three-step), {gaussian} (gaussian) or {exact_curve} (exact-curve); {two_step} give no dark \
             field (two-step)"
        )
    })
}

/// Offsets of the masks that move the illumination curve out of the scan, where slits and pixels have one
/// period.
fn curve_beside_scan(scene: &Scene, optics: &Optics) -> Option<String> {
    let [sample, detector] = [&scene.sample_mask, &scene.detector_mask].map(Option::as_ref);
    let [sample, detector] = [sample?, detector?];
    let is_plain = |mask: &MaskSpec| mask.apertures.is_empty() && mask.shifts.is_empty();
    if !(is_plain(sample) && is_plain(detector)) {
        return None;
    }
    let (period, pitch) = (sample.period, scene.detector.pitch[0] / scene.detector.distance);
    let fits = |period: f64, distance: f64| (period / distance / pitch - 1.0).abs() < SAME_PERIOD;
    if !fits(period, sample.distance) || !fits(detector.period, detector.distance) {
        return None;
    }
    let offsets = || scene.scan.mask_offsets.iter().copied();
    let low = offsets().fold(f64::INFINITY, f64::min);
    let high = offsets().fold(f64::NEG_INFINITY, f64::max);
    let seen = |offset: f64, distance: f64| offset * optics.analyser / distance;
    let peak = seen(detector.offset, detector.distance) / scene.magnification() - sample.offset;
    let middle = f64::midpoint(low, high);
    let peak = middle + libm::remainder(peak - middle, period);
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

/// Errors of the mask offsets beyond half a period.
fn displaced_mask(scene: &Scene) -> Option<String> {
    let half = scene.sample_mask.as_ref()?.period / 2.0;
    let errors = scene.scan.errors.mask_offsets.iter().flatten();
    let most = errors.fold(0.0, |most: f64, error| most.max(error.abs()));
    (most > half).then(|| {
        format!(
            "scan.errors displace the sample mask by up to {} um, more than half its period, {} um: is their \
             unit right?",
            number(most * 1e6),
            number(half * 1e6)
        )
    })
}

/// Light that varies more than that of any source.
fn unsteady_light(scan: &Scan) -> Option<String> {
    let light = || scan.errors.intensities.iter().flatten().copied();
    let (low, high) = (light().fold(1.0, f64::min), light().fold(1.0, f64::max));
    (low * UNSTEADY < 1.0 || high > UNSTEADY).then(|| {
        format!(
            "scan.errors give frames {} to {} of the nominal light: intensity errors are shares, 0.01 for 1 %",
            number(low),
            number(high)
        )
    })
}

/// Bars beyond any mask.
fn thick_bars(scene: &Scene) -> Vec<String> {
    let thick = scene.masks().filter(|(_, mask)| mask.body.thickness() > limits::THICK_BARS);
    thick
        .map(|(name, mask)| {
            format!(
                "{name}.{} of {} mm is more than any mask has, about 1 mm: is its unit right?",
                mask.body.thickness_key(),
                number(mask.body.thickness() * 1e3)
            )
        })
        .collect()
}

/// Materials of objects with the density of a gas, that refract as light optics does, or more than any
/// solid. `energy`: of the beam, keV.
fn odd_materials(scene: &Scene, energy: f64) -> Vec<String> {
    let mut doubts = Vec::new();
    for (name, spec) in &scene.materials {
        let used = scene.objects.iter().any(|object| object.material == *name);
        match spec {
            MaterialSpec::Formula { density, .. } | MaterialSpec::Mixture { density, .. }
                if used && *density < GAS =>
            {
                doubts.push(format!(
                    "materials.{name}.density of {} g/cm3 ({} kg/m3) is the density of a gas: is its unit right?",
                    number(*density),
                    number(density * 1e3)
                ));
            }
            MaterialSpec::Constants { delta, .. } if *delta < 0.0 => doubts.push(format!(
                "materials.{name}.delta of {delta:e} is negative: X-rays away from absorption edges have \
                 delta > 0, with n = 1 - delta"
            )),
            MaterialSpec::Constants { delta, .. } if *delta > DENSEST / energy.powi(2) => {
                doubts.push(format!(
                    "materials.{name}.delta of {delta:e} is more than the densest solid has at {} keV, \
                     about {:.1e}: is it right?",
                    number(energy),
                    DENSEST / energy.powi(2)
                ));
            }
            _ => {}
        }
    }
    doubts
}

/// Too few photons for a fit, or more than the numbers of the detector hold; `passed`: most light of a pixel
/// behind the masks, share of open beam.
fn photons(counts: &Counts, passed: f64) -> Vec<String> {
    let mut doubts = Vec::new();
    if counts.photons < FEW_PHOTONS {
        doubts.push(format!(
            "detector.photons of {} is too few for a fit: it is the mean number of photons of an open pixel \
             in a frame",
            number(counts.photons)
        ));
    }
    if counts.photons > MANY_PHOTONS {
        doubts.push(format!(
            "detector.photons of {:.1e} is more than an open pixel gets in a frame: it is no sum over pixels or \
             frames, and no rate",
            counts.photons
        ));
    }
    let signal = passed * counts.photons * counts.gain;
    if counts.electronic_noise > signal {
        doubts.push(format!(
            "detector.electronic_noise of {} is more than the {} detector numbers that aligned masks light a \
             pixel with: it is a standard deviation, in detector numbers",
            number(counts.electronic_noise),
            number(signal)
        ));
    }
    if let Some(bits) = counts.bit_depth {
        let most = 2_f64.powf(f64::from(bits)) - 1.0;
        if signal < FEW_NUMBERS {
            doubts.push(format!(
                "aligned masks light a pixel with {} detector numbers above no light, and rounding to whole \
                 numbers takes the rest: a larger detector.gain avoids it",
                number(signal)
            ));
        }
        let brightest = signal + counts.number_without_light();
        if brightest > most {
            doubts.push(format!(
                "aligned masks light a pixel with the detector number {}, and {bits} bits hold {} at most: \
                 brighter pixels are clipped; a smaller detector.gain avoids it",
                number(brightest.round()),
                number(most)
            ));
        }
    }
    doubts
}
