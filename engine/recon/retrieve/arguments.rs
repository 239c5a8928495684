//! The table of options of `retrieve`, and what they make of an input.

use super::Region;
use super::background::Background;
use super::correct::Corrections;
use super::input::{Columns, Input, offsets};
use super::method::Method;
use super::options::RetrieveOptions;
use super::planar::{Aperture, Lattice};
use super::value_noise::Weights;
use beamlet_core::array_file::Format;
use beamlet_core::options::Need::{Default as Usual, Without};
use beamlet_core::options::Relation::{
    Declared, Excludes, Listed, Needs, Position, Program, Repeated, Short, Unless,
};
use beamlet_core::options::{
    ABOVE_ZERO, FILE, FROM_ZERO, Hyphens, Kind, OptionValue, Options, POSITIVE_COUNT, Refusal,
    SWITCH, TEXTS, any_length, choice, choices, numbers_of, words_of,
};
use beamlet_core::{Error, Result, numbers, options};
use beamlet_files::FrameOrder;
use std::ops::Range;
use std::path::PathBuf;

options! {
    /// Arguments of `retrieve`, as they are given.
    RetrieveArguments;
    run: Option<PathBuf> = FILE.named("RUN"), Without(""),
        [Program, Position, Unless("flat"), Excludes(&["flat", "flats_every", "sample", "dark", "geometry", "offsets",
            "offsets_z", "set", "frame_order"])],
        "Run directory of `beamlet simulate`";
    flat: Option<PathBuf> = FILE, Without(""), [Program, Needs(&["sample", "geometry", "output"])],
        "Flat frames: NPY, EXR, TIFF, a folder of frames, or a pattern for names in a folder, as 'raw/flat_*' (in quotes)";
    flats_every: Option<u32> = POSITIVE_COUNT, Without("one flat, or one for each view"), [Needs(&["flat"])],
        "Views between one flat and the next, if --flat has several: the flat of a view is interpolated between the two nearest";
    sample: Option<PathBuf> = FILE, Without(""), [Program, Needs(&["flat"])],
        "Sample frames, one view or several, as --flat";
    frame_order: FrameOrder = choice::<FrameOrder>("ORDER", "str"), Usual("view,step"), [Program, Needs(&["flat"])],
        "Order of the frames of --flat and --sample";
    dark: Option<PathBuf> = FILE, Without(""), [Program, Needs(&["flat"])],
        "Frames without beam; their mean is subtracted";
    bad_pixels: Option<PathBuf> = FILE.in_python("ArrayLike", "bool or numbers, (row, column)"), Without(""), [],
        "Pixels to exclude: an image (NPY, EXR, TIFF) with 0 for each good pixel, or a text with row,column on each line, counted from 0; they get no result and their own flag";
    columns: Option<Columns> = COLUMNS, Without(""), [],
        "Columns to keep, counted from 0, the end excluded: with a step of 2 for a mask of two pixels per period";
    bin: Option<[usize; 2]> = BIN, Without(""), [],
        "Columns and rows to combine into one pixel, after --columns: sums of counts, means of intensities";
    empty_beam: Option<Region> = REGION, Without(""), [],
        "Pixels (after --columns and --bin) with nothing in the beam, the ends excluded: reports transmission, refraction, dose of each step and drift there, and warns if they differ from an empty beam";
    correct: Corrections = CORRECTIONS, Without(""), [Listed],
        "Corrections from the pixels of --empty-beam or, without it, from both sides of each view where they are empty";
    offsets: Option<Offsets> = OFFSETS, Without("from the geometry's scan"), [Declared, Needs(&["flat"])],
        "Offsets of the sample mask: a list with units, or a file with one on each line";
    offsets_z: Option<Offsets> = OFFSETS, Without(""), [Needs(&["flat"])],
        "Offsets of the sample mask along z, as --offsets and one for each of them: retrieves refraction and dark field along x and z";
    lattice: Option<Lattice> = LATTICE, Without(""), [],
        "Lattice of the beamlets of a sample mask alone, as it is on the detector: periods along x and z, an angle after them, or two vectors `X,Z;X,Z`. Retrieves refraction and dark field along x and z";
    aperture: Option<Aperture> = APERTURE, Without(""), [],
        "Aperture of the sample mask as it is projected on the detector, or with --offsets-z on the detector mask, for --method beamlet or exact-curve: `WIDTH,HEIGHT` or `round DIAMETER`";
    detector_aperture: Option<Aperture> = DETECTOR_APERTURE, Without(""), [],
        "Aperture of the detector mask, for --offsets-z with --method exact-curve: `WIDTH,HEIGHT`";
    geometry: Option<PathBuf> = FILE.named("SCENE"), Without(""), [Program, Needs(&["flat"])],
        "Scene file with the distances and masks of the measurement";
    set: Vec<String> = TEXTS, Without(""), [Program, Repeated, Needs(&["geometry"])],
        "Change a value of the geometry: key.path=value (may be repeated)";
    omit_steps: Vec<usize> = STEPS, Without(""), [Listed],
        "Mask steps to leave out of flat and sample, counted from 0, as a frame without beam";
    output: Option<PathBuf> = FILE.named("DIR"), Without("RUN/retrieved"), [Program, Short('o')],
        "Directory of the images";
    method: Option<Method> = choice::<Method>("METHOD", "Method"),
        Without("exact-curve where the scene knows the curve of its masks, else gaussian; for a sample mask alone beamlet, on a lattice without --aperture gaussian"), [Declared],
        "The estimator";
    background: Option<Background> = BACKGROUND, Without("leak where the masks are known and nothing scatters, else free"), [],
        "Background of the curves, for gaussian and exact-curve: `free`, the light that the masks `leak`, or a number of the frames";
    weights: Weights = choice::<Weights>("WEIGHTS", "Weights"), Usual("none"), [],
        "Weights of a fit's values";
    counts: bool = SWITCH, Without(""), [Program, Needs(&["run"])],
        "Take the run's detector numbers instead of its intensities";
    gain: Option<f64> = ABOVE_ZERO, Without("from a run's scene, else 1"), [],
        "Detector number of one photon, for the uncertainties of counts";
    read_noise: Option<f64> = FROM_ZERO, Without("from a run's scene, else 0"), [],
        "Standard deviation of the detector number without light, for the uncertainties of counts";
    saturation: Option<f32> = SINGLE, Without("the largest number of a run's detector"), [],
        "Exclude values at or above this number of the files";
    phase: bool = SWITCH, Without(""), [],
        "Also make images of the phase: refraction integrated along the rows, m of delta times length; rows must begin and end in air";
    format: Option<Format> = choice::<Format>("FORMAT", "Format"), Without("the format of the sample's stack"), [Program],
        "File format of the images";
    overwrite: bool = SWITCH, Without(""), [Program], "Replace existing images";
    json: bool = SWITCH, Without(""), [Program], "Print retrieved.json instead of a summary";
}

