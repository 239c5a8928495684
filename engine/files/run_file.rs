//! run.json: the provenance of a run, written when it begins and again when it ends.

use super::part::ViewRange;
use super::record::{Platform, RunRecord, RunStart};
use super::shape::{StackShape, ViewAngles};
use beamlet_core::array_file::Format;
use beamlet_core::{Error, Result, input_file};
use beamlet_model::scene::Scene;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::SystemTime;

/// How far a run came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RunState {
    /// It runs, or was ended without a word: by the power, or a signal that cannot be caught.
    Running,
    /// It was stopped, or failed, before every view was committed; it can be resumed.
    Interrupted,
    /// Every view is committed.
    Done,
}

/// The layout of run directories that this version writes and reads.
pub const FORMAT_VERSION: u32 = 1;

/// Key that every layout has: its number.
#[derive(Deserialize)]
struct Versioned {
    format_version: u32,
}

/// Contents of run.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RunFile {
    /// Layout of the run directory: [`FORMAT_VERSION`].
    pub format_version: u32,
    /// How far the run came.
    pub state: RunState,
    /// File format of the frames.
    pub format: Format,
    /// Shape of the stacks.
    pub extent: StackShape,
    /// When the run began, and when run.json was written last: UTC, RFC 3339. Dates, durations and
    /// command lines say nothing about the stacks: neither resuming nor comparing looks at them.
    pub began: String,
    /// See `began`.
    pub written: String,
    /// Seconds that the run took so far by the clock on the wall, all its parts together.
    pub duration_s: f64,
    /// Title of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Angles of the views.
    #[serde(flatten)]
    pub view_angles: ViewAngles,
    /// For each flat the view before which it is taken, the number of views for a flat behind the last;
    /// `None` where one flat serves all views.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flats_before_views: Option<Vec<u32>>,
    /// The same of the darks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub darks_before_views: Option<Vec<u32>>,
    /// Command line of each part of the run, the first first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub commands: Vec<String>,
    /// Views that existed already when the run was resumed; times exclude them.
    pub resumed_views: u32,
    /// Views of the part of a run that this folder holds; `None`: all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<ViewRange>,
    /// Parts that the run was joined from, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<JoinedPart>,
    /// Provenance; tally and times are zero until the run is done.
    #[serde(flatten)]
    pub record: RunRecord,
}

/// Provenance of a part that was joined.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct JoinedPart {
    /// Its views.
    pub views: ViewRange,
    /// Program that made it.
    #[serde(flatten)]
    pub platform: Platform,
    /// When it began: UTC, RFC 3339.
    pub began: String,
    /// Seconds by the clock.
    pub duration_s: f64,
}

/// The date and time, UTC, as RFC 3339 has it.
pub fn now() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string()
}

impl RunFile {
    /// The file of a run of a scene that begins.
    pub(super) fn begin(
        format: Format,
        extent: StackShape,
        scene: &Scene,
        start: &RunStart,
    ) -> Self {
        let scan = &scene.scan;
        Self {
            format_version: FORMAT_VERSION,
            state: RunState::Running,
            format,
            extent,
            began: now(),
            written: String::new(),
            duration_s: 0.0,
            title: scene.title.clone(),
            view_angles: ViewAngles::of(scene),
            flats_before_views: scan.flats_every.map(|_| scan.flat_places()),
            darks_before_views: scan.darks_every.map(|_| scan.dark_places()),
            commands: Vec::new(),
            resumed_views: 0,
            part: None,
            parts: Vec::new(),
            record: RunRecord::begin(start, scene.sampling.seed),
        }
    }

    /// Refuses a part of a run, in the folder `path`, where a whole run is expected.
    pub(super) fn refuse_part(&self, path: &Path) -> Result<()> {
        let Some(views) = self.part else { return Ok(()) };
        let part = beamlet_core::printed::path(path);
        let problem = format!(
            "holds views {views} of a run; `beamlet join {part} … -o RUN` makes one run of all its parts"
        );
        Err(Error::file(path, problem, None))
    }

    /// Takes over when an earlier part of the run began, how long it took and by which command.
    pub(super) fn go_on_from(&mut self, earlier: &Self) {
        self.began.clone_from(&earlier.began);
        self.duration_s = earlier.duration_s;
        self.commands.clone_from(&earlier.commands);
        self.parts.clone_from(&earlier.parts);
    }

    /// Reads a run.json.
    ///
    /// # Errors
    /// [`Error::File`] where it is missing, was not written by beamlet, or has the layout of another
    /// version.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input_file::text(path)
            .map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
        let refused = |problem: String| {
            Error::file(path, format!("is not the record of a beamlet run: {problem}"), None)
        };
        let versioned = serde_json::from_str::<Versioned>(&text);
        match versioned.map_err(|error| refused(error.to_string()))?.format_version {
            FORMAT_VERSION => {}
            found => {
                let problem = format!(
                    "has the format_version {found}; this version of beamlet reads {FORMAT_VERSION}"
                );
                return Err(Error::file(path, problem, None));
            }
        }
        let file: Self = serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
        file.extent.check().map_err(|found| refused(format!("it claims {found}")))?;
        Ok(file)
    }

    /// Writes it whole or not at all.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where it cannot be written.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        let dated = Self { written: now(), ..self.clone() };
        let mut text = serde_json::to_string_pretty(&dated)
            .map_err(|error| Error::file(path, format!("cannot be written: {error}"), None))?;
        text.push('\n');
        beamlet_core::whole_file::write_whole(path, text.as_bytes())
    }
}
