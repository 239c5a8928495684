//! The resolved scene as TOML.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use super::read_scan::{angle_range, offset_range};
use super::write_detector::write_detector;
use super::write_shape::shape_table;
use super::{
    Beam, Instances, MaskBody, MaskSpec, MaterialSpec, Mesh, Normals, Object, Placement,
    RandomRays, Scene, Scheme, ShapeOrMesh, SpectrumOrigin, Transport, path, write_beam,
    write_instances,
};
use crate::spot::{Spot, SpotPart};
use crate::units::Dimension::{self, Angle, Attenuation, Density, Energy, Length};
use crate::{Error, Result};

/// A TOML text that grows line by line.
pub(super) struct Text(String);

impl Text {
    fn table(&mut self, header: &str) {
        let _ = writeln!(self.0, "\n{header}");
    }

    fn comment(&mut self, text: &str) {
        // A comment ends with its line, and TOML allows no control characters in it.
        let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let _ = writeln!(self.0, "# {line}");
    }

    /// A key with a value that is TOML already.
    pub(super) fn raw(&mut self, key: &str, value: impl std::fmt::Display) {
        let _ = writeln!(self.0, "{key} = {value}");
    }

    pub(super) fn text(&mut self, key: &str, value: &str) {
        self.raw(key, quoted(value));
    }

    pub(super) fn quantity(&mut self, key: &str, value: f64, dimension: Dimension) {
        self.raw(key, quantity(value, dimension));
    }
}

pub(super) fn to_toml(
    scene: &Scene,
    directory: &Path,
    hashes: &BTreeMap<String, String>,
    sets: &[String],
) -> Result<String> {
    let mut out = Text(String::new());
    out.comment(concat!("Resolved scene, beamlet ", env!("CARGO_PKG_VERSION")));
    sets.iter().for_each(|set| out.comment(&format!("--set {set}")));
    if let Some(title) = &scene.title {
        out.text("title", title);
    }

    out.table("[source]");
    out.quantity("distance", scene.source.distance, Length);
    write_spot(&mut out, &scene.source.spot);
    write_beam(&mut out, scene, directory)?;

    out.table("[detector]");
    write_detector(&mut out, scene, directory)?;

    for (key, mask) in scene.masks() {
        out.table(&format!("[{key}]"));
        write_mask(&mut out, mask);
    }

    write_sampling(&mut out, scene);

    out.table("[scan]");
    let offsets = &scene.scan.mask_offsets;
    let last = offsets.last().copied().unwrap_or(0.0);
    out.raw("mask_offsets", series(offsets, &[last], Length, offset_range));
    out.raw("angles", series(&scene.scan.angles, &ends(&scene.scan.angles), Angle, angle_range));

    for (name, spec) in &scene.materials {
        let key = if path::is_bare(name) { name.clone() } else { quoted(name) };
        out.table(&format!("[materials.{key}]"));
        write_material(&mut out, spec, scene, directory)?;
    }
    write_surroundings(&mut out, scene, hashes, directory)?;
    for object in scene.listed_objects() {
        out.table("[[object]]");
        let hash = hashes.get(&object.name).or(object.sha256.as_ref());
        write_object(&mut out, object, hash, scene, directory)?;
    }
    if !scene.files.is_empty() {
        out.table("[files]");
    }
    for (path, hash) in &scene.files {
        out.text(&quoted(&file(path, scene, directory)?), hash);
    }
    Ok(out.0)
}

fn write_surroundings(
    out: &mut Text,
    scene: &Scene,
    hashes: &BTreeMap<String, String>,
    directory: &Path,
) -> Result<()> {
    out.table("[surroundings]");
    let region = scene.region();
    out.text("material", region.map_or(&scene.surroundings, |region| &region.material));
    if region.is_some() || scene.path_material != "vacuum" {
        out.text("path_material", &scene.path_material);
    }
    let Some(region) = region else { return Ok(()) };
    out.table("[surroundings.region]");
    match &region.geometry {
        ShapeOrMesh::Shape(shape) => {
            // { kind = { keys } }
            let table = shape_table(shape);
            let inner = table.trim_start_matches("{ ").strip_suffix(" }").unwrap_or(&table);
            let (kind, keys) = inner.split_once(" = ").unwrap_or((inner, ""));
            out.raw(kind, keys);
        }
        ShapeOrMesh::Mesh(_) => {
            let hash = hashes.get(&region.name).or(region.sha256.as_ref());
            write_geometry(out, region, hash, scene, directory)?;
        }
    }
    write_placement(out, &region.placement);
    Ok(())
}

