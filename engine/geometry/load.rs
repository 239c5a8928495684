//! From the objects of a scene to a sample.

use std::path::Path;

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::body::Body;
use super::surface::{Defect, Surface};
use super::{ObjectSummary, Sample, nesting, obj, placement, shapes, stl};
use crate::error::{Error, Result};
use crate::scene::{Mesh, Object, Scene, ShapeOrMesh};

/// Reads, checks and places every object of the scene.
///
/// # Errors
/// Files that cannot be read, surfaces that are not closed, and objects whose surfaces meet or
/// that a later one swallows. A scene without objects is an empty sample.
pub fn load(scene: &Scene) -> Result<Sample> {
    let loaded: Vec<(Body, String)> = scene
        .objects
        .par_iter()
        .zip(0_u32..u32::try_from(scene.objects.len()).unwrap_or(u32::MAX))
        .map(|(object, number)| body(scene, object, number))
        .collect::<Result<_>>()?;
    let (mut bodies, hashes): (Vec<Body>, Vec<String>) = loaded.into_iter().unzip();
    let names: Vec<String> = scene.objects.iter().map(|object| object.name.clone()).collect();
    nesting::nest(&mut bodies, &names)?;
    assemble(bodies, names, hashes)
}

/// Triangles of the meshes of a scene as far as that can be told without reading them: those in
/// binary STL files.
#[must_use]
pub fn triangles_in_files(scene: &Scene) -> u64 {
    let of = |object: &Object| match &object.geometry {
        ShapeOrMesh::Mesh(Mesh::File { path, .. }) => {
            stl::triangles_in(&scene.directory.join(path))
        }
        _ => None,
    };
    scene.objects.iter().filter_map(of).sum()
}

/// SHA-256 of a file, hexadecimal.
///
/// # Errors
/// The file cannot be read.
pub fn file_hash(path: &Path) -> Result<String> {
    Ok(hash(&read(path)?))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| Error::output(path, "cannot read the mesh", Some(e)))
}

fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The body of an object and the hash of its mesh.
fn body(scene: &Scene, object: &Object, number: u32) -> Result<(Body, String)> {
    let label = match &object.geometry {
        ShapeOrMesh::Mesh(Mesh::File { path, .. }) => {
            format!("\"{}\" ({})", object.name, path.display())
        }
        _ => format!("\"{}\"", object.name),
    };
    let failed = |defect: Defect| Error::mesh(label.clone(), defect.problem, defect.place);
    let (mut surface, unit, hash) = match &object.geometry {
        ShapeOrMesh::Shape(shape) => (shapes::surface(shape).map_err(failed)?, 1.0, String::new()),
        ShapeOrMesh::Mesh(Mesh::File { path, unit }) => {
            let bytes = read(&scene.directory.join(path))?;
            (parse(path, &bytes).map_err(failed)?, *unit, hash(&bytes))
        }
        ShapeOrMesh::Mesh(Mesh::Arrays { vertices, triangles }) => {
            let surface = arrays(vertices, triangles).map_err(failed)?;
            (surface, 1.0, hash_arrays(vertices, triangles))
        }
    };
    let dropped = surface.weld();
    placement::place(&mut surface, unit, &object.placement).map_err(failed)?;
    let mut body = Body::new(surface, number).map_err(failed)?;
    if dropped > 0 {
        body.warnings.insert(0, format!("{dropped} triangles without area were left out"));
    }
    let [low, high] = body.bounds();
    let extent = (high - low).max_element();
    if !(1e-6..=1.0).contains(&extent) {
        body.warnings.push(format!(
            "it is {extent:.3e} m across: is its `unit` (or `scale`) the right one?"
        ));
    }
    if let Some(recorded) = &object.sha256
        && *recorded != hash
    {
        return Err(Error::mesh(
            &object.name,
            "is not the mesh that the scene was made with",
            format!("sha256 {hash}, the scene records {recorded}"),
        ));
    }
    Ok((body, hash))
}

/// By the extension; without a known one, by what the bytes look like.
fn parse(path: &Path, bytes: &[u8]) -> std::result::Result<Surface, Defect> {
    let extension = path.extension().map(|it| it.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("obj") => obj::parse(bytes),
        Some("stl") => stl::parse(bytes),
        _ => Err(Defect::new(
            "the format of the mesh is not known",
            "the file name must end in .stl or .obj",
        )),
    }
}

fn arrays(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> std::result::Result<Surface, Defect> {
    let mut surface = Surface::default();
    for (number, triangle) in triangles.iter().enumerate() {
        let place = || format!("triangle {number}");
        let [Some(a), Some(b), Some(c)] = triangle.map(|index| vertices.get(index as usize)) else {
            return Err(Defect::new(
                format!("{triangle:?} names a vertex beyond the {} given", vertices.len()),
                place(),
            ));
        };
        surface
            .push_triangle([*a, *b, *c].map(Into::into))
            .map_err(|problem| Defect::new(problem, place()))?;
    }
    Ok(surface)
}

fn hash_arrays(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> String {
    let vertices = vertices.as_flattened().iter().flat_map(|number| number.to_le_bytes());
    let triangles = triangles.as_flattened().iter().flat_map(|index| index.to_le_bytes());
    hash(&vertices.chain(triangles).collect::<Vec<u8>>())
}

fn assemble(bodies: Vec<Body>, names: Vec<String>, hashes: Vec<String>) -> Result<Sample> {
    let count = |of: fn(&Body) -> usize| bodies.iter().map(of).sum::<usize>();
    let (vertices, triangles) =
        (count(|body| body.surface.vertices.len()), count(|body| body.surface.triangles.len()));
    if u32::try_from(vertices.max(triangles)).is_err() {
        return Err(Error::mesh(
            "the sample",
            format!("{triangles} triangles are more than 32 bits can count"),
            "all objects together",
        ));
    }
    let mut sample = Sample::default();
    let number = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
    for ((body, name), hash) in bodies.into_iter().zip(names).zip(hashes) {
        let mut inside = Vec::new();
        for component in body.components.iter().filter(|component| component.volume > 0.0) {
            if !inside.contains(&component.outside) {
                inside.push(component.outside);
            }
        }
        sample.objects.push(ObjectSummary {
            name,
            triangles: body.surface.triangles.len(),
            volume: body.components.iter().map(|component| component.volume).sum(),
            bounds: body.bounds(),
            inside,
            hash,
            warnings: body.warnings,
        });
        let (vertex, component) = (number(sample.vertices.len()), number(sample.components.len()));
        sample.vertices.extend(body.surface.vertices);
        sample
            .triangles
            .extend(body.surface.triangles.iter().map(|corners| corners.map(|it| it + vertex)));
        sample.triangle_component.extend(body.triangle_component.iter().map(|it| it + component));
        sample.components.extend(body.components);
    }
    Ok(sample)
}
