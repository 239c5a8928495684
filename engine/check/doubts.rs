//! Doubts about a set-up: values that are allowed, and unlikely.

use super::{CheckReport, angles, faces};
use beamlet_core::printed::number;
use beamlet_geometry::Sample;
use beamlet_model::optics::{Mask, Optics, ends};
use beamlet_model::scene::{Beam, Counts, MaterialSpec, Photons, Scene, SpectrumOrigin, limits};
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
/// Share of the light that an absorber takes, below which it is probably too thin.
const THIN_ABSORBER: f64 = 0.01;
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
/// Light of a frame over the nominal one, or its inverse, beyond which a share was meant as per cent.
const UNSTEADY: f64 = 2.0;

/// Doubts so far, in words.
#[derive(Default)]
struct Doubts(Vec<String>);

/// The doubts about a scene.
pub(super) fn doubts(scene: &Scene, sample: &Sample, report: &CheckReport) -> Vec<String> {
    let optics = Optics::of(scene);
    let mut all = Doubts::default();
    all.of_pixels(scene, &optics);
    all.of_masks(scene, &optics);
    all.of_beam(scene, report.setup.nodes.mean_energy());
    all.of_scan(scene);
    all.0.extend(angles::few_views(scene, sample));
    all.0.extend(angles::doubts(&scene.scan));
    all.of_materials(scene, report.setup.energy);
    if let Some(counts) = &scene.detector.counts {
        let open = masks(&optics).map(Mask::open_share).fold(1.0, f64::min);
        if let Some(exposure) = &report.exposure {
            all.of_counts(counts, exposure.photons, open);
        }
    }
    all.0.extend(faces::doubts(scene, sample));
    all.0
}

impl Doubts {
    fn add(&mut self, is_odd: bool, text: impl FnOnce() -> String) {
        if is_odd {
            self.0.push(text());
        }
    }

    /// Pixels that no detector has, and masks whose projected periods or slits do not fit one another or the pixels.
    fn of_pixels(&mut self, scene: &Scene, optics: &Optics) {
        let detector = &optics.detector;
        let (plane, [pitch, height]) = (detector.distance, detector.pitch);
        let columns = f64::from(detector.pixels[0]);
        self.add(pitch.max(height) > WIDE_PIXELS, || {
            format!(
                "detector.pitch of {} mm is wider than any pixel of an X-ray detector: is its unit right?",
                number(pitch.max(height) * 1e3)
            )
        });
        let Some(mask) = &optics.detector_mask else { return };
        let period = mask.without_shifts(plane).period[0];
        if let Some(sample_mask) = &optics.sample_mask {
            let first = sample_mask.without_shifts(plane).period[0];
            let times = (first / period).round();
            let is_plain =
                scene.masks().all(|(_, mask)| mask.apertures.is_empty() && mask.shifts.is_empty());
            self.add(is_plain && times >= 2.0, || {
                format!(
                    "the projected period of sample_mask, {:.3} um, is {times} times that of detector_mask, {:.3} um: \
                     one slit of {times} has light at a time; is one of the periods wrong?",
                    first * 1e6,
                    period * 1e6
                )
            });
            let moire = fringes(first, period, columns);
            self.add(moire > FRINGES, || {
                format!(
                    "the projected periods of the masks, {:.3} um and {:.3} um, differ so that {moire:.1} moire \
                     fringes cross the detector; periods that fit are in proportion to the distances",
                    first * 1e6,
                    period * 1e6
                )
            });
        }
        let beats = fringes(period, pitch, columns);
        self.add(beats > FRINGES, || {
            format!(
                "the projected period of detector_mask, {:.3} um, and detector.pitch, {:.3} um, differ so that \
                 {beats:.1} fringes cross the detector: set detector_mask.period to {:.4} um, or omit it",
                period * 1e6,
                pitch * 1e6,
                pitch * 1e6 * (period / pitch).round().max(1.0) / (plane / optics.analyser)
            )
        });
        let openings = mask.openings(plane);
        let middle = if detector.pixels[0].is_multiple_of(2) { 0.0 } else { 0.5 };
        let is_crossed = [middle, middle + 1.0].into_iter().any(|border| {
            let place = mask.off_centre(border * pitch / plane, plane);
            openings.ends().any(|[low, high]| low < place && place < high)
        });
        // A slit of a pixel's width crosses borders wherever it is.
        self.add(is_crossed && openings.narrowest(0) < 0.9 * pitch, || {
            "slits of detector_mask are in front of pixel borders, so that two pixels share the light of a slit: \
             detector_mask.offset moves the slits in front of pixel centres"
                .into()
        });
    }

