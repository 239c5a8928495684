//! One stack in a file or a folder, frame by frame or band by band.

use super::checksums::Checksums;
use super::folder::{self, FolderFrames};
use super::frame_order::FrameOrder;
use beamlet_core::array_file::{ArrayFile, Format, Value, endings, refuse_wide};
use beamlet_core::printed::counted;
use beamlet_core::{Error, Result, folder as folder_names, numbers, reserve};
use ndarray::{Array, Array2, Array3, ArrayView, Axis, Dimension, s};
use rayon::prelude::*;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One stack in a file or a folder, `[view][step][row][column]`.
///
/// | place | layout |
/// |---|---|
/// | `.npy` | 2, 3 or 4 dimensions: (row, column), (step, row, column), (view, step, row, column) |
/// | `.tif`, `.tiff` | one page per frame, strips or tiles, `BigTIFF` too; see [`StackFile::with_steps`] |
/// | `.exr` | one frame |
/// | folder of `.exr` or `.tif` files | one frame per file, in the order of the numbers in their names ([`StackFile::frame_names`]) |
/// | folder of such folders | one view per folder |
/// | pattern for names in a folder, `raw/flat_*` | as a folder of the files or folders that it fits |
///
/// Samples are f32, f64, or whole numbers of 8, 16 or 32 bits (EXR: f16, f32, u32), one per pixel.
#[derive(Debug)]
pub struct StackFile {
    path: PathBuf,
    shape: [usize; 4],
    order: FrameOrder,
    source: StackSource,
    /// True if values (of the first frame of a folder) have 8 bits.
    has_bytes: bool,
    /// Checksums of a stack of a run.
    checksums: Option<Checksums>,
}

#[derive(Debug)]
enum StackSource {
    /// A file of frames.
    File(ArrayFile),
    /// A file per frame, the views one after another, and the frames by the numbers in the names of
    /// the files, the last changing fastest.
    Frames(FolderFrames),
    /// Values of the caller's.
    Values(StackValues),
}

/// Reads rows of a frame, counted over all views, `[row][column]`.
type ReadFrame = dyn Fn(usize, Range<usize>) -> Result<Vec<f32>> + Send + Sync;

/// Values that a function gives.
struct StackValues(Box<ReadFrame>);

impl fmt::Debug for StackValues {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StackValues").finish_non_exhaustive()
    }
}

impl StackFile {
    /// A stack of values in memory, views, steps, rows and columns. `read` gives rows of a frame,
    /// counted over all views, `[row][column]`; `name` stands for the file in errors and records.
    ///
    /// # Errors
    /// [`Error::File`] where a side is zero or a frame has too many pixels.
    ///
    /// # Example
    ///
    /// ```
    /// use beamlet::stack::StackFile;
    ///
    /// // One view of two steps of 3 x 4 pixels.
    /// let read = |frame: usize, rows: std::ops::Range<usize>| Ok(vec![frame as f32; 4 * rows.len()]);
    /// let stack = StackFile::of_values("flat", [1, 2, 3, 4], read)?;
    /// assert_eq!(stack.frame(0, 1, 0..3)?[[2, 3]], 1.0);
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn of_values(
        name: &str,
        shape: [usize; 4],
        read: impl Fn(usize, Range<usize>) -> Result<Vec<f32>> + Send + Sync + 'static,
    ) -> Result<Self> {
        let path = PathBuf::from(name);
        refuse_wide(&path, [shape[2], shape[3]])?;
        let source = StackSource::Values(StackValues(Box::new(read)));
        let order = FrameOrder::ViewStep;
        Self { path, shape, order, source, has_bytes: false, checksums: None }.refuse_empty()
    }

