//! The detector from the tree.

use std::path::PathBuf;

use super::detector::{Absorber, Blur, Counts, Detector, DetectorMode, KernelFile, Scatter};
use super::limits;
use super::read::{pair_allowed, read_pair};
use super::read_beam::read_layer;
use super::table::{ListItem, Table};
use crate::Result;
use crate::units::Dimension::{Energy, Length};

const IMAGE: &str = "path of an NPY, TIFF or PNG file";

pub(super) fn read_detector(table: &Table<'_>) -> Result<Detector> {
    let pixels = "columns and rows, such as [128, 128]";
    let pitch = table.require("pitch", pair_allowed(Length))?;
    Ok(Detector {
        distance: table.quantity("distance", Length)?,
        pixels: table
            .require("pixels", pixels)?
            .array(pixels, |item| item.integer(1..=limits::PIXELS))?,
        pitch: read_pair(&pitch, Length)?,
        mode: read_mode(table)?,
        absorber: table.get("absorber").map(|item| read_absorber(&item)).transpose()?,
        blur: table.get("blur").map(|item| read_blur(&item)).transpose()?,
        scatter: table.get("scatter").map(|item| read_scatter(&item)).transpose()?,
        counts: read_counts(table)?,
    })
}

fn read_mode(table: &Table<'_>) -> Result<DetectorMode> {
    let counting = match table.get("mode") {
        Some(item) => item.choice(&[("counting", true), ("integrating", false)])?,
        None => true,
    };
    if counting {
        return Ok(DetectorMode::Counting {
            low: table.optional_quantity("threshold_low", Energy)?,
            high: table.optional_quantity("threshold_high", Energy)?,
        });
    }
    for key in ["threshold_low", "threshold_high"] {
        table.forbid(key, "no threshold: only mode = \"counting\" has them")?;
    }
    Ok(DetectorMode::Integrating)
}

fn read_absorber(item: &ListItem<'_>) -> Result<Absorber> {
    let table = item.table("detector.absorber")?;
    let (material, thickness) = read_layer(&table)?;
    Ok(Absorber { material, thickness })
}

fn read_blur(item: &ListItem<'_>) -> Result<Blur> {
    let table = item.table("detector.blur")?;
    let one = "one of: sigma; fwhm; kernel and pixel";
    let only = |wanted: &[&str]| {
        let others = ["sigma", "fwhm", "kernel", "pixel"];
        others.iter().filter(|key| !wanted.contains(key)).try_for_each(|key| table.forbid(key, one))
    };
    if table.get("kernel").is_some() {
        only(&["kernel", "pixel"])?;
        return Ok(Blur::Kernel(read_kernel(&table)?));
    }
    let (key, scale) = if table.get("fwhm").is_some() {
        ("fwhm", 1.0 / (8.0 * std::f64::consts::LN_2).sqrt())
    } else {
        ("sigma", 1.0)
    };
    only(&[key])?;
    let sigma = read_pair(&table.require(key, one)?, Length)?.map(|width| width * scale);
    Ok(Blur::Gaussian { sigma })
}

fn read_scatter(item: &ListItem<'_>) -> Result<Scatter> {
    let table = item.table("detector.scatter")?;
    let one = "either image; or kernel, pixel and fraction";
    if let Some(item) = table.get("image") {
        ["kernel", "pixel", "fraction"].iter().try_for_each(|key| table.forbid(key, one))?;
        return Ok(Scatter::Image(PathBuf::from(item.text(IMAGE)?)));
    }
    table.require("kernel", one)?;
    let fraction = "a number without a unit: scattered light over the light that scatters";
    Ok(Scatter::Kernel {
        kernel: read_kernel(&table)?,
        fraction: table.require("fraction", fraction)?.number()?,
    })
}

fn read_kernel(table: &Table<'_>) -> Result<KernelFile> {
    let pixel = table.require("pixel", pair_allowed(Length))?;
    Ok(KernelFile {
        path: PathBuf::from(table.require("kernel", IMAGE)?.text(IMAGE)?),
        pixel: read_pair(&pixel, Length)?,
    })
}

fn read_counts(table: &Table<'_>) -> Result<Option<Counts>> {
    let Some(photons) = table.get("photons") else {
        for key in ["electronic_noise", "swank", "gain", "offset", "bit_depth"] {
            table
                .forbid(key, "this key together with photons: without them there are no counts")?;
        }
        return Ok(None);
    };
    let default = Counts::of_photons(photons.number()?);
    let number = |key: &str, default: f64| table.get(key).map_or(Ok(default), |item| item.number());
    let counts = Counts {
        electronic_noise: number("electronic_noise", default.electronic_noise)?,
        swank: number("swank", default.swank)?,
        gain: number("gain", default.gain)?,
        offset: table.get("offset").map(|item| item.number()).transpose()?,
        bit_depth: table
            .get("bit_depth")
            .map(|item| item.integer(1..=limits::BIT_DEPTH))
            .transpose()?,
        ..default
    };
    Ok(Some(counts.with_offset(counts.number_without_light())))
}
