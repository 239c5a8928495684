//! The arguments as they are typed. Help texts live here; what arguments mean is decided in
//! `commands`.

mod beam;

pub(crate) use beam::{Material, Spectrum};

use beamlet::Backend;
use beamlet::retrieve::{ImageFormat, Method, Weights};
use beamlet::scene::Scene;
use beamlet::stack::Format;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Edge-illumination X-ray phase contrast imaging, simulated from CAD models.
#[derive(Debug, Parser)]
#[command(
    name = "beamlet",
    version,
    subcommand_required = true,
    arg_required_else_help = true,
    after_help = "Start here:\n  beamlet example cylinder -o cylinder\n  beamlet check cylinder/scene.toml\n  \
                  beamlet simulate cylinder/scene.toml -o run\n\n\
                  Exit codes: 0 done, 1 failed, 2 usage, 130 interrupted."
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// How much goes to stderr.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verbosity {
    Quiet,
    Normal,
    Verbose,
}

impl Arguments {
    pub(crate) fn verbosity(&self) -> Verbosity {
        match &self.verb {
            Verb::Simulate(simulate) if simulate.quiet => Verbosity::Quiet,
            Verb::Simulate(simulate) if simulate.verbose => Verbosity::Verbose,
            Verb::Illuminate(illuminate) if illuminate.quiet => Verbosity::Quiet,
            Verb::Illuminate(illuminate) if illuminate.verbose => Verbosity::Verbose,
            Verb::Retrieve(retrieve) if retrieve.quiet => Verbosity::Quiet,
            Verb::Check(check) if check.quiet => Verbosity::Quiet,
            _ => Verbosity::Normal,
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Simulate a scene into a run directory
    Simulate(Simulate),
    /// Illuminate the kept moments of a run: other masks, spectra, materials, detectors
    Illuminate(Illuminate),
    /// Retrieve transmission, refraction and dark field from a run or from measured stacks
    Retrieve(Box<Retrieve>),
    /// Tell how two stacks, runs or retrievals differ
    Compare(Compare),
    /// Tell what a scene amounts to, without simulating it, or whether a run is whole
    Check(Check),
    /// Draw a scene (set-up and sample) or a run (frames, retrieved images, curves) as PNG files
    View(View),
    /// Write a run as one page to explore in a browser
    Report(Report),
    /// Tell and draw what a source emits, before and after its filters
    Spectrum(Spectrum),
    /// Tell the constants of a material, or list the built-in ones
    Material(Material),
    /// List the Vulkan devices
    Devices(Devices),
    /// List the scenes that come with beamlet, or write one with its meshes
    Example(Example),
}

/// A scene and what is changed in it.
#[derive(Debug, Args)]
pub(crate) struct SceneArguments {
    /// Scene file, TOML or JSON
    pub(crate) scene: PathBuf,
    /// Change a value of the scene: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub(crate) sets: Vec<String>,
}

impl SceneArguments {
    /// The scene with its changes.
    pub(crate) fn load(&self) -> beamlet::Result<Scene> {
        Scene::load_with(&self.scene, &self.sets)
    }

    /// Gives an error of a later stage its place in the scene file.
    pub(crate) fn locate(&self, error: beamlet::Error) -> beamlet::Error {
        Scene::locate(&self.scene, &self.sets, error)
    }
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet simulate scene.toml -o run\n  \
    beamlet simulate scene.toml -o run --resume\n  \
    beamlet simulate scene.toml -o run40 --format npy --set 'source.energy=40 keV'\n\n\
    The run directory holds scene.toml (the scene with every default), run.json (device, \
    counts, times), progress.log (what is committed) and the frames: flat and sample. \
    Ctrl-C ends a run so that --resume goes on with it.")]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Run directory to write
    #[arg(short, long, value_name = "RUN")]
    pub(crate) output: PathBuf,
    /// File format of the frames [default: exr; with --resume that of the run]
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatName>,
    /// How rays find triangles: auto measures both on the scene
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
    /// Vulkan device, by its number or part of its name (see `beamlet devices`)
    #[arg(long, value_name = "N|NAME")]
    pub(crate) device: Option<String>,
    /// Most memory of the run, host and device together, such as "2 GiB" [default: what the
    /// geometry needs, and up to 1 GiB for a band]
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) memory_limit: Option<u64>,
    /// Go on with an interrupted run
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// With --resume: accept another device, driver, backend or version than the run began with
    #[arg(long, requires = "resume")]
    pub(crate) allow_mixed: bool,
    /// With --resume: go on where the run recorded no hashes of the files that its scene names
    #[arg(long, requires = "resume")]
    pub(crate) allow_unhashed: bool,
    /// Replace an earlier run; files that are not of a run stay
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Keep the moments of the rays in RUN/moments, for `beamlet illuminate`
    #[arg(long)]
    pub(crate) keep_moments: bool,
    /// No progress, errors only
    #[arg(short, long, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// More of what is going on
    #[arg(short, long)]
    pub(crate) verbose: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet simulate scene.toml -o run --keep-moments\n  \
    beamlet illuminate run --scene wider.toml -o wider\n  \
    beamlet illuminate run --scene a.toml --scene b.toml -o designs\n\n\
    Source distance, angles and the place and shape of every object must be those of the run; \
    masks, mask offsets, spot, spectrum, the materials' constants and the detector may differ. \
    Several scenes are written to directories of their names.")]
pub(crate) struct Illuminate {
    /// Run directory with moments (`simulate --keep-moments`)
    pub(crate) run: PathBuf,
    /// Scene to illuminate them with, TOML or JSON (may be repeated)
    #[arg(long, value_name = "SCENE", required = true)]
    pub(crate) scene: Vec<PathBuf>,
    /// Change a value of every scene: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub(crate) sets: Vec<String>,
    /// Run directory to write; with several scenes, the directory of their run directories
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// File format of the frames [default: exr]
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatName>,
    /// How rays that are walked again find triangles: auto measures both on the scene
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
    /// Vulkan device, by its number or part of its name (see `beamlet devices`)
    #[arg(long, value_name = "N|NAME")]
    pub(crate) device: Option<String>,
    /// Most memory of the run, host and device together, such as "2 GiB"
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) memory_limit: Option<u64>,
    /// Replace earlier runs; files that are not of a run stay
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// No progress, errors only
    #[arg(short, long, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// More of what is going on
    #[arg(short, long)]
    pub(crate) verbose: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet retrieve run\n  \
    beamlet retrieve run --method exact-curve --format npy --overwrite\n  \
    beamlet retrieve --flat flat.tif --sample sample.tif --dark dark.tif \\\n    \
      --offsets '-12 um, -6 um, 0 um, 6 um, 12 um' --geometry scene.toml -o images\n\n\
    Images go to RUN/retrieved, or to DIR: transmission, refraction (rad), dark_field (rad^2), \
    their 1-sigma uncertainties, flags, and the parameters of the fits; retrieved.json tells \
    units and the meaning of the flags. docs/retrieval.md has formulas, validity and bias.")]
pub(crate) struct Retrieve {
    /// Run directory of `beamlet simulate`
    #[arg(required_unless_present = "flat",
        conflicts_with_all = ["flat", "sample", "dark", "geometry", "offsets", "sets"])]
    pub(crate) run: Option<PathBuf>,
    /// Flat frames: NPY, EXR, TIFF, or a folder of frames
    #[arg(long, value_name = "FILE", requires_all = ["sample", "geometry", "output"])]
    pub(crate) flat: Option<PathBuf>,
    /// Sample frames, one view or several
    #[arg(long, value_name = "FILE", requires = "flat")]
    pub(crate) sample: Option<PathBuf>,
    /// Frames without beam; their mean is subtracted
    #[arg(long, value_name = "FILE", requires = "flat")]
    pub(crate) dark: Option<PathBuf>,
    /// Offsets of the sample mask: a list with units, or a file with one on each line
    /// [default: those of the geometry's scan]
    #[arg(long, value_name = "LIST|FILE", requires = "flat", allow_hyphen_values = true)]
    pub(crate) offsets: Option<String>,
    /// Scene file whose distances and masks the frames were taken with
    #[arg(long, value_name = "SCENE", requires = "flat")]
    pub(crate) geometry: Option<PathBuf>,
    /// Change a value of the geometry: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value, requires = "geometry")]
    pub(crate) sets: Vec<String>,
    /// Directory of the images [default: RUN/retrieved]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// The estimator
    #[arg(long, value_enum, default_value_t = MethodName::Gaussian)]
    pub(crate) method: MethodName,
    /// Weights of a fit's values
    #[arg(long, value_enum, default_value_t = WeightsName::None)]
    pub(crate) weights: WeightsName,
    /// Take the run's detector numbers instead of its intensities
    #[arg(long, requires = "run")]
    pub(crate) counts: bool,
    /// Detector number of one photon, for the uncertainties of counts [default: that of a run's
    /// scene, else 1]
    #[arg(long, value_name = "NUMBER", value_parser = above_zero, allow_negative_numbers = true)]
    pub(crate) gain: Option<f64>,
    /// Standard deviation of a number without light, for --weights poisson [default: that of a
    /// run's scene, else 0]
    #[arg(long, value_name = "NUMBER", value_parser = from_zero, allow_negative_numbers = true)]
    pub(crate) read_noise: Option<f64>,
    /// Leave out values from here on, as they are in the files [default: the largest number of
    /// a run's detector]
    #[arg(long, value_name = "NUMBER", value_parser = single, allow_negative_numbers = true)]
    pub(crate) saturation: Option<f32>,
    /// Two-step: steps of the sample, counted from 0 [default: those nearest to the slopes]
    #[arg(long, value_name = "I,J", value_parser = two_steps)]
    pub(crate) steps: Option<[usize; 2]>,
    /// Two-step: offsets of the sample's steps, where they are not those of the flat
    #[arg(long, value_name = "LIST|FILE", allow_hyphen_values = true)]
    pub(crate) sample_offsets: Option<String>,
    /// File format of the images
    #[arg(long, value_enum, default_value_t = ImageFormatName::Exr)]
    pub(crate) format: ImageFormatName,
    /// Vulkan device, by its number or part of its name (see `beamlet devices`)
    #[arg(long, value_name = "N|NAME")]
    pub(crate) device: Option<String>,
    /// Replace images that are there
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Print retrieved.json instead of a summary
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress, errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet compare run other\n  \
    beamlet compare run/retrieved other/retrieved --json\n  \
    beamlet compare run/sample measured.tif --tolerance 0.01 --difference differences\n\n\
    Exit codes: 0 nothing differs by more than the tolerance, 1 something does, 2 trouble.")]
pub(crate) struct Compare {
    /// Run, directory of retrieved images, or stack (NPY, EXR, TIFF, folder of frames)
    pub(crate) a: PathBuf,
    /// What is compared with it, of the same kind
    pub(crate) b: PathBuf,
    /// Largest difference of a pixel that counts as none
    #[arg(long, value_name = "NUMBER", default_value_t = 0.0, value_parser = from_zero, allow_negative_numbers = true)]
    pub(crate) tolerance: f64,
    /// Write images of B - A into a new directory
    #[arg(long, value_name = "DIR")]
    pub(crate) difference: Option<PathBuf>,
    /// File format of the images of differences
    #[arg(long, value_enum, default_value_t = ImageFormatName::Exr, requires = "difference")]
    pub(crate) format: ImageFormatName,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet check scene.toml\n  \
    beamlet check scene.toml --set 'detector.pixels=[512, 512]'\n  \
    beamlet check scene.toml --json\n  \
    beamlet check run\n\n\
    Of a run every view, and the moments that it keeps, are compared with their checksums; the \
    exit code is 1 where it is not whole.")]
pub(crate) struct Check {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Tell what a run with this memory limit takes, such as "2 GiB"
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) memory_limit: Option<u64>,
    /// How rays find triangles: auto measures both on the scene
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
    /// Vulkan device, by its number or part of its name (see `beamlet devices`)
    #[arg(long, value_name = "N|NAME")]
    pub(crate) device: Option<String>,
    /// Do not estimate rays and time: needs no device, and no more memory than the meshes
    #[arg(long, conflicts_with_all = ["device", "backend"])]
    pub(crate) no_estimate: bool,
    /// Print JSON (SI units, energies in keV)
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress, errors only on stderr; the report stays
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet view scene.toml -o pictures\n  \
    beamlet view run -o pictures\n  \
    beamlet view run -o pictures --show curve --pixel 80,64\n  \
    beamlet view run -o pictures --show retrieved --map refraction,refraction_sigma --view 3\n\n\
    Prints the names of the files that it wrote. Nothing is written where anything is wrong. \
    docs/pictures.md tells what each picture shows.")]
pub(crate) struct View {
    /// Scene file (TOML or JSON), or run directory
    pub(crate) what: PathBuf,
    /// Directory to write the pictures to
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Replace pictures that are there
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) of_scene: ViewOfScene,
    #[command(flatten)]
    pub(crate) of_run: ViewOfRun,
}

/// What is asked of the pictures of a scene.
#[derive(Debug, Args)]
#[command(next_help_heading = "Pictures of a scene")]
pub(crate) struct ViewOfScene {
    /// Change a value of the scene: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub(crate) sets: Vec<String>,
    /// Where the sample is looked at from: degrees from the source's side towards +x [default:
    /// 35]
    #[arg(long, value_name = "DEG", value_parser = degrees, allow_hyphen_values = true)]
    pub(crate) azimuth: Option<f64>,
    /// Degrees above the horizontal plane [default: 24]
    #[arg(long, value_name = "DEG", value_parser = degrees, allow_hyphen_values = true)]
    pub(crate) elevation: Option<f64>,
    /// Vulkan device, by its number or part of its name (see `beamlet devices`)
    #[arg(long, value_name = "N|NAME")]
    pub(crate) device: Option<String>,
}

/// What is asked of the pictures of a run.
#[derive(Debug, Args)]
#[command(next_help_heading = "Pictures of a run")]
pub(crate) struct ViewOfRun {
    /// What to draw [default: everything that the run has]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT")]
    pub(crate) show: Vec<Show>,
    /// Retrieved images to draw, by name [default: the three contrasts]
    #[arg(long = "map", value_delimiter = ',', value_name = "NAME")]
    pub(crate) maps: Vec<String>,
    /// Number of the view, from 0 [default: 0]
    #[arg(long, value_name = "N")]
    pub(crate) view: Option<u32>,
    /// Number of the mask step, from 0 [default: the brightest of the flat]
    #[arg(long, value_name = "N")]
    pub(crate) step: Option<u32>,
    /// Row of profiles and sinograms, from 0 on top [default: the middle]
    #[arg(long, value_name = "N")]
    pub(crate) row: Option<u32>,
    /// Pixel of the illumination curve [default: where the sample deflects most in the row]
    #[arg(long, value_name = "COL,ROW", value_parser = pixel)]
    pub(crate) pixel: Option<[u32; 2]>,
}

/// `--show`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Show {
    /// A frame of the flat and of a view
    Frames,
    /// Retrieved images
    Retrieved,
    /// Intensities and retrieved values along a row
    Profiles,
    /// The illumination curve of a pixel with its fit
    Curve,
    /// A row over all views
    Sinograms,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet report run\n  \
    beamlet report run -o page.html --most 64MiB\n\n\
    The page needs no network and no server: open it in a browser. Runs whose frames would make \
    it larger than --most are shown with pixels, views and steps binned or left out; the page \
    says so.")]
pub(crate) struct Report {
    /// Run directory
    pub(crate) run: PathBuf,
    /// File to write [default: RUN/report.html]
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Most bytes of image data in the page, such as "64 MiB" [default: 24 MiB]
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) most: Option<u64>,
    /// Replace the file if it is there
    #[arg(long)]
    pub(crate) overwrite: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Choose a device with `simulate --device` or the environment variable \
    BEAMLET_DEVICE, by its number or part of its name.")]
pub(crate) struct Devices {
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet example\n  \
    beamlet example cylinder -o cylinder\n  \
    beamlet simulate cylinder/scene.toml -o run")]
pub(crate) struct Example {
    /// Name of the scene; without it the names are listed
    #[arg(requires = "output")]
    pub(crate) name: Option<String>,
    /// Directory to write it to
    #[arg(short, long, value_name = "DIR", requires = "name")]
    pub(crate) output: Option<PathBuf>,
    /// Replace files that are there
    #[arg(long, requires = "name")]
    pub(crate) overwrite: bool,
}

/// `--format`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatName {
    /// One 32-bit float EXR file per frame
    Exr,
    /// Two arrays for numpy: flat.npy and sample.npy
    Npy,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Exr => Self::Exr,
            FormatName::Npy => Self::Npy,
        }
    }
}

