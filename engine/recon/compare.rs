//! Differences of two stacks, runs or retrievals, simulated or measured, image by image.

use beamlet_core::array_file::Sample;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, numbers};
use beamlet_files::layout::{self, RETRIEVED, stack_of};
use beamlet_files::{Format, ImageDirectory, Kind, Maps, OpenRun, StackFile, refuse_overlap};
use beamlet_model::scene::Exposure;
use ndarray::{Array2, Zip};
use rayon::prelude::*;
use serde::Serialize;
use std::ops::Range;
use std::path::Path;

/// Differences of two series of images. `b - a` where there is a sign.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Difference {
    /// `flat`, `sample`, the name of a retrieved image, or `stack`.
    pub name: String,
    /// Images compared.
    pub images: usize,
    /// Pixels that are finite in both.
    pub pixels: u64,
    /// Pixels that are finite in one only, or infinite in unlike ways.
    pub unlike: u64,
    /// Mean of a over `pixels`.
    pub mean_a: f64,
    /// Mean of b.
    pub mean_b: f64,
    /// Mean of b - a.
    pub mean: f64,
    /// Root mean square of b - a.
    pub rms: f64,
    /// Root mean square of b - a over the root mean square of a; `null` if a is zero.
    pub relative: Option<f64>,
    /// Largest |b - a|.
    pub largest: f64,
    /// View, step, row and column of the largest, counted from 0.
    pub largest_at: [usize; 4],
}

impl Difference {
    /// True if nothing differs by more than this.
    #[must_use]
    pub fn within(&self, tolerance: f64) -> bool {
        self.unlike == 0 && self.largest <= tolerance
    }
}

/// Rows compared so far, and who is to know.
struct Advance<'a, 'b> {
    control: &'a mut RowsControl<'b>,
    done: u64,
    all: u64,
}

impl Advance<'_, '_> {
    /// # Errors
    /// [`Error::Interrupted`] where the comparison is to end.
    fn by(&mut self, rows: usize) -> Result<()> {
        self.done += rows as u64;
        if let Some(progress) = &mut self.control.progress {
            progress(self.done, self.all);
        }
        self.control.cancel.check()
    }
}

/// Where images of differences go, one file (or folder) per name.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct DifferencesTo<'a> {
    /// A directory that does not exist yet, or is empty.
    pub path: &'a Path,
    /// The format of the images.
    pub format: Format,
}

impl<'a> DifferencesTo<'a> {
    /// Images of a format in a directory.
    #[must_use]
    pub const fn new(path: &'a Path, format: Format) -> Self {
        Self { path, format }
    }
}

/// Compares two paths: two runs (their stacks, and counts and retrieved images if both have them), two
/// directories of retrieved images, or two stacks.
///
/// # Errors
/// [`Error::File`] where one cannot be read, where they are of unlike kinds or shapes (names
/// both), or where the images of differences cannot be written; [`Error::Interrupted`]. Nothing is
/// left behind then.
///
/// # Example
///
/// ```no_run
/// use beamlet::{RowsControl, compare::compare};
///
/// let mut control = RowsControl::default();
/// for difference in compare("run".as_ref(), "other".as_ref(), None, &mut control)? {
///     println!("{} {}", difference.name, difference.largest);
/// }
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn compare(
    a: &Path,
    b: &Path,
    to: Option<DifferencesTo<'_>>,
    control: &mut RowsControl<'_>,
) -> Result<Vec<Difference>> {
    let pairs = pairs(a, b)?;
    for (name, [a, b]) in &pairs {
        if a.shape() != b.shape() {
            let problem = format!(
                "has {:?} views, steps, rows and columns in {name}; {} has {:?}",
                b.shape(),
                a.path().display(),
                a.shape()
            );
            return Err(Error::file(b.path(), problem, None));
        }
    }
    let mut images = match to {
        Some(to) => {
            let mut read: Vec<_> =
                pairs.iter().flat_map(|(_, pair)| pair).map(|s| s.path().to_path_buf()).collect();
            // A run may hold other files, a folder of images may not.
            let whole = [a, b].into_iter().filter(|path| !matches!(kind(path), ComparedKind::Run));
            read.extend(whole.map(Path::to_path_buf));
            refuse_overlap(to.path, &read)?;
            let about = serde_json::json!({
                "difference": "b - a", "a": a.display().to_string(), "b": b.display().to_string(),
            });
            Some(ImageDirectory::begin(to.path, Kind::Images, to.format, false, about)?)
        }
        None => None,
    };
    let rows = |[views, steps, rows, _]: [usize; 4]| (views * steps * rows) as u64;
    let all = pairs.iter().map(|(_, [a, _])| rows(a.shape())).sum();
    let mut advance = Advance { control, done: 0, all };
    let mut found = Vec::new();
    for (name, pair) in &pairs {
        found.push(difference(name, pair, images.as_mut(), &mut advance)?);
    }
    if let Some(images) = images {
        images.finish(None)?;
    }
    Ok(found)
}

