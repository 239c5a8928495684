//! `reconstruct`.

use super::shared::{DeviceArguments, Messages};
use super::values::{above_zero, finite, key_value, length, lengths, sizes};
use beamlet::reconstruct::{Filter, Quantity, Region, VolumeFormat};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet reconstruct run -o volume\n  \
    beamlet reconstruct run -o volume --quantity delta --format mhd \\\n    \
      --region 'rod=cylinder:1 mm, 0 mm, 0.8 mm' --truth\n  \
    beamlet reconstruct dither0/retrieved dither1/retrieved -o volume --dry-run\n  \
    beamlet reconstruct sinograms.npy --geometry scene.toml --quantity mu -o volume\n\n\
    Volumes go to DIR: mu (1/m) from the transmission, delta from the refraction angles, dark-field \
    (rad^2/m), [z][y][x], each side ascending; volume.json records grid, units and provenance. \
    docs/reconstruction.md goes from a scan to slices.")]
pub(crate) struct Reconstruct {
    /// Run directory (retrieved first where it has no images), folders of retrieved images whose
    /// columns interleave, or with --geometry a file of sinograms [view][row][column], NPY or TIFF:
    /// -ln of the transmission, angles in rad, or variances in rad^2
    #[arg(required = true, value_name = "RUN|IMAGES|FILE")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Directory of the volumes
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Volumes to make: mu, delta, dark-field, separated by commas, or all that the images have
    #[arg(long, value_delimiter = ',', value_parser = quantity(), default_value = "all")]
    pub(crate) quantity: Vec<QuantityName>,
    /// Method
    #[arg(long, value_enum, default_value_t = ReconstructionName::Fbp)]
    pub(crate) method: ReconstructionName,
    #[command(flatten)]
    pub(crate) filtered: Filtered,
    #[command(flatten)]
    pub(crate) iterated: Iterated,
    /// Use the uncertainties of the retrieval: fbp writes uncertainties of voxels and of means of
    /// regions, iterative methods weigh by them
    #[arg(long)]
    pub(crate) sigma: bool,
    /// Take stripes of single columns off the sinograms, which are rings in slices
    #[arg(long)]
    pub(crate) rings: bool,
    /// Leave out kμ, which is added to delta for gradients of the attenuation where mu is made, too
    #[arg(long)]
    pub(crate) no_gradient_bias: bool,
    /// Side of a voxel [default: a pixel as the axis of rotation sees it]
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    pub(crate) voxel: Option<f64>,
    /// Voxels along x, y, z [default: the field of view at the axis]
    #[arg(long, value_name = "X,Y,Z", value_parser = sizes)]
    pub(crate) size: Option<[usize; 3]>,
    /// Centre of the first voxel from the axis of rotation and the optical axis [default: the volume
    /// lies about them]
    #[arg(long, value_name = "X,Y,Z", value_parser = lengths, allow_hyphen_values = true)]
    pub(crate) origin: Option<[f64; 3]>,
    /// Column of the axis of rotation, counted from 0 at the centre of the first, with a fraction; auto
    /// finds it by lines that are seen from both ends [default: from geometry.json or the scene]
    #[arg(long, value_name = "auto|PIXELS", value_parser = centre, allow_negative_numbers = true)]
    pub(crate) centre: Option<Centre>,
    /// File format of the volumes
    #[arg(long, value_parser = format(), default_value = "tiff")]
    pub(crate) format: VolumeFormat,
    /// Write the mean over a region to regions.csv (may be repeated): NAME=cylinder:X,Y,RADIUS (along
    /// z), NAME=sphere:X,Y,Z,RADIUS or NAME=box:X,Y,Z,WIDTH,DEPTH,HEIGHT, lengths with units
    #[arg(long = "region", value_name = "NAME=SHAPE", allow_hyphen_values = true)]
    pub(crate) regions: Vec<Region>,
    /// Write the scene on the same voxels (mu, delta, labels of objects), and the errors by object to
    /// errors.csv
    #[arg(long)]
    pub(crate) truth: bool,
    /// Scene file of a file of sinograms: angles, distances, pixels
    #[arg(long, value_name = "SCENE")]
    pub(crate) geometry: Option<PathBuf>,
    /// Change a value of the geometry: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value, requires = "geometry")]
    pub(crate) sets: Vec<String>,
    #[command(flatten)]
    pub(crate) device: DeviceArguments,
    /// Replace volumes that are there
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Print the grid, memory and time, and write nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Print volume.json instead of a summary
    #[arg(long, conflicts_with = "dry_run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

/// Options of filtered back-projection.
#[derive(Debug, Args)]
pub(crate) struct Filtered {
    /// Window of the filter of fbp
    #[arg(long, value_parser = filter(), default_value = "ram-lak")]
    pub(crate) filter: Filter,
    /// Frequency from which on nothing counts in fbp, as a share of Nyquist's: above 0, up to 1
    #[arg(long, value_name = "SHARE", value_parser = above_zero, default_value_t = 1.0)]
    pub(crate) cut_off: f64,
    /// Corrections for the lever arms of voxels before and behind the axis in fbp [default: 1 for views
    /// over less than a turn, else 0]
    #[arg(long, value_name = "COUNT")]
    pub(crate) arm_passes: Option<usize>,
    /// Continue rows of a body wider than the detector as an ellipse, in fbp of mu and dark-field
    #[arg(long)]
    pub(crate) extrapolate: bool,
}

/// Options of iterative methods.
#[derive(Debug, Args)]
pub(crate) struct Iterated {
    /// Most iterations of cgls, sirt and bb
    #[arg(long, value_name = "COUNT", default_value_t = 20)]
    pub(crate) iterations: usize,
    /// End iterations at this root mean square of the residuals, in the unit of the sinograms
    #[arg(long, value_name = "RMS", value_parser = above_zero)]
    pub(crate) discrepancy: Option<f64>,
    /// Keep voxels at or above zero, in sirt and bb
    #[arg(long)]
    pub(crate) non_negative: bool,
    /// Make delta of refraction angles integrated along the rows, in cgls, sirt and bb
    #[arg(long)]
    pub(crate) phase: bool,
}

/// `--method`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReconstructionName {
    /// Filtered back-projection; FDK in cones
    Fbp,
    /// Conjugate gradients
    Cgls,
    /// Simultaneous iterative reconstruction; delta by --phase
    Sirt,
    /// Gradient descent with the steps of Barzilai and Borwein
    Bb,
}

