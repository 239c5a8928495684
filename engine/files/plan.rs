//! plan.json and device.json: the scene and the device that the shards of a run have in common.
//!
//! `beamlet plan` writes scene.toml, geometry.json and plan.json; each shard is made in a folder of
//! its own, on the platform of device.json; the join makes a run of them and removes the plan.

use super::geometry_file::GeometryFile;
use super::layout::{self, DEVICE, GEOMETRY, LOG, PLAN, RUN, SCENE};
use super::progress_log::ProgressLog;
use super::record::Platform;
use super::run_file::{RunFile, now};
use super::shape::StackShape;
use super::shard::Shard;
use super::values::hex;
use super::{own_files, read, scene_file};
use beamlet_core::array_file::Format;
use beamlet_core::whole_file::{refuse_link, sync_directory, write_whole};
use beamlet_core::{Error, Result, folder, input_file, setters};
use beamlet_model::scene::Scene;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Layout of planned runs.
const VERSION: u32 = 1;

/// Plan of a run in shards, stored as plan.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Plan {
    /// Layout of the planned run.
    pub plan_version: u32,
    /// Version of beamlet.
    pub version: String,
    /// When it was made: UTC, RFC 3339.
    pub made: String,
    /// Command line, where there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Number of shards.
    pub shards: u32,
    /// File format of the frames.
    pub format: Format,
    /// Shape of the stacks.
    pub extent: StackShape,
    /// SHA-256 of scene.toml, which has the hashes of the files of the scene.
    pub scene_sha256: String,
}

/// Choices of a plan beside its scene.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct PlanOptions {
    /// Number of shards, from 1 to the number of views.
    pub shards: u32,
    /// File format of the frames.
    pub format: Format,
    /// SHA-256 of the meshes by the name of their object ([`super::RunStart::mesh_hashes`]).
    pub mesh_hashes: BTreeMap<String, String>,
    /// Platform of every shard; `None`: taken from the first shard.
    pub platform: Option<Platform>,
    /// `key=value` that the scene was loaded with, for scene.toml.
    pub overrides: Vec<String>,
    /// Command line.
    pub command: Option<String>,
}

impl PlanOptions {
    setters! {
        /// Sets the number of shards.
        with_shards(shards: u32);
        /// Sets the file format of the frames.
        with_format(format: Format);
        /// Sets the hashes of the meshes.
        with_mesh_hashes(mesh_hashes: BTreeMap<String, String>);
        /// Sets the platform of every shard.
        with_platform(platform: impl Into<Option<Platform>>);
        /// Sets the overrides that the scene was loaded with.
        with_overrides(overrides: Vec<String>);
        /// Sets the command line.
        with_command(command: impl Into<Option<String>>);
    }
}

impl Plan {
    /// Makes the directory of a run in shards.
    ///
    /// # Errors
    /// [`Error::Argument`] where there are more shards than views, or none; [`Error::File`] where
    /// `run` is taken or cannot be written.
    pub fn create(run: &Path, scene: &Scene, options: &PlanOptions) -> Result<Self> {
        let extent = StackShape::of(scene)?;
        Shard::new(0, options.shards)?;
        if options.shards > extent.views {
            let allowed = format!("1 to {}, the number of views", extent.views);
            return Err(Error::argument("shards", options.shards.to_string(), allowed));
        }
        if layout::is_planned(run) {
            let problem = "holds the plan of a run already; remove it or choose another directory";
            return Err(Error::file(run, problem, None));
        }
        own_files::look(run, false)?;
        folder::make_all(run)?;
        let log = ProgressLog::lock(&run.join(LOG))?;
        own_files::look(run, false)?;
        let scene = scene.with_file_hashes()?;
        let text = scene_file::resolved(run, &scene, &options.mesh_hashes, &options.overrides)?;
        write_whole(&run.join(SCENE), text.as_bytes())?;
        write_whole(&run.join(GEOMETRY), GeometryFile::of(&scene).text()?.as_bytes())?;
        if let Some(platform) = &options.platform {
            let path = run.join(DEVICE);
            write_whole(&path, &json(&path, platform)?)?;
        }
        let plan = Self {
            plan_version: VERSION,
            version: beamlet_core::program::VERSION.to_owned(),
            made: now(),
            command: options.command.clone(),
            shards: options.shards,
            format: options.format,
            extent,
            scene_sha256: hex(&Sha256::digest(&text)),
        };
        write_whole(&run.join(PLAN), &json(&run.join(PLAN), &plan)?)?;
        drop(log);
        Ok(plan)
    }

    /// Reads the plan of a run.
    ///
    /// # Errors
    /// [`Error::File`] where there is none, or not one of this version.
    pub fn read(run: &Path) -> Result<Self> {
        let path = run.join(PLAN);
        if !path.exists() {
            let problem = match layout::is_run(run) {
                true => "is a whole run, not a run in shards".to_owned(),
                false => {
                    format!("is not a planned run: it has no {PLAN}; `beamlet plan` makes one")
                }
            };
            return Err(Error::file(run, problem, None));
        }
        let plan: Self = parse(&path, "is not the plan of a run")?;
        if plan.plan_version != VERSION {
            let found = plan.plan_version;
            let problem = format!("has the plan_version {found}; allowed: {VERSION}");
            return Err(Error::file(path, problem, None));
        }
        plan.extent.check().map_err(|found| Error::file(&path, format!("claims {found}"), None))?;
        Shard::new(0, plan.shards).map_err(|error| Error::file(&path, error.to_string(), None))?;
        Ok(plan)
    }

    /// The shards.
    pub fn all(&self) -> impl Iterator<Item = Shard> + use<> {
        let count = self.shards;
        (0..count).map(move |index| Shard { index, count })
    }

