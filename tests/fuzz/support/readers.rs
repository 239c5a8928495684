//! Readers of files: whatever the bytes of an input, they are read or refused.

use super::{OTHER, exr, frames, meshes, npy, put, tiff, with_control};
use beamlet::internals::geometry::diagnose;
use beamlet::scene::Scene;
use std::path::Path;

/// A reader with inputs that it reads.
#[derive(Debug)]
pub struct Reader {
    /// Name of its target.
    pub name: &'static str,
    /// Inputs to damage.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Reads an input.
    ///
    /// # Panics
    /// Where a property of what was read does not hold.
    pub read: fn(&[u8]),
}

/// Scene texts: what loads can be written and read again.
pub const SCENE: Reader = Reader { name: "scene", seeds: scenes, read: read_scene };
/// STL files; the count of triangles follows the length.
pub const STL: Reader = Reader {
    name: "stl",
    seeds: || with_control(meshes::stl_seeds()),
    read: |input| read_mesh("a.stl", &meshes::stl(input)),
};
/// OBJ files.
pub const OBJ: Reader =
    Reader { name: "obj", seeds: meshes::obj_seeds, read: |bytes| read_mesh("a.obj", bytes) };
/// PLY files.
pub const PLY: Reader =
    Reader { name: "ply", seeds: meshes::ply_seeds, read: |bytes| read_mesh("a.ply", bytes) };
/// 3MF files: models, put into an archive unless their control leaves the archive to them.
pub const THREEMF: Reader = Reader {
    name: "threemf",
    seeds: || with_control(meshes::threemf_seeds()),
    read: |input| read_mesh("a.3mf", &meshes::threemf(input)),
};
/// NPY stacks; a control of [`OTHER`] reads an image (kernels, spots).
pub const NPY: Reader = Reader {
    name: "npy",
    seeds: || with_control(npy::seeds()),
    read: |input| read_stack("a.npy", input, npy::repaired),
};
/// EXR frames.
pub const EXR: Reader = Reader {
    name: "exr",
    seeds: || with_control(exr::seeds()),
    read: |input| read_stack("a.exr", input, exr::repaired),
};
/// TIFF stacks; a control of [`OTHER`] reads an image.
pub const TIFF: Reader = Reader {
    name: "tiff",
    seeds: || with_control(tiff::seeds()),
    read: |input| read_stack("a.tif", input, tiff::repaired),
};
/// Readers that need no run.
pub const ALL: [Reader; 8] = [SCENE, STL, OBJ, PLY, THREEMF, NPY, EXR, TIFF];

/// Scenes; those in JSON begin with `j`.
fn scenes() -> Vec<Vec<u8>> {
    let json = concat!("j", include_str!("../scenes/random.json"));
    let paper = include_str!("../../inputs/scene_paper.toml");
    let all = [json, include_str!("../scenes/spectrum.toml"), paper];
    all.map(|text| text.as_bytes().to_vec()).to_vec()
}

fn read_scene(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let scene = match text.strip_prefix('j') {
        Some(json) => Scene::from_json(json, "."),
        None => Scene::from_toml(&text, "."),
    };
    if let Ok(scene) = scene {
        let again = scene.to_toml(".", &Default::default(), &[]).expect("it can be written");
        assert_eq!(Scene::from_toml(&again, ".").expect("it can be read again"), scene);
    }
}

fn read_mesh(name: &str, bytes: &[u8]) {
    let _ = diagnose(Path::new(name), bytes, 1e-3);
}

fn read_stack(name: &str, input: &[u8], repair: fn(u8, &[u8]) -> Vec<u8>) {
    let Some((&control, file)) = input.split_first() else { return };
    let path = put(name, &repair(control, file));
    match control & OTHER {
        0 => frames::read_stack(&path),
        _ => {
            let _ = beamlet::internals::image::read(&path);
        }
    }
}