/// The Gaussians themselves, so that a run needs no file.
fn write_spot(out: &mut Text, spot: &Spot) {
    if let Some(fit) = spot.fit() {
        out.comment(&format!("spot: {} Gaussians for {}", spot.parts().len(), fit.file));
    }
    if let [SpotPart { weight: 1.0, fwhm, offset: [0.0, 0.0] }] = spot.parts() {
        out.raw("spot", list(fwhm, Length));
        return;
    }
    let part = |part: &SpotPart| {
        let weight = number(part.weight);
        let (fwhm, offset) = (list(&part.fwhm, Length), list(&part.offset, Length));
        format!("{{ weight = {weight}, fwhm = {fwhm}, offset = {offset} }}")
    };
    let parts: Vec<_> = spot.parts().iter().map(part).collect();
    out.raw("spot", format!("{{ gaussians = [{}] }}", parts.join(", ")));
}

fn write_beam(out: &mut Text, scene: &Scene, directory: &Path) -> Result<()> {
    match &scene.source.beam {
        Beam::Energy(energy) => out.quantity("energy", *energy, Energy),
        Beam::Spectrum(spec) => {
            let path = match &spec.origin {
                SpectrumOrigin::File { path } => Some(file(path, scene, directory)?),
                SpectrumOrigin::Tube { .. } => None,
            };
            out.raw("spectrum", write_beam::spectrum(spec, path.as_deref()));
        }
    }
    Ok(())
}

fn write_mask(out: &mut Text, mask: &MaskSpec) {
    out.quantity("distance", mask.distance, Length);
    match &mask.body {
        MaskBody::Bars { material, thickness } => {
            out.text("material", material);
            out.quantity("thickness", *thickness, Length);
        }
        MaskBody::Sheet { transmission } => out.raw("transmission", number(*transmission)),
    }
    out.quantity("aperture", mask.aperture, Length);
    out.quantity("period", mask.period, Length);
    out.quantity("offset", mask.offset, Length);
}

fn write_sampling(out: &mut Text, scene: &Scene) {
    let sampling = &scene.sampling;
    out.table("[sampling]");
    let scheme = match sampling.scheme {
        Scheme::Cells => "cells",
        Scheme::Random => "random",
    };
    let transport = match sampling.transport {
        Transport::Auto => "auto",
        Transport::FirstOrder => "first-order",
        Transport::Exact => "exact",
    };
    out.text("scheme", scheme);
    match sampling.cells {
        Some(cells) => out.raw("cells", cells),
        None => out.comment("cells: from the geometry"),
    }
    out.raw("rows", sampling.rows);
    out.raw("tolerance", format!("{:?}", sampling.tolerance));
    out.quantity("angle_tolerance", sampling.angle_tolerance, Angle);
    out.raw("max_rays", sampling.max_rays);
    match sampling.rays {
        RandomRays::Count(count) => out.raw("rays", count),
        RandomRays::Grid(grid) => out.raw("rays", format!("{grid:?}")),
    }
    out.text("transport", transport);
    out.raw("seed", sampling.seed);
}

fn write_material(
    out: &mut Text,
    spec: &MaterialSpec,
    scene: &Scene,
    directory: &Path,
) -> Result<()> {
    match spec {
        MaterialSpec::Formula { formula, density } => {
            out.text("formula", formula);
            out.quantity("density", *density, Density);
        }
        MaterialSpec::Mixture { parts, density } => {
            let part =
                |(name, weight): &(String, f64)| format!("{} = {}", quoted(name), number(*weight));
            let parts: Vec<_> = parts.iter().map(part).collect();
            out.raw("mixture", format!("{{ {} }}", parts.join(", ")));
            out.quantity("density", *density, Density);
        }
        MaterialSpec::Constants { mu, delta } => {
            out.quantity("mu", *mu, Attenuation);
            out.raw("delta", number(*delta));
        }
        MaterialSpec::Table { path } => {
            out.text("table", &file(path, scene, directory)?);
        }
    }
    Ok(())
}

