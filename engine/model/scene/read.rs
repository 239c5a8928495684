//! The scene model from the tree, table by table.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::files::hash;
use super::keys::mask::read_mask;
use super::keys::material::MaterialEntry;
use super::keys::record::Record;
use super::keys::spot::spot_file;
use super::keys::surroundings::read_surroundings;
use super::keys::top::{TOP, read_title};
use super::keys::value::{Value, optional, required};
use super::table::{ListItem, Table};
use super::tree::Document;
use super::{Scene, cone_vec};
use beamlet_core::{Error, Result};

/// Reads a scene. The result still has to be validated. Errors are reported to the document; without
/// a source or a detector there is no scene, and what else is wrong stands for nothing in it.
pub(super) fn read_scene(document: &Document) -> Option<Scene> {
    let top = document.keep(ListItem::root(document).table(&TOP))?;
    let files = document.keep(read_files(&top)).unwrap_or_default();
    let source = document.keep(required(&top, "source"));
    let detector = document.keep(required(&top, "detector"));
    let materials = document.keep(read_materials(&top)).unwrap_or_default();
    let (Some(source), Some(detector)) = (source, detector) else { return None };
    let scattering =
        materials.iter().filter_map(|(name, it)| Some((name.clone(), it.scattering()?))).collect();
    let microstructures = materials
        .iter()
        .filter_map(|(name, it)| Some((name.clone(), it.microstructure.clone()?)))
        .collect();
    let mut scene = Scene {
        directory: document.directory.clone(),
        materials: materials.into_iter().map(|(name, it)| (name, it.spec)).collect(),
        scattering,
        microstructures,
        files,
        ..Scene::new(source, detector)
    };
    let title = top.get("title").map(|item| read_title(&item, top.row("title")?)).transpose();
    scene.title = document.keep(title).flatten();
    for (key, mask) in
        [("sample_mask", &mut scene.sample_mask), ("detector_mask", &mut scene.detector_mask)]
    {
        let Some(item) = top.get(key) else { continue };
        let table = item.table(&super::keys::mask::MASK.spec);
        *mask = document.keep(table.and_then(|table| read_mask(&table, key, &scene.detector)));
    }
    scene.sampling = keep(document, &top, "sampling").unwrap_or_default();
    scene.scan = keep(document, &top, "scan").unwrap_or_default();
    scene.objects = keep(document, &top, "object").unwrap_or_default();
    if let Some(item) = top.get("surroundings") {
        let table = item.table(&super::keys::object::SURROUNDINGS);
        document.keep(table.and_then(|table| read_surroundings(&table, &mut scene)));
    }
    document.keep(read_cone_vec(&top, &mut scene));
    document.keep(hash_spot(&top, &mut scene));
    document.keep(hash_tables(document, &mut scene));
    Some(scene)
}

fn keep<V: Value>(document: &Document, top: &Table<'_>, key: &str) -> Option<V> {
    document.keep(optional(top, key)).flatten()
}

/// Hashes of files by path.
fn read_files(top: &Table<'_>) -> Result<BTreeMap<PathBuf, String>> {
    let (Some(item), row) = (top.get("files"), top.row("files")?) else {
        return Ok(BTreeMap::new());
    };
    let named = item.named()?;
    named.iter().map(|(path, item)| Ok((PathBuf::from(path), String::read(item, row)?))).collect()
}

/// Motions by the vectors of a file: they need source and detector.
fn read_cone_vec(top: &Table<'_>, scene: &mut Scene) -> Result<()> {
    let Some(scan) = top.get("scan") else { return Ok(()) };
    let scan = scan.table(&super::keys::scan::SCAN.spec)?;
    let Some(item) = scan.get("cone_vec") else { return Ok(()) };
    if let Some(other) = ["angles", "motions"].iter().find(|key| scan.get(key).is_some()) {
        let found = format!("both cone_vec and {other}");
        return item.refuse(item.error(found, "cone_vec alone, or angles and motions"), ());
    }
    let path: PathBuf = required(&scan, "cone_vec")?;
    let rows = match cone_vec::read(&item.directory().join(&path)) {
        Ok(rows) => {
            item.note_table(&path);
            rows
        }
        Err(error) => {
            return item.refuse(item.error(error.to_string(), "12 numbers a line, in mm"), ());
        }
    };
    let mut motions = Vec::with_capacity(rows.len());
    for (view, row) in rows.iter().enumerate() {
        match cone_vec::motion(scene, row) {
            Ok(motion) => motions.push(motion),
            Err([found, allowed]) => {
                let found = format!("{}, view {view}: {found}", path.display());
                return item.refuse(item.error(found, allowed), ());
            }
        }
    }
    scene.scan.angles = vec![0.0; motions.len()];
    scene.scan.motions = motions;
    scene.scan.draw_errors();
    Ok(())
}

fn read_materials(top: &Table<'_>) -> Result<BTreeMap<String, MaterialEntry>> {
    let (Some(item), row) = (top.get("materials"), top.row("materials")?) else {
        return Ok(BTreeMap::new());
    };
    let entry = |(name, item): &(&str, ListItem<'_>)| {
        let nothing = MaterialEntry::begin(&|_| false);
        Ok(((*name).to_owned(), item.or_instead(MaterialEntry::read(item, row), nothing)?))
    };
    item.named()?.iter().map(entry).collect()
}

/// Adds the hashes of the tables whose values are in the scene to the hashes of its files.
fn hash_tables(document: &Document, scene: &mut Scene) -> Result<()> {
    for (key, path) in document.tables() {
        let found = hash(&scene.directory.join(&path))?;
        if let Some(recorded) = scene.files.get(&path).filter(|recorded| **recorded != found) {
            let allowed = format!("sha256 {recorded}, as in [files]");
            let found = format!("{}: sha256 {found}", path.display());
            return Err(Error::scene(key, found, allowed));
        }
        scene.files.insert(path, found);
    }
    Ok(())
}

/// Adds the hash of the file of the spot to the hashes of the scene.
fn hash_spot(top: &Table<'_>, scene: &mut Scene) -> Result<()> {
    let source = top.require("source")?.table(&super::keys::source::SOURCE.spec)?;
    let Some(spot) = source.get("spot").filter(|_| scene.source.spot.fit().is_some()) else {
        return Ok(());
    };
    let Some(path) = spot_file(&spot)? else { return Ok(()) };
    let found = hash(&scene.directory.join(&path))?;
    match scene.files.get(&path) {
        Some(recorded) if *recorded != found => {
            let found = format!("{}: sha256 {found}", path.display());
            let error = spot.error(found, format!("sha256 {recorded}, as in [files]"));
            spot.refuse(error, ())
        }
        _ => {
            scene.files.insert(path, found);
            Ok(())
        }
    }
}
