//! The scene: the input of a simulation, in SI units with every default filled in.
//!
//! A scene is read from TOML or JSON (docs/scene.md), or built from the structs below. The text is parsed
//! into one tree that knows the place of every value, overrides are applied to that tree, and one reader
//! turns it into the model, so that every error can show its place.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

mod beam;
mod cone_vec;
mod derived;
mod detector;
mod exposure;
mod files;
pub mod formula;
mod instances;
mod keys;
pub mod limits;
mod model;
mod motion;
mod parse;
pub(crate) mod path;
mod pattern;
mod polygon;
mod read;
mod rectangles;
mod rotation;
mod sample;
mod scan;
mod scan_errors;
mod scattering;
mod set;
mod slits;
mod table;
mod targets;
mod text;
mod tree;
mod validate;
mod validate_distances;
mod validate_heights;
mod view;
mod write;

pub use crate::spot::{Spot, SpotFit, SpotPart};
pub(crate) use beam::ANODE_ANGLES;
pub use beam::{Anode, Beam, Filter, SpectrumOrigin, SpectrumSpec};
pub use detector::{Absorber, Blur, Counts, Detector, DetectorMode, KernelFile, Photons, Scatter};
pub use exposure::Exposure;
pub use files::{hash_until, text_hash};
pub use instances::{Instances, Packing, PackingAmount, PackingKind, PackingRegion};
pub use keys::detector::validate_thresholds;
pub use keys::docs;
/// The JSON Schema of scene files.
pub mod schema {
    pub use super::keys::schema::json_schema;
}
pub use model::{
    ApertureLattice, ApertureShape, BarLayer, MaskBody, MaskSpec, Quality, Sampling, Scene, Scheme,
    Source, Substrate, Tolerances, Transport,
};
pub use motion::Motion;
pub use pattern::{Pattern, Strip};
pub use rectangles::Rectangle;
pub use sample::{MaterialSpec, Mesh, MeshFormat, Normals, Object, Placement, Shape, ShapeOrMesh};
pub use scan::{Fly, RotationAxis, Scan};
pub use scan_errors::ScanErrors;
pub use scattering::{BodyShape, Microstructure, Scattering, ScatteringAxis};
pub use targets::RandomRays;
pub use view::{Pose, View};

use beamlet_core::{Error, Result, input_file};
use tree::Document;

