//! Arguments of the verbs that write meshes.

use super::SceneArguments;
use super::beam::length;
use super::shared::Messages;
use beamlet::MaskPlace;
use beamlet::cli_support::units::Dimension;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet mesh scene.toml -o sample.obj\n  \
    beamlet mesh scene.toml --object lens -o lens.stl --error '0.1 um'\n  \
    beamlet mesh assembly.3mf --group lens -o lens.ply\n\n\
    Objects of a scene are written in their places, without the volumes that later objects cover. OBJ keeps their names; PLY and STL hold one mesh. Exact shapes become facets whose vertices lie on the surface. A mesh file must be closed.")]
pub(crate) struct Mesh {
    /// Scene file (.toml, .json), or a mesh file (.stl, .obj, .ply, .3mf)
    #[arg(value_name = "SCENE|OBJECT")]
    pub(crate) input: PathBuf,
    /// File to write, by its ending OBJ, PLY or STL
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// An object of the scene; without it all objects (may be repeated)
    #[arg(long = "object", value_name = "NAME")]
    pub(crate) objects: Vec<String>,
    /// Object, group or material of the mesh file (OBJ, 3MF); without it the whole file
    #[arg(long, value_name = "NAME", conflicts_with_all = ["objects", "sets"])]
    pub(crate) group: Option<String>,
    /// Largest distance of facets from an exact shape, such as "1 um"
    #[arg(long, value_name = "LENGTH", value_parser = length, default_value = "1 um", allow_hyphen_values = true)]
    pub(crate) error: f64,
    /// The length of 1.0 in the written file, and in a mesh file without a unit
    #[arg(long, value_name = "UNIT", value_parser = unit, default_value = "mm")]
    pub(crate) unit: f64,
    /// Change a value of the scene: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = super::key_value)]
    pub(crate) sets: Vec<String>,
    /// Replace an existing file
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet mask scene.toml -o mask.obj\n  \
    beamlet mask scene.toml --mask detector --frame '5 mm' --substrate '0.5 mm' -o mask.obj\n\n\
    Bars are closed boxes, in one object. Frame and substrate touch them and are separate \
    objects: OBJ files hold all of them, STL and PLY files one --part. x runs across the slits from \
    the optical axis, y along the beam from the centre plane of the bars, z along the slits. The command \
    prints the object for a scene.")]
pub(crate) struct Mask {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// File to write, by its ending OBJ, PLY or STL
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// The mask to write [default: the sample mask, else the detector mask]
    #[arg(long, value_enum)]
    pub(crate) mask: Option<MaskName>,
    /// Least width covered by the bars, such as "20 mm" [default: the beam on the detector]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) width: Option<f64>,
    /// Height of the bars [default: the beam on the detector]
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) height: Option<f64>,
    /// Width of a frame around the bars, as thick as they are
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) frame: Option<f64>,
    /// Thickness of a substrate behind the bars
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) substrate: Option<f64>,
    /// Write this part alone: bars, frame or substrate
    #[arg(long, value_name = "PART")]
    pub(crate) part: Option<String>,
    /// The length of 1.0 in the file
    #[arg(long, value_name = "UNIT", value_parser = unit, default_value = "mm")]
    pub(crate) unit: f64,
    /// Replace an existing file
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MaskName {
    /// Before the sample
    Sample,
    /// Before the detector
    Detector,
}

impl From<MaskName> for MaskPlace {
    fn from(name: MaskName) -> Self {
        match name {
            MaskName::Sample => Self::Sample,
            MaskName::Detector => Self::Detector,
        }
    }
}

fn unit(text: &str) -> Result<f64, String> {
    Dimension::Length.parse_unit(text).map_err(|error| error.to_string())
}
