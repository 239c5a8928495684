//! The report as aligned text for a terminal.

use super::{
    CheckReport, CheckedObject, ExpectedUncertainty, Hardening, IlluminationCurve, Material,
    PlanarUncertainty, ScanExposure, Work,
};
use beamlet_core::numbers;
use beamlet_core::printed::{duration, number};
use beamlet_core::units::Dimension;
use beamlet_files::AuditedError;
use std::fmt::{self, Display, Formatter};

/// Most objects of a list by name.
const NAMED: usize = 4;

impl Display for CheckReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write_setup(f)?;
        if let Some(curve) = &self.illumination {
            write_illumination(f, curve)?;
        }
        if let Some(expected) = &self.in_two_directions {
            write_in_two_directions(f, expected)?;
        }
        if let Some(exposure) = &self.exposure {
            write_exposure(f, exposure)?;
        }
        writeln!(f, "\nlimits of ray optics")?;
        self.ray_limits.lines().into_iter().try_for_each(|(label, text)| line(f, &label, text))?;
        let nodes = &self.setup.nodes;
        write!(f, "\nmaterials at {} keV", number(self.setup.energy))?;
        match nodes.energies.len() {
            1 => writeln!(f)?,
            count => {
                let error = nodes.estimated_error;
                writeln!(
                    f,
                    ", the mean of {count} energy nodes (estimated error {error:.1e}); over the spectrum: \
                     `beamlet material NAME --spectrum SCENE`"
                )?;
            }
        }
        let width = self.materials.iter().map(|m| m.name.chars().count()).max().unwrap_or(0);
        for material in &self.materials {
            write_material(f, material, width)?;
        }
        if !self.microstructures.is_empty() {
            writeln!(f, "\nmicrostructures")?;
        }
        for structure in &self.microstructures {
            write!(f, "{structure}")?;
        }
        if !self.objects.is_empty() {
            writeln!(f, "\nobjects")?;
        }
        for object in &self.objects {
            write_object(f, object)?;
        }
        if self.objects.iter().any(|it| !it.cut_by.is_empty()) {
            writeln!(f, "\noverlaps")?;
        }
        for CheckedObject { name, cut_by, .. } in &self.objects {
            cut_by
                .iter()
                .try_for_each(|it| writeln!(f, "  \"{name}\" overlaps \"{it}\": \"{it}\" wins"))?;
        }
        let work = &self.work;
        writeln!(f, "\nwork")?;
        line(f, "tolerances", work.tolerances.text())?;
        write_estimate(f, work)?;
        let memory = &work.memory;
        let [peak, host, device] =
            [memory.peak_bytes, memory.host_bytes, memory.device_bytes].map(bytes);
        line(f, "memory", format!("{peak} at the peak (host {host}, device {device})"))?;
        let band = format!("{} rows, {}", memory.band_rows, bytes(memory.band_bytes));
        line(f, "band", band)?;
        line(f, "output", bytes(work.output_bytes))?;
        if !self.warnings.is_empty() {
            writeln!(f)?;
        }
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}

