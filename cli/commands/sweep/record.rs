//! `sweep.json`: what a sweep is about, and its finished designs.

use super::{refuse_existing, refuse_read};
use crate::args::Sweep as Arguments;
use crate::failure::Failure;
use crate::picture::sweep::file_name;
use beamlet::cli_support::{InputHashes, write_file};
use beamlet::scene::Scene;
use beamlet::sweep::{Outcome, Score};
use beamlet::{Cancel, Error};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

const NAME: &str = "sweep.json";

/// Removes the files of an earlier sweep, which may have other scores.
fn remove_earlier(output: &Path) {
    let text = std::fs::read_to_string(output.join(NAME)).unwrap_or_default();
    let scores = serde_json::from_str(&text)
        .ok()
        .and_then(|earlier: Record| Score::of_list(&earlier.subject.score).ok());
    let pictures = scores.unwrap_or_default().iter().map(file_name).collect::<Vec<_>>();
    let pictures = pictures.into_iter().chain(["front".into()]);
    let pictures = pictures.flat_map(|name| [format!("{name}.png"), format!("{name}.svg")]);
    for name in pictures.chain(["sweep.csv".into(), "best.toml".into()]) {
        // A missing file needs no removal, and one that stays is replaced later.
        let _ = std::fs::remove_file(output.join(name));
    }
}

/// Inputs that decide the scores of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Subject {
    version: String,
    /// The scene without varied keys, as TOML.
    scene: String,
    /// SHA-256 of the files that it refers to.
    #[serde(default)]
    inputs: BTreeMap<String, String>,
    vary: Vec<String>,
    /// Text of the tables among `vary`, "" of others.
    tables: Vec<String>,
    score: Vec<String>,
    fix: Option<String>,
}

/// The file.
#[derive(Debug, Deserialize)]
pub(super) struct Record {
    subject: Subject,
    /// Finished designs, from the first on.
    pub(super) designs: Vec<Outcome>,
}

/// The file as it is written.
#[derive(Serialize)]
struct RecordView<'a> {
    subject: &'a Subject,
    designs: &'a [Outcome],
}

impl Record {
    /// A new record, or the one that is resumed.
    pub(super) fn begin(arguments: &Arguments, scene: &Scene) -> Result<Self, Failure> {
        let table = |text: &String| match text.contains('=') {
            true => String::new(),
            false => std::fs::read_to_string(text).unwrap_or_default(),
        };
        let subject = Subject {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: scene.to_toml(&scene.directory, &BTreeMap::new(), &[])?,
            inputs: InputHashes::of(&scene.input_files(), &Cancel::default())?.hashes,
            vary: arguments.vary.clone(),
            tables: arguments.vary.iter().map(table).collect(),
            score: arguments.score.clone(),
            fix: arguments.fix.clone(),
        };
        let path = arguments.output.join(NAME);
        let mut read = scene.input_files();
        read.push(arguments.scene.scene.clone());
        read.extend(arguments.vary.iter().map(Into::into));
        let best = arguments.output.join("best.toml");
        refuse_read(&[path.clone(), best], &read)?;
        if !arguments.resume {
            refuse_existing(&[path], arguments.overwrite)?;
            remove_earlier(&arguments.output);
            return Ok(Self { subject, designs: Vec::new() });
        }
        let failed = |problem: String| Failure::File { path: path.clone(), problem };
        let text = std::fs::read_to_string(&path)
            .map_err(|error| failed(format!("no sweep to resume: {error}")))?;
        let known: Self = serde_json::from_str(&text)
            .map_err(|error| failed(format!("no record of a sweep: {error}")))?;
        match known.subject.difference(&subject) {
            None => Ok(known),
            Some(what) => Err(failed(format!(
                "belongs to a sweep with another {what}; continue with the same one, or replace it by --overwrite"
            ))),
        }
    }

    /// Writes the file with these designs in place of the one that is there.
    pub(super) fn write(&self, output: &Path, designs: &[Outcome]) -> beamlet::Result<()> {
        let path = output.join(NAME);
        let text = serde_json::to_string(&RecordView { subject: &self.subject, designs });
        let text = text.map_err(|error| Error::file(&path, error.to_string(), None))?;
        write_file(&path, text.as_bytes())
    }
}

impl Subject {
    /// Name of the first input that differs.
    fn difference(&self, other: &Self) -> Option<&'static str> {
        [
            (self.version != other.version, "version of beamlet"),
            (self.scene != other.scene, "scene"),
            (self.inputs != other.inputs, "file of the scene"),
            (self.vary != other.vary || self.tables != other.tables, "--vary"),
            (self.score != other.score, "--score"),
            (self.fix != other.fix, "--fix"),
        ]
        .into_iter()
        .find_map(|(differs, what)| differs.then_some(what))
    }
}
