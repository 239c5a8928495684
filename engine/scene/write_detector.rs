//! The resolved detector as TOML.

use std::path::Path;

use super::write::{Text, file, list, number, quantity, quoted};
use super::{Blur, DetectorMode, KernelFile, Scatter, Scene};
use crate::Result;
use crate::units::Dimension::{Energy, Length};

pub(super) fn write_detector(out: &mut Text, scene: &Scene, directory: &Path) -> Result<()> {
    let detector = &scene.detector;
    out.quantity("distance", detector.distance, Length);
    out.raw("pixels", format!("{:?}", detector.pixels));
    out.raw("pitch", list(&detector.pitch, Length));
    match detector.mode {
        DetectorMode::Counting { low, high } => {
            out.text("mode", "counting");
            for (key, threshold) in [("threshold_low", low), ("threshold_high", high)] {
                if let Some(threshold) = threshold {
                    out.quantity(key, threshold, Energy);
                }
            }
        }
        DetectorMode::Integrating => out.text("mode", "integrating"),
    }
    if let Some(absorber) = &detector.absorber {
        let (material, thickness) =
            (quoted(&absorber.material), quantity(absorber.thickness, Length));
        out.raw("absorber", format!("{{ material = {material}, thickness = {thickness} }}"));
    }
    let kernel = |kernel: &KernelFile| -> Result<String> {
        let path = quoted(&file(&kernel.path, scene, directory)?);
        Ok(format!("kernel = {path}, pixel = {}", list(&kernel.pixel, Length)))
    };
    match &detector.blur {
        Some(Blur::Gaussian { sigma }) => {
            out.raw("blur", format!("{{ sigma = {} }}", list(sigma, Length)));
        }
        Some(Blur::Kernel(measured)) => out.raw("blur", format!("{{ {} }}", kernel(measured)?)),
        None => {}
    }
    match &detector.scatter {
        Some(Scatter::Image(path)) => {
            let path = quoted(&file(path, scene, directory)?);
            out.raw("scatter", format!("{{ image = {path} }}"));
        }
        Some(Scatter::Kernel { kernel: spread, fraction }) => {
            let fraction = number(*fraction);
            out.raw("scatter", format!("{{ {}, fraction = {fraction} }}", kernel(spread)?));
        }
        None => {}
    }
    if let Some(counts) = &detector.counts {
        out.raw("photons", number(counts.photons));
        out.raw("electronic_noise", number(counts.electronic_noise));
        out.raw("swank", number(counts.swank));
        out.raw("gain", number(counts.gain));
        out.raw("offset", number(counts.number_without_light()));
        if let Some(bits) = counts.bit_depth {
            out.raw("bit_depth", bits);
        }
    }
    Ok(())
}
