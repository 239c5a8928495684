//! Moments of a view on disk.
//!
//! A header, then blocks of cell rows with their cells (`moments/bytes.rs`), then the SHA-256 of all of it. Numbers are
//! little-endian words of 32 bits; docs/kept.md describes them. A file is written under another name and
//! renamed when its view is committed.

mod read;

pub use read::{Block, MomentFile};

use crate::layout;
use beamlet_core::whole_file::refuse_link;
use beamlet_core::{Error, Result, folder, input_file, numbers, open_file};
use beamlet_interface::MOMENTS_PER_MATERIAL;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

const MAGIC: [u8; 16] = *b"beamlet moments\0";
const VERSION: u32 = 3;
/// Magic, version, words of a ray's moments, hash of the run's scene.
const HEADER: usize = 16 + 8 + 32;
const HASH: usize = 32;
/// Most words of a ray's moments, for 10,000 materials.
const WORDS: usize = 10_000 * MOMENTS_PER_MATERIAL;
/// Words of a block's header: cell rows, cells, wide cells traced exactly, all of those, first and
/// last row.
pub const BLOCK: usize = 6;
/// Words of a ray: its place and view. Rays of cells have no key.
pub const RAY: usize = 5;
/// Words of its result.
pub const RESULT: usize = 8;
/// Words of the ray at an end, and of its result.
pub const END: usize = RAY + RESULT;
/// Words of a cell traced exactly: the cell, and for both ends ray and result.
pub const EXACT_WORDS: usize = 1 + 2 * END;

/// Hash of the scene.toml of a run, which ties moments to it.
///
/// # Errors
///
/// [`Error::File`] where the scene of the run cannot be read.
pub fn scene_digest(run: &Path) -> Result<[u8; 32]> {
    let path = run.join(layout::SCENE);
    let text = input_file::read(&path, input_file::TEXT)
        .map_err(|error| Error::file(&path, "cannot be read", Some(error)))?;
    Ok(Sha256::digest(text).into())
}

/// Writes the moments of a run, view by view.
#[derive(Debug)]
pub struct MomentWriter {
    /// Folder of scene.toml.
    run: PathBuf,
    /// Folder of the folder of moments.
    part: PathBuf,
    scene: Option<RunScene>,
    open: Option<ViewInWork>,
}

/// The scene.toml of the run, which stays open: it shows whether the run is still at its path.
#[derive(Debug)]
struct RunScene {
    file: File,
    path: PathBuf,
    digest: [u8; 32],
}

impl RunScene {
    fn open(run: &Path) -> Result<Self> {
        let path = run.join(layout::SCENE);
        let file = input_file::open(&path)
            .map_err(|error| Error::file(&path, "cannot be read", Some(error)))?;
        Ok(Self { file, path, digest: scene_digest(run)? })
    }

    fn refuse_moved(&self) -> Result<()> {
        open_file::refuse_moved(&self.file, &self.path, open_file::RESUME)
    }
}

#[derive(Debug)]
struct ViewInWork {
    view: u32,
    file: BufWriter<File>,
    partial: PathBuf,
    hash: Sha256,
}

impl MomentWriter {
    /// A writer beside the frames of the run in `run`. Nothing is written before the first view.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::moments::MomentWriter;
    /// use beamlet::stack::{Format, RunDirectory};
    /// use beamlet::{Control, Engine, EngineOptions, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default().with_keep_moments(true))?;
    /// let mut directory = RunDirectory::create("run", Format::Npy, false)?;
    /// let mut moments = MomentWriter::new("run");
    /// let control = Control::default().with_keep(&mut moments);
    /// engine.run(&Scene::load("scene.toml")?, &mut directory, control)?;
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    #[must_use]
    pub fn new(run: impl Into<PathBuf>) -> Self {
        let run = run.into();
        Self { part: run.clone(), run, scene: None, open: None }
    }

    /// A writer of the moments of a shard in the folder `part`, of the planned run in `run`.
    #[must_use]
    pub(crate) fn of_shard(run: PathBuf, part: PathBuf) -> Self {
        Self { run, part, scene: None, open: None }
    }

    /// A run has begun in the directory: its views follow.
    ///
    /// # Errors
    /// [`Error::File`] where there is none.
    #[doc(hidden)]
    pub fn begin_run(&mut self) -> Result<()> {
        self.scene = Some(RunScene::open(&self.run)?);
        Ok(())
    }

    /// Appends the parts of a block of a view.
    ///
    /// # Errors
    /// [`Error::File`].
    #[doc(hidden)]
    pub fn append(&mut self, view: u32, words: usize, parts: &[&[u8]]) -> Result<()> {
        self.reach(view, words)?;
        let Some(open) = self.open.as_mut() else { return Ok(()) };
        parts.iter().try_for_each(|part| open.put(part))
    }

    /// Begins a view, unless it is in work.
    fn reach(&mut self, view: u32, words: usize) -> Result<()> {
        match &self.open {
            Some(open) if open.view == view => Ok(()),
            _ => self.begin(view, words),
        }
    }

