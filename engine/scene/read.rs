//! The scene model from the tree: kinds of values, defaults and alternatives. Ranges that
//! concern several keys, and those of quantities, are checked by [`Scene::validate`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::files::hash;
use super::limits;
use super::read_beam::read_beam;
use super::read_detector::read_detector;
use super::read_sample::{read_hash, read_materials, read_objects};
use super::read_scan::read_scan;
use super::read_spot::{read_spot, spot_file};
use super::read_surroundings::read_surroundings;
use super::table::{ListItem, Table};
use super::tree::Document;
use super::{Detector, MaskBody, MaskSpec, RandomRays, Sampling, Scene, Scheme, Source, Transport};
use crate::units::Dimension::{self, Angle, Length};
use crate::{Result, printed};

/// Reads a scene. The result still has to be validated. Errors are reported to the document; without
/// a source or a detector there is no scene, and what else is wrong stands for nothing in it.
pub(super) fn read_scene(document: &Document, directory: &Path) -> Option<Scene> {
    let keep = |result| document.keep(result);
    let top = document.keep(ListItem::root(document).table(""))?;
    let table = |key: &str| top.require(key, format!("a table [{key}]"))?.table(key);
    let mut files = document.keep(read_files(&top)).unwrap_or_default();
    let source = table("source").and_then(|source| read_source(&source, directory, &mut files));
    let source = document.keep(source);
    let detector = document.keep(table("detector").and_then(|table| read_detector(&table)));
    let materials = document.keep(read_materials(&top)).unwrap_or_default();
    let objects = document.keep(read_objects(&top)).unwrap_or_default();
    let sampling = document.keep(read_sampling(&top)).unwrap_or_default();
    let scan = document.keep(read_scan(&top)).unwrap_or_default();
    let detector = detector?;
    let mask = |key: &str| {
        let item = top.get(key)?;
        let mask = keep(item.table(key).and_then(|table| read_mask(&table, key, &detector)));
        if mask.is_none() {
            // Nothing is moved without it.
            document.forget(key.to_owned());
            document.forget("scan.mask_offsets".to_owned());
        }
        mask
    };
    let title = top.get("title").and_then(|item| document.keep(read_title(&item)));
    let mut scene = Scene {
        directory: directory.to_owned(),
        title,
        sample_mask: mask("sample_mask"),
        detector_mask: mask("detector_mask"),
        sampling,
        scan,
        materials,
        objects,
        files,
        ..Scene::new(source?, detector)
    };
    if let Some(item) = top.get("surroundings") {
        let table = item.table("surroundings");
        document.keep(table.and_then(|table| read_surroundings(&table, &mut scene)));
    }
    Some(scene)
}

/// One line of text.
fn read_title(item: &ListItem<'_>) -> Result<String> {
    let allowed = format!("a line of text, of 1 to {} characters", limits::TITLE);
    let is_line = |text: &&str| {
        !text.trim().is_empty()
            && text.chars().count() <= limits::TITLE
            && !text.chars().any(printed::is_unsafe)
    };
    match item.as_text().filter(is_line) {
        Some(text) => Ok(text.trim().to_owned()),
        None => item.refuse(item.mismatch(allowed), String::new()),
    }
}

/// Hashes of files by path.
fn read_files(top: &Table<'_>) -> Result<BTreeMap<PathBuf, String>> {
    let Some(item) = top.get("files") else { return Ok(BTreeMap::new()) };
    let named = item.named()?;
    named.iter().map(|(path, item)| Ok((PathBuf::from(path), read_hash(item)?))).collect()
}

/// The source; the hash of the file of its spot, which is read now, is added to `files`.
fn read_source(
    table: &Table<'_>,
    directory: &Path,
    files: &mut BTreeMap<PathBuf, String>,
) -> Result<Source> {
    let spot = table.require("spot", pair_allowed(Length))?;
    let read = read_spot(&spot, directory);
    let file = if read.is_ok() { spot_file(&spot)? } else { None };
    let source = Source {
        distance: table.quantity("distance", Length)?,
        spot: spot.or_instead(read, [f64::NAN; 2].into())?,
        beam: read_beam(table)?,
    };
    if let Some(path) = file {
        let found = hash(&directory.join(&path))?;
        match files.get(&path) {
            Some(recorded) if *recorded != found => {
                let found = format!("{}: sha256 {found}", path.display());
                let error = spot.error(found, format!("sha256 {recorded}, as in [files]"));
                spot.refuse(error, ())?;
            }
            _ => {
                files.insert(path, found);
            }
        }
    }
    Ok(source)
}

pub(super) fn pair_allowed(dimension: Dimension) -> String {
    format!("{}; or a list of two of them, [x, z]", dimension.allowed())
}

