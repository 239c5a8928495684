//! `retrieve`.

use super::names::{MethodName, WeightsName, format};
use super::shared::{DeviceArguments, Messages, ProfileArguments};
use super::values::{
    above_zero, aperture, bin, columns, corrections, detector_aperture, from_zero, key_value,
    lattice, region, single,
};
use beamlet::retrieve::{Aperture, Background, Columns, Corrections, Lattice, Region};
use beamlet::stack::Format;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet retrieve run\n  \
    beamlet retrieve run --method exact-curve --format npy --overwrite\n  \
    beamlet retrieve --flat flat.tif --sample sample.tif --dark dark.tif \\\n    \
      --offsets '-12 um, -6 um, 0 um, 6 um, 12 um' --geometry scene.toml -o images\n  \
    beamlet retrieve --flat flat.tif --sample sample.tif --geometry scene.toml \\\n    \
      --lattice '40 um, 40 um' -o images\n\n\
    Images go to RUN/retrieved, or to DIR: transmission, refraction (rad), dark_field (rad^2), \
    their 1-sigma uncertainties, flags, and the parameters of the fits; retrieved.json records \
    units and the meaning of the flags. docs/retrieval.md has formulas, validity and bias.")]
pub(crate) struct Retrieve {
    /// Run directory of `beamlet simulate`
    #[arg(required_unless_present = "flat",
        conflicts_with_all = ["flat", "flats_every", "sample", "dark", "geometry", "offsets",
            "offsets_z", "sets"])]
    pub(crate) run: Option<PathBuf>,
    /// Flat frames: NPY, EXR, TIFF, a folder of frames, or a pattern for names in a folder, as
    /// 'raw/flat_*' (in quotes)
    #[arg(long, value_name = "FILE", requires_all = ["sample", "geometry", "output"])]
    pub(crate) flat: Option<PathBuf>,
    /// Views between one flat and the next, if --flat has several: the flat of a view is interpolated
    /// between the two nearest [default: one flat, or one for each view]
    #[arg(long, value_name = "N", requires = "flat", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) flats_every: Option<u32>,
    /// Sample frames, one view or several, as --flat
    #[arg(long, value_name = "FILE", requires = "flat")]
    pub(crate) sample: Option<PathBuf>,
    /// Frames without beam; their mean is subtracted
    #[arg(long, value_name = "FILE", requires = "flat")]
    pub(crate) dark: Option<PathBuf>,
    /// Pixels to exclude: an image (NPY, EXR, TIFF) with 0 for each good pixel, or a text with
    /// row,column on each line, counted from 0; they get no result and their own flag
    #[arg(long, value_name = "FILE")]
    pub(crate) bad_pixels: Option<PathBuf>,
    /// Columns to keep, counted from 0, the end excluded, as `1::2` for a mask of two pixels per period
    #[arg(long, value_name = "START:END:STEP", value_parser = columns)]
    pub(crate) columns: Option<Columns>,
    /// Columns and rows to combine into one pixel, after --columns: sums of counts, means of
    /// intensities
    #[arg(long, value_name = "COLUMNS,ROWS", value_parser = bin)]
    pub(crate) bin: Option<[usize; 2]>,
    /// Pixels (after --columns and --bin) with nothing in the beam, the ends excluded: reports
    /// transmission, refraction, dose of each step and drift there, and warns if they differ from an
    /// empty beam
    #[arg(long, value_name = "C0:C1[,R0:R1]", value_parser = region)]
    pub(crate) empty_beam: Option<Region>,
    /// Corrections from the pixels of --empty-beam or, without it, from both sides of each view where
    /// they are empty: `offset` subtracts the refraction angle found there, `plane` a plane through it,
    /// `dose` divides each frame by its dose, `steps` fits curves with the mask offset found for each
    /// frame
    #[arg(long, value_name = "offset,plane,dose,steps", value_parser = corrections)]
    pub(crate) correct: Option<Corrections>,
    /// Offsets of the sample mask: a list with units, or a file with one on each line [default: from the
    /// geometry's scan]
    #[arg(long, value_name = "LIST|FILE", requires = "flat", allow_hyphen_values = true)]
    pub(crate) offsets: Option<String>,
    /// Offsets of the sample mask along z, as --offsets and one for each of them: retrieves refraction and
    /// dark field along x and z
    #[arg(long, value_name = "LIST|FILE", requires = "flat", allow_hyphen_values = true)]
    pub(crate) offsets_z: Option<String>,
    /// Lattice of the beamlets of a sample mask alone, as it is on the detector: periods along x and z, an
    /// angle after them, or two vectors `X,Z;X,Z`. Retrieves refraction and dark field along x and z
    #[arg(long, value_name = "X,Z[,ANGLE]", value_parser = lattice, allow_hyphen_values = true)]
    pub(crate) lattice: Option<Lattice>,
    /// Aperture of the sample mask as it is projected on the detector, or with --offsets-z on the detector mask, for
    /// --method beamlet or exact-curve: `WIDTH,HEIGHT` or `round DIAMETER`
    #[arg(long, value_name = "WIDTH,HEIGHT", value_parser = aperture)]
    pub(crate) aperture: Option<Aperture>,
    /// Aperture of the detector mask, for --offsets-z with --method exact-curve: `WIDTH,HEIGHT`
    #[arg(long, value_name = "WIDTH,HEIGHT", value_parser = detector_aperture)]
    pub(crate) detector_aperture: Option<Aperture>,
    /// Scene file with the distances and masks of the measurement
    #[arg(long, value_name = "SCENE", requires = "flat")]
    pub(crate) geometry: Option<PathBuf>,
    /// Change a value of the geometry: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value, requires = "geometry")]
    pub(crate) sets: Vec<String>,
    /// Mask steps to leave out of flat and sample, counted from 0, as a frame without beam
    #[arg(long, value_name = "STEP,…", value_delimiter = ',')]
    pub(crate) omit_steps: Vec<usize>,
    /// Directory of the images [default: RUN/retrieved]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// The estimator [default: exact-curve where the scene knows the curve of its masks, else gaussian; for a
    /// sample mask alone beamlet, on a lattice without --aperture gaussian]
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodName>,
    /// Background of the curves, for gaussian and exact-curve: `free`, the light that the masks `leak`, or a number of
    /// the frames [default: leak where the masks are known and nothing scatters, else free]
    #[arg(long, value_name = "BACKGROUND", allow_hyphen_values = true)]
    pub(crate) background: Option<Background>,
    /// Weights of a fit's values
    #[arg(long, value_enum, default_value_t = WeightsName::None)]
    pub(crate) weights: WeightsName,
    /// Take the run's detector numbers instead of its intensities
    #[arg(long, requires = "run")]
    pub(crate) counts: bool,
    /// Detector number of one photon, for the uncertainties of counts [default: from a run's scene, else
    /// 1]
    #[arg(long, value_name = "NUMBER", value_parser = above_zero, allow_negative_numbers = true)]
    pub(crate) gain: Option<f64>,
    /// Standard deviation of the detector number without light, for the uncertainties of counts
    /// [default: from a run's scene, else 0]
    #[arg(long, value_name = "NUMBER", value_parser = from_zero, allow_negative_numbers = true)]
    pub(crate) read_noise: Option<f64>,
    /// Exclude values at or above this number of the files [default: the largest number of a run's
    /// detector]
    #[arg(long, value_name = "NUMBER", value_parser = single, allow_negative_numbers = true)]
    pub(crate) saturation: Option<f32>,
    /// Also make images of the phase: refraction integrated along the rows, m of delta times length;
    /// rows must begin and end in air
    #[arg(long)]
    pub(crate) phase: bool,
    /// File format of the images [default: the format of the sample's stack]
    #[arg(long, value_parser = format())]
    pub(crate) format: Option<Format>,
    #[command(flatten)]
    pub(crate) device: DeviceArguments,
    #[command(flatten)]
    pub(crate) profile: ProfileArguments,
    /// Replace existing images
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Print retrieved.json instead of a summary
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}
