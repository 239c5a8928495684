//! The closing lines of `beamlet retrieve`.

use crate::failure::Failure;
use beamlet::retrieve::{Record, flags};
use std::io::Write;
use std::path::Path;

/// What would settle the fits, where every pixel is ill-conditioned.
fn remedy(record: &Record, pixels: u64) -> Option<String> {
    let all = |bit: u32| record.flagged.get(&bit).is_some_and(|count| *count == pixels);
    if !all(flags::of_pixel(flags::ILL_CONDITIONED, 0))
        && !all(flags::of_pixel(0, flags::ILL_CONDITIONED))
    {
        return None;
    }
    let offsets = if record.points.is_empty() { &record.offsets } else { &record.points };
    let [low, high] = offsets
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(*at), high.max(*at)]);
    let sigma = record.flat_width.filter(|_| record.method != "beamlet")?;
    Some(format!(
        "every pixel is ill-conditioned: {} offsets cover {:.1} sigma of the flat's curve (sigma {:.1} \
         um); seven or more over +-{:.0} um would determine width and background",
        offsets.len(),
        (high - low) / sigma,
        sigma * 1e6,
        2.5e6 * sigma
    ))
}

/// Prints the results and warnings of a retrieval. `has_counts`: of the run that was read.
pub(super) fn write(
    record: &Record,
    path: &Path,
    seconds: f64,
    has_counts: bool,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let [views, rows, columns] = record.shape;
    if let Some(title) = &record.title {
        writeln!(out, "title    {}", beamlet::cli_support::printed::line(title))?;
    }
    writeln!(out, "images   {}", beamlet::cli_support::printed::path(path))?;
    let background = match &record.background {
        Some(background) => format!(", background {background}"),
        None => String::new(),
    };
    writeln!(out, "method   {}, weights {}{background}", record.method, record.weights)?;
    writeln!(out, "views    {views} of {columns} x {rows} pixels, in {seconds:.1} s")?;
    let pixels = views * rows * columns;
    writeln!(out, "pixels   {} of {pixels} without a result", record.without_answer)?;
    let remedy = remedy(record, pixels as u64);
    let said_once =
        [flags::of_pixel(flags::ILL_CONDITIONED, 0), flags::of_pixel(0, flags::ILL_CONDITIONED)];
    for (bit, count) in record.flagged.iter().filter(|(_, count)| **count > 0) {
        if remedy.is_none() || !said_once.contains(bit) {
            let meaning = record.flags.get(bit).map_or("", String::as_str);
            writeln!(out, "         {count} flagged {meaning} (bit {bit})")?;
        }
    }
    if let Some(response) = &record.response {
        writeln!(out, "response {response} of small contrasts")?;
    }
    if let Some(residual) = record.residual.filter(|_| !record.counts) {
        let share = 100.0 * residual;
        writeln!(
            out,
            "misfit   residual of the fits {share:.2} % of open beam (rms, median of all pixels)"
        )?;
    }
    if let Some(drift) = record.drift {
        writeln!(out, "phase    {}", crate::commands::drift_words(&drift))?;
    }
    write_expected(record, out)?;
    write_light(record, out)?;
    write_chi_square(record, out)?;
    write_empty_beam(record, out)?;
    write_corrections(record, out)?;
    if let Some(remedy) = remedy {
        writeln!(out, "note     {remedy}")?;
    }
    if has_counts && !record.counts {
        let way = "--counts --weights poisson retrieves from them, with uncertainties";
        writeln!(out, "note     the run also has counts: {way}")?;
    }
    Ok(())
}

/// Expected uncertainties in two directions.
fn write_expected(record: &Record, out: &mut impl Write) -> Result<(), Failure> {
    let of = |name: &str| record.expected_sigma.get(name).copied();
    let all = [
        "transmission",
        "refraction",
        "refraction_z",
        "dark_field",
        "dark_field_z",
        "dark_field_xz",
    ];
    if let [Some(t), Some(x), Some(z), Some(xx), Some(zz), Some(xz)] = all.map(of) {
        let [x, z] = [x, z].map(|angle| angle * 1e6);
        let [xx, zz, xz] = [xx, zz, xz].map(|square| square * 1e12);
        writeln!(
            out,
            "noise    1 sigma without a sample: T {t:.2e}, angles x {x:.2e} and z {z:.2e} urad, dark fields xx \
             {xx:.2e}, zz {zz:.2e} and xz {xz:.2e} urad^2"
        )?;
    }
    Ok(())
}