    fn begin(&mut self, view: u32, words: usize) -> Result<()> {
        self.open = None;
        let directory = self.part.join(layout::MOMENTS);
        let Some(scene) = &self.scene else {
            return Err(Error::file(&self.run, "no run has begun here", None));
        };
        scene.refuse_moved()?;
        let path = layout::moments(&directory, view);
        let partial = layout::moments_partial(&directory, view);
        [&directory, &path, &partial].into_iter().try_for_each(|path| refuse_link(path))?;
        for path in [&path, &partial] {
            if !is_of_beamlet(path)? {
                let problem = "was not written by beamlet and would be replaced";
                return Err(Error::file(path, problem, None));
            }
        }
        let file = folder::make(&directory)
            .and_then(|()| File::create(&partial))
            .map_err(|error| Error::file(&partial, "cannot be written", Some(error)))?;
        let mut open =
            ViewInWork { view, file: BufWriter::new(file), partial, hash: Sha256::new() };
        open.put(&MAGIC)?;
        open.put(bytemuck::cast_slice(&[VERSION, numbers::count(words)]))?;
        open.put(&scene.digest)?;
        self.open = Some(open);
        Ok(())
    }

    /// The view is whole. A view without any ray in the sample has a file too.
    ///
    /// # Errors
    /// [`Error::File`].
    #[doc(hidden)]
    pub fn commit(&mut self, view: u32, words: usize) -> Result<()> {
        self.reach(view, words)?;
        self.scene.as_ref().map_or(Ok(()), RunScene::refuse_moved)?;
        let Some(mut open) = self.open.take() else { return Ok(()) };
        open_file::refuse_moved(open.file.get_ref(), &open.partial, open_file::RESUME)?;
        let hash = open.hash.clone().finalize();
        let directory = self.part.join(layout::MOMENTS);
        let path = layout::moments(&directory, open.view);
        let partial = open.partial.clone();
        open.file
            .write_all(&hash)
            .and_then(|()| open.file.flush())
            .and_then(|()| open.file.get_ref().sync_all())
            .and_then(|()| fs::rename(&partial, &path))
            .map_err(|error| Error::file(&path, "cannot be written", Some(error)))?;
        beamlet_core::whole_file::sync_directory(&directory)
    }
}

/// Checks that the moments of a view are in the folder `part`, whole and of the run in `run`.
///
/// # Errors
/// [`Error::File`].
pub(crate) fn check([run, part]: [&Path; 2], view: u32) -> Result<()> {
    MomentFile::open(&part.join(layout::MOMENTS), view, &scene_digest(run)?).map(|_| ())
}

/// Puts the moments of a view of a shard in the folder `part` into the run in `run`, and checks them.
///
/// # Errors
/// [`Error::File`].
pub(crate) fn adopt(run: &Path, part: &Path, view: u32) -> Result<()> {
    let directory = run.join(layout::MOMENTS);
    let from = layout::moments(&part.join(layout::MOMENTS), view);
    let (path, partial) =
        (layout::moments(&directory, view), layout::moments_partial(&directory, view));
    [&directory, &path, &partial, &from].into_iter().try_for_each(|path| refuse_link(path))?;
    folder::make(&directory)
        .map_err(|error| Error::file(&directory, "cannot be created", Some(error)))?;
    beamlet_core::whole_file::link_or_copy(&from, &partial)?;
    fs::rename(&partial, &path)
        .map_err(|error| Error::file(&path, "cannot be written", Some(error)))?;
    // A rename between two links of one file leaves both.
    let _ = fs::remove_file(&partial);
    beamlet_core::whole_file::sync_directory(&directory)?;
    check([run; 2], view)
}

/// Refuses a run that keeps moments and lacks the moments of a view.
///
/// # Errors
/// [`Error::File`].
pub(crate) fn refuse_missing(run: &Path, mut views: Range<u32>) -> Result<()> {
    let directory = run.join(layout::MOMENTS);
    let found = open_file::names_of_run(&directory)?;
    let is_there = |path: &PathBuf| {
        path.file_name().is_some_and(|name| found.binary_search(&name.to_owned()).is_ok())
    };
    let lost = views.find(|view| !is_there(&layout::moments(&directory, *view)));
    lost.map_or(Ok(()), |view| Err(open_file::lost(&layout::moments(&directory, view))))
}

impl Drop for MomentWriter {
    /// A view of which nothing is committed leaves nothing behind.
    fn drop(&mut self) {
        if let Some(open) = self.open.take() {
            // A run that was moved keeps it there: at the path may be another run.
            if open_file::is_at(open.file.get_ref(), &open.partial) {
                let _ = fs::remove_file(&open.partial);
            }
        }
    }
}

impl ViewInWork {
    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.hash.update(bytes);
        self.file
            .write_all(bytes)
            .map_err(|error| Error::file(&self.partial, "cannot be written", Some(error)))
    }
}

/// Removes the moments of an earlier run of `views` views from its directory. Files of others
/// stay, whatever their names.
///
/// # Errors
/// [`Error::File`].
pub(crate) fn remove(run: &Path, views: u32) -> Result<()> {
    let directory = run.join(layout::MOMENTS);
    let names = match folder::names(&directory) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Ok(());
        }
        names => names.map_err(|error| Error::file(&directory, "cannot be read", Some(error)))?,
    };
    for name in names {
        let view = name.to_str().and_then(layout::view_of_moments);
        let path = directory.join(&name);
        if view.is_some_and(|view| view < views) {
            refuse_link(&path)?;
            if !is_of_beamlet(&path)? {
                continue;
            }
            fs::remove_file(&path)
                .map_err(|error| Error::file(&path, "cannot be removed", Some(error)))?;
        }
    }
    let _ = fs::remove_dir(&directory);
    Ok(())
}

/// True if a file begins as moments do, as far as it goes: one in the making may be empty.
fn is_of_beamlet(path: &Path) -> Result<bool> {
    let mut head = Vec::new();
    match File::open(path).and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut head)) {
        Ok(_) => Ok(MAGIC.starts_with(&head)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(true),
        Err(error) => Err(Error::file(path, "cannot be read", Some(error))),
    }
}
