//! Pictures: `view` and `report`.

use super::key_value;
use super::shared::{DeviceArguments, Messages, memory_size};
use beamlet::cli_support::units;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet view scene.toml -o pictures\n  \
    beamlet view run -o pictures\n  \
    beamlet view run -o pictures --show curve --pixel 80,64\n  \
    beamlet view run -o pictures --show retrieved --map refraction,refraction_sigma --view 3\n  \
    beamlet view run -o pictures --range refraction=-5..5 --width 2400\n  \
    beamlet view run --retrieved other -o pictures --format svg\n  \
    beamlet view measured_images -o pictures\n  \
    beamlet view volume -o pictures --map mu --slice 12 --range mu=0..60\n\n\
    Prints the names of the files that it wrote. If a picture fails, nothing is written. \
    docs/pictures.md explains each picture.")]
pub(crate) struct View {
    /// Scene file (TOML or JSON), run directory, directory of retrieved images, or of volumes
    pub(crate) what: PathBuf,
    /// Directory to write the pictures to
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Replace existing pictures
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// File format of the pictures
    #[arg(long, value_enum, default_value_t = PictureFormat::Png)]
    pub(crate) format: PictureFormat,
    /// Width of each picture in pixels, 200 to 20000 [default: about 1200]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(200..=20_000), allow_negative_numbers = true)]
    pub(crate) width: Option<u32>,
    #[command(flatten)]
    pub(crate) messages: Messages,
    #[command(flatten)]
    pub(crate) of_scene: ViewOfScene,
    #[command(flatten)]
    pub(crate) of_run: ViewOfRun,
}

/// Options of the pictures of a scene.
#[derive(Debug, Args)]
#[command(next_help_heading = "Pictures of a scene")]
pub(crate) struct ViewOfScene {
    /// Change a value of the scene: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub(crate) sets: Vec<String>,
    /// Direction from which the sample is drawn: degrees from the source towards +x [default: 35]
    #[arg(long, value_name = "DEG", value_parser = degrees, allow_hyphen_values = true)]
    pub(crate) azimuth: Option<f64>,
    /// Degrees above the horizontal plane [default: 24]
    #[arg(long, value_name = "DEG", value_parser = degrees, allow_hyphen_values = true)]
    pub(crate) elevation: Option<f64>,
    #[command(flatten)]
    pub(crate) device: DeviceArguments,
}

/// Options of the pictures of a run.
#[derive(Debug, Args)]
#[command(next_help_heading = "Pictures of a run, of retrieved images or of volumes")]
pub(crate) struct ViewOfRun {
    /// What to draw [default: everything that the run has]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT")]
    pub(crate) show: Vec<Show>,
    /// Retrieved images or volumes to draw, by name [default: the three contrasts; every volume]
    #[arg(long = "map", value_delimiter = ',', value_name = "NAME")]
    pub(crate) maps: Vec<String>,
    /// Directory of the run's retrieved images [default: RUN/retrieved]
    #[arg(long, value_name = "DIR")]
    pub(crate) retrieved: Option<PathBuf>,
    /// Ends of a colour scale, in the unit of the picture (may be repeated): the name of an image,
    /// intensity or counts
    #[arg(long = "range", value_name = "NAME=LOW..HIGH", value_parser = value_range)]
    pub(crate) ranges: Vec<ValueRange>,
    /// Number of the view, from 0 [default: 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) view: Option<u32>,
    /// Number of the mask step, from 0 [default: the brightest of the flat]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) step: Option<u32>,
    /// Row of profiles and sinograms, from 0 on top [default: the middle]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) row: Option<u32>,
    /// Slice of a reconstruction, from 0 at the bottom [default: the middle]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) slice: Option<u32>,
    /// Pixel of the illumination curve [default: where the sample deflects most in the row]
    #[arg(long, value_name = "COL,ROW", value_parser = pixel)]
    pub(crate) pixel: Option<[u32; 2]>,
}

/// `--format` of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum PictureFormat {
    /// Pixels
    #[default]
    Png,
    /// Lines and text as vectors, images as pixels
    Svg,
}

impl PictureFormat {
    pub(crate) const fn ending(self) -> &'static str {
        match self {
            Self::Png => ".png",
            Self::Svg => ".svg",
        }
    }
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
    beamlet report run -o page.html --most 64MiB\n  \
    beamlet report run --retrieved other\n  \
    beamlet report measured_images\n  \
    beamlet report volume\n\n\
    The page needs no network and no server: open it in a browser. Runs whose frames would make \
    it larger than --most are shown with pixels, views and steps binned or left out, volumes with \
    voxels binned; the page says so.")]
pub(crate) struct Report {
    /// Run directory, directory of retrieved images, or of volumes
    pub(crate) run: PathBuf,
    /// Directory of the run's retrieved images [default: RUN/retrieved]
    #[arg(long, value_name = "DIR")]
    pub(crate) retrieved: Option<PathBuf>,
    /// File to write [default: RUN/report.html; beside the directory for images or volumes
    /// alone]
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Limit of image data in the page, such as "64 MiB" [default: 24 MiB]
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) most: Option<u64>,
    /// Replace an existing file
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) device: DeviceArguments,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

fn degrees(text: &str) -> Result<f64, String> {
    match units::number(text) {
        Some(angle) if angle.abs() <= 360.0 => Ok(angle),
        _ => Err("a number of degrees from -360 to 360".into()),
    }
}

fn pixel(text: &str) -> Result<[u32; 2], String> {
    let parts: Vec<_> = text.split(',').map(|part| part.trim().parse::<u32>()).collect();
    match parts[..] {
        [Ok(column), Ok(row)] => Ok([column, row]),
        _ => Err("write column,row, as in 80,64, both counted from 0, rows from the top".into()),
    }
}

/// The ends of a colour scale: of which image, and in its shown unit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ValueRange {
    pub(crate) name: String,
    pub(crate) ends: [f64; 2],
}

fn value_range(text: &str) -> Result<ValueRange, String> {
    let number = |text: &str| units::number(text).filter(|value| value.is_finite());
    let parts = text.split_once('=').and_then(|(name, ends)| {
        let (low, high) = ends.split_once("..")?;
        Some((name.trim().to_owned(), [number(low)?, number(high)?]))
    });
    match parts {
        Some((name, ends)) if !name.is_empty() && ends[0] < ends[1] => {
            Ok(ValueRange { name, ends })
        }
        _ => Err("write name=low..high with low below high, as in refraction=-10..10".into()),
    }
}
