//! Arguments of `sweep`.

use super::SceneArguments;
use super::shared::{DeviceArguments, Messages};
use super::view::PictureFormat;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet sweep scene.toml --vary 'sample_mask.projected_aperture=10:40:16 um' --score sigma_alpha -o apertures\n  \
    beamlet sweep scene.toml --vary 'sample_mask.projected_aperture=10:40:16 um' \
    --vary 'scan.mask_offsets.count=5,7,9,11' --score sigma_alpha,sigma_dark_field --fix 'time=60 s' -o designs\n  \
    beamlet sweep scene.toml --vary designs.csv --score visibility,dose -o designs\n  \
    beamlet sweep scene.toml --vary 'source.energy=15:40:6 keV' --score cnr:rod,bias_alpha:rod -o energies\n\n\
    Scores: sigma_transmission, sigma_alpha and sigma_dark_field (1 sigma of a pixel without a sample), visibility, \
    photons (of an open pixel in a frame), time (of all frames), load (of the tube), kerma and dose (in water, at the \
    axis of rotation). At the sample, whose first view is simulated: bias_transmission, bias_alpha and bias_dark_field (root \
    mean square of the difference from the ideal images), error_transmission, error_alpha and error_dark_field (with noise), \
    cnr, cnr_alpha and cnr_dark_field (contrast to noise); of an object as cnr:OBJECT. DIR gets sweep.csv with a design a row, a picture of each score, the Pareto front of the first two \
    scores, best.toml, the best design by the first score, and sweep.json, from which --resume continues.")]
pub(crate) struct Sweep {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Values of a key, KEY=FROM:TO:COUNT UNIT or KEY=VALUE,VALUE UNIT, or a CSV table with keys in its header and a
    /// design a row (may be repeated; all combinations are designs)
    #[arg(long, value_name = "KEY=VALUES|FILE", required = true)]
    pub(crate) vary: Vec<String>,
    /// Scores, separated by commas or repeated; the first decides
    #[arg(long, value_name = "SCORES", required = true)]
    pub(crate) score: Vec<String>,
    /// Change the exposure of each design so that all have this in common: time, dose or photons of the scan, as the
    /// scene has it or with a value, such as 'time=60 s'
    #[arg(long, value_name = "QUANTITY")]
    pub(crate) fix: Option<String>,
    /// Directory to write
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// File format of the pictures
    #[arg(long, value_enum, default_value_t = PictureFormat::Png)]
    pub(crate) format: PictureFormat,
    #[command(flatten)]
    pub(crate) device: DeviceArguments,
    /// Continue an interrupted sweep
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// Replace an earlier sweep
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Print JSON (SI units)
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}