    /// Opens a stack: reads headers, no values.
    ///
    /// # Errors
    /// [`Error::File`] with file, found and allowed: an unsupported format, sample type or shape, a file
    /// shorter than its header states, frames missing from a series of numbers.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::stack::StackFile;
    ///
    /// let stack = StackFile::open("measured.tif")?;
    /// // View 0, step 0, rows 0 to 15.
    /// let frame = stack.frame(0, 0, 0..16)?;
    /// println!("{:?}, first pixel {}", stack.shape(), frame[[0, 0]]);
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        if folder_names::is_pattern(path) {
            return Self::open_folder(path);
        }
        let found = std::fs::metadata(path)
            .map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
        if found.is_dir() {
            return Self::open_folder(path);
        }
        let Some(format) = Format::of(path) else {
            let folders = endings(|format| format.abilities().folders);
            let problem = format!(
                "is not a stack; allowed: {}, and folders of frames ({folders})",
                endings(|_| true)
            );
            return Err(Error::file(path, problem, None));
        };
        let file = ArrayFile::open(path, format)?;
        let shape = shape_of(path, &file)?;
        let skipped = file.skipped();
        if skipped > 0 {
            log::info!(
                "{}: {skipped} of {} pages are reduced copies (thumbnails) and are skipped",
                path.display(),
                shape[1] + skipped
            );
        }
        let has_bytes = file.has_bytes();
        let source = StackSource::File(file);
        let (path, order) = (path.to_path_buf(), FrameOrder::ViewStep);
        Self { path, shape, order, source, has_bytes, checksums: None }.refuse_empty()
    }

    fn open_folder(path: &Path) -> Result<Self> {
        let frames = folder::frames(path)?;
        let ([rows, columns], has_bytes) = match frames.files.first() {
            Some(frame) => {
                let file = ArrayFile::open(frame, frames.format)?;
                (file.frames().1, file.has_bytes())
            }
            None => ([0, 0], false),
        };
        let shape = [frames.views, frames.files.len() / frames.views.max(1), rows, columns];
        let source = StackSource::Frames(frames);
        let (own, order) = (path.to_path_buf(), FrameOrder::ViewStep);
        let stack = Self { path: own, shape, order, source, has_bytes, checksums: None };
        if log::log_enabled!(log::Level::Info) {
            let names = stack.frame_names().unwrap_or_default();
            let (count, all) = (names.len(), names.join(", "));
            log::info!("{}: {count} frames in the order {all}", path.display());
        }
        stack.refuse_empty()
    }

    fn refuse_empty(self) -> Result<Self> {
        if self.shape.contains(&0) {
            let [views, steps, rows, columns] = self.shape;
            let problem = format!(
                "holds nothing: {views} views of {steps} steps of {rows} x {columns} pixels"
            );
            return Err(Error::file(self.path, problem, None));
        }
        Ok(self)
    }

    /// The same frames in another order: views and steps of four dimensions, or of folders in a folder, change places.
    /// Frames that are one list become views by [`StackFile::with_steps`].
    #[must_use]
    pub const fn with_order(mut self, order: FrameOrder) -> Self {
        if matches!(order, FrameOrder::StepView) && self.shape[0] > 1 {
            let [views, steps, rows, columns] = self.shape;
            self.shape = [steps, views, rows, columns];
        }
        self.order = order;
        self
    }

    /// Order of the frames.
    #[must_use]
    pub const fn order(&self) -> FrameOrder {
        self.order
    }

    /// The same frames as views of `steps` steps each: files of pages do not say where a view ends.
    ///
    /// # Errors
    /// [`Error::File`] where the number of frames is not a multiple of `steps`, or where the
    /// stack has views of another length already.
    pub fn with_steps(mut self, steps: usize) -> Result<Self> {
        let [views, found, ..] = self.shape;
        if found == steps {
            return Ok(self);
        }
        if let StackSource::Frames(FolderFrames { sides, .. }) = &self.source
            && sides.len() > 1
            && views == 1
        {
            // Frames of a view are numbered by the last numbers, or steps by the first ones.
            let (of_steps, name) = match self.order {
                FrameOrder::ViewStep => (sides.iter().rev().collect::<Vec<_>>(), "last"),
                FrameOrder::StepView => (sides.iter().collect(), "first"),
            };
            let within = of_steps.into_iter().scan(1, |all, side| {
                *all *= side;
                Some(*all)
            });
            if within.into_iter().all(|frames| frames != steps) {
                let sides: Vec<String> = sides.iter().map(usize::to_string).collect();
                let problem = format!(
                    "has names with {} different numbers, the {name} of which counts steps; expected \
                     {steps} steps",
                    sides.join(" x ")
                );
                return Err(Error::file(self.path, problem, None));
            }
        }
        if views > 1 || steps == 0 || found % steps != 0 {
            let problem = format!(
                "has {} of {}; expected {}",
                counted(views, "view"),
                counted(found, "step"),
                counted(steps, "step")
            );
            return Err(Error::file(self.path, problem, None));
        }
        self.shape[0] = found / steps;
        self.shape[1] = steps;
        Ok(self)
    }

    /// The first `views` views: the others do not count.
    pub(crate) fn first_views(mut self, views: usize) -> Self {
        self.shape[0] = self.shape[0].min(views);
        self
    }

    /// The file, the folder, or the pattern for names in a folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file or folder, or the files and folders that a pattern fits.
    #[doc(hidden)]
    pub fn places(&self) -> Vec<PathBuf> {
        match folder_names::is_pattern(&self.path) {
            true => folder_names::entries(&self.path).unwrap_or_default(),
            false => vec![self.path.clone()],
        }
    }

    /// The file, folder or pattern; `None` where the values are in memory.
    #[doc(hidden)]
    pub fn file(&self) -> Option<&Path> {
        match self.source {
            StackSource::Values(_) => None,
            _ => Some(&self.path),
        }
    }

    /// Names of the files that a folder has as frames, in their order, the views one after another;
    /// `None` where the stack is a file.
    #[must_use]
    pub fn frame_names(&self) -> Option<Vec<String>> {
        let StackSource::Frames(FolderFrames { files, .. }) = &self.source else { return None };
        let name = |file: &PathBuf| {
            let name = file.strip_prefix(folder_names::holder(&self.path)).ok()?;
            Some(name.display().to_string())
        };
        Some(files.iter().filter_map(name).collect())
    }

    /// Format of the file or of the frames; NPY of values in memory.
    #[must_use]
    pub fn format(&self) -> Format {
        match &self.source {
            StackSource::File(_) => Format::of(&self.path).unwrap_or_default(),
            StackSource::Frames(frames) => frames.format,
            StackSource::Values(_) => Format::Npy,
        }
    }

    /// Views, steps, rows and columns, none of them zero.
    #[must_use]
    pub const fn shape(&self) -> [usize; 4] {
        self.shape
    }

    /// True if values (of the first frame of a folder) have 8 bits.
    #[doc(hidden)]
    pub const fn has_bytes(&self) -> bool {
        self.has_bytes
    }

    /// True if a few rows cost no more than their share: nothing is decoded or compared whole.
    #[doc(hidden)]
    pub const fn reads_any_rows(&self) -> bool {
        matches!(&self.source, StackSource::File(file) if file.reads_any_rows())
            && self.checksums.is_none()
    }

    /// Some rows of a view with all its steps, `[step][row][column]`.
    ///
    /// # Errors
    /// [`Error::File`] if a file cannot be read or a frame has another shape than the first; if the view
    /// or the rows do not exist; if a view of a run differs from the committed one.
    pub fn rows(&self, view: usize, rows: Range<u32>) -> Result<Array3<f32>> {
        let [views, steps, ..] = self.shape;
        if view >= views {
            let problem = format!(
                "has {}; view {view} was requested, counted from 0",
                counted(views, "view")
            );
            return Err(Error::file(&self.path, problem, None));
        }
        if steps > 0
            && rows.start <= rows.end
            && rows.end <= self.row_count()
            && let Some(whole) = self.compared(view * steps)?
            && whole.dim().0 == steps
        {
            let rows = rows.start as usize..rows.end as usize;
            return owned(&self.path, whole.slice(s![.., rows, ..]));
        }
        let read = |step| self.frame(view, step, rows.clone());
        let frames: Vec<Array2<f32>> = match &self.source {
            // Frames are compressed one by one: worth a thread each.
            StackSource::Frames(..) => {
                (0..steps).into_par_iter().map(read).collect::<Result<_>>()?
            }
            _ => (0..steps).map(read).collect::<Result<_>>()?,
        };
        let [_, _, _, columns] = self.shape;
        let mut all = reserve::room(steps * rows.len() * columns, "rows of a view")?;
        frames.iter().for_each(|frame| all.extend(frame));
        Array3::from_shape_vec((steps, rows.len(), columns), all)
            .map_err(|error| Error::file(&self.path, format!("cannot be read: {error}"), None))
    }

    /// A whole view, `[step][row][column]`.
    ///
    /// # Errors
    /// As [`StackFile::rows`].
    pub fn view(&self, view: usize) -> Result<Array3<f32>> {
        self.rows(view, 0..self.row_count())
    }

    /// Some rows of one frame, `[row][column]`.
    ///
    /// # Errors
    /// As [`StackFile::rows`].
    pub fn frame(&self, view: usize, step: usize, rows: Range<u32>) -> Result<Array2<f32>> {
        self.frame_as(view, step, rows)
    }

    /// As [`StackFile::frame`], of values as f32 or f64.
    ///
    /// # Errors
    /// As [`StackFile::rows`].
    #[doc(hidden)]
    pub fn frame_as<T: Value>(
        &self,
        view: usize,
        step: usize,
        rows: Range<u32>,
    ) -> Result<Array2<T>> {
        let [views, steps, row_count, columns] = self.shape;
        let range = rows.start as usize..rows.end as usize;
        if view >= views || step >= steps || range.start > range.end || range.end > row_count {
            let problem = format!(
                "has {views} views, {steps} steps, {row_count} rows; requested rows {range:?} of \
                 view {view}, step {step}, counted from 0"
            );
            return Err(Error::file(&self.path, problem, None));
        }
        let index = self.order.index([view, step], [views, steps]);
        if let Some(whole) = self.compared(index)? {
            let part = whole.slice(s![index % whole.dim().0, range, ..]);
            return Ok(part.mapv(|value| T::rounded(value.into())));
        }
        let values = self.values(index, range.clone())?;
        Array2::from_shape_vec((range.len(), columns), values)
            .map_err(|error| Error::file(&self.path, format!("cannot be read: {error}"), None))
    }

    /// Compares the view that a frame belongs to with its checksum, where the stack has them and
    /// that was not done before; the view, where it was kept.
    fn compared(&self, index: usize) -> Result<Option<Arc<Array3<f32>>>> {
        let Some(checksums) = &self.checksums else { return Ok(None) };
        let [_, _, row_count, columns] = self.shape;
        let read = |frame| self.values(frame, 0..row_count);
        checksums.of_frame(&self.path, index, [row_count, columns], read)
    }

    /// Some rows of a frame, counted over all views, in the order of the file.
    fn values<T: Value>(&self, index: usize, rows: Range<usize>) -> Result<Vec<T>> {
        let [_, _, row_count, columns] = self.shape;
        let frame = [row_count, columns];
        match &self.source {
            StackSource::File(file) => file.read(index, rows),
            StackSource::Frames(frames) => {
                ArrayFile::read_frame(&frames.files[index], frames.format, frame, rows)
            }
            StackSource::Values(StackValues(read)) => {
                let values = read(index, rows)?;
                let values = values.into_iter().map(|value| T::rounded(value.into()));
                reserve::collected(values, "rows of a frame")
            }
        }
    }

    /// Compares every view with its checksum when it is first read.
    pub(super) fn with_checksums(mut self, checksums: Checksums) -> Self {
        self.checksums = Some(checksums);
        self
    }

    /// Rows of a frame.
    #[must_use]
    pub fn row_count(&self) -> u32 {
        numbers::count(self.shape[2])
    }

    /// All frames of one view as one image, for files whose steps are views (maps).
    pub(super) fn only_frame(&self, index: usize) -> Result<Array2<f32>> {
        let all = self.frame(0, index, 0..self.row_count())?;
        debug_assert_eq!(all.len_of(Axis(0)), self.shape[2]);
        Ok(all)
    }
}

