//! Frames in a file each, of a format without pages.
//!
//! A view is built in a folder of its own and renamed into place, so that a directory of frames is
//! whole or not there. A view that comes in one band is converted as it comes; one in several bands
//! is spooled to a raw file first, because such a file is written once from top to bottom.

use super::layout;
use super::part::Part;
use super::shape::StackShape;
use super::values::{Values, hex};
use beamlet_core::array_file::{ArrayFile, Format, Sample, append, le_bytes};
use beamlet_core::whole_file::{link_or_copy, refuse_link};
use beamlet_core::{Error, Result, folder, open_file, reserve};
use beamlet_model::optics::{Mask, Optics};
use beamlet_model::scene::{Exposure, Scene};
use ndarray::{ArrayView2, ArrayView3};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The frames of a run directory as files.
#[derive(Debug)]
pub(super) struct FrameFiles {
    root: PathBuf,
    format: Format,
    part: Part,
    /// True if there are dark frames.
    dark: bool,
    about: About,
    /// Raw values `[step][row][column]` of the view in work, when it comes in several bands.
    spool: Option<File>,
    /// Checksum of the view in work once its frames are in the folder of partial frames.
    converted: Option<String>,
}

impl FrameFiles {
    /// Frames under `root` with these values: intensities, or detector numbers; with dark frames
    /// or without.
    pub(super) fn begin(
        root: &Path,
        format: Format,
        part: Part,
        scene: &Scene,
        values: Values,
        dark: bool,
    ) -> Self {
        let (root, about) = (root.to_path_buf(), About::of(scene, values));
        Self { root, format, part, dark, about, spool: None, converted: None }
    }

    pub(super) fn write(
        &mut self,
        view: Exposure,
        rows: &Range<u32>,
        data: ArrayView3<'_, f32>,
    ) -> Result<()> {
        if rows.len() == self.part.extent.rows as usize {
            self.make_partial()?;
            let frames: Vec<_> = (0_u32..).zip(data.outer_iter()).collect();
            let write = |(step, frame): &(u32, ArrayView2<'_, f32>)| {
                self.write_frame(view, *step, frame.view())
            };
            let hash = || {
                let mut hasher = Sha256::new();
                for frame in data.outer_iter() {
                    hasher.update(le_bytes(frame.iter().copied())?);
                }
                Ok::<_, Error>(hex(&hasher.finalize()))
            };
            // Large frames are compressed by threads of their own.
            let write_all = || match self.part.extent.frame_bytes() < SMALL {
                true => frames.par_iter().try_for_each(write),
                false => frames.iter().try_for_each(write),
            };
            let (written, checksum) = rayon::join(write_all, hash);
            written?;
            self.converted = Some(checksum?);
            return Ok(());
        }
        let path = self.spool_path();
        if self.spool.is_none() {
            self.make_partial()?;
            let mut options = File::options();
            let file = options.create(true).truncate(true).read(true).write(true).open(&path);
            self.spool = Some(file.map_err(failed(&path, "cannot be created"))?);
        }
        let row_bytes = 4 * u64::from(self.part.extent.columns);
        for (step, frame) in (0_u64..).zip(data.outer_iter()) {
            let offset = step * self.part.extent.frame_bytes() + u64::from(rows.start) * row_bytes;
            let bytes = le_bytes(frame.iter().copied())?;
            if let Some(file) = &mut self.spool {
                file.seek(SeekFrom::Start(offset))
                    .and_then(|_| file.write_all(&bytes))
                    .map_err(failed(&path, "cannot be written"))?;
            }
        }
        Ok(())
    }

    /// Puts the frames of the view in place and syncs them; their checksum.
    pub(super) fn commit(&mut self, view: Exposure) -> Result<String> {
        if let Some(spool) = self.spool.take() {
            self.converted = Some(self.convert(view, spool)?);
            let path = self.spool_path();
            fs::remove_file(&path).map_err(failed(&path, "cannot be removed"))?;
        }
        let checksum = self.converted.take().unwrap_or_default();
        let partial = self.root.join(layout::PARTIAL);
        let frames: Vec<PathBuf> =
            (0..self.part.extent.steps).map(|step| partial.join(self.step_name(step))).collect();
        // Journalling file systems settle syncs that wait at the same time together.
        frames.par_iter().try_for_each(|path| {
            File::open(path).and_then(|file| file.sync_all()).map_err(failed(path, "cannot sync"))
        })?;
        self.put_in_place(view, &partial)?;
        Ok(checksum)
    }