impl CheckReport {
    fn write_setup(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let setup = &self.setup;
        let extent = setup.extent;
        if let Some(title) = &self.title {
            writeln!(f, "{}\n", beamlet_core::printed::line(title))?;
        }
        writeln!(f, "set-up")?;
        line(f, "mask magnification", number(setup.magnification))?;
        line(f, "object magnification", number(setup.object_magnification))?;
        line(f, "lever arm", length(setup.lever_arm))?;
        line(f, "fan angle", format!("{} deg", number(setup.fan_angle.to_degrees())))?;
        let [x, z] = setup.field_of_view.map(length);
        line(f, "field of view", format!("{x} x {z}"))?;
        let spot = &setup.spot;
        let [x, z] = spot.fwhm.map(length);
        let parts = match spot.parts {
            1 => String::new(),
            parts => format!(", the width by variance of {parts} Gaussians"),
        };
        let made = spot.fit.as_ref().map_or(String::new(), |fit| {
            let error = spot
                .curve_error
                .map_or(String::new(), |error| format!(", flat within {error:.1e} of open beam"));
            let off = fit.relative_error;
            format!(" for {} pixels (shape within {off:.1e}{error})", count(fit.samples as u64))
        });
        line(f, "focal spot", format!("{x} x {z}{parts}{made}"))?;
        for (name, mask) in
            [("sample mask", setup.sample_mask), ("detector mask", setup.detector_mask)]
        {
            let text = match mask {
                Some([period, aperture]) => {
                    format!("period {}, aperture {}", length(period), length(aperture))
                }
                None => "none".into(),
            };
            line(f, name, text)?;
        }
        if let Some(grid) = setup.subpixel_grid {
            let [x, z] = grid.parts;
            let error = number(grid.error);
            let text = format!("{x} x {z} parts of a pixel, error up to {error} of open beam");
            line(f, "detector blur", text)?;
        }
        let [near, far] = setup.clearance.map(distance);
        let text = setup.swept.map_or("nothing".into(), |[low, high]| {
            format!("{} to {} from the source", distance(low), distance(high))
        });
        line(f, "sample sweeps", format!("{text}, room from {near} to {far}"))?;
        if !setup.passing.is_empty() {
            let names: Vec<String> = setup.passing.iter().map(|it| self.with_share(it)).collect();
            line(f, "", format!("along z through the field: {}", named(&names)))?;
        }
        let (views, steps) = (extent.views, extent.steps);
        let frames = format!("{views} x {steps} of {} x {} pixels", extent.columns, extent.rows);
        line(f, "views x steps", frames)
    }
}

impl CheckReport {
    /// The name of an object that is higher than the field, and the share of it that is seen.
    fn with_share(&self, name: &str) -> String {
        let Some(object) = self.objects.iter().find(|it| it.name == name) else {
            return name.into();
        };
        let [low, high] = object.bounds.map(|[.., z]| z);
        let share = 100.0 * self.setup.field_of_view[1] / (high - low);
        format!("{name} ({} % of its {})", number(share), length(high - low))
    }
}

/// The light behind the masks, and the offsets of the curve.
fn write_illumination(f: &mut Formatter<'_>, curve: &IlluminationCurve) -> fmt::Result {
    let percent = |share: f64| format!("{} %", number(100.0 * share));
    writeln!(f, "\nillumination curve")?;
    line(f, "visibility", percent(curve.visibility))?;
    line(
        f,
        "sigma, FWHM",
        format!("{}, {} of mask offset", length(curve.sigma), length(curve.fwhm)),
    )?;
    line(f, "open fraction", format!("{} of open beam on average", percent(curve.open_fraction)))?;
    let [sample, detector] = curve.leak.map(percent);
    line(f, "leak of bars", format!("{sample} (sample mask), {detector} (detector mask)"))?;
    let [low, high] = curve.reach();
    let periods = [low, high].map(|reach| reach * curve.sigma / curve.period);
    let reach =
        format!("{low:.2} to {high:.2} sigma, {:.3} to {:.3} periods", periods[0], periods[1]);
    // The digits of a curve say nothing of a hundredth of its width.
    let place = match curve.peak.abs() > 0.01 * curve.sigma {
        true => format!(" from the peak at {}", length(curve.peak)),
        false => String::new(),
    };
    let reach = reach + &place;
    line(f, "mask offsets", reach)?;
    if curve.has_three_offsets() {
        let settled = "T, alpha and sigma_DF2, without a background of their own: what is beside the light that the \
                       masks leak appears as dark field, and misfits are not found";
        line(f, "with three offsets", settled.into())?;
    }
    if let Some(retrieval) = &curve.retrieval {
        let own = format!("{}, background {}", retrieval.method, retrieval.background);
        line(f, "retrieve", own)?;
        if let Some(response) = &retrieval.response {
            line(f, "response", format!("{response} of small contrasts"))?;
        }
        for error in &retrieval.phase {
            line(f, "--phase", error.of_phase())?;
        }
    }
    let Some(expected) = &curve.expected else { return Ok(()) };
    let ExpectedUncertainty { transmission, refraction, dark_field } = *expected;
    let text = format!(
        "T {transmission:.2e}, alpha {:.2e} urad, sigma_DF2 {:.2e} urad2, without a sample",
        refraction * 1e6,
        dark_field * 1e12
    );
    line(f, "expected 1 sigma", text)
}