impl RetrieveArguments {
    /// Paths of the files of offsets that are given.
    #[must_use]
    pub fn lists(&self) -> Vec<PathBuf> {
        let path = |offsets: &Offsets| match offsets {
            Offsets::Text(text) => Some(PathBuf::from(text)).filter(|path| path.is_file()),
            Offsets::Lengths(_) => None,
        };
        [&self.offsets, &self.offsets_z].into_iter().flatten().filter_map(path).collect()
    }

    /// The input with the steps, pixels and values that are kept of it.
    ///
    /// # Errors
    /// As the functions of [`Input`].
    pub fn applied_to(&self, input: Input) -> Result<Input> {
        let mut input = input.without_steps(&self.omit_steps)?.saturated_at(self.saturation);
        if self.flats_every.is_some() {
            input = input.with_flats_every(self.flats_every);
        }
        if let Some(path) = &self.bad_pixels {
            input = input.with_bad_pixels(path)?;
        }
        Ok(input.with_selection(self.columns, self.bin)?.with_options(self.given()))
    }

    /// Options of a retrieval of this input; noise that is not given is that of its scene.
    ///
    /// # Errors
    /// [`Error::Argument`] for options of counts with intensities.
    pub fn options(&self, input: &Input) -> Result<RetrieveOptions> {
        for (name, is_given) in [
            ("gain", self.gain.is_some()),
            ("read_noise", self.read_noise.is_some()),
            ("weights", self.weights == Weights::Poisson),
        ] {
            if is_given && !input.counts() {
                let words = if name == "weights" { " poisson" } else { "" };
                let flag = format!("--{}{words}", name.replace('_', "-"));
                let allowed = format!("counts: {flag} is for counts; add --counts for a run");
                return Err(Error::argument(name, "intensities", allowed));
            }
        }
        let offsets_z = self.offsets_z.as_ref().map(Offsets::lengths).transpose()?;
        let of_scene = input.noise();
        let [gain, read_noise] = of_scene.unwrap_or([1.0, 0.0]);
        Ok(RetrieveOptions {
            method: self.method,
            background: self.background,
            weights: self.weights,
            gain: input.counts().then(|| self.gain.unwrap_or(gain)),
            gain_assumed: self.gain.is_none() && of_scene.is_none(),
            read_noise: self.read_noise.unwrap_or(read_noise),
            saturation: None,
            empty_beam: self.empty_beam.clone(),
            correct: self.correct,
            phase: self.phase,
            lattice: self.lattice,
            aperture: self.aperture,
            detector_aperture: self.detector_aperture,
            offsets_z: offsets_z.unwrap_or_default(),
        })
    }
}