/// A name and the two stacks that have it.
type Pair = (String, [StackFile; 2]);

/// The compared stacks, by name.
fn pairs(a: &Path, b: &Path) -> Result<Vec<Pair>> {
    let kinds = [kind(a), kind(b)];
    match kinds {
        [ComparedKind::Run, ComparedKind::Run] => {
            let runs = [OpenRun::open(a)?, OpenRun::open(b)?];
            let [flat, sample] = [Exposure::Flat(0), Exposure::Sample(0)];
            let mut all = vec![
                (stack_of(flat, false), [runs[0].flat()?, runs[1].flat()?]),
                (stack_of(sample, false), [runs[0].sample()?, runs[1].sample()?]),
            ];
            let [flats, samples] = [
                [runs[0].counts_flat()?, runs[1].counts_flat()?],
                [runs[0].counts_sample()?, runs[1].counts_sample()?],
            ];
            for (stack, pair) in [(flat, flats), (sample, samples)] {
                if let [Some(a), Some(b)] = pair {
                    all.push((stack_of(stack, true), [a, b]));
                }
            }
            let retrieved = [a, b].map(|run| run.join(RETRIEVED));
            if retrieved.iter().all(|path| path.is_dir()) {
                all.extend(maps(&retrieved[0], &retrieved[1])?);
            }
            Ok(all)
        }
        [ComparedKind::Maps, ComparedKind::Maps] => maps(a, b),
        [ComparedKind::Stack, ComparedKind::Stack] => {
            Ok(vec![("stack".to_owned(), [StackFile::open(a)?, StackFile::open(b)?])])
        }
        [found, other] => {
            if let Some(missing) = [a, b].into_iter().find(|path| !path.exists()) {
                let problem = layout::problem_of(missing, "", "");
                return Err(Error::file(missing, problem, None));
            }
            let problem = format!(
                "is {}; {} is {}: compare like with like, as RUN/sample with a measured stack",
                other.word(b),
                a.display(),
                found.word(a)
            );
            Err(Error::file(b, problem, None))
        }
    }
}

/// Retrieved images that both have; it is an error where there are none.
fn maps(a: &Path, b: &Path) -> Result<Vec<Pair>> {
    let [of_a, mut of_b] = [Maps::open(a)?, Maps::open(b)?].map(Maps::into_stacks);
    let shared: Vec<Pair> = of_a
        .into_iter()
        .filter_map(|(name, a)| of_b.remove(&name).map(|b| (name, [a, b])))
        .collect();
    if shared.is_empty() {
        let problem = format!("has no image in common with {}", a.display());
        return Err(Error::file(b, problem, None));
    }
    Ok(shared)
}

#[derive(Debug, Clone, Copy)]
enum ComparedKind {
    Run,
    Maps,
    Stack,
}

impl ComparedKind {
    fn word(self, path: &Path) -> &'static str {
        match self {
            Self::Run => "a run",
            Self::Maps => "a directory of retrieved images",
            Self::Stack if path.is_dir() => "a folder, neither a run nor retrieved images",
            Self::Stack => "a stack",
        }
    }
}

fn kind(path: &Path) -> ComparedKind {
    if layout::is_run(path) {
        ComparedKind::Run
    } else if layout::is_retrieved(path) {
        ComparedKind::Maps
    } else {
        ComparedKind::Stack
    }
}

/// Pixels of a frame that are compared at a time, for files with random access to rows.
const BAND: usize = 1 << 19;
/// The same for files that are decoded in larger pieces.
const DECODED_BAND: usize = 1 << 23;
/// Bands that are compared side by side.
const BANDS: usize = 16;

