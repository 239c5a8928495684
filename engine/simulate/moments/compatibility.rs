//! Allowed differences between a run with stored moments and a scene that uses them.

use super::DELTA_HEADROOM;
use beamlet_core::{Error, Result, printed};
use beamlet_geometry as geometry;
use beamlet_model::media::MaterialTable;
use beamlet_model::scene::{Instances, Mesh, Normals, Object, Scene, ShapeOrMesh};

/// Source distance, angles and the shape and place of every object must be the same.
///
/// # Errors
/// [`Error::Scene`] with the key that differs; [`Error::File`] where a mesh cannot be read.
pub(super) fn check(base: &Scene, scene: &Scene) -> Result<()> {
    let differs = |key: &str, found: String, there: String| {
        Err(Error::scene(key, found, format!("{there}, as in the stored run")))
    };
    let mm = |m: f64| format!("{} mm", 1e3 * m);
    if base.source.distance.to_bits() != scene.source.distance.to_bits() {
        return differs("source.distance", mm(scene.source.distance), mm(base.source.distance));
    }
    if base.scan.angles != scene.scan.angles {
        let count = |s: &Scene| format!("{} angles", s.scan.angles.len());
        return differs("scan.angles", format!("other angles ({})", count(scene)), count(base));
    }
    let (before, now) = (&base.scan, &scene.scan);
    let same = [
        ("motions", before.motions == now.motions),
        ("axis", before.axis == now.axis),
        ("travel", before.has_travel_of(now)),
        ("dithers", before.dithers == now.dithers),
        ("fly", before.fly == now.fly),
        ("errors", before.errors.source == now.errors.source),
    ];
    if let Some((key, _)) = same.iter().find(|(_, same)| !same) {
        let found = "another motion of the sample".into();
        return differs(&format!("scan.{key}"), found, "the same motion".into());
    }
    if base.objects.len() != scene.objects.len() {
        let count = |s: &Scene| format!("{} objects", s.objects.len());
        return differs("object", count(scene), count(base));
    }
    for (index, (there, here)) in base.objects.iter().zip(&scene.objects).enumerate() {
        let key = |name: &str| scene.object_key(index, name);
        if there.placement != here.placement {
            let name = &here.name;
            return differs(
                &key("position"),
                format!("\"{name}\" elsewhere"),
                "the same place".into(),
            );
        }
        if there.roughness.to_bits() != here.roughness.to_bits() {
            let (now, was) = (here.roughness, there.roughness);
            return differs(&key("roughness"), now.to_string(), was.to_string());
        }
        if there.normals != here.normals {
            let name = |normals: Normals| match normals {
                Normals::Facets => "\"facets\"",
                Normals::Smooth => "\"smooth\"",
            };
            let (now, was) = (name(here.normals), name(there.normals));
            return differs(&key("normals"), now.into(), was.into());
        }
        if let Some((found, was)) = other_surface(scene, there, here)? {
            return differs(&key("mesh"), found, was);
        }
        if !same_instances(base, there, scene, here)? {
            let name = &here.name;
            let (found, was) =
                (format!("other instances of \"{name}\""), "the same instances".into());
            return differs(&key("instances"), found, was);
        }
    }
    Ok(())
}

/// True if an object has the same instances: files by their contents, packings by their keys.
fn same_instances(base: &Scene, there: &Object, scene: &Scene, here: &Object) -> Result<bool> {
    match (&there.instances, &here.instances) {
        (Some(Instances::File(was)), Some(Instances::File(now))) => {
            Ok(base.file_hash(was)? == scene.file_hash(now)?)
        }
        (was, now) => Ok(was == now),
    }
}

/// Surface of an object, now and in the run, if they differ.
fn other_surface(scene: &Scene, there: &Object, here: &Object) -> Result<Option<(String, String)>> {
    let (ShapeOrMesh::Mesh(Mesh::File { unit: was, group: taken, .. }), Some(recorded)) =
        (&there.geometry, &there.sha256)
    else {
        let same = there.geometry == here.geometry;
        return Ok((!same).then(|| ("another shape".into(), "the shape".into())));
    };
    let ShapeOrMesh::Mesh(Mesh::File { path, unit, group }) = &here.geometry else {
        return Ok(Some(("no mesh file".into(), format!("a mesh with sha256 {recorded}"))));
    };
    let hash = geometry::file_hash(&scene.directory.join(path))?;
    if hash != *recorded {
        return Ok(Some((format!("a mesh with sha256 {hash}"), format!("sha256 {recorded}"))));
    }
    if group != taken {
        let words = |group: &Option<String>| match group {
            Some(group) => format!("the group {group:?}"),
            None => "the whole mesh".into(),
        };
        return Ok(Some((words(group), words(taken))));
    }
    let words = |unit: Option<f64>| match unit {
        Some(unit) => format!("a unit of {unit} m"),
        None => "the unit of the file".into(),
    };
    let same = was.map(f64::to_bits) == unit.map(f64::to_bits);
    Ok((!same).then(|| (words(*unit), words(*was))))
}

/// Materials of `scene` in the order in which the run kept its moments.
///
/// # Errors
/// [`Error::Scene`] where objects that shared a material do not share one now, or where a
/// material refracts more strongly than rays were flagged for.
pub(super) fn media(
    base: &Scene,
    old: &MaterialTable,
    scene: &Scene,
    new: &MaterialTable,
) -> Result<MaterialTable> {
    let mut of_material: Vec<Option<u32>> = vec![None; old.names.len()];
    of_material[0] = Some(0);
    for (index, (was, now)) in old.of_object.iter().zip(&new.of_object).enumerate() {
        let seen = &mut of_material[*was as usize];
        if seen.is_some_and(|seen| seen != *now) {
            let name = &base.objects[index].material;
            return Err(Error::scene(
                scene.object_key(index, "material"),
                format!("\"{}\"", scene.objects[index].material),
                format!("one material for all objects of \"{name}\", whose moments are one sum"),
            ));
        }
        *seen = Some(*now);
    }
    let order: Vec<usize> = of_material.iter().map(|m| m.unwrap_or(0) as usize).collect();
    let constants: Vec<Vec<_>> =
        new.constants.iter().map(|node| order.iter().map(|&m| node[m]).collect()).collect();
    let media = MaterialTable {
        names: order.iter().map(|&m| new.names[m].clone()).collect(),
        energies: new.energies.clone(),
        weights: new.weights.clone(),
        constants,
        of_object: old.of_object.clone(),
        rough: old.rough.clone(),
    };
    for (index, name) in media.names.iter().enumerate() {
        let (now, was) = (media.delta(index), old.delta(index));
        if now > DELTA_HEADROOM * was * (1.0 + 1e-9) && now > 0.0 {
            let beside = match was > 0.0 {
                true => format!("{} times the delta of the run", printed::number(now / was)),
                false => "where the run has 0".to_owned(),
            };
            return Err(Error::scene(
                "source",
                format!("\"{name}\" with a delta of {now:.3e}, {beside}"),
                format!(
                    "up to {DELTA_HEADROOM} times the delta of the run, for which its rays are valid; simulate this scene instead"
                ),
            ));
        }
    }
    Ok(media)
}