    /// Puts the frames of a view in the folder `from` into place, by links where the system has them;
    /// their checksum.
    pub(super) fn adopt(&self, view: Exposure, from: &Path) -> Result<String> {
        self.make_partial()?;
        let partial = self.root.join(layout::PARTIAL);
        let from = layout::view_folder(from, self.part.extent, view);
        let names: Vec<String> =
            (0..self.part.extent.steps).map(|step| self.step_name(step)).collect();
        names.par_iter().try_for_each(|name| {
            refuse_link(&from.join(name))?;
            link_or_copy(&from.join(name), &partial.join(name))
        })?;
        self.put_in_place(view, &partial)?;
        checksum(&self.root, self.format, self.part.extent, view)
    }

    /// Spooled values to frames, one frame in memory at a time.
    fn convert(&self, view: Exposure, mut spool: File) -> Result<String> {
        let path = self.spool_path();
        let unread = failed(&path, "cannot be read");
        let mut hasher = Sha256::new();
        spool.seek(SeekFrom::Start(0)).map_err(&unread)?;
        let shape = [self.part.extent.rows as usize, self.part.extent.columns as usize];
        let mut values = reserve::zeroed::<f32>(shape[0] * shape[1], "a frame")?;
        for step in 0..self.part.extent.steps {
            let bytes = bytemuck::cast_slice_mut::<f32, u8>(&mut values);
            spool.read_exact(bytes).map_err(&unread)?;
            hasher.update(&*bytes);
            values.iter_mut().for_each(|value| *value = f32::from_le_bytes(value.to_ne_bytes()));
            let frame = ArrayView2::from_shape(shape, &values)
                .map_err(|error| Error::file(&path, format!("cannot be read: {error}"), None))?;
            self.write_frame(view, step, frame)?;
        }
        Ok(hex(&hasher.finalize()))
    }

    fn write_frame(&self, view: Exposure, step: u32, frame: ArrayView2<'_, f32>) -> Result<()> {
        let path = self.root.join(layout::PARTIAL).join(self.step_name(step));
        let about = self.about.of_frame(view, step);
        let sides = [1, self.part.extent.rows, self.part.extent.columns];
        append(&path, self.format, sides, None, Sample::F32)?.put(frame, &about)
    }

    /// Renames the frames to where they belong.
    fn put_in_place(&self, view: Exposure, partial: &Path) -> Result<()> {
        let target = layout::view_folder(&self.root, self.part.extent, view);
        let parent = target.parent().unwrap_or(&self.root).to_path_buf();
        folder::make(&parent).map_err(failed(&parent, "cannot be created"))?;
        if target.exists() {
            // A directory that also holds files of others: they stay.
            for step in 0..self.part.extent.steps {
                let name = self.step_name(step);
                fs::rename(partial.join(&name), target.join(&name))
                    .map_err(failed(&target, "frames cannot be moved there"))?;
            }
        } else {
            fs::rename(partial, &target).map_err(failed(&target, "cannot be renamed to"))?;
        }
        beamlet_core::whole_file::sync_directory(&target)?;
        beamlet_core::whole_file::sync_directory(&parent)
    }

    fn make_partial(&self) -> Result<()> {
        let path = self.root.join(layout::PARTIAL);
        folder::make(&path).map_err(failed(&path, "cannot be created"))
    }

    /// Refuses a run whose views are committed and whose frames are not all in place.
    pub(super) fn refuse_missing(&self) -> Result<()> {
        let darks = if self.dark { self.part.extent.darks } else { 0 };
        let views = self.part.extent.all_views().chain((0..darks).map(Exposure::Dark));
        for view in views.filter(|view| self.part.has(*view)) {
            let directory = layout::view_folder(&self.root, self.part.extent, view);
            let found = open_file::names_of_run(&directory)?;
            // Names are sorted; files of others may be among them.
            let is_there = |step: &u32| found.binary_search(&self.step_name(*step).into()).is_ok();
            if let Some(step) = (0..self.part.extent.steps).find(|step| !is_there(step)) {
                return Err(open_file::lost(&directory.join(self.step_name(step))));
            }
        }
        Ok(())
    }

    fn spool_path(&self) -> PathBuf {
        self.root.join(layout::PARTIAL).join(layout::SPOOL)
    }

    fn step_name(&self, step: u32) -> String {
        layout::frame(self.part.extent.steps, step, self.format)
    }
}

