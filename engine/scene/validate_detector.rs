//! Ranges of the detector.

use super::detector::{Blur, Counts, Detector, DetectorMode, KernelFile, Scatter};
use super::validate::{Faults, count, named, not_negative, plain, positive};
use super::{Beam, Scene, SpectrumOrigin, SpectrumSpec, limits};
use crate::units::Dimension::{Energy, Length};
use crate::{Error, Result};

/// Photons of an open pixel: beyond this f64 does not resolve neighbouring counts.
const PHOTONS: f64 = 1e12;

pub(super) fn validate_detector(scene: &Scene, faults: &mut Faults) {
    let detector = &scene.detector;
    faults.note(positive("detector.distance", detector.distance, Length));
    let mut pixels = detector.pixels.iter();
    faults.note(pixels.try_for_each(|side| count("detector.pixels", *side, 1, limits::PIXELS)));
    let mut pitch = detector.pitch.iter();
    faults.note(pitch.try_for_each(|pitch| positive("detector.pitch", *pitch, Length)));
    faults.note(validate_mode(detector));
    // Where it takes a file to know the highest energy, the run and `check` look.
    faults.note(match &scene.source.beam {
        Beam::Energy(energy) => validate_thresholds(detector, *energy),
        Beam::Spectrum(SpectrumSpec { origin: SpectrumOrigin::Tube { kvp, .. }, .. }) => {
            validate_thresholds(detector, *kvp)
        }
        Beam::Spectrum(_) => Ok(()),
    });
    if let Some(absorber) = &detector.absorber {
        faults.note(named("detector.absorber.material", &absorber.material));
        faults.note(positive("detector.absorber.thickness", absorber.thickness, Length));
    }
    match &detector.blur {
        Some(Blur::Gaussian { sigma }) => faults.note(validate_blur(*sigma, detector.pitch)),
        Some(Blur::Kernel(kernel)) => faults.note(validate_kernel("detector.blur", kernel)),
        None => {}
    }
    match &detector.scatter {
        Some(Scatter::Image(path)) => faults.note(file("detector.scatter.image", path)),
        Some(Scatter::Kernel { kernel, fraction }) => {
            faults.note(validate_kernel("detector.scatter", kernel));
            let key = "detector.scatter.fraction";
            faults.note(plain(key, *fraction, *fraction > 0.0, "a number > 0"));
        }
        None => {}
    }
    if let Some(counts) = &detector.counts {
        validate_counts(detector, counts, faults);
    }
}

fn validate_blur(sigma: [f64; 2], pitch: [f64; 2]) -> Result<()> {
    for (sigma, pitch) in sigma.into_iter().zip(pitch) {
        not_negative("detector.blur.sigma", sigma, Length)?;
        let most = limits::BLUR * pitch;
        if sigma > most {
            return Err(Error::scene(
                "detector.blur.sigma",
                Length.format(sigma),
                format!("no more than {} pixels, {}", limits::BLUR, Length.format(most)),
            ));
        }
    }
    Ok(())
}

fn validate_mode(detector: &Detector) -> Result<()> {
    let DetectorMode::Counting { low, high } = detector.mode else { return Ok(()) };
    for (key, threshold) in [("threshold_low", low), ("threshold_high", high)] {
        if let Some(threshold) = threshold {
            positive(&format!("detector.{key}"), threshold, Energy)?;
        }
    }
    match (low, high) {
        (Some(low), Some(high)) if low >= high => Err(Error::scene(
            "detector.threshold_high",
            Energy.format(high),
            format!("more than threshold_low, {}", Energy.format(low)),
        )),
        _ => Ok(()),
    }
}

/// Refuses thresholds beyond the highest energy of the beam, keV.
///
/// # Errors
/// [`Error::Scene`] with the key of the threshold.
pub(crate) fn validate_thresholds(detector: &Detector, highest: f64) -> Result<()> {
    let DetectorMode::Counting { low, high } = detector.mode else { return Ok(()) };
    for (key, threshold) in [("threshold_low", low), ("threshold_high", high)] {
        let Some(threshold) = threshold else { continue };
        if threshold > highest {
            return Err(Error::scene(
                format!("detector.{key}"),
                Energy.format(threshold),
                format!("no more than the highest energy of the beam, {}", Energy.format(highest)),
            ));
        }
    }
    Ok(())
}

fn validate_kernel(table: &str, kernel: &KernelFile) -> Result<()> {
    file(&format!("{table}.kernel"), &kernel.path)?;
    kernel.pixel.iter().try_for_each(|size| positive(&format!("{table}.pixel"), *size, Length))
}

fn file(key: &str, path: &std::path::Path) -> Result<()> {
    if path.as_os_str().is_empty() {
        return Err(Error::scene(key, "\"\"", "path of a file"));
    }
    Ok(())
}

fn validate_counts(detector: &Detector, counts: &Counts, faults: &mut Faults) {
    let key = |key: &str| format!("detector.{key}");
    let Counts { photons, electronic_noise, swank, gain, offset, bit_depth } = *counts;
    let allowed = "a number of photons > 0, up to 1e12";
    faults.note(plain(&key("photons"), photons, photons > 0.0 && photons <= PHOTONS, allowed));
    let noise = electronic_noise >= 0.0;
    faults.note(plain(&key("electronic_noise"), electronic_noise, noise, "a number >= 0"));
    let inside = swank > 0.0 && swank <= 1.0;
    faults.note(plain(&key("swank"), swank, inside, "a number above 0, up to 1"));
    if swank < 1.0 && detector.mode != DetectorMode::Integrating {
        let found = format!("{swank:?} with mode = \"counting\"");
        let allowed = "1: a photon that is counted is one count; or mode = \"integrating\"";
        faults.add(Error::scene(key("swank"), found, allowed));
    }
    faults.note(plain(&key("gain"), gain, gain > 0.0, "a number > 0"));
    let offset = offset.unwrap_or(0.0);
    faults.note(plain(&key("offset"), offset, true, "a finite number"));
    if let Some(bits) = bit_depth {
        faults.note(count(&key("bit_depth"), bits, 1, limits::BIT_DEPTH));
    }
}