impl Scene {
    /// Loads and validates a scene file, TOML or JSON by its extension.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the file cannot be read; otherwise [`Error::Scene`] with place, key, found and
    /// allowed value, or [`Error::Several`] of them.
    ///
    /// # Example
    ///
    /// ```no_run
    /// let scene = beamlet::scene::Scene::load("scene.toml")?;
    /// println!("{} views", scene.scan.angles.len());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        Self::load_with(path, &[])
    }

    /// Loads a scene file with overrides `key.path=value` applied to it in their order. The
    /// value is TOML, or a bare string: `source.energy=40 keV`, `object[0].material=gold`,
    /// `object.rod.material=gold`.
    ///
    /// # Errors
    ///
    /// As [`Self::load`]; also where an override leads nowhere.
    pub fn load_with(path: impl AsRef<Path>, sets: &[String]) -> Result<Self> {
        let path = path.as_ref();
        Self::from_document(Self::document(path, sets)?, directory_of(path))
    }

    /// Gives an error that came up after loading its place in the scene file: the line of its
    /// key, or of the nearest table above it.
    #[must_use]
    pub fn locate(path: impl AsRef<Path>, sets: &[String], error: Error) -> Error {
        match Self::document(path.as_ref(), sets) {
            Ok(document) => document.located(error),
            Err(_) => error,
        }
    }

    fn document(path: &Path, sets: &[String]) -> Result<Document> {
        let file = Some(path.to_owned());
        let extension = path.extension().map(|text| text.to_string_lossy().to_lowercase());
        let parse = match extension.as_deref() {
            Some("toml") => parse::toml,
            Some("json") => parse::json,
            _ => {
                if let Err(error) = std::fs::metadata(path) {
                    return Err(Error::file(path, "cannot be read", Some(error)));
                }
                let of_run = path.join("scene.toml");
                let problem = match path.is_dir() {
                    true if of_run.is_file() => {
                        let scene = beamlet_core::printed::path(&of_run);
                        format!("the scene file must end in .toml or .json; this is a directory, whose scene is {scene}")
                    }
                    true => "the scene file must end in .toml or .json; this is a directory without a run".into(),
                    false => "the scene file must end in .toml or .json".into(),
                };
                return Err(Error::file(path, problem, None));
            }
        };
        let text = input_file::text(path)
            .map_err(|source| Error::file(path, "cannot read the scene", Some(source)))?;
        with_sets(parse(&text, file)?, sets)
    }

    /// Reads and validates TOML text; relative paths in it start from `directory`.
    ///
    /// # Errors
    ///
    /// [`Error::Scene`] with place, key, found and allowed value.
    pub fn from_toml(text: &str, directory: impl AsRef<Path>) -> Result<Self> {
        Self::from_toml_with(text, directory, &[])
    }

    /// Reads and validates JSON text; relative paths in it start from `directory`.
    ///
    /// # Errors
    ///
    /// [`Error::Scene`] with place, key, found and allowed value.
    pub fn from_json(text: &str, directory: impl AsRef<Path>) -> Result<Self> {
        Self::from_json_with(text, directory, &[])
    }

    /// As [`Self::from_toml`], with overrides as in [`Self::load_with`].
    ///
    /// # Errors
    ///
    /// As [`Self::load_with`].
    pub fn from_toml_with(
        text: &str,
        directory: impl AsRef<Path>,
        sets: &[String],
    ) -> Result<Self> {
        Self::from_document(with_sets(parse::toml(text, None)?, sets)?, directory.as_ref())
    }

    /// As [`Self::from_json`], with overrides as in [`Self::load_with`].
    ///
    /// # Errors
    ///
    /// As [`Self::load_with`].
    pub fn from_json_with(
        text: &str,
        directory: impl AsRef<Path>,
        sets: &[String],
    ) -> Result<Self> {
        Self::from_document(with_sets(parse::json(text, None)?, sets)?, directory.as_ref())
    }

    fn from_document(document: Document, directory: &Path) -> Result<Self> {
        Self::from_document_and(document, directory, |_| Vec::new())
    }

    /// As [`Self::load_with`], with what `more` finds wrong with the scene among its errors, each at
    /// its place. A single error of `more` is left to where it matters.
    ///
    /// # Errors
    ///
    /// As [`Self::load_with`].
    #[doc(hidden)]
    pub fn load_and(
        path: &Path,
        sets: &[String],
        more: impl FnOnce(&Self) -> Vec<Error>,
    ) -> Result<Self> {
        Self::from_document_and(Self::document(path, sets)?, directory_of(path), more)
    }

    fn from_document_and(
        mut document: Document,
        directory: &Path,
        more: impl FnOnce(&Self) -> Vec<Error>,
    ) -> Result<Self> {
        directory.clone_into(&mut document.directory);
        let scene = read::read_scene(&document);
        let mut of_values = scene.as_ref().map(Self::faults).unwrap_or_default();
        let more = scene.as_ref().map(more).unwrap_or_default();
        if more.len() > 1 || !of_values.is_empty() || document.has_errors() {
            of_values.extend(more);
        }
        Error::of_all(document.all_errors(of_values))?;
        // Without a source or a detector there was an error.
        scene.ok_or_else(|| Error::scene("scene", "no scene", "a source and a detector"))
    }

    /// A path of the scene, from where the program runs.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.directory.join(path)
    }

    /// The resolved scene as TOML for a file in `directory`: every default filled in, every
    /// quantity so that it reads back to the same bits, and so an equal scene. `hashes` are the
    /// SHA-256 of mesh files by the name of their object; an object without an entry keeps its
    /// own. `sets` are recorded as comments. In another directory than the scene's own, paths
    /// are written absolute. A mesh given as arrays is left out, with a comment in its place:
    /// such a text documents the run and does not load.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if a path is not Unicode or the working directory is gone.
    pub fn to_toml(
        &self,
        directory: impl AsRef<Path>,
        hashes: &BTreeMap<String, String>,
        sets: &[String],
    ) -> Result<String> {
        write::to_toml(self, directory.as_ref(), hashes, sets)
    }
}

/// A document with overrides applied to it in their order.
fn with_sets(mut document: Document, sets: &[String]) -> Result<Document> {
    for set in sets {
        set::apply(&mut document, set)?;
    }
    Ok(document)
}

/// Where relative paths of a scene file start.
fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