    /// The scene of the planned run in `run`, as it was planned.
    ///
    /// # Errors
    /// [`Error::File`] where scene.toml or a file of the scene changed since.
    pub fn scene(&self, run: &Path) -> Result<Scene> {
        let path = run.join(SCENE);
        let text = input_file::text(&path)
            .map_err(|error| Error::file(&path, "cannot be read", Some(error)))?;
        if hex(&Sha256::digest(&text)) != self.scene_sha256 {
            let problem =
                format!("is not the scene of {PLAN}: it changed since the run was planned");
            return Err(Error::file(path, problem, None));
        }
        let scene = read::read_scene(&path)?;
        let extent = StackShape::of(&scene)?;
        if extent != self.extent {
            let problem = format!("claims {:?}; {SCENE} has {extent:?}", self.extent);
            return Err(Error::file(run.join(PLAN), problem, None));
        }
        Ok(scene)
    }

    /// Refuses the record of another shard, or of a shard of another plan. `path`: the folder of the shard.
    ///
    /// # Errors
    /// [`Error::File`].
    pub(super) fn refuse_other(&self, path: &Path, file: &RunFile, shard: Shard) -> Result<()> {
        let is_other = file.scene_sha256.as_ref() != Some(&self.scene_sha256);
        let what = match file.shard {
            Some(found) if found != shard => format!("it is shard {found}, here is shard {shard}"),
            Some(_) if is_other => "its scene differs".to_owned(),
            Some(_) if file.extent != self.extent || file.format != self.format => {
                "its stacks have another shape or format".to_owned()
            }
            Some(_) => return Ok(()),
            None => format!("it is a whole run, here is shard {shard}"),
        };
        Err(of_other_plan(path, &what))
    }

    /// The platform of the shards of the planned run in `run`; `None` before the first began.
    ///
    /// # Errors
    /// [`Error::File`] where device.json cannot be read.
    pub fn platform(run: &Path) -> Result<Option<Platform>> {
        let path = run.join(DEVICE);
        if !path.exists() {
            return Ok(None);
        }
        parse(&path, "is not the record of a device").map(Some)
    }
}

/// The platform in device.json, which the first shard writes where the plan has none. `folder`: the
/// folder of the shard, which is locked.
pub(super) fn settle_platform(run: &Path, folder: &Path, platform: &Platform) -> Result<Platform> {
    let path = run.join(DEVICE);
    if let Some(settled) = Plan::platform(run)? {
        return Ok(settled);
    }
    refuse_link(&path)?;
    // Whole under a name of its own; only one of several gets the name that counts.
    let mine = folder.join(DEVICE);
    write_whole(&mine, &json(&mine, platform)?)?;
    take_name(&mine, &path, fs::hard_link(&mine, &path))?;
    Ok(Plan::platform(run)?.unwrap_or_else(|| platform.clone()))
}

/// The error of a folder with a shard of another plan.
fn of_other_plan(path: &Path, what: &str) -> Error {
    let problem =
        format!("is of another plan: {what}; remove {}", beamlet_core::printed::path(path));
    Error::file(path.join(RUN), problem, None)
}

/// Gives a whole file the name that a link took or failed to take; the file loses its first name.
fn take_name(mine: &Path, path: &Path, linked: std::io::Result<()>) -> Result<()> {
    let taken = match linked {
        // A system without links: the last of the shards that begin at the same moment wins, and the
        // join compares all.
        Err(error) if error.kind() != ErrorKind::AlreadyExists => fs::rename(mine, path),
        _ => Ok(()),
    };
    let _ = fs::remove_file(mine);
    taken.map_err(|error| Error::file(path, "cannot be written", Some(error)))?;
    sync_directory(path.parent().unwrap_or(path))
}

/// Refuses the folder of a shard where a whole run is expected.
pub(super) fn refuse_shard(path: &Path, file: &RunFile) -> Result<()> {
    let Some(shard) = file.shard else { return Ok(()) };
    let run = path.parent().and_then(Path::parent).map_or_else(PathBuf::new, Path::to_path_buf);
    let problem = format!(
        "holds shard {shard} of a run; `beamlet join {}` joins all of them",
        beamlet_core::printed::path(&run)
    );
    Err(Error::file(path, problem, None))
}

fn json(path: &Path, value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value)
        .map_err(|error| Error::file(path, format!("cannot be written: {error}"), None))?;
    text.push(b'\n');
    Ok(text)
}

fn parse<T: serde::de::DeserializeOwned>(path: &Path, problem: &str) -> Result<T> {
    let text =
        input_file::text(path).map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    serde_json::from_str(&text)
        .map_err(|error| Error::file(path, format!("{problem}: {error}"), None))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without links a file gets its name whole, by a rename: a copy under that name would be seen in parts.
    #[test]
    #[cfg(unix)]
    fn a_file_gets_its_name_whole_where_there_are_no_links() {
        use std::os::unix::fs::MetadataExt;
        let folder = tempfile::tempdir().unwrap();
        let [mine, path] = ["mine", "device.json"].map(|name| folder.path().join(name));
        let inode = |path: &Path| fs::metadata(path).unwrap().ino();
        fs::write(&mine, "first").unwrap();
        let first = inode(&mine);
        take_name(&mine, &path, Err(ErrorKind::Unsupported.into())).unwrap();
        assert_eq!((inode(&path), mine.exists()), (first, false));
        // With links the first of two keeps the name.
        fs::write(&mine, "second").unwrap();
        take_name(&mine, &path, fs::hard_link(&mine, &path)).unwrap();
        assert_eq!((fs::read_to_string(&path).unwrap().as_str(), mine.exists()), ("first", false));
    }
}