/// Frames of fewer bytes are written side by side.
const SMALL: u64 = 1 << 20;

/// SHA-256 of a view as it is in its frames under `root`.
pub(super) fn checksum(
    root: &Path,
    format: Format,
    extent: StackShape,
    view: Exposure,
) -> Result<String> {
    let directory = layout::view_folder(root, extent, view);
    let mut hasher = Sha256::new();
    let shape = [extent.rows as usize, extent.columns as usize];
    for step in 0..extent.steps {
        let path = directory.join(layout::frame(extent.steps, step, format));
        let values = ArrayFile::read_frame(&path, format, shape, 0..shape[0])?;
        hasher.update(le_bytes(values.into_iter())?);
    }
    Ok(hex(&hasher.finalize()))
}

fn failed<'a>(path: &'a Path, problem: &'a str) -> impl Fn(std::io::Error) -> Error + 'a {
    move |error| Error::file(path, problem, Some(error))
}

/// The metadata of a frame, JSON in the attribute `beamlet`.
#[derive(Debug)]
struct About {
    /// Keys that all frames share.
    shared: serde_json::Map<String, serde_json::Value>,
    scene: Box<Scene>,
}

impl About {
    fn of(scene: &Scene, values: Values) -> Self {
        let optics = Optics::of(scene);
        let mask = |mask: &Option<Mask>| {
            let lengths = |mask: &Mask| mask.lengths().into_iter().chain(mask.lengths_z());
            serde_json::json!(mask.as_ref().map(|mask| BTreeMap::from_iter(lengths(mask))))
        };
        let shared = [
            ("units", "m, rad, keV".into()),
            match values {
                Values::Intensities => ("intensity", "1 = pixel without masks and sample".into()),
                Values::Numbers => ("counts", "detector numbers".into()),
            },
            ("row_0", "top (largest z); columns run along +x".into()),
            ("energy", scene.source.beam.single_energy().into()),
            ("source_distance", scene.source.distance.into()),
            ("spot", scene.source.spot.fwhm().to_vec().into()),
            ("detector_distance", scene.detector.distance.into()),
            ("pitch", scene.detector.pitch.to_vec().into()),
            ("sample_mask", mask(&optics.sample_mask)),
            ("detector_mask", mask(&optics.detector_mask)),
        ];
        Self {
            shared: shared.into_iter().map(|(key, value)| (key.to_owned(), value)).collect(),
            scene: Box::new(scene.clone()),
        }
    }

    fn of_frame(&self, view: Exposure, step: u32) -> String {
        let mut about = self.shared.clone();
        about.insert("mask_step".into(), step.into());
        let scan = &self.scene.scan;
        let offsets = scan.planned_offsets(view);
        about.insert("mask_offset".into(), offsets.get(step as usize).copied().into());
        if let Some(offset) = scan.mask_offsets_z.get(step as usize) {
            about.insert("mask_offset_z".into(), (*offset).into());
        }
        let before = match view {
            Exposure::Flat(flat) if scan.flats_every.is_some() => {
                scan.flat_places().get(flat as usize).copied()
            }
            Exposure::Dark(dark) if scan.darks_every.is_some() => {
                scan.dark_places().get(dark as usize).copied()
            }
            _ => None,
        };
        if let Some(before) = before {
            about.insert("before_view".into(), before.into());
        }
        if let Exposure::Sample(index) = view {
            about.insert("view".into(), index.into());
        }
        let step = step as usize;
        if let Some(of) = scan.view_of_errors(view).filter(|_| !scan.errors.is_none()) {
            let [x, z] = self.scene.applied_offsets(view);
            about.insert("mask_offset_applied".into(), x.get(step).copied().into());
            if let Some(applied) = z.get(step) {
                about.insert("mask_offset_z_applied".into(), (*applied).into());
            }
            about.insert("intensity_applied".into(), scan.intensity(of, step).into());
            if let Some(source) = scan.errors.source.get(of) {
                about.insert("source_applied".into(), source.to_vec().into());
            }
        }
        if let Exposure::Sample(index) = view
            && (index as usize) < scan.views()
        {
            about.insert("angle".into(), scan.angle_of(index as usize).into());
            let vectors = serde_json::to_value(self.scene.view(index as usize));
            about.insert("vectors".into(), vectors.unwrap_or_default());
        }
        serde_json::Value::Object(about).to_string()
    }
}
