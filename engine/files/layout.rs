//! Names of all files that beamlet gives a name, also in the making: no other file spells one.
//!
//! ```text
//! RUN/scene.toml  geometry.json  run.json  progress.log  report.html
//! RUN/flat.npy  sample.npy  dark.npy  counts/flat.npy  counts/sample.npy      a file per stack
//! RUN/flat/view_0001/step_000.exr  dark/view_0001/…     the second of several flats, a file per frame
//! RUN/flat/step_000.exr  sample/view_0000/step_000.exr  dark/…  counts/…      a file per frame
//! RUN/retrieved/retrieved.json  geometry.json  corrections.csv  NAME.npy  or  NAME/view_0000.exr
//! ASTRA/astra.json  load_astra.py  NAME.npy
//! VOLUME/volume.json  errors.csv  residuals.csv
//! VOLUME/NAME.npy  or  NAME/slice_0000.exr  or  NAME.mhd  NAME.raw
//! FOLDER.partial/.beamlet-partial  FOLDER.replaced   arrays in the making, and those that they replace
//! RUN/NAME.new  RUN/partial                                       a run in the making
//! .NAME.beamlet-new                                                any other file in the making
//! ```
//!
//! A volume is an array with a name, as a retrieved image is (`array`).

use super::shape::StackShape;
use beamlet_core::array_file::Format;
use beamlet_core::whole_file::{NEW, whole_name};
use beamlet_model::scene::Exposure;
use std::path::{Path, PathBuf};

/// Resolved scene of a run.
pub const SCENE: &str = "scene.toml";
/// Geometry of the views of a run or of retrieved images.
pub const GEOMETRY: &str = "geometry.json";
/// Provenance of a run, and how far it came.
pub const RUN: &str = "run.json";
/// Views of a run that are committed.
pub const LOG: &str = "progress.log";
/// Page of `beamlet report` in a run.
pub const REPORT: &str = "report.html";
/// Text by which a page of `beamlet report` is known.
pub(crate) const REPORT_MARK: &str = "<meta name=\"generator\" content=\"beamlet\">";
/// Folder of the images that were retrieved from a run.
pub const RETRIEVED: &str = "retrieved";
/// Description of retrieved images, in their folder.
pub const RECORD: &str = "retrieved.json";
/// Description of a reconstruction, in the folder of its volumes.
pub const VOLUME: &str = "volume.json";
/// Corrections by empty beam, in the folder of retrieved images.
pub const CORRECTIONS: &str = "corrections.csv";
/// Errors by object, in the folder of a reconstruction with its truth.
pub const ERRORS: &str = "errors.csv";
/// Description of projections for ASTRA, in their folder.
pub const ASTRA: &str = "astra.json";
/// Script that loads these projections.
pub const ASTRA_SCRIPT: &str = "load_astra.py";
/// Residuals of iterations, in the folder of an iterative reconstruction.
pub const RESIDUALS: &str = "residuals.csv";
/// Folder of the stacks of detector numbers.
pub(crate) const COUNTS: &str = "counts";
/// Folder of the frames of a view in the making, with its spool.
pub(crate) const PARTIAL: &str = "partial";
/// Spool of a view in the making, in the folder of partial frames.
pub(crate) const SPOOL: &str = "spool.f32";
/// Endings of the folders of retrieved images in the making, and of those that are replaced.
pub(crate) const IMAGES_PARTIAL: &str = ".partial";
/// See [`IMAGES_PARTIAL`].
pub(crate) const IMAGES_REPLACED: &str = ".replaced";
/// File that marks a folder of images in the making as one of beamlet.
pub(crate) const IMAGES_MARK: &str = ".beamlet-partial";
const FLAT: &str = "flat";
const SAMPLE: &str = "sample";
const DARK: &str = "dark";
/// The stacks, each by its first view.
pub(super) const STACKS: [Exposure; 3] =
    [Exposure::Flat(0), Exposure::Sample(0), Exposure::Dark(0)];
/// Beginnings of the names of views and steps.
const VIEW: &str = "view_";
const STEP: &str = "step_";
const SLICE: &str = "slice_";
/// Files beside the arrays of a folder.
const BESIDE: [&str; 8] =
    [RECORD, ASTRA, VOLUME, GEOMETRY, CORRECTIONS, ERRORS, RESIDUALS, ASTRA_SCRIPT];
/// Endings of a `MetaImage`: its header, and its values.
const HEADER: &str = ".mhd";
const RAW: &str = ".raw";

/// True if a folder holds a run or a part of one.
#[must_use]
pub fn is_run(folder: &Path) -> bool {
    folder.join(RUN).exists()
}

