//! The arguments as they are typed. Help texts live here; what arguments mean is decided in
//! `commands`.

mod beam;
mod convert;
mod look;
mod mesh;
mod options;
mod shared;
mod simulate;
mod sweep;
mod view;

pub(crate) use beam::{Material, Spectrum};
pub(crate) use convert::{Convert, Program};
pub(crate) use look::{Check, Compare};
pub(crate) use mesh::{Mask, Mesh};
pub(crate) use options::TableArguments;
pub(crate) use shared::{Messages, ProfileArguments};
pub(crate) use simulate::{Join, Simulate};
pub(crate) use sweep::Sweep;
pub(crate) use view::{PictureFormat, Report, Show, ValueRange, View, ViewOfRun, ViewOfScene};

use beamlet::cli_support::options::{ReconstructArguments, RetrieveArguments};
use beamlet::scene::Scene;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
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

impl Arguments {
    /// How much goes to stderr.
    pub(crate) const fn messages(&self) -> Messages {
        match &self.verb {
            Verb::Simulate(simulate) => simulate.messages,
            Verb::Join(join) => join.messages,
            Verb::Retrieve(retrieve) => retrieve.messages,
            Verb::Reconstruct(reconstruct) => reconstruct.messages,
            Verb::Convert(convert) => convert.messages,
            Verb::Compare(compare) => compare.messages,
            Verb::Check(check) => check.messages,
            Verb::Sweep(sweep) => sweep.messages,
            Verb::View(view) => view.messages,
            Verb::Report(report) => report.messages,
            Verb::Spectrum(spectrum) => spectrum.messages,
            Verb::Material(material) => material.messages,
            Verb::Mesh(mesh) => mesh.messages,
            Verb::Mask(mask) => mask.messages,
            Verb::Devices(devices) => devices.messages,
            Verb::Example(example) => example.messages,
            Verb::Explain(explain) => explain.messages,
            Verb::Schema(schema) => schema.messages,
            Verb::Completions(completions) => completions.messages,
            Verb::Man(man) => man.messages,
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Simulate a scene into a run directory
    Simulate(Simulate),
    /// Join parts of a run, which other processes or machines have simulated
    Join(Join),
    /// Retrieve transmission, refraction and dark field from a run or from measured stacks
    #[command(after_help = RETRIEVE)]
    Retrieve(Box<TableArguments<RetrieveArguments>>),
    /// Reconstruct volumes of attenuation, delta and dark field from a run or retrieved images
    #[command(after_help = RECONSTRUCT)]
    Reconstruct(Box<TableArguments<ReconstructArguments>>),
    /// Write retrieved images for another program: ASTRA
    Convert(Convert),
    /// Compare two stacks, runs or retrievals
    Compare(Compare),
    /// Check a scene without simulating it, or the files of a run against their checksums
    Check(Check),
    /// Score designs of a set-up: noise, visibility, time and dose, and errors and contrast at a sample
    Sweep(Sweep),
    /// Draw a scene (set-up, sample), a run (frames, retrieved images, curves), retrieved images or
    /// volumes
    View(View),
    /// Write a run, retrieved images or a reconstruction as one page to explore in a browser
    Report(Report),
    /// Print and draw the spectrum of a source, before and after its filters
    Spectrum(Spectrum),
    /// Print the constants of a material, or list the built-in ones
    Material(Material),
    /// Write the objects of a scene, or another mesh file, as a mesh file
    Mesh(Mesh),
    /// Write a mask of a scene as a mesh file: bars, frame, substrate
    Mask(Mask),
    /// List the Vulkan devices
    Devices(Devices),
    /// List the scenes that come with beamlet, or write one with its meshes
    Example(Example),
    /// Explain a kind of error: causes and remedies
    Explain(Explain),
    /// Print the JSON Schema of scene files, for editors
    Schema(Schema),
    /// Print the completion script of a shell
    Completions(Completions),
    /// Write manual pages, one for each verb
    Man(Man),
}

fn key_value(text: &str) -> Result<String, String> {
    match text.split_once('=') {
        Some((key, _)) if !key.trim().is_empty() => Ok(text.to_owned()),
        _ => Err("write key.path=value, as in 'source.energy=40 keV'".into()),
    }
}

const RETRIEVE: &str = "Examples:\n  \
    beamlet retrieve run\n  \
    beamlet retrieve run --method exact-curve --format npy --overwrite\n  \
    beamlet retrieve --flat flat.tif --sample sample.tif --dark dark.tif \\\n    \
      --offsets '-12 um, -6 um, 0 um, 6 um, 12 um' --geometry scene.toml -o images\n  \
    beamlet retrieve --flat flat.tif --sample sample.tif --geometry scene.toml \\\n    \
      --lattice '40 um, 40 um' -o images\n\n\
    Images go to RUN/retrieved, or to DIR: transmission, refraction (rad), dark_field (rad^2), \
    their 1-sigma uncertainties, flags, and the parameters of the fits; retrieved.json records \
    units and the meaning of the flags. docs/retrieval.md has formulas, validity and bias.";

const RECONSTRUCT: &str = "Examples:\n  \
    beamlet reconstruct run -o volume\n  \
    beamlet reconstruct run -o volume --quantity delta --format mhd --truth\n  \
    beamlet reconstruct dither0/retrieved dither1/retrieved -o volume --dry-run\n  \
    beamlet reconstruct sinograms.npy --geometry scene.toml --quantity mu -o volume\n  \
    beamlet reconstruct run -o volume --method cgls --iterations 10 --mask 'cylinder:0 mm,0 mm,8 mm'\n  \
    beamlet reconstruct run -o volume --quantity mu --beam-hardening water@40keV\n\n\
    Volumes go to DIR: mu (1/m) from the transmission, delta from the refraction angles, dark-field \
    (rad^2/m), [z][y][x], each side ascending; volume.json records grid, units and provenance. \
    docs/reconstruction.md goes from a scan to slices.";

/// A scene and changes to it.
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
        beamlet::cli_support::load_scene(&self.scene, &self.sets)
    }

    /// Gives an error of a later stage its place in the scene file.
    pub(crate) fn locate(&self, error: beamlet::Error) -> beamlet::Error {
        Scene::locate(&self.scene, &self.sets, error)
    }
}

#[derive(Debug, Args)]
#[command(after_help = "Choose a device with `simulate --device` or the environment variable \
    BEAMLET_DEVICE, by its number or part of its name.")]
pub(crate) struct Devices {
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    beamlet schema > scene.schema.json\n\n\
    Editors with Taplo check and complete a scene whose first line is\n  \
    #:schema ./scene.schema.json")]
pub(crate) struct Schema {
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet completions bash > ~/.local/share/bash-completion/completions/beamlet\n  \
    beamlet completions zsh > ~/.zfunc/_beamlet\n  \
    beamlet completions fish > ~/.config/fish/completions/beamlet.fish")]
pub(crate) struct Completions {
    /// The shell
    pub(crate) shell: Shell,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet man -o ~/.local/share/man/man1\n  \
    man beamlet-simulate")]
pub(crate) struct Man {
    /// Directory to write them to
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Replace existing pages
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beamlet explain\n  \
    beamlet explain device")]
pub(crate) struct Explain {
    /// Kind of error; without it the kinds are listed
    pub(crate) kind: Option<String>,
    #[command(flatten)]
    pub(crate) messages: Messages,
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
    /// Replace existing files
    #[arg(long, requires = "name")]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) messages: Messages,
}