/// One quantity for both directions, or a list of x and z.
pub(super) fn read_pair(item: &ListItem<'_>, dimension: Dimension) -> Result<[f64; 2]> {
    if item.is_list() {
        return item.array(&pair_allowed(dimension), |item| item.quantity(dimension));
    }
    Ok([item.quantity(dimension)?; 2])
}

fn read_mask(table: &Table<'_>, key: &str, detector: &Detector) -> Result<MaskSpec> {
    let body = read_body(table)?;
    let distance = match table.get("distance") {
        Some(item) => item.quantity(Length)?,
        None if key == "detector_mask" => detector.distance - body.thickness() / 2.0,
        None => return Err(table.missing("distance", Length.allowed())),
    };
    // Lengths on the detector shrink towards the source.
    let projected = |length: f64| length * distance / detector.distance;
    let period = match table.get("period") {
        Some(item) => item.quantity(Length)?,
        None => projected(detector.pitch[0]),
    };
    let aperture = match (table.get("aperture"), table.get("projected_aperture")) {
        (Some(aperture), None) => aperture.quantity(Length)?,
        (None, Some(aperture)) => projected(aperture.quantity(Length)?),
        (Some(aperture), Some(both)) => {
            both.refuse(both.error("both aperture and projected_aperture", "one of them"), ())?;
            both.quantity(Length)?;
            aperture.quantity(Length)?
        }
        (None, None) => {
            let allowed = format!("{}; or projected_aperture instead", Length.allowed());
            table.require("aperture", allowed)?.quantity(Length)?
        }
    };
    // A mask without bars is allowed; the projection rounds.
    let rounding = aperture > period && aperture <= period * (1.0 + 1e-12);
    Ok(MaskSpec {
        distance,
        period,
        aperture: if rounding { period } else { aperture },
        offset: table.optional_quantity("offset", Length)?.unwrap_or(0.0),
        body,
    })
}

fn read_body(table: &Table<'_>) -> Result<MaskBody> {
    if let Some(item) = table.get("transmission") {
        for key in ["material", "thickness"] {
            table.forbid(key, "either transmission, or material and thickness")?;
        }
        return Ok(MaskBody::Sheet { transmission: item.number()? });
    }
    let material = "name of a material; or transmission instead of material and thickness";
    Ok(MaskBody::Bars {
        material: table.require("material", material)?.text(material)?.to_owned(),
        thickness: table.quantity("thickness", Length)?,
    })
}

fn read_sampling(top: &Table<'_>) -> Result<Sampling> {
    let default = Sampling::default();
    let Some(item) = top.get("sampling") else { return Ok(default) };
    let table = item.table("sampling")?;
    let schemes = [("cells", Scheme::Cells), ("random", Scheme::Random)];
    let transports = [
        ("auto", Transport::Auto),
        ("first-order", Transport::FirstOrder),
        ("exact", Transport::Exact),
    ];
    let count = 1..=limits::RAYS;
    let grid = "a number of rays, such as 5000, or a grid of them in x and z, such as [5000, 4]";
    let get = |key| table.get(key);
    Ok(Sampling {
        scheme: get("scheme").map_or(Ok(default.scheme), |item| item.choice(&schemes))?,
        cells: get("cells").map(|item| item.integer(1..=limits::CELLS)).transpose()?,
        rows: get("rows").map_or(Ok(default.rows), |item| item.integer(1..=limits::ROWS))?,
        tolerance: get("tolerance").map_or(Ok(default.tolerance), |item| read_tolerance(&item))?,
        angle_tolerance: table
            .optional_quantity("angle_tolerance", Angle)?
            .unwrap_or(default.angle_tolerance),
        max_rays: get("max_rays")
            .map_or(Ok(default.max_rays), |item| item.integer(count.clone()))?,
        rays: get("rays").map_or(Ok(default.rays), |item| {
            let rays = |item: &ListItem<'_>| item.integer(count.clone());
            if item.is_list() {
                item.array(grid, rays).map(RandomRays::Grid)
            } else {
                rays(&item).map(RandomRays::Count)
            }
        })?,
        transport: get("transport")
            .map_or(Ok(default.transport), |item| item.choice(&transports))?,
        seed: get("seed").map_or(Ok(default.seed), |item| item.integer(0..=u64::MAX))?,
    })
}

/// The tolerance as a share of open beam. Up to version 0.1 it was a length.
fn read_tolerance(item: &ListItem<'_>) -> Result<f64> {
    if item.as_text().is_some_and(|text| Length.parse(text).is_ok()) {
        let allowed = "a share of open beam from 1e-6 to 1e-2, such as 1e-4 (a length until version \
                       0.1; `angle_tolerance` bounds displacements)";
        return item.refuse(item.mismatch(allowed), Sampling::default().tolerance);
    }
    item.number()
}