/// Problem of a path that is not the folder to be read: nothing is there, or a file (`file`), or another
/// folder (`folder`).
#[must_use]
pub fn problem_of(path: &Path, file: &str, folder: &str) -> String {
    match (path.exists(), path.is_dir()) {
        (false, _) => "does not exist",
        (true, false) => file,
        (true, true) => folder,
    }
    .to_owned()
}

/// True if a folder holds a reconstruction.
#[must_use]
pub fn is_volume(folder: &Path) -> bool {
    folder.join(VOLUME).exists()
}

/// True if a folder holds retrieved images.
#[must_use]
pub fn is_retrieved(folder: &Path) -> bool {
    folder.join(RECORD).exists()
}

/// Name of the stack that a view belongs to: `flat`, `sample` or `dark`.
pub(crate) fn stack(view: Exposure) -> String {
    match view {
        Exposure::Flat(_) => FLAT,
        Exposure::Sample(_) => SAMPLE,
        Exposure::Dark(_) => DARK,
    }
    .to_owned()
}

/// Name of a stack, of intensities or of counts: `sample`, `counts/sample`.
#[must_use]
pub fn stack_of(view: Exposure, counts: bool) -> String {
    if counts { format!("{COUNTS}/{}", stack(view)) } else { stack(view) }
}

/// The stack of such a name, and whether it is one of counts.
#[must_use]
pub fn stack_named(name: &str) -> Option<(Exposure, bool)> {
    let mut all = STACKS.into_iter().flat_map(|view| [(view, false), (view, true)]);
    all.find(|(view, counts)| stack_of(*view, *counts) == name)
}

/// Name of a view, as intensities or as counts, in the log: `sample/3`, `counts/flat`; `flat/1` is the
/// second flat.
pub(crate) fn view(view: Exposure, counts: bool) -> String {
    match view {
        Exposure::Flat(0) | Exposure::Dark(0) => stack_of(view, counts),
        _ => format!("{}/{}", stack_of(view, counts), view.index()),
    }
}

/// The view of such a name, and whether it is one of counts.
pub(crate) fn view_named(name: &str) -> Option<(Exposure, bool)> {
    let counted = name.strip_prefix(COUNTS).and_then(|name| name.strip_prefix('/'));
    let name = counted.unwrap_or(name);
    let view = match name.split_once('/') {
        Some((stack, index)) => stack_named(stack)?.0.with_index(index.parse().ok()?),
        None => stack_named(name)?.0,
    };
    let counts = counted.is_some();
    (self::view(view, false) == name).then_some((view, counts))
}

/// An array with a name: a file, or a folder of files of frames.
pub fn array(folder: &Path, name: &str, format: Format) -> PathBuf {
    match format.abilities().pages {
        true => folder.join(format!("{name}.{}", format.ending())),
        false => folder.join(name),
    }
}

/// Name of an array by its file, which has the ending that is written.
pub(crate) fn array_name(file: &str) -> Option<&str> {
    let (name, ending) = file.rsplit_once('.')?;
    paged().any(|format| format.ending() == ending).then_some(name)
}

/// Formats whose files hold all frames.
fn paged() -> impl Iterator<Item = Format> {
    Format::ALL.into_iter().filter(|format| format.abilities().pages)
}

/// Formats with a file per frame.
fn single() -> impl Iterator<Item = Format> {
    Format::ALL.into_iter().filter(|format| !format.abilities().pages)
}

/// Name of a view among `views`.
fn numbered_view(views: u32, view: u32) -> String {
    numbered(VIEW, views, view)
}

fn numbered(beginning: &str, count: u32, index: u32) -> String {
    let width = digits(count).max(4);
    format!("{beginning}{index:0width$}")
}

/// Folder of a view's frames, of a format with a file per frame.
pub(super) fn view_folder(root: &Path, extent: StackShape, view: Exposure) -> PathBuf {
    let stack = root.join(stack(view));
    match has_folders(extent, view) {
        true => stack.join(numbered_view(extent.count_of(view), view.index())),
        false => stack,
    }
}

/// True if the views of a stack have folders: views of the sample, and several flats or darks.
pub(super) const fn has_folders(extent: StackShape, view: Exposure) -> bool {
    matches!(view, Exposure::Sample(_)) || extent.count_of(view) > 1
}

/// The view of a folder of a stack.
pub(crate) fn view_of_folder(name: &str, views: u32) -> Option<u32> {
    number(name, VIEW, "").filter(|view| *view < views && numbered_view(views, *view) == name)
}

/// File of a step's frame.
pub(crate) fn frame(steps: u32, step: u32, format: Format) -> String {
    let width = digits(steps).max(3);
    format!("{STEP}{step:0width$}.{}", format.ending())
}

/// True if a file is the frame of one of `steps` steps.
pub(crate) fn is_frame(name: &str, steps: u32) -> bool {
    single().any(|format| {
        let step = number(name, STEP, &format!(".{}", format.ending()));
        step.is_some_and(|step| step < steps && frame(steps, step, format) == name)
    })
}

