//! `beamlet mask`: a mask of a scene as a mesh file.

use super::mesh::{refuse_format, write};
use super::pictures::{refuse_existing, refuse_read};
use crate::args::Mask as Arguments;
use crate::failure::Failure;
use beamlet::cli_support::units::Dimension::Length;
use beamlet::geometry::NamedMesh;
use beamlet::scene::{MaskSpec, MeshFormat, Scene};
use beamlet::{MaskMeshOptions, MaskPlace, mask_meshes};
use std::io::Write;

pub(super) fn run(arguments: &Arguments, out: &mut impl Write) -> Result<(), Failure> {
    let scene = arguments.scene.load()?;
    let path = std::slice::from_ref(&arguments.output);
    let mut read = scene.input_files();
    read.push(arguments.scene.scene.clone());
    refuse_format(&arguments.output)?;
    refuse_read(path, &read)?;
    refuse_existing(path, arguments.overwrite)?;
    let place = match arguments.mask {
        Some(name) => name.into(),
        None if scene.sample_mask.is_none() && scene.detector_mask.is_some() => MaskPlace::Detector,
        None => MaskPlace::Sample,
    };
    let size = match (arguments.width, arguments.height) {
        (Some(width), Some(height)) => Some([width, height]),
        (None, None) => None,
        _ => return Err(Failure::Usage("--width and --height: give both or neither".into())),
    };
    let options = MaskMeshOptions::default()
        .with_size(size)
        .with_frame(arguments.frame)
        .with_substrate(arguments.substrate);
    let located = |error| arguments.scene.locate(error);
    let mut meshes = mask_meshes(&scene, place, &options).map_err(located)?;
    if let Some(part) = &arguments.part {
        let there: Vec<_> = meshes.iter().map(|mesh| mesh.name.clone()).collect();
        meshes.retain(|mesh| mesh.name == *part);
        if meshes.is_empty() {
            let there = there.join(", ");
            return Err(Failure::Usage(format!("no part is named \"{part}\"; allowed: {there}")));
        }
    }
    let has_names = MeshFormat::of(&arguments.output).is_some_and(MeshFormat::has_groups);
    if meshes.len() > 1 && !has_names {
        return Err(Failure::Usage(
            "bars, frame and substrate are separate objects, which only OBJ files can hold; write \
             one with --part, or choose a name that ends in .obj"
                .into(),
        ));
    }
    write(&arguments.output, &meshes, arguments.unit, out)?;
    let mask = match place {
        MaskPlace::Detector => &scene.detector_mask,
        _ => &scene.sample_mask,
    };
    for (mesh, mask) in meshes.iter().zip(std::iter::repeat(mask).flatten()) {
        print_object(&scene, place, mask, mesh, arguments, has_names, out)?;
    }
    Ok(())
}

/// The object for a scene.
fn print_object(
    scene: &Scene,
    place: MaskPlace,
    mask: &MaskSpec,
    mesh: &NamedMesh,
    arguments: &Arguments,
    has_names: bool,
    out: &mut impl Write,
) -> Result<(), Failure> {
    let unit = Length.format(arguments.unit);
    let unit = unit.strip_prefix("1 ").unwrap_or(&unit);
    let file = arguments.output.file_name().unwrap_or_default().to_string_lossy();
    writeln!(out, "\n[[object]]\nname = \"{} {}\"", place.key(), mesh.name)?;
    writeln!(out, "mesh = \"{file}\"\nunit = \"{unit}\"")?;
    if has_names {
        writeln!(out, "group = \"{}\"", mesh.name)?;
    }
    match mask.body.layers().first() {
        Some((material, _)) if mesh.name != "substrate" => {
            writeln!(out, "material = \"{material}\"")?
        }
        _ => writeln!(out, "material = \"silicon\"   # material of the substrate")?,
    }
    // To a picometre: the difference of two distances rounds.
    let y = ((mask.distance - scene.source.distance) * 1e12).round() / 1e12;
    let y = Length.format(y);
    Ok(writeln!(out, "position = [\"0 mm\", \"{y}\", \"0 mm\"]")?)
}