    /// Masks that leave next to no illumination curve or light, or that nobody has.
    fn of_masks(&mut self, scene: &Scene, optics: &Optics) {
        if let (Some(mask), Some(_)) = (&optics.sample_mask, &optics.detector_mask) {
            let period = mask.without_shifts(optics.analyser).period[0];
            let blur = (scene.magnification() - 1.0) * spot::deviation(scene.source.spot.fwhm()[0]);
            self.add(blur > BLURRED_AWAY * period, || {
                format!(
                    "the spot blurs the illumination curve away: its standard deviation is {:.1} um on the detector \
                     mask, where the sample mask has a period of {:.1} um; a smaller source.spot or sample_mask \
                     nearer to the sample keeps the curve",
                    blur * 1e6,
                    period * 1e6
                )
            });
        }
        for (name, mask) in scene.masks() {
            let thickness = mask.body.thickness();
            self.add(thickness > limits::THICK_BARS, || {
                format!(
                    "{name}.{} of {} mm is more than any mask has, about 1 mm: is its unit right?",
                    mask.body.thickness_key(),
                    number(thickness * 1e3)
                )
            });
        }
        for mask in masks(optics) {
            let open = mask.open_share();
            self.add(open < CLOSED, || {
                format!(
                    "the apertures of {} are {:.2} % of it: are the units of aperture and period right?",
                    mask.name(),
                    100.0 * open
                )
            });
        }
    }

    /// A beam that air or filters change much. `energy`: mean, keV.
    fn of_beam(&mut self, scene: &Scene, energy: f64) {
        self.0.extend(dark_beam(scene));
        if let Some(absorber) = &scene.detector.absorber
            && let Ok(of) = material::constants_at(scene, &absorber.material, energy)
        {
            let taken = -libm::expm1(-of.mu * absorber.thickness);
            self.add(taken < THIN_ABSORBER, || {
                format!(
                    "detector.absorber takes {:.2} % of the photons that reach it at {} keV: are its thickness, unit and \
                     material right?",
                    100.0 * taken,
                    number(energy)
                )
            });
        }
        let Beam::Spectrum(spec) = &scene.source.beam else { return };
        let distance = scene.detector.distance;
        // A single energy is not hardened.
        if scene.path_material == "vacuum"
            && energy < SOFT
            && let Ok(air) = material::constants_at(scene, "air", energy)
        {
            let taken = 1.0 - (-air.mu * distance).exp();
            self.add(taken > TAKEN_BY_AIR, || {
                format!(
                    "the beam of {} keV on average runs through {} m of vacuum; air takes {:.0} % of it and hardens \
                     the spectrum: surroundings.path_material = \"air\" unless the path is evacuated",
                    number(energy),
                    number(distance),
                    100.0 * taken
                )
            });
        }
        match &spec.origin {
            SpectrumOrigin::Tube { kvp, .. } => {
                self.add(spec.filters.is_empty() && energy < SOFT_TUBE * kvp, || {
                    format!(
                        "the beam of the tube has no filter besides its window, and a mean energy of {} keV: \
                         most set-ups have a filter (source.spectrum.filters), at least of air",
                        number(energy)
                    )
                });
            }
            SpectrumOrigin::File { path } => {
                let Ok(spectrum) = Spectrum::before_filters(scene, spec) else { return };
                let is_continuous = CONTINUOUS.contains(&spectrum.energies_kev.len());
                self.add(is_continuous && !spectrum.is_even(), || {
                    format!(
                        "the energies of {} are uneven: each weight counts as the photons of its row; multiply \
                         weights per keV by the width of their row",
                        beamlet_core::printed::path(path)
                    )
                });
            }
            _ => {}
        }
    }

    /// Angles and offsets in another unit, too few offsets, and errors of a scan that nobody has.
    fn of_scan(&mut self, scene: &Scene) {
        let scan = &scene.scan;
        let angles = &scan.angles;
        let [low, high] = ends(angles);
        if let [first, .., last] = angles[..] {
            let count = angles.len() as f64;
            let degrees = (last - first).abs().to_degrees();
            // With the end and without it.
            let spans = [degrees, degrees * count / (count - 1.0)];
            let is_turn = |turn: f64| spans.iter().any(|span| (span / turn - 1.0).abs() < TURN);
            self.add(angles.len() > 2 && [PI, 2.0 * PI].into_iter().any(is_turn), || {
                format!(
                    "scan.angles cover {} deg, which is {} turns if the numbers are radians: is their unit right?",
                    number(degrees),
                    if degrees > 4.0 { "1" } else { "1/2" }
                )
            });
        }
        let turns = (high - low) / (2.0 * PI);
        self.add(scan.is_circle() && turns > MANY_TURNS, || {
            format!(
                "scan.angles cover {turns:.1} turns of a sample that does not travel: is their unit right?"
            )
        });
        let different = different_offsets(&scene.offsets_of_group(&scan.mask_offsets));
        let methods = [Method::TwoStep, Method::ThreeStep, Method::Gaussian, Method::ExactCurve];
        let [two_step, three_step, gaussian, exact_curve] = methods.map(Method::least_offsets);
        self.add(scene.masks().count() == 2 && different < three_step, || {
            format!(
                "different values of scan.mask_offsets: {different}; `retrieve` needs {three_step} of them \
                 (method three-step), {gaussian} (gaussian) or {exact_curve} (exact-curve); {two_step} give no dark \
                 field (two-step)"
            )
        });
        if let Some(mask) = &scene.sample_mask {
            let half = mask.period / 2.0;
            let errors = scan.errors.mask_offsets.iter().flatten();
            let most = errors.fold(0.0, |most: f64, error| most.max(error.abs()));
            self.add(most > half, || {
                format!(
                    "scan.errors displace the sample mask by up to {} um, more than half its period, {} um: is their \
                     unit right?",
                    number(most * 1e6),
                    number(half * 1e6)
                )
            });
        }
        let [low, high] = ends(scan.errors.intensities.iter().flatten().chain([&1.0]));
        self.add(low * UNSTEADY < 1.0 || high > UNSTEADY, || {
            format!(
                "scan.errors give frames {} to {} of the nominal light: intensity errors are shares, 0.01 for 1 %",
                number(low),
                number(high)
            )
        });
    }