/// File of the image of a view, of a format with a file per frame.
pub(crate) fn image_of_view(views: u32, view: u32, format: Format) -> String {
    format!("{}.{}", numbered_view(views, view), format.ending())
}

/// File of a slice of a volume, of a format with a file per frame.
pub(crate) fn image_of_slice(slices: u32, slice: u32, format: Format) -> String {
    format!("{}.{}", numbered(SLICE, slices, slice), format.ending())
}

/// True if a file is the image of a view or slice.
pub(crate) fn is_image_of_folder(name: &str) -> bool {
    let index = [VIEW, SLICE].into_iter().find_map(|beginning| name.strip_prefix(beginning));
    let digits = |format: Format| index?.strip_suffix(format.ending())?.strip_suffix('.');
    single().filter_map(digits).any(|digits| digits.bytes().all(|digit| digit.is_ascii_digit()))
}

/// Files of a volume as `MetaImage`: header and values.
pub fn meta_image(name: &str) -> [String; 2] {
    [HEADER, RAW].map(|ending| format!("{name}{ending}"))
}

/// True if a file may lie beside the arrays of a folder, or is one of these in the making.
pub(crate) fn is_beside_arrays(name: &str) -> bool {
    let name = whole_name(name);
    BESIDE.contains(&name) || [HEADER, RAW].iter().any(|ending| name.ends_with(ending))
}

/// Folders of a run.
pub(crate) fn folders() -> impl Iterator<Item = String> {
    STACKS.map(stack).into_iter().chain([COUNTS, PARTIAL].map(str::to_owned))
}

/// Files of the stacks of a run, and of its counts, in every format.
pub(crate) fn stack_files() -> impl Iterator<Item = String> {
    let stacks = STACKS.map(stack);
    paged()
        .flat_map(move |format| stacks.clone().map(|stack| format!("{stack}.{}", format.ending())))
}

/// Files that a crash leaves where another file was being written.
pub(crate) fn unfinished() -> impl Iterator<Item = String> {
    [SCENE, GEOMETRY, RUN].into_iter().map(|name| format!("{name}{NEW}"))
}

/// Names in a run directory.
pub(crate) fn owned() -> impl Iterator<Item = String> {
    let records = [RUN, SCENE, GEOMETRY, LOG].map(str::to_owned);
    records.into_iter().chain(stack_files()).chain(unfinished()).chain(folders())
}

/// True if beamlet gives this name to anything in a folder of a run.
pub(crate) fn is_of_folder(name: &str) -> bool {
    let is_step = |format: Format| number(name, STEP, &format!(".{}", format.ending())).is_some();
    [FLAT, SAMPLE, PARTIAL, SPOOL].contains(&name)
        || stack_files().any(|file| file == name)
        || single().any(is_step)
        || number(name, VIEW, "").is_some()
}

/// The number between two ends of a name.
fn number(name: &str, start: &str, end: &str) -> Option<u32> {
    let digits = name.strip_prefix(start)?.strip_suffix(end)?;
    let plain = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    if plain { digits.parse().ok() } else { None }
}

/// Digits of the largest index below `count`.
fn digits(count: u32) -> usize {
    count.saturating_sub(1).checked_ilog10().map_or(1, |log| log as usize + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_recognised_and_those_of_others_are_not() {
        let folder = Path::new("");
        let [flats, darks] = [Exposure::Flat, Exposure::Dark].map(|of| [of(0), of(12)]);
        for view in [&flats[..], &darks, &[Exposure::Sample(12_345)]].concat() {
            for counts in [false, true] {
                assert_eq!(view_named(&super::view(view, counts)), Some((view, counts)));
            }
        }
        for name in ["sample", "sample/", "sample/x", "flat/0", "flat_0001", ""] {
            assert_eq!(view_named(name), None, "{name}");
        }
        for format in Format::ALL {
            let file = array(folder, "volume", format);
            let name = file.to_str().unwrap();
            assert_eq!(array_name(name), format.abilities().pages.then_some("volume"));
            assert_eq!(is_frame(&frame(12, 11, format), 12), !format.abilities().pages);
            for image in [image_of_view(9, 3, format), image_of_slice(9, 3, format)] {
                assert_eq!(is_image_of_folder(&image), !format.abilities().pages);
            }
        }
        assert!(!is_frame("step_012.exr", 12) && !is_frame("step_11.exr", 12));
        assert!(!is_image_of_folder("view_00x0.exr") && !is_image_of_folder("slice_0000exr"));
        assert_eq!(view_of_folder("view_0011", 12), Some(11));
        assert_eq!(view_of_folder("view_11", 12), None);
        assert_eq!(array_name("flat.bin"), None);
    }
}