/// Mask offsets as they are given.
#[derive(Debug, Clone, PartialEq)]
pub enum Offsets {
    /// A list with units, or the path of a file.
    Text(String),
    /// Lengths, m.
    Lengths(Vec<f64>),
}

impl Offsets {
    /// The offsets, m.
    ///
    /// # Errors
    /// As [`offsets`].
    pub fn lengths(&self) -> Result<Vec<f64>> {
        match self {
            Self::Text(text) => offsets(text),
            Self::Lengths(lengths) => Ok(lengths.clone()),
        }
    }
}

/// A value of frames, which are of 32 bits.
const SINGLE: Kind<f32> = Kind::new("NUMBER", "float", "a number above 0, up to 3.4e38", |given| {
    let number = given.number().filter(|it| *it > 0.0 && *it <= f64::from(f32::MAX));
    number.map(numbers::single).ok_or(Refusal::Form)
})
.with_hyphens(Hyphens::Numbers);

const COLUMNS: Kind<Columns> = Kind::new("START:END:STEP", "slice", "", |given| match *given {
    OptionValue::Argument(ref text) => Ok(Columns::parse(text)?),
    OptionValue::Slice { start, end, step } => {
        let index = |value: Option<i64>, least: i64, usual: usize| match value {
            None => Ok(usual),
            Some(value) if value >= least => usize::try_from(value).map_err(|_| Refusal::Form),
            Some(_) => Err(Refusal::Form),
        };
        let columns = Columns {
            start: index(start, 0, 0)?,
            end: end.map(|end| index(Some(end), 1, 0)).transpose()?,
            step: index(step, 1, 1)?,
        };
        if columns.end.is_some_and(|end| end <= columns.start) {
            Err(Refusal::Form)
        } else {
            Ok(columns)
        }
    }
    _ => Err(Refusal::Form),
})
.in_python("slice", "a slice of columns, as slice(1, None, 2)");

const BIN: Kind<[usize; 2]> =
    Kind::new("COLUMNS,ROWS", "tuple[int, int]", "columns,rows from 1 on, as in 2,1", |given| {
        numbers_of(given, 1)
    })
    .in_python("tuple[int, int]", "numbers of columns and rows, 1 or more");