/// Sums over pixels.
#[derive(Default)]
struct DifferenceSums {
    pixels: u64,
    unlike: u64,
    a: f64,
    b: f64,
    squares_a: f64,
    squares: f64,
    largest: f64,
    largest_at: [usize; 4],
}

fn difference(
    name: &str,
    pair: &[StackFile; 2],
    to: Option<&mut ImageDirectory>,
    advance: &mut Advance<'_, '_>,
) -> Result<Difference> {
    let [views, steps, rows, columns] = pair[0].shape();
    let frames = (0..views).flat_map(|view| (0..steps).map(move |step| (view, step)));
    let mut sums = DifferenceSums::default();
    if let Some(to) = to {
        // Images are written whole; without them frames may be larger than memory.
        let name = name.replace('/', "_");
        for (view, step) in frames {
            let (own, [of_a, mut image]) = compared(pair, view, step, 0..rows)?;
            sums.add(&own);
            image -= &of_a;
            let image = image.mapv(numbers::single);
            to.put(&name, "the shape of a and b", Sample::F32, views * steps, image.view())?;
            advance.by(rows)?;
        }
    } else {
        let any_rows = pair.iter().all(StackFile::reads_any_rows);
        let pixels = if any_rows { BAND } else { DECODED_BAND };
        let band = (pixels / columns.max(1)).max(1);
        let side_by_side = if any_rows { BANDS } else { 1 };
        let bands: Vec<Range<usize>> =
            (0..rows).step_by(band).map(|first| first..rows.min(first + band)).collect();
        for (view, step) in frames {
            for bands in bands.chunks(side_by_side) {
                let each: Vec<DifferenceSums> = bands
                    .par_iter()
                    .map(|band| Ok(compared(pair, view, step, band.clone())?.0))
                    .collect::<Result<_>>()?;
                // In their order, whatever the number of threads.
                each.iter().for_each(|own| sums.add(own));
                advance.by(bands.iter().map(ExactSizeIterator::len).sum())?;
            }
        }
    }
    let n = sums.pixels.max(1) as f64;
    let rms = (sums.squares / n).sqrt();
    let rms_a = (sums.squares_a / n).sqrt();
    Ok(Difference {
        name: name.to_owned(),
        images: views * steps,
        pixels: sums.pixels,
        unlike: sums.unlike,
        mean_a: sums.a / n,
        mean_b: sums.b / n,
        mean: (sums.b - sums.a) / n,
        rms,
        relative: (rms_a > 0.0).then(|| rms / rms_a),
        largest: sums.largest,
        largest_at: sums.largest_at,
    })
}

/// Sums over some rows of a frame, and these rows.
fn compared(
    [a, b]: &[StackFile; 2],
    view: usize,
    step: usize,
    rows: Range<usize>,
) -> Result<(DifferenceSums, [Array2<f64>; 2])> {
    let first = rows.start;
    let rows = [rows.start, rows.end].map(numbers::count);
    // Whole numbers of 32 bits are more than f32 holds.
    let of_a = a.frame_as::<f64>(view, step, rows[0]..rows[1])?;
    let of_b = b.frame_as::<f64>(view, step, rows[0]..rows[1])?;
    let mut sums = DifferenceSums::default();
    sums.take(&of_a, &of_b, [view, step, first]);
    Ok((sums, [of_a, of_b]))
}

impl DifferenceSums {
    fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.unlike += other.unlike;
        self.a += other.a;
        self.b += other.b;
        self.squares_a += other.squares_a;
        self.squares += other.squares;
        if other.largest > self.largest {
            self.largest = other.largest;
            self.largest_at = other.largest_at;
        }
    }

    fn take(&mut self, a: &Array2<f64>, b: &Array2<f64>, [view, step, first]: [usize; 3]) {
        Zip::indexed(a).and(b).for_each(|(row, column), a, b| {
            let row = first + row;
            if !(a.is_finite() && b.is_finite()) {
                let like = (a.is_nan() && b.is_nan()) || a.to_bits() == b.to_bits();
                self.unlike += u64::from(!like);
                return;
            }
            let (a, b) = (*a, *b);
            self.pixels += 1;
            self.a += a;
            self.b += b;
            self.squares_a += a * a;
            self.squares += (b - a) * (b - a);
            if (b - a).abs() > self.largest {
                self.largest = (b - a).abs();
                self.largest_at = [view, step, row, column];
            }
        });
    }
}