/// Expected uncertainties along x and z.
fn write_in_two_directions(f: &mut Formatter<'_>, expected: &PlanarUncertainty) -> fmt::Result {
    let PlanarUncertainty { method, transmission, refraction: [x, z], dark_field } = *expected;
    writeln!(f, "\nexpected 1 sigma along x and z (method {method}), without a sample")?;
    line(f, "T", format!("{transmission:.2e}"))?;
    line(f, "alpha x, z", format!("{:.2e}, {:.2e} urad", x * 1e6, z * 1e6))?;
    let text = dark_field.map_or("not determined".into(), |dark| {
        let [xx, zz, xz] = dark.map(|value| format!("{:.2e}", value * 1e12));
        format!("{xx}, {zz}, {xz} urad2")
    });
    line(f, "sigma2 xx, zz, xz", text)
}

/// Photons, time and dose.
fn write_exposure(f: &mut Formatter<'_>, exposure: &ScanExposure) -> fmt::Result {
    let ScanExposure { photons, time, tube_load, air_kerma, water_dose, materials } = exposure;
    let gray = |dose: f64| Dimension::Dose.rounded(format!("{dose:.3e}").parse().unwrap_or(dose));
    writeln!(f, "\nexposure")?;
    line(f, "photons", format!("{photons:.4e} of an open pixel in a frame"))?;
    if let (Some(time), Some(load)) = (time, tube_load) {
        let text = format!("{} s of all frames, {} mA s", number(*time), number(*load));
        line(f, "time, tube load", text)?;
    }
    let place = "at the axis of rotation, in frames with the sample";
    line(f, "air kerma", format!("{} {place}", gray(*air_kerma)))?;
    line(f, "dose in water", gray(*water_dose))?;
    for of in materials.iter().filter(|of| of.material != "water") {
        let text = of.dose.map_or_else(|| "unknown: not tabulated".to_owned(), gray);
        line(f, &format!("dose in {}", of.material), text)?;
    }
    Ok(())
}

/// Rays and time, from a part of the patches.
fn write_estimate(f: &mut Formatter<'_>, work: &Work) -> fmt::Result {
    let Some(estimate) = &work.estimate else {
        let reason = work.no_estimate.as_deref().unwrap_or_default();
        return line(f, "rays", format!("no estimate: {reason}"));
    };
    let rays = [estimate.rays_per_view, estimate.rays].map(about);
    line(f, "rays", format!("about {} per view, {} in all", rays[0], rays[1]))?;
    line(f, "lines", format!("about {} in all", about(estimate.lines)))?;
    if let Some(error) = &estimate.sampling_error {
        let AuditedError { rms, standard_error, patches, .. } = error;
        let text = format!(
            "{rms:.1e} of open beam (rms of {patches} beamlets and rows, standard error {standard_error:.1e})"
        );
        line(f, "sampling", text)?;
    }
    let time = format!("about {}, without noise and output", duration(estimate.seconds));
    line(f, "time", time)
}

fn write_material(f: &mut Formatter<'_>, material: &Material, width: usize) -> fmt::Result {
    let Material { name, mu, delta, critical_angle, scattering, scattering_along, .. } = material;
    let angle = format!("{} mrad", number(critical_angle * 1e3));
    write!(f, "  {name:width$}  mu {:>12}  delta {delta:>11.4e}", format!("{} /m", number(*mu)))?;
    write!(f, "  critical angle {angle:>14}")?;
    if scattering.max(*scattering_along) > 0.0 {
        let text = |value: f64| {
            let rounded = format!("{value:.4e}").parse().unwrap_or(value);
            Dimension::Scattering.rounded(rounded)
        };
        write!(f, "  scattering {}", text(*scattering))?;
        if scattering_along.to_bits() != scattering.to_bits() {
            write!(f, " across its axis, {} along it", text(*scattering_along))?;
        }
    }
    if let Some(Hardening { path, change }) = &material.hardening {
        write!(f, "  hardening {:+.1} % over {}", 100.0 * change, length(*path))?;
    }
    write!(f, "  ({})", material.used_by.join(", "))?;
    writeln!(f, "{}", if material.shadows_builtin { ", hides the built-in one" } else { "" })
}

