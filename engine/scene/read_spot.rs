//! The focal spot from the tree: a size, or a table of another shape. Files are read at
//! once: a scene holds the Gaussians that were made of them.

use std::path::{Path, PathBuf};

use super::limits;
use super::read::{pair_allowed, read_pair};
use super::table::{ListItem, Table};
use crate::spot::{Spot, SpotPart};
use crate::units::Dimension::Length;
use crate::{Error, Result};

const FORMS: &str = "image and pixel; profile; gaussians; or fwhm, with points where it is to be \
                     a superposition of point sources";

pub(super) fn read_spot(item: &ListItem<'_>, directory: &Path) -> Result<Spot> {
    if !item.is_table() {
        return Ok(read_pair(item, Length)?.into());
    }
    let table = item.table("source.spot")?;
    let only = |wanted: &[&str]| {
        let others = ["fwhm", "points", "image", "pixel", "background", "profile", "gaussians"];
        others.iter().filter(|k| !wanted.contains(k)).try_for_each(|k| table.forbid(k, FORMS))
    };
    if let Some(image) = table.get("image") {
        only(&["image", "pixel", "background"])?;
        let path = directory.join(image.text("path of an NPY, TIFF or PNG file")?);
        let pixel = read_pair(&table.require("pixel", pair_allowed(Length))?, Length)?;
        let background = table.get("background").map(|item| item.number()).transpose()?;
        return Spot::read_image(&path, pixel, background).map_err(|e| placed(&table, &image, e));
    }
    if let Some(profile) = table.get("profile") {
        only(&["profile"])?;
        let path = directory.join(profile.text("path of a CSV file")?);
        return Spot::read_profile(&path).map_err(|error| placed(&table, &profile, error));
    }
    if let Some(gaussians) = table.get("gaussians") {
        only(&["gaussians"])?;
        let allowed = "a list of { weight = 1.0, fwhm = \"20 um\", offset = [\"5 um\", \"0 um\"] }";
        let items = gaussians.items(allowed)?;
        let parts = items.iter().map(read_gaussian).collect::<Result<Vec<_>>>()?;
        return Ok(Spot::gaussians(parts));
    }
    only(&["fwhm", "points"])?;
    let fwhm = read_pair(&table.require("fwhm", FORMS)?, Length)?;
    let Some(points) = table.get("points") else { return Ok(fwhm.into()) };
    let counts = "points along x and z, such as [31, 1]";
    let count: [u32; 2] = points.array(counts, |item| item.integer(1..=limits::SPOT_PARTS))?;
    if count[0].saturating_mul(count[1]) > limits::SPOT_PARTS {
        let most = limits::SPOT_PARTS;
        return Err(points.mismatch(format!("up to {most} points in all")));
    }
    Ok(Spot::points(fwhm, count))
}

/// The file of a spot, as the scene names it.
pub(super) fn spot_file(item: &ListItem<'_>) -> Result<Option<PathBuf>> {
    if !item.is_table() {
        return Ok(None);
    }
    let table = item.table("source.spot")?;
    let file = table.get("image").or_else(|| table.get("profile"));
    file.map(|file| Ok(PathBuf::from(file.text("path of a file")?))).transpose()
}

fn read_gaussian(item: &ListItem<'_>) -> Result<SpotPart> {
    let table = item.table("source.spot.gaussian")?;
    let pair = |key: &str| table.get(key).map(|item| read_pair(&item, Length)).transpose();
    Ok(SpotPart {
        weight: table.get("weight").map_or(Ok(1.0), |item| item.number())?,
        fwhm: read_pair(&table.require("fwhm", pair_allowed(Length))?, Length)?,
        offset: pair("offset")?.unwrap_or_default(),
    })
}

/// The error of a file at the key that names it; errors with a line of their own keep that.
fn placed(table: &Table<'_>, item: &ListItem<'_>, error: Error) -> Error {
    match error {
        Error::Scene { place, key, found, allowed } if place.file.is_none() => {
            let name = key.rsplit('.').next().unwrap_or_default();
            let at = table.get(name).unwrap_or_else(|| item.clone());
            let file = item.as_text().unwrap_or_default();
            let found = if name == "image" { format!("{file}: {found}") } else { found };
            at.error(found, allowed)
        }
        Error::File { .. } => item.error(error.to_string(), "a file that can be read"),
        other => other,
    }
}