/// `--centre`
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Centre {
    Auto,
    Column(f64),
}

fn centre(text: &str) -> Result<Centre, String> {
    if text == "auto" {
        return Ok(Centre::Auto);
    }
    finite(text).map(Centre::Column).map_err(|error| format!("{error}, or auto"))
}

/// `--quantity`: one, or all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum QuantityName {
    All,
    One(Quantity),
}

fn quantity() -> impl TypedValueParser<Value = QuantityName> {
    let names = Quantity::ALL.map(Quantity::name).into_iter().chain(["all"]);
    let named = |name: String| {
        let found = Quantity::ALL.into_iter().find(|quantity| quantity.name() == name);
        found.map_or(QuantityName::All, QuantityName::One)
    };
    PossibleValuesParser::new(names).map(named)
}

fn filter() -> impl TypedValueParser<Value = Filter> {
    let named = |name: String| {
        Filter::ALL.into_iter().find(|filter| filter.name() == name).unwrap_or_default()
    };
    PossibleValuesParser::new(Filter::ALL.map(Filter::name)).map(named)
}

fn format() -> impl TypedValueParser<Value = VolumeFormat> {
    let value = |format: VolumeFormat| PossibleValue::new(format.name()).help(format.summary());
    let named = |name: String| {
        VolumeFormat::ALL.into_iter().find(|format| format.name() == name).unwrap_or_default()
    };
    PossibleValuesParser::new(VolumeFormat::ALL.map(value)).map(named)
}