/// Pixels from 0, the ends excluded: columns, and rows where they follow.
const REGION: Kind<Region> = Kind::new(
    "C0:C1[,R0:R1]",
    "EmptyBeam",
    "C0:C1 or C0:C1,R0:R1, pixels from 0, the ends excluded",
    |given| {
        let columns_and_rows = match given {
            OptionValue::Argument(_) => given.items().unwrap_or_default(),
            OptionValue::List(items) if matches!(items.first(), Some(OptionValue::List(_))) => {
                items.clone()
            }
            one => vec![one.clone()],
        };
        match &columns_and_rows[..] {
            [columns] => Ok(Region::new(span(columns)?, None)),
            [columns, rows] => Ok(Region::new(span(columns)?, span(rows)?)),
            _ => Err(Refusal::Form),
        }
    },
)
.in_python("EmptyBeam", "(first, end) of columns, or a pair of these of columns and rows");

/// First index and end of a range that is not empty.
fn span(given: &OptionValue) -> std::result::Result<Range<usize>, Refusal> {
    let ends = match given {
        OptionValue::Argument(text) => OptionValue::Argument(text.replace(':', ",")),
        ends => ends.clone(),
    };
    let [start, end] = numbers_of(&ends, 0)?;
    if start < end { Ok(start..end) } else { Err(Refusal::Form) }
}

const CORRECTIONS: Kind<Corrections> = choices(
    Kind::new("CORRECTION", "Correction | Sequence[Correction]", "", |given| {
        match &words_of(given)?[..] {
            [] => Ok(Corrections::default()),
            words => Ok(Corrections::parse(&words.join(","))?),
        }
    }),
    Corrections::words,
);

const STEPS: Kind<Vec<usize>> =
    Kind::new("STEP,…", "Sequence[int]", "mask steps, from 0", |given| {
        let steps: Option<Vec<usize>> =
            given.items().ok_or(Refusal::Form)?.iter().map(OptionValue::whole).collect();
        steps.ok_or(Refusal::Form)
    })
    .in_python("Sequence[int]", "a list of mask steps, from 0");

const OFFSETS: Kind<Offsets> = Kind::new("LIST|FILE", "Lengths", "", |given| match given {
    OptionValue::Argument(text) => Ok(Offsets::Text(text.clone())),
    OptionValue::List(items) => {
        Ok(Offsets::Lengths(items.iter().map(any_length).collect::<std::result::Result<_, _>>()?))
    }
    _ => Err(Refusal::Form),
})
.in_python("Lengths", "a list of numbers in m, or of texts with a unit as \"20 um\"")
.with_hyphens(Hyphens::Texts);

const LATTICE: Kind<Lattice> =
    Kind::new("X,Z[,ANGLE]", "str", "text as \"40 um, 40 um, 3 deg\"", |given| {
        Ok(Lattice::parse(given.text().ok_or(Refusal::Form)?)?)
    })
    .with_hyphens(Hyphens::Texts);

const APERTURE: Kind<Aperture> =
    Kind::new("WIDTH,HEIGHT", "str", "text as \"30 um, 20 um\" or \"round 30 um\"", |given| {
        Ok(Aperture::parse("aperture", given.text().ok_or(Refusal::Form)?)?)
    });

const DETECTOR_APERTURE: Kind<Aperture> =
    Kind::new("WIDTH,HEIGHT", "str", "text as \"30 um, 20 um\"", |given| {
        Ok(Aperture::parse("detector_aperture", given.text().ok_or(Refusal::Form)?)?)
    });

const BACKGROUND: Kind<Background> =
    Kind::new("BACKGROUND", "str | float", "free, leak or a number", |given| match given.text() {
        Some(text) => Ok(text.parse()?),
        None => given.number().map(Background::Value).ok_or(Refusal::Form),
    })
    .with_hyphens(Hyphens::Texts);