/// A copy of a part of a view.
fn owned<D: Dimension>(path: &Path, part: ArrayView<'_, f32, D>) -> Result<Array<f32, D>> {
    let values = reserve::collected(part.iter().copied(), "rows of a view")?;
    Array::from_shape_vec(part.raw_dim(), values)
        .map_err(|error| Error::file(path, format!("cannot be read: {error}"), None))
}

/// Two to four sides, filled up with ones in front.
fn shape_of(path: &Path, file: &ArrayFile) -> Result<[usize; 4]> {
    if file.is_fortran() {
        let problem = "is in Fortran order; allowed: C order (numpy: np.ascontiguousarray)";
        return Err(Error::file(path, problem, None));
    }
    let sides: Option<Vec<u32>> = file.sides().iter().map(|n| u32::try_from(*n).ok()).collect();
    let sides = sides.filter(|sides| (2..=4).contains(&sides.len())).ok_or_else(|| {
        let problem = format!(
            "has the shape {:?}; allowed: (row, column), (step, row, column) or (view, step, \
             row, column)",
            file.sides()
        );
        Error::file(path, problem, None)
    })?;
    let mut shape = [1; 4];
    for (to, from) in shape[4 - sides.len()..].iter_mut().zip(&sides) {
        *to = *from as usize;
    }
    refuse_wide(path, [shape[2], shape[3]])?;
    Ok(shape)
}