/// `--format` of images
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ImageFormatName {
    /// One 32-bit float EXR file per view
    Exr,
    /// One array for numpy per image: (view, row, column)
    Npy,
    /// One 32-bit float TIFF per image, a page per view
    Tiff,
}

impl From<ImageFormatName> for ImageFormat {
    fn from(name: ImageFormatName) -> Self {
        match name {
            ImageFormatName::Exr => Self::Exr,
            ImageFormatName::Npy => Self::Npy,
            ImageFormatName::Tiff => Self::Tiff,
        }
    }
}

/// `--method`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodName {
    /// Gaussian on a background by least squares; 4 steps or more
    Gaussian,
    /// Gaussian without background through 3 steps
    ThreeStep,
    /// Two steps on the flat's fitted curve; no dark field
    TwoStep,
    /// Area, centroid and variance of curves that end within the scan
    Moments,
    /// Triangle, for small spots and apertures of one projected width
    Triangle,
    /// Trapezoid, for small spots
    Trapezoid,
    /// The masks' own curve, blurred: free of the Gaussian's bias
    ExactCurve,
    /// Gaussian per beamlet over neighbouring pixels: single mask
    Beamlet,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::Gaussian => Self::Gaussian,
            MethodName::ThreeStep => Self::ThreeStep,
            MethodName::TwoStep => Self::TwoStep,
            MethodName::Moments => Self::Moments,
            MethodName::Triangle => Self::Triangle,
            MethodName::Trapezoid => Self::Trapezoid,
            MethodName::ExactCurve => Self::ExactCurve,
            MethodName::Beamlet => Self::Beamlet,
        }
    }
}