fn write_object(
    out: &mut Text,
    object: &Object,
    hash: Option<&String>,
    scene: &Scene,
    directory: &Path,
) -> Result<()> {
    out.text("name", &object.name);
    write_geometry(out, object, hash, scene, directory)?;
    if matches!(object.geometry, ShapeOrMesh::Mesh(_)) || object.allow_defects {
        out.raw("allow_defects", object.allow_defects);
    }
    out.text("material", &object.material);
    write_placement(out, &object.placement);
    if let Some(instances) = &object.instances {
        let text = match instances {
            Instances::File(path) => quoted(&file(path, scene, directory)?),
            Instances::Packing(packing) => write_instances::packing(packing),
        };
        out.raw("instances", text);
    }
    if object.roughness > 0.0 {
        out.raw("roughness", number(object.roughness));
    }
    if object.normals == Normals::Smooth {
        out.text("normals", "smooth");
    }
    Ok(())
}

/// The shape or mesh of an object.
fn write_geometry(
    out: &mut Text,
    object: &Object,
    hash: Option<&String>,
    scene: &Scene,
    directory: &Path,
) -> Result<()> {
    match &object.geometry {
        ShapeOrMesh::Shape(shape) => out.raw("shape", shape_table(shape)),
        ShapeOrMesh::Mesh(Mesh::File { path, unit, group }) => {
            out.text("mesh", &file(path, scene, directory)?);
            if let Some(unit) = unit {
                let text = Length.format(*unit);
                out.text("unit", text.strip_prefix("1 ").unwrap_or(&text));
            }
            if let Some(group) = group {
                out.text("group", group);
            }
            if let Some(hash) = hash {
                out.text("sha256", hash);
            }
        }
        ShapeOrMesh::Mesh(Mesh::Arrays { vertices, triangles }) => {
            let (vertices, triangles) = (vertices.len(), triangles.len());
            out.comment(&format!(
                "mesh given as arrays: {vertices} vertices, {triangles} triangles"
            ));
            if let Some(hash) = hash {
                out.comment(&format!("sha256 {hash}"));
            }
        }
    }
    Ok(())
}

fn write_placement(out: &mut Text, placement: &Placement) {
    out.raw("center", placement.center);
    out.raw("scale", number(placement.scale));
    let turn = |(axis, angle): &([f64; 3], f64)| {
        let axis = axis.map(number).join(", ");
        format!("{{ axis = [{axis}], angle = {} }}", quantity(*angle, Angle))
    };
    let turns: Vec<_> = placement.rotate.iter().map(turn).collect();
    out.raw("rotate", format!("[{}]", turns.join(", ")));
    out.raw("position", list(&placement.position, Length));
}

/// A path as it has to stand in a file in `directory`.
pub(super) fn file(path: &Path, scene: &Scene, directory: &Path) -> Result<String> {
    let unicode = |path: &Path| {
        let problem = "the path has to be Unicode to be written into a scene";
        path.to_str().map(str::to_owned).ok_or_else(|| Error::file(path, problem, None))
    };
    if directory == scene.directory {
        return unicode(path);
    }
    let path = scene.resolve(path);
    let absolute = std::path::absolute(&path)
        .map_err(|source| Error::file(&path, "cannot make the path absolute", Some(source)))?;
    unicode(&absolute)
}

pub(super) fn quantity(value: f64, dimension: Dimension) -> String {
    quoted(&dimension.format(value))
}

pub(super) fn list(values: &[f64], dimension: Dimension) -> String {
    let texts: Vec<_> = values.iter().map(|value| quantity(*value, dimension)).collect();
    format!("[{}]", texts.join(", "))
}

/// Shortest text that reads back to the same number.
pub(super) fn number(value: f64) -> String {
    format!("{value:?}")
}

/// A range where one reads back to the same bits, or else the list.
fn series(
    values: &[f64],
    ends: &[f64],
    dimension: Dimension,
    spread: fn(f64, f64, u32) -> Vec<f64>,
) -> String {
    let count = u32::try_from(values.len()).unwrap_or(0);
    let from = values.first().copied().unwrap_or(0.0);
    let same = |end: &&f64| {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        count > 2 && bits(&spread(from, **end, count)) == bits(values)
    };
    match ends.iter().find(same) {
        Some(end) => {
            let (from, to) = (quantity(from, dimension), quantity(*end, dimension));
            format!("{{ from = {from}, to = {to}, count = {count} }}")
        }
        None => list(values, dimension),
    }
}

/// Candidates for the excluded end of a range of angles: as computed, and its round degrees.
fn ends(angles: &[f64]) -> Vec<f64> {
    let [first, second, ..] = angles else { return Vec::new() };
    let end = first + (second - first) * angles.len() as f64;
    let degrees = (end.to_degrees() * 1e6).round() / 1e6;
    vec![degrees.to_radians(), end]
}

/// A TOML basic string.
pub(super) fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
