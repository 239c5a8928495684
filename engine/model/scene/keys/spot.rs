//! Keys of the focal spot: a size, or a table of another shape. Files are read at once: a scene holds
//! the Gaussians that were made of them.

use super::prelude::*;
use crate::scene::limits::SPOT_PARTS;
use crate::spot::{Spot, SpotPart};

keys! { SPOT, "source.spot",
    [Forms(&[&["image", "pixel", "background"], &["profile"], &["gaussians"], &["fwhm", "points"]], 3)],
    [];
    image => IMAGE, Required, r#""spot.tif""#,
        "One grey channel, values >= 0 after `background`, some above.";
    pixel => Pair(POSITIVE), Required, r#""2 um""#, "Size of the pixels of the image.";
    background => Number("a number", ANY), Without("none"), "102.5",
        "Value of the image that is subtracted from all of it.";
    profile => File("path of a CSV file"), Required, r#""profile.csv""#,
        "Positions >= 0, ascending, and values >= 0.";
    gaussians => Tables(&GAUSSIAN.spec), Required, r#"[{ fwhm = "20 um" }]"#,
        "1 to 4096 Gaussians.";
    fwhm => Pair(NOT_NEGATIVE), Required, r#"["30 um", "26 um"]"#,
        "Full width at half maximum of the Gaussian.";
    points => Counts("points along x and z", 1, SPOT_PARTS as u64), Without("the Gaussian itself"), "[41, 31]",
        "The Gaussian as points, up to 4096 in all.";
}

keys! { GAUSSIAN: SpotPart, "source.spot.gaussian", [], [];
    weight => Number("a number", NOT_NEGATIVE), Default("1.0"), "0.4",
        "Relative weight of the light; at least one is above 0.";
    fwhm => Pair(NOT_NEGATIVE), Required, r#"["14 um", "10 um"]"#,
        "Full width at half maximum; 0 is a point.";
    offset => Pair(ANY), Default(r#"["0 m", "0 m"]"#), r#"["-10 um", "4 um"]"#, "Its centre.";
}

impl Record for SpotPart {
    const KEYS: &'static Keys<Self> = &GAUSSIAN;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::new(1.0, [f64::NAN; 2], [0.0; 2])
    }
}

impl Value for Spot {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        if !item.is_table() {
            return <[f64; 2]>::read(item, row).map(Self::from);
        }
        let table = item.table(&SPOT)?;
        match table.form("image") {
            "image" => {
                let image = table.require("image")?;
                let path = item.directory().join(required::<PathBuf>(&table, "image")?);
                let pixel: [f64; 2] = required(&table, "pixel")?;
                let background = optional(&table, "background")?;
                if image.as_text().is_none() || pixel.iter().any(|side| side.is_nan()) {
                    return Ok([f64::NAN; 2].into());
                }
                let read = Self::read_image(&path, pixel, background);
                read.map_err(|error| placed(&table, &image, error))
            }
            "profile" => {
                let profile = table.require("profile")?;
                let path = item.directory().join(required::<PathBuf>(&table, "profile")?);
                Self::read_profile(&path).map_err(|error| placed(&table, &profile, error))
            }
            "gaussians" => Ok(Self::gaussians(required(&table, "gaussians")?)),
            _ => {
                let fwhm: [f64; 2] = required(&table, "fwhm")?;
                let sound = fwhm.iter().all(|side| *side >= 0.0);
                let Some(points) = table.get("points").filter(|_| sound) else {
                    return Ok(fwhm.into());
                };
                let count: [u32; 2] = required(&table, "points")?;
                if count[0].saturating_mul(count[1]) > SPOT_PARTS {
                    return Err(points.mismatch(format!("up to {SPOT_PARTS} points in all")));
                }
                Ok(Self::points(fwhm, count))
            }
        }
    }

    /// The Gaussians themselves, so that a run needs no file.
    fn write(&self, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        if let [SpotPart { weight: 1.0, fwhm, offset: [0.0, 0.0] }] = self.parts() {
            return fwhm.write(row, base);
        }
        let parts = self.parts().to_vec().write(row, base)?;
        Ok(parts.map(|parts| inline(&[("gaussians", parts)])))
    }

    fn check(&self, key: &str, row: &Row, faults: &mut Faults) {
        faults.note(check_parts(self.parts(), key, row));
    }
}

fn check_parts(parts: &[SpotPart], spot: &str, row: &Row) -> Result<()> {
    let (all, most) = (format!("{spot}.gaussians"), SPOT_PARTS as usize);
    if parts.is_empty() || parts.len() > most {
        let found = format!("{} Gaussians", parts.len());
        return Err(Error::scene(all, found, format!("1 to {most}")));
    }
    if let [SpotPart { weight: 1.0, fwhm, offset: [0.0, 0.0] }] = parts {
        let Either(_, pair, _) = row.kind else { return Ok(()) };
        return fwhm.iter().try_for_each(|fwhm| in_range(spot, pair, *fwhm));
    }
    let mut faults = Faults::default();
    parts.to_vec().check(&all, row, &mut faults);
    if let Some(first) = faults.0.into_iter().next() {
        return Err(first);
    }
    let sum: f64 = parts.iter().map(|part| part.weight).sum();
    if sum.is_finite() && sum > 0.0 {
        return Ok(());
    }
    Err(Error::scene(all, format!("{sum:?}"), "weights with a finite sum > 0"))
}

/// The file of a spot, as the table of the source names it.
pub(crate) fn spot_file(item: &ListItem<'_>) -> Result<Option<PathBuf>> {
    if !item.is_table() {
        return Ok(None);
    }
    let table = item.table(&SPOT)?;
    Ok(optional(&table, "image")?.or(optional(&table, "profile")?))
}

/// The error of a file at the key that names it; errors with a line of their own keep that.
pub(crate) fn placed(table: &Table<'_>, item: &ListItem<'_>, error: Error) -> Error {
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
