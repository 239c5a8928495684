//! `sweep.json` of a directory: what a sweep is about, and its finished designs, from which it is resumed.

use super::{Load, Outcome, Score, Sweep};
use beamlet_core::whole_file::write_file;
use beamlet_core::{Cancel, Error, Result};
use beamlet_files::InputHashes;
use beamlet_geometry::hash_arrays;
use beamlet_model::scene::{Mesh, Object, ShapeOrMesh};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const NAME: &str = "sweep.json";
/// Least time between two writes of a sweep in progress.
const BETWEEN: Duration = Duration::from_secs(5);

/// Inputs that decide the scores of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Subject {
    version: String,
    /// The scene without varied keys, as TOML.
    scene: String,
    /// SHA-256 of the files that it refers to, and of meshes given as arrays, by "object.NAME".
    #[serde(default)]
    inputs: BTreeMap<String, String>,
    vary: Vec<String>,
    /// Text of the tables among `vary`, "" of others.
    tables: Vec<String>,
    score: Vec<String>,
    fix: Option<String>,
}

/// The file as it is read.
#[derive(Deserialize)]
struct Recorded {
    subject: Subject,
    /// Finished designs, from the first on.
    designs: Vec<Outcome>,
}

/// The file as it is written.
#[derive(Serialize)]
struct RecordView<'a> {
    subject: &'a Subject,
    designs: &'a [Outcome],
}

/// Record of a sweep in a directory.
#[derive(Debug)]
pub struct SweepRecord {
    path: PathBuf,
    subject: Subject,
    /// Time of the last write by [`Self::keep`], or of the begin.
    written: Instant,
}

impl SweepRecord {
    /// Record of a sweep over the scene that `load` gives without overrides, without a file yet.
    ///
    /// # Errors
    /// [`Error::File`] for an input that cannot be read; [`Error::Interrupted`].
    pub fn new(directory: &Path, sweep: &Sweep, load: &Load<'_>, cancel: &Cancel) -> Result<Self> {
        let scene = &load(&[])?;
        let table = |text: &String| match text.contains('=') {
            true => String::new(),
            false => std::fs::read_to_string(text).unwrap_or_default(),
        };
        let of_arrays = |object: &Object| match &object.geometry {
            ShapeOrMesh::Mesh(Mesh::Arrays { vertices, triangles }) => {
                Some((format!("object.{}", object.name), hash_arrays(vertices, triangles)))
            }
            ShapeOrMesh::Mesh(_) | ShapeOrMesh::Shape(_) => None,
        };
        let mut files = scene.input_files();
        for set in sweep.designs.sets_of_keys() {
            cancel.check()?;
            // A value that the scene refuses alone may serve with others.
            let others = load(&[set]).map(|scene| scene.input_files()).unwrap_or_default();
            files.extend(others.into_iter().filter(|file| file.exists()));
        }
        files.sort_unstable();
        files.dedup();
        let mut inputs = InputHashes::of(&files, cancel)?.hashes;
        inputs.extend(scene.objects.iter().filter_map(of_arrays));
        let subject = Subject {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: scene.to_toml(&scene.directory, &BTreeMap::new(), &[])?,
            inputs,
            vary: sweep.vary.clone(),
            tables: sweep.vary.iter().map(table).collect(),
            score: sweep.scores.iter().map(Score::name).collect(),
            fix: sweep.fix.clone(),
        };
        Ok(Self { path: directory.join(NAME), subject, written: Instant::now() })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Scores of the sweep whose record is in the place of this one; none without a record.
    #[must_use]
    pub fn earlier_scores(&self) -> Vec<Score> {
        let text = std::fs::read_to_string(&self.path).unwrap_or_default();
        let earlier = serde_json::from_str(&text).ok();
        let scores = earlier.and_then(|it: Recorded| Score::of_list(&it.subject.score).ok());
        scores.unwrap_or_default()
    }

    /// Finished designs of the record that is there.
    ///
    /// # Errors
    /// [`Error::File`] where there is none, or it belongs to another sweep.
    pub fn resume(&self) -> Result<Vec<Outcome>> {
        let failed = |problem: String| Error::file(&self.path, problem, None);
        let text = std::fs::read_to_string(&self.path)
            .map_err(|error| failed(format!("no sweep to resume: {error}")))?;
        let known: Recorded = serde_json::from_str(&text)
            .map_err(|error| failed(format!("no record of a sweep: {error}")))?;
        match known.subject.difference(&self.subject) {
            None => Ok(known.designs),
            Some(what) => Err(failed(format!(
                "belongs to a sweep with another {what}; continue with the same one, or replace it by overwrite"
            ))),
        }
    }

    /// Writes the finished designs of a sweep in progress, every few seconds.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn keep(&mut self, designs: &[Outcome]) -> Result<()> {
        if self.written.elapsed() > BETWEEN {
            self.write(designs)?;
            self.written = Instant::now();
        }
        Ok(())
    }

    /// Writes the file with these designs in place of the one that is there.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn write(&self, designs: &[Outcome]) -> Result<()> {
        let text = serde_json::to_string(&RecordView { subject: &self.subject, designs });
        let text = text.map_err(|error| Error::file(&self.path, error.to_string(), None))?;
        write_file(&self.path, text.as_bytes())
    }
}

impl Subject {
    /// Name of the first input that differs.
    fn difference(&self, other: &Self) -> Option<&'static str> {
        [
            (self.version != other.version, "version of beamlet"),
            (self.scene != other.scene, "scene"),
            (self.inputs != other.inputs, "file of the scene"),
            (self.vary != other.vary || self.tables != other.tables, "vary"),
            (self.score != other.score, "score"),
            (self.fix != other.fix, "fix"),
        ]
        .into_iter()
        .find_map(|(differs, what)| differs.then_some(what))
    }
}
