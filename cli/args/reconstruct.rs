//! `reconstruct`.

use super::shared::{DeviceArguments, Messages, ProfileArguments};
use super::values::{above_zero, finite, key_value, length, lengths, memory_size, sizes};
use beamlet::cli_support::units::Dimension;
use beamlet::reconstruct::{Filter, Quantity, VolumeFormat, VoxelMask};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet reconstruct run -o volume\n  \
    beamlet reconstruct run -o volume --quantity delta --format mhd --truth\n  \
    beamlet reconstruct dither0/retrieved dither1/retrieved -o volume --dry-run\n  \
    beamlet reconstruct sinograms.npy --geometry scene.toml --quantity mu -o volume\n  \
    beamlet reconstruct run -o volume --method cgls --iterations 10 --mask 'cylinder:0 mm,0 mm,8 mm'\n  \
    beamlet reconstruct run -o volume --quantity mu --beam-hardening water@40keV\n\n\
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
    /// Remove rings: stripes of single columns in the sinograms
    #[arg(long)]
    pub(crate) rings: bool,
    /// Keep views in delta that lost their refraction at flat faces along the beam
    #[arg(long)]
    pub(crate) keep_views: bool,
    /// Do not correct delta for gradients of the attenuation (by kμ, where mu is made, too)
    #[arg(long)]
    pub(crate) no_gradient_bias: bool,
    /// Correct mu for the hardening of a beam with a spectrum in a sample of this material; ENERGY
    /// (with a unit, as in water@40keV) is the energy of mu [default: the mean energy of the detected light
    /// that the masks modulate]
    #[arg(long, value_name = "MATERIAL[@ENERGY]", value_parser = hardening)]
    pub(crate) beam_hardening: Option<Hardening>,
    /// Side of a voxel [default: the size of a pixel at the axis of rotation]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) voxel: Option<f64>,
    /// Voxels along x, y, z [default: the field of view at the axis]
    #[arg(long, value_name = "X,Y,Z", value_parser = sizes)]
    pub(crate) size: Option<[usize; 3]>,
    /// Centre of the first voxel from the axis of rotation and the optical axis [default: the volume is
    /// centred on both]
    #[arg(long, value_name = "X,Y,Z", value_parser = lengths, allow_hyphen_values = true)]
    pub(crate) origin: Option<[f64; 3]>,
    /// Column of the axis of rotation, counted from 0 at the centre of the first, with a fraction; if views
    /// move the sample, of the mean place of its origin; auto
    /// finds it from lines that views from both ends measure [default: from geometry.json or the scene]
    #[arg(long, value_name = "auto|PIXELS", value_parser = centre, allow_negative_numbers = true)]
    pub(crate) centre: Option<Centre>,
    /// File format of the volumes
    #[arg(long, value_parser = format(), default_value = "tiff")]
    pub(crate) format: VolumeFormat,
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
    #[command(flatten)]
    pub(crate) profile: ProfileArguments,
    /// Most memory, host and device together, such as "2 GiB": slabs of fbp on the device become
    /// smaller; what does not fit is refused [default: the sinograms and volumes, plus up to 1 GiB on
    /// the device]
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) memory_limit: Option<u64>,
    /// Replace existing volumes
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
    /// Window of the filter of fbp [default: ram-lak]
    #[arg(long, value_parser = filter())]
    pub(crate) filter: Option<Filter>,
    /// Highest frequency in fbp, as a fraction of the Nyquist frequency: above 0, up to 1 [default: 1]
    #[arg(long, value_name = "SHARE", value_parser = above_zero)]
    pub(crate) cut_off: Option<f64>,
    /// Number of corrections for the lever arms of voxels before and behind the axis, in fbp [default:
    /// 1 for views over less than a turn, else 0]
    #[arg(long, value_name = "COUNT")]
    pub(crate) arm_passes: Option<usize>,
    /// Continue rows of a body wider than the detector as an ellipse, in fbp of mu and dark-field
    #[arg(long)]
    pub(crate) extrapolate: bool,
}

/// Options of iterative methods.
#[derive(Debug, Args)]
pub(crate) struct Iterated {
    /// Most iterations of cgls, sirt and bb [default: 20]
    #[arg(long, value_name = "COUNT")]
    pub(crate) iterations: Option<usize>,
    /// End iterations at this root mean square of the residuals, in the unit of the sinograms
    #[arg(long, value_name = "RMS", value_parser = above_zero)]
    pub(crate) discrepancy: Option<f64>,
    /// Keep voxels at or above zero, in sirt and bb
    #[arg(long)]
    pub(crate) non_negative: bool,
    /// Reconstruct delta from refraction angles integrated along the rows, in cgls, sirt and bb
    #[arg(long)]
    pub(crate) phase: bool,
    /// Voxels that may differ from zero, in cgls, sirt and bb: cylinder:X,Y,RADIUS (along z),
    /// sphere:X,Y,Z,RADIUS or box:X,Y,Z,WIDTH,DEPTH,HEIGHT, lengths with units, or a file (NPY, TIFF) [z][y][x] with 0
    /// for all other voxels
    #[arg(long, value_name = "SHAPE|FILE")]
    pub(crate) mask: Option<VoxelMask>,
    /// Directory of volumes with the same voxels, from which cgls, sirt and bb start [default: zero]
    #[arg(long, value_name = "DIR")]
    pub(crate) start: Option<PathBuf>,
}

impl Filtered {
    /// The first option that is given.
    pub(crate) fn first(&self) -> Option<&'static str> {
        let given = [
            ("--filter", self.filter.is_some()),
            ("--cut-off", self.cut_off.is_some()),
            ("--arm-passes", self.arm_passes.is_some()),
            ("--extrapolate", self.extrapolate),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }
}

impl Iterated {
    /// The first option that is given.
    pub(crate) fn first(&self) -> Option<&'static str> {
        let given = [
            ("--iterations", self.iterations.is_some()),
            ("--discrepancy", self.discrepancy.is_some()),
            ("--non-negative", self.non_negative),
            ("--phase", self.phase),
            ("--mask", self.mask.is_some()),
            ("--start", self.start.is_some()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }
}

/// `--beam-hardening`
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hardening {
    pub(crate) material: String,
    /// keV.
    pub(crate) energy: Option<f64>,
}

fn hardening(text: &str) -> Result<Hardening, String> {
    let (material, energy) = match text.split_once('@') {
        Some((material, energy)) => {
            let energy = Dimension::Energy.parse(energy).map_err(|error| error.to_string())?;
            (material, Some(energy))
        }
        None => (text, None),
    };
    match material.trim() {
        "" => Err("write a material, or MATERIAL@ENERGY as in water@40keV".into()),
        material => Ok(Hardening { material: material.to_owned(), energy }),
    }
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
