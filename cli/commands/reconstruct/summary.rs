//! Plan and summary of a reconstruction in words.

use crate::failure::Failure;
use beamlet::cli_support::options::ReconstructArguments;
use beamlet::cli_support::printed;
use beamlet::reconstruct::{
    Input, LostUse, Method, Quantity, Reconstructed, VolumeEstimate, VolumePlan, VolumeRecord,
};
use std::io::Write;
use std::path::Path;

/// Where the voxels lie, in words.
fn grid_words(grid: &beamlet::reconstruct::VolumeGrid) -> String {
    let [x, y, z] = grid.size;
    let [a, b, c] = grid.voxel.map(|side| side * 1e6);
    let [[left, right], [front, back], [low, high]] =
        grid.ends().map(|ends| ends.map(|end| end * 1e3));
    format!(
        "{x} x {y} x {z} voxels of {a:.4} x {b:.4} x {c:.4} um, centres at x {left:.4} to {right:.4}, y \
         {front:.4} to {back:.4}, z {low:.4} to {high:.4} mm"
    )
}

fn names(quantities: &[Quantity]) -> String {
    quantities.iter().map(|quantity| quantity.name()).collect::<Vec<_>>().join(", ")
}

/// Prints the plan of a reconstruction.
pub(super) fn describe(
    given: &ReconstructArguments,
    plan: &VolumePlan,
    input: &Input,
    found: VolumeEstimate,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let [views, rows, columns] = input.geometry().shape();
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    writeln!(out, "volumes  {} ({})", names(&plan.quantities), given.format)?;
    writeln!(
        out,
        "views    {views} of {columns} x {rows} pixels, axis of rotation in column {:.3}",
        input.geometry().axis_column()
    )?;
    writeln!(out, "grid     {}", grid_words(&plan.grid))?;
    writeln!(
        out,
        "memory   {:.1} MiB on the host and {:.1} MiB on the device; each volume {:.1} MiB",
        mib(found.host_bytes),
        mib(found.device_bytes),
        mib(found.volume_bytes)
    )?;
    let what = match &plan.method {
        Method::Iterative { options, .. } => {
            format!("projections and back-projections, {} iterations", options.iterations)
        }
        _ => "back-projection".to_owned(),
    };
    writeln!(
        out,
        "time     about {:.1} s of {what}, extrapolated from a part of it on this device",
        found.seconds
    )?;
    writeln!(out, "nothing was written")?;
    Ok(())
}

/// The energy that μ is quoted at.
fn energy_words(record: &VolumeRecord, out: &mut impl Write) -> Result<(), Failure> {
    if let Some(it) = &record.beam_hardening {
        writeln!(
            out,
            "energy   mu at {:.3} keV, corrected for beam hardening in {} (-ln T up to {:.3}; fit \
             within {:.1e})",
            it.energy_kev, it.material, it.largest, it.error
        )?;
        return Ok(());
    }
    match record.beam {
        Some(beam) if beam.spectrum => writeln!(
            out,
            "energy   mu and delta are means over the spectrum (mean detected energy {:.3} keV); mu \
             is not corrected for beam hardening",
            beam.kev
        )?,
        Some(beam) => writeln!(out, "energy   {:.3} keV", beam.kev)?,
        None => {}
    }
    Ok(())
}

/// Views that lost their refraction.
fn lost_views(record: &VolumeRecord, out: &mut impl Write) -> Result<(), Failure> {
    let Some(moment) = &record.refraction_moment else {
        return Ok(());
    };
    let Some(way) = moment.lost_views_are else {
        return Ok(());
    };
    let way = match way {
        LostUse::Interpolated => "interpolated in delta (--keep-views keeps them)",
        LostUse::ZeroWeight => "weight 0 in delta (--keep-views keeps them)",
        _ => "kept in delta",
    };
    writeln!(out, "lost     refraction in {}: {way}", moment.words())?;
    Ok(())
}

/// Closing lines.
pub(super) fn summary(
    given: &ReconstructArguments,
    done: &Reconstructed,
    retrieved: Option<&Path>,
    seconds: f64,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let record = &done.record;
    if let Some(path) = retrieved {
        let note = "retrieved first, with the defaults of beamlet retrieve";
        writeln!(out, "images   {} ({note})", printed::path(path))?;
    }
    writeln!(out, "volumes  {}", printed::path(&given.output))?;
    for (name, unit) in &record.units {
        writeln!(out, "         {name} ({unit})")?;
    }
    writeln!(out, "method   {} {}", record.method, record.options)?;
    let [views, rows, columns] = record.sinograms;
    writeln!(out, "views    {views} of {columns} x {rows} pixels, in {seconds:.1} s")?;
    writeln!(out, "grid     {}", grid_words(&record.grid()))?;
    writeln!(out, "axis     in column {:.3}", record.axis_column)?;
    energy_words(record, out)?;
    for (what, value) in [("mask", &record.mask), ("start", &record.start)] {
        if let Some(value) = value {
            writeln!(out, "{what:<8} {value}")?;
        }
    }
    lost_views(record, out)?;
    if let Some(drift) = record.drift {
        writeln!(out, "phase    {}", crate::commands::drift_words(&drift))?;
    }
    if let Some(k) = record.gradient_bias_m {
        writeln!(out, "bias     delta + k mu, k = {k:.3e} m (gradients of the attenuation)")?;
    }
    for (name, counts) in &record.pixels {
        let is_mu = name == Quantity::Mu.name();
        let misfits = if is_mu { "filled" } else { "kept" };
        writeln!(
            out,
            "pixels   {name}: of {}, {} without a result and {} with T <= 0 are filled, {} misfits {misfits}",
            counts.pixels, counts.without_answer, counts.dark, counts.misfits
        )?;
    }
    if let Some(table) = &done.errors {
        writeln!(out)?;
        write!(out, "{table}")?;
    }
    Ok(())
}