/// `--weights`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum WeightsName {
    /// All values alike
    None,
    /// Of counts, from the fit: the maximum of the Poisson likelihood
    Poisson,
}

impl From<WeightsName> for Weights {
    fn from(name: WeightsName) -> Self {
        match name {
            WeightsName::None => Self::None,
            WeightsName::Poisson => Self::Poisson,
        }
    }
}

/// `--backend`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendName {
    /// The faster one on this scene
    Auto,
    /// The driver's acceleration structures
    RayQuery,
    /// Our own tree, in a compute shader
    Bvh,
}

impl BackendName {
    /// `None` leaves the choice to the engine.
    pub(crate) fn choice(self) -> Option<Backend> {
        match self {
            Self::Auto => None,
            Self::RayQuery => Some(Backend::RayQuery),
            Self::Bvh => Some(Backend::Bvh),
        }
    }
}

fn two_steps(text: &str) -> Result<[usize; 2], String> {
    let steps: Option<Vec<usize>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match steps.as_deref() {
        Some(&[first, second]) if first != second => Ok([first, second]),
        _ => Err("write two steps that differ, as in 3,7; they count from 0".into()),
    }
}

fn number(text: &str, allowed: &str, is_allowed: impl Fn(f64) -> bool) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|value: &f64| value.is_finite());
    found.filter(|value| is_allowed(*value)).ok_or_else(|| format!("allowed: {allowed}"))
}