fn write_object(f: &mut Formatter<'_>, object: &CheckedObject) -> fmt::Result {
    writeln!(f, "  {} ({})", object.name, object.material)?;
    let detail =
        |f: &mut Formatter<'_>, label: &str, text: String| writeln!(f, "    {label:<18}{text}");
    let triangles = match object.triangles {
        0 => "0: an exact shape has none".into(),
        triangles => count(triangles as u64),
    };
    detail(f, "triangles", triangles)?;
    if object.instances > 0 {
        detail(f, "instances", count(object.instances as u64))?;
    }
    let is_whole = object.triangles == 0 && !object.cut_by.is_empty();
    let whole = if is_whole { " with what later objects cover" } else { "" };
    detail(f, "volume", format!("{} mm3{whole}", number(object.volume * 1e9)))?;
    let [low, high] = object.bounds.map(|corner| corner.map(|value| number(value * 1e3)));
    let range = |axis: usize| format!("{} to {}", low[axis], high[axis]);
    detail(f, "box x, y, z [mm]", format!("{}; {}; {}", range(0), range(1), range(2)))?;
    if !object.inside.is_empty() {
        detail(f, "inside", object.inside.join(", "))?;
    }
    let kinds = object.defects.kinds();
    for (kind, found) in kinds.into_iter().filter(|(_, found)| found.count > 0) {
        writeln!(f, "    {kind}: {}", found.to_string().replace('\n', "\n  "))?;
    }
    Ok(())
}

fn line(f: &mut Formatter<'_>, label: &str, text: String) -> fmt::Result {
    writeln!(f, "  {label:<22}{text}")
}

/// Names of objects; of many the number.
fn named(names: &[String]) -> String {
    match names.len() {
        ..=NAMED => names.join(", "),
        count => format!("{}, {} in all", names[..NAMED].join(", "), count),
    }
}

/// A length in the unit that suits it.
pub(super) fn length(metres: f64) -> String {
    let (scale, unit) = match metres.abs() {
        size if size >= 0.1 || size == 0.0 => (1.0, "m"),
        size if size >= 1e-3 => (1e3, "mm"),
        _ => (1e6, "um"),
    };
    format!("{} {unit}", number(metres * scale))
}

/// A count with its thousands apart.
#[must_use]
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// An estimated count, to two digits.
fn about(value: f64) -> String {
    let digits = value.abs().max(1.0).log10().floor() - 1.0;
    let unit = 10_f64.powf(digits.max(0.0));
    let rounded = numbers::whole::<u64>((value / unit).round() * unit);
    count(rounded)
}

/// Bytes in the unit that suits them.
pub(super) fn bytes(value: u64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    let mut scaled = value as f64 / 1024.0;
    let mut unit = 0;
    while scaled >= 1024.0 && unit + 1 < UNITS.len() {
        scaled /= 1024.0;
        unit += 1;
    }
    format!("{scaled:.1} {}", UNITS[unit])
}

/// A distance from the source, to the micrometre.
fn distance(metres: f64) -> String {
    format!("{metres:.6} m")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_counts_and_times_keep_their_unit_and_digits() {
        assert_eq!(length(1.5e-4), "150 um");
        assert_eq!(length(0.0128), "12.8 mm");
        assert_eq!(count(1_234_567), "1 234 567");
        assert_eq!(bytes(3 << 20), "3.0 MiB");
        assert_eq!(about(0.0), "0");
        assert_eq!(about(7.4), "7");
        assert_eq!(about(18_734_512.0), "19 000 000");
        assert_eq!(duration(0.84), "0.8 s");
        assert_eq!(duration(5000.0), "83 min");
    }
}
