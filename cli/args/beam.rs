//! Arguments of the verbs about beams and materials.

use super::shared::Messages;
use beamlet::cli_support::units::Dimension;
use beamlet::scene::{Anode, Filter};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet spectrum scene.toml\n  \
    beamlet spectrum tube.csv --filter 'Al:1 mm' --plot tube.svg\n  \
    beamlet spectrum --anode tungsten --kvp '60 kV' --inherent 'beryllium:0.2 mm' --filter 'Al:1 mm'\n\n\
    The half-value layer is the thickness of aluminium that halves the air kerma. A scene's \
    energy nodes are the few energies that represent the spectrum in a run.")]
pub(crate) struct Spectrum {
    /// Scene file (.toml, .json), or a spectrum file: energy in keV, weight in photons
    #[arg(conflicts_with = "anode")]
    pub(crate) input: Option<PathBuf>,
    /// Change a value of the scene: key.path=value (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = super::key_value, requires = "input")]
    pub(crate) sets: Vec<String>,
    /// Built-in tube with this anode: tungsten or molybdenum
    #[arg(long, value_parser = anode, requires = "kvp")]
    pub(crate) anode: Option<Anode>,
    /// Tube voltage, such as "60 kV"
    #[arg(long, value_name = "VOLTAGE", value_parser = voltage, requires = "anode")]
    pub(crate) kvp: Option<f64>,
    /// Angle between the face of the target and the optical axis [default: 12 deg]
    #[arg(long, value_name = "ANGLE", value_parser = angle, requires = "anode")]
    pub(crate) anode_angle: Option<f64>,
    /// Filter of the tube itself (may be repeated)
    #[arg(long, value_name = "MATERIAL:THICKNESS", value_parser = filter, requires = "anode")]
    pub(crate) inherent: Vec<Filter>,
    /// Additional filter, behind the filters of the scene (may be repeated)
    #[arg(long = "filter", value_name = "MATERIAL:THICKNESS", value_parser = filter)]
    pub(crate) filters: Vec<Filter>,
    /// Draw the spectrum before and after filters into this file (.svg or .png)
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// Replace an existing picture
    #[arg(long, requires = "plot")]
    pub(crate) overwrite: bool,
    /// Print JSON (keV, photons on the scale of the input; layers in m)
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet material\n  \
    beamlet material gold --energy '30 keV' --thickness '225 um'\n  \
    beamlet material C5H8O2 --density '1.18 g/cm3' --energy '20 keV' --energy '30 keV'\n  \
    beamlet material water --spectrum tube.csv --thickness '1 cm'\n  \
    beamlet material powder --spectrum scene.toml\n\n\
    With a scene, a material with microstructure also shows its dark field in that set-up, what is assumed, and \
    warnings.\n\n\
    mu: photoabsorption, coherent and incoherent scattering, Elam, Ravel and Sieber (2002). \
    delta: f1 of Chantler (2000). The refractive index is n = 1 - delta + i beta.")]
pub(crate) struct Material {
    /// Name of a built-in material or of the scene's, or a chemical formula; without it the
    /// built-in names are listed
    #[arg(value_parser = material)]
    pub(crate) name: Option<String>,
    /// Density, such as "1.2 g/cm3"; needed for a formula that no built-in material has
    #[arg(long, value_parser = density, requires = "name", allow_hyphen_values = true)]
    pub(crate) density: Option<f64>,
    /// Photon energy, such as "30 keV" (may be repeated)
    #[arg(long = "energy", value_name = "ENERGY", value_parser = energy, requires = "name", conflicts_with = "spectrum", allow_hyphen_values = true)]
    pub(crate) energies: Vec<f64>,
    /// Mean over a spectrum: a spectrum file, or a scene with its filters and materials
    #[arg(long, value_name = "FILE|SCENE", requires = "name")]
    pub(crate) spectrum: Option<PathBuf>,
    /// Thickness for which the transmission is printed, such as "1 mm"
    #[arg(long, value_parser = length, requires = "name", allow_hyphen_values = true)]
    pub(crate) thickness: Option<f64>,
    /// Print JSON (SI units, energies in keV, densities in g/cm3)
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

/// A name, or a formula that a substance may have.
fn material(text: &str) -> Result<String, String> {
    beamlet::cli_support::check_formula(text).map(|()| text.to_owned())
}

fn anode(text: &str) -> Result<Anode, String> {
    let meant = |(name, anode): &(&str, Anode)| {
        name.eq_ignore_ascii_case(text) || anode.symbol().eq_ignore_ascii_case(text)
    };
    let found = Anode::ALL.into_iter().find(meant);
    found.map(|found| found.1).ok_or_else(|| "tungsten or molybdenum".into())
}

fn filter(text: &str) -> Result<Filter, String> {
    let form = "write MATERIAL:THICKNESS, as in 'Al:1 mm'";
    let (material, thickness) = text.rsplit_once(':').ok_or(form)?;
    if material.trim().is_empty() {
        return Err(form.into());
    }
    Ok(Filter::new(material.trim(), length(thickness)?))
}

pub(super) fn length(text: &str) -> Result<f64, String> {
    positive(Dimension::Length, text)
}

fn energy(text: &str) -> Result<f64, String> {
    positive(Dimension::Energy, text)
}

fn density(text: &str) -> Result<f64, String> {
    match positive(Dimension::Density, text)? {
        value if value <= 100.0 => Ok(value),
        value => {
            Err(format!("found {}; allowed: up to 100 g/cm3", Dimension::Density.rounded(value)))
        }
    }
}

fn voltage(text: &str) -> Result<f64, String> {
    positive(Dimension::Voltage, text)
}

fn angle(text: &str) -> Result<f64, String> {
    positive(Dimension::Angle, text)
}

fn positive(dimension: Dimension, text: &str) -> Result<f64, String> {
    match dimension.parse(text).map_err(|error| error.to_string())? {
        value if value > 0.0 => Ok(value),
        value => Err(format!("found {}; allowed: a value > 0", dimension.rounded(value))),
    }
}