fn above_zero(text: &str) -> Result<f64, String> {
    number(text, "a finite number above 0", |value| value > 0.0)
}

fn from_zero(text: &str) -> Result<f64, String> {
    number(text, "a finite number from 0 on", |value| value >= 0.0)
}

/// A value of frames, which are of 32 bits.
fn single(text: &str) -> Result<f32, String> {
    let most = f64::from(f32::MAX);
    let value = number(text, "a number above 0, up to 3.4e38", |v| v > 0.0 && v <= most)?;
    #[allow(clippy::cast_possible_truncation, reason = "rounding to f32 is what is asked for")]
    let value = value as f32;
    Ok(value)
}

fn memory_size(text: &str) -> Result<u64, String> {
    beamlet::units::memory_size(text).map_err(|error| error.to_string())
}

fn degrees(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(angle) if angle.abs() <= 360.0 => Ok(angle),
        _ => Err("a number of degrees from -360 to 360".into()),
    }
}

fn pixel(text: &str) -> Result<[u32; 2], String> {
    let parts: Vec<_> = text.split(',').map(|part| part.trim().parse::<u32>()).collect();
    match parts[..] {
        [Ok(column), Ok(row)] => Ok([column, row]),
        _ => Err("write column,row as in 80,64; both count from 0, rows from the top".into()),
    }
}

fn key_value(text: &str) -> Result<String, String> {
    match text.split_once('=') {
        Some((key, _)) if !key.trim().is_empty() => Ok(text.to_owned()),
        _ => Err("write key.path=value, as in 'source.energy=40 keV'".into()),
    }
}
