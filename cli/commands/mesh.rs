//! `beamlet mesh`: objects of a scene, or a mesh file, as a mesh file.

use super::beam;
use super::pictures::{refuse_existing, refuse_read};
use crate::args::Mesh as Arguments;
use crate::failure::Failure;
use crate::progress::Reporter;
use beamlet::Control;
use beamlet::cli_support::printed::number;
use beamlet::geometry::{NamedMesh, write_meshes};
use beamlet::scene::{Beam, Mesh, MeshFormat, Object, Scene};
use std::io::Write;
use std::path::Path;

pub(super) fn run(arguments: &Arguments, out: &mut impl Write) -> Result<(), Failure> {
    let scene = scene(arguments)?;
    let located = |error| match beam::is_scene(&arguments.input) {
        true => Scene::locate(&arguments.input, &arguments.sets, error),
        false => error,
    };
    let path = std::slice::from_ref(&arguments.output);
    let mut read = scene.input_files();
    read.push(arguments.input.clone());
    refuse_format(&arguments.output)?;
    refuse_read(path, &read)?;
    refuse_existing(path, arguments.overwrite)?;
    let mut reporter = Reporter::new(arguments.messages);
    let mut progress = |progress| reporter.update(progress);
    let mut control = Control::default().with_progress(&mut progress);
    let sample = beamlet::load_sample(&scene, &mut control).map_err(located)?;
    reporter.doing("making facets of shapes");
    for object in &sample.objects {
        object.warnings.iter().for_each(|text| log::warn!("{}: {text}", object.name));
    }
    let mut meshes = sample.meshes(arguments.error)?;
    if !arguments.objects.is_empty() {
        meshes = chosen(meshes, &arguments.objects)?;
    }
    reporter.finish();
    write(&arguments.output, &meshes, arguments.unit, out)
}

/// The scene, or one about nothing with the mesh file as its object.
fn scene(arguments: &Arguments) -> Result<Scene, Failure> {
    let input = &arguments.input;
    if beam::is_scene(input) {
        if arguments.group.is_some() {
            let problem = "--group is for mesh files; for a scene use --object";
            return Err(Failure::Usage(problem.into()));
        }
        return Ok(Scene::load_with(input, &arguments.sets)?);
    }
    let Some(format) = MeshFormat::of(input) else {
        let shown = beamlet::cli_support::printed::path(input);
        return Err(Failure::Usage(format!(
            "{shown} is neither a scene (.toml, .json) nor a mesh (.stl, .obj, .ply, .3mf)"
        )));
    };
    if !arguments.objects.is_empty() || !arguments.sets.is_empty() {
        return Err(Failure::Usage(
            "--object and --set are for scenes; for a mesh file use --group".into(),
        ));
    }
    let name = input.file_stem().unwrap_or_default().to_string_lossy();
    let mut name = beamlet::cli_support::printed::line(&name);
    if let Some(group) = &arguments.group {
        name.clone_from(group);
    }
    let unit = (!format.has_unit()).then_some(arguments.unit);
    let mesh = Mesh::File { path: input.clone(), unit, group: arguments.group.clone() };
    let mut scene = beam::bare(Beam::Energy(30.0))?;
    scene.objects.push(Object::new(name, mesh, "vacuum"));
    scene.validate()?;
    Ok(scene)
}

fn chosen(meshes: Vec<NamedMesh>, names: &[String]) -> Result<Vec<NamedMesh>, Failure> {
    if let Some(name) = names.iter().find(|name| !meshes.iter().any(|mesh| mesh.name == **name)) {
        let there: Vec<_> = meshes.iter().map(|mesh| format!("\"{}\"", mesh.name)).collect();
        let there = if there.is_empty() { "none".into() } else { there.join(", ") };
        return Err(Failure::Usage(format!("no object is named \"{name}\"; allowed: {there}")));
    }
    Ok(meshes.into_iter().filter(|mesh| names.contains(&mesh.name)).collect())
}

/// Refuses files that no mesh can be written to, before work is done.
pub(super) fn refuse_format(path: &Path) -> Result<(), Failure> {
    match MeshFormat::of(path) {
        Some(MeshFormat::Obj | MeshFormat::Ply | MeshFormat::Stl) => Ok(()),
        _ => Err(Failure::Usage(format!(
            "{}: the name must end in .obj, .ply or .stl",
            beamlet::cli_support::printed::path(path)
        ))),
    }
}

/// Writes meshes and prints their properties.
pub(super) fn write(
    path: &Path,
    meshes: &[NamedMesh],
    unit: f64,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let filled: Vec<&NamedMesh> = meshes.iter().filter(|mesh| !mesh.triangles.is_empty()).collect();
    if filled.is_empty() {
        return Err(Failure::File {
            path: path.into(),
            problem: "nothing to write: no object has triangles".into(),
        });
    }
    if filled.len() > 1 && MeshFormat::of(path) != Some(MeshFormat::Obj) {
        log::warn!(
            "{} objects are written as one mesh; OBJ files keep them separate",
            filled.len()
        );
    }
    write_meshes(path, meshes, unit)?;
    writeln!(out, "{}", beamlet::cli_support::printed::path(path))?;
    for mesh in filled {
        let (name, count) = (&mesh.name, mesh.triangles.len());
        writeln!(out, "  {name}: {count} triangles, {} mm3", number(mesh.volume() * 1e9))?;
    }
    Ok(())
}