    /// Materials of objects with the density of a gas, that refract as light optics does, or more than any solid.
    /// `energy`: of the beam, keV.
    fn of_materials(&mut self, scene: &Scene, energy: f64) {
        for (name, spec) in &scene.materials {
            match *spec {
                MaterialSpec::Formula { density, .. } | MaterialSpec::Mixture { density, .. } => {
                    let is_used = scene.objects.iter().any(|object| object.material == *name);
                    let is_host = scene.microstructures.contains_key(name);
                    self.add(is_used && !is_host && density < GAS, || {
                        format!(
                            "materials.{name}.density of {} g/cm3 ({} kg/m3) is the density of a gas: is its unit \
                             right?",
                            number(density),
                            number(density * 1e3)
                        )
                    });
                }
                MaterialSpec::Constants { delta, .. } => {
                    self.add(delta < 0.0, || {
                        format!(
                            "materials.{name}.delta of {delta:e} is negative: X-rays away from absorption edges have \
                             delta > 0, with n = 1 - delta"
                        )
                    });
                    let densest = DENSEST / energy.powi(2);
                    self.add(delta > densest, || {
                        format!(
                            "materials.{name}.delta of {delta:e} is more than the densest solid has at {} keV, \
                             about {densest:.1e}: is it right?",
                            number(energy)
                        )
                    });
                }
                _ => {}
            }
        }
    }

    /// Too few photons of an open pixel for a fit, or more than the numbers of the detector hold. `passed`: most light of
    /// a pixel behind the masks, share of open beam.
    fn of_counts(&mut self, counts: &Counts, photons: f64, passed: f64) {
        let begin = |number: String| match counts.photons {
            Photons::Number(_) => format!("detector.photons of {number} is"),
            Photons::Exposure(_) => {
                format!("{number} photons by detector.exposure and source.current are")
            }
        };
        self.add(photons < FEW_PHOTONS, || {
            let begin = begin(number(photons));
            format!(
                "{begin} too few for a fit: it is the mean number of photons of an open pixel in a frame"
            )
        });
        self.add(photons > MANY_PHOTONS, || {
            let begin = begin(format!("{photons:.1e}"));
            format!(
                "{begin} more than an open pixel gets in a frame: it is no sum over pixels or frames, and no rate"
            )
        });
        let signal = passed * photons * counts.gain;
        self.add(counts.electronic_noise > signal, || {
            format!(
                "detector.electronic_noise of {} is more than the {} detector numbers that aligned masks light a \
                 pixel with: it is a standard deviation, in detector numbers",
                number(counts.electronic_noise),
                number(signal)
            )
        });
        let Some(bits) = counts.bit_depth else { return };
        self.add(signal < FEW_NUMBERS, || {
            format!(
                "aligned masks light a pixel with {} detector numbers above no light, and rounding to whole \
                 numbers takes the rest: a larger detector.gain avoids it",
                number(signal)
            )
        });
        let most = 2_f64.powf(f64::from(bits)) - 1.0;
        let brightest = signal + counts.number_without_light();
        self.add(brightest > most, || {
            format!(
                "aligned masks light a pixel with the detector number {}, and {bits} bits hold {} at most: \
                 brighter pixels are clipped; a smaller detector.gain avoids it",
                number(brightest.round()),
                number(most)
            )
        });
    }
}

/// Both masks, where they are there.
fn masks(optics: &Optics) -> impl Iterator<Item = &Mask> {
    optics.sample_mask.iter().chain(&optics.detector_mask)
}

/// Fringes across the columns of two periods whose ratio, or its inverse, is nearly whole.
fn fringes(a: f64, b: f64, columns: f64) -> f64 {
    let ratio = (a / b).max(b / a);
    (ratio - ratio.round()).abs() / ratio.round() * columns
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