/// Counts of odd values.
fn write_light(record: &Record, out: &mut impl Write) -> Result<(), Failure> {
    if record.above_one > 0 {
        writeln!(out, "light    {} pixels with a transmission above 1", record.above_one)?;
    }
    if record.negative_values > 0 && record.counts {
        let count = record.negative_values;
        writeln!(out, "light    {count} values of flat and sample below zero")?;
    }
    Ok(())
}

fn write_chi_square(record: &Record, out: &mut impl Write) -> Result<(), Failure> {
    let (Some(found), Some(gain)) = (record.reduced_chi_square, record.gain) else { return Ok(()) };
    write!(out, "chi2     {found:.2}, reduced, median of all pixels")?;
    if let Some(beyond) = record.chi_square_beyond_flat {
        write!(out, "; {beyond:.2} beyond the residuals of the flat")?;
    }
    match record.gain_assumed {
        true => writeln!(out, " (for an assumed gain of {gain}; set it with --gain)")?,
        false => writeln!(out)?,
    }
    Ok(())
}

/// Results of the empty beam, of one view or as the range of several.
fn write_empty_beam(record: &Record, out: &mut impl Write) -> Result<(), Failure> {
    let Some(empty) = &record.empty_beam else { return Ok(()) };
    let views = &empty.views;
    let has_beamlets = record.method == "beamlet" || record.lattice_m.is_some();
    let [moved, moved_z] = match has_beamlets {
        true => ["drift of beamlets", "drift of beamlets along z"],
        false => ["drift of masks", "drift of masks along z"],
    };
    for (name, unit, scale, values) in [
        ("transmission", "", 1.0, views.iter().map(|of| of.transmission).collect::<Vec<_>>()),
        ("refraction", " urad", 1e6, views.iter().map(|of| of.refraction).collect()),
        (moved, " um", 1e6, views.iter().map(|of| of.drift).collect()),
        ("refraction along z", " urad", 1e6, views.iter().map(|of| of.refraction_z).collect()),
        (moved_z, " um", 1e6, views.iter().map(|of| of.drift_z).collect()),
    ] {
        let values: Vec<[f64; 2]> = values.into_iter().flatten().collect();
        if let Some(line) = range(&values, scale) {
            writeln!(out, "empty    {name} {line}{unit}")?;
        }
    }
    let doses: Vec<[f64; 2]> = views.iter().flat_map(|of| &of.dose).copied().collect();
    if let Some(line) = range(&doses, 1.0).filter(|_| doses.len() > 1) {
        writeln!(out, "empty    dose of a step, relative to the flat, {line}")?;
    }
    Ok(())
}

/// Corrections by empty beam, of one view or as the range of several.
fn write_corrections(record: &Record, out: &mut impl Write) -> Result<(), Failure> {
    let views = &record.corrections;
    for (name, scale, unit, values) in [
        (
            "dose of a frame",
            1.0,
            "",
            views.iter().flat_map(|of| of.dose.clone()).collect::<Vec<_>>(),
        ),
        (
            "displacement of a frame",
            1e6,
            " um",
            views.iter().flat_map(|of| of.steps.clone()).collect(),
        ),
        ("refraction", 1e6, " urad", views.iter().filter_map(|of| of.offset).map(Some).collect()),
        (
            "displacement of a frame along z",
            1e6,
            " um",
            views.iter().flat_map(|of| of.steps_z.clone()).collect(),
        ),
        (
            "refraction along z",
            1e6,
            " urad",
            views.iter().filter_map(|of| of.offset_z).map(Some).collect(),
        ),
    ] {
        let known: Vec<[f64; 2]> = values.iter().copied().flatten().collect();
        let Some(line) = range(&known, scale) else { continue };
        write!(out, "correct  {name} {line}{unit}")?;
        match values.len() - known.len() {
            0 => writeln!(out)?,
            unknown => writeln!(out, "; {unknown} of {} unknown", values.len())?,
        }
    }
    Ok(())
}

/// A value with its uncertainty, or the least and greatest with the median one.
fn range(values: &[[f64; 2]], scale: f64) -> Option<String> {
    let mut sorted = values.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (first, last) = (sorted.first()?[0] * scale, sorted.last()?[0] * scale);
    sorted.sort_by(|a, b| a[1].total_cmp(&b[1]));
    let sigma = sorted[sorted.len() / 2][1] * scale;
    Some(match values.len() {
        1 => format!("{first:.4} ± {sigma:.4}"),
        _ => format!("{first:.4} to {last:.4} (± {sigma:.4})"),
    })
}
