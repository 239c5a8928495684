//! The table of options of `reconstruct`, and the method and grid that they choose.

use super::choice::GridChoice;
use super::fbp_options::FbpOptions;
use super::filter::Filter;
use super::geometry::ScanGeometry;
use super::gradient_bias::gradient_bias;
use super::hardening::{BeamEnergy, Hardening, HardeningChoice};
use super::method::Method;
use super::plan::VolumePlan;
use super::quantity::Quantity;
use super::solver::{IterativeOptions, Solver};
use super::voxel_mask::VoxelMask;
use super::write::VolumeFormat;
use beamlet_core::options::Need::{Default as Usual, Required, Without};
use beamlet_core::options::Relation::{
    Excludes, Listed, Methods, Needs, Position, Program, Repeated, Short,
};
use beamlet_core::options::{
    ABOVE_ZERO, Choice, FILE, FINITE, Hyphens, Kind, LENGTH, MEMORY, PATHS, Refusal, SWITCH, TEXTS,
    WHOLE, Word, any_length, choice, choices, numbers_of, words_of,
};
use beamlet_core::{Error, Result, options};
use beamlet_model::scene::Scene;
use std::path::PathBuf;

const FILTERED: options::Relation = Methods(
    &["fbp"],
    "iterative methods do not filter rows, and their model contains the lever arms",
);
const ITERATED: options::Relation =
    Methods(&["cgls", "sirt", "bb"], "filtered back-projection has one step");

options! {
    /// Arguments of `reconstruct`, as they are given.
    ReconstructArguments;
    inputs: Vec<PathBuf> = PATHS.named("RUN|IMAGES|FILE"), Required, [Program, Position, Repeated],
        "Run directory (retrieved first where it has no images), folders of retrieved images whose columns interleave, or with --geometry a file of sinograms [view][row][column], NPY or TIFF: -ln of the transmission, angles in rad, or variances in rad^2";
    output: PathBuf = FILE.named("DIR"), Required, [Program, Short('o')], "Directory of the volumes";
    quantity: Vec<Quantity> = QUANTITIES, Usual("all"), [Program, Listed],
        "Volumes to make: mu, delta, dark-field, separated by commas, or all that the images have";
    method: MethodName = choice::<MethodName>("METHOD", "Reconstruction"), Usual("fbp"), [], "Method";
    filter: Filter = choice::<Filter>("FILTER", "Window"), Usual("ram-lak"), [FILTERED],
        "Window of the filter of fbp";
    cut_off: f64 = ABOVE_ZERO.named("SHARE"), Usual("1.0"), [FILTERED],
        "Highest frequency in fbp, as a fraction of the Nyquist frequency: above 0, up to 1";
    arm_passes: Option<usize> = WHOLE, Without("1 for views over less than a turn, else 0"), [FILTERED],
        "Number of corrections for the lever arms of voxels before and behind the axis, in fbp";
    extrapolate: bool = SWITCH, Without(""), [FILTERED],
        "Continue rows of a body wider than the detector as an ellipse, in fbp of mu and dark-field";
    iterations: usize = WHOLE, Usual("20"), [ITERATED], "Most iterations of cgls, sirt and bb";
    discrepancy: Option<f64> = ABOVE_ZERO.named("RMS"), Without(""), [ITERATED],
        "End iterations at this root mean square of the residuals, in the unit of the sinograms";
    non_negative: bool = SWITCH, Without(""), [ITERATED], "Keep voxels at or above zero, in sirt and bb";
    phase: bool = SWITCH, Without(""), [ITERATED],
        "Reconstruct delta from refraction angles integrated along the rows, in cgls, sirt and bb";
    mask: Option<VoxelMask> = MASK, Without(""), [ITERATED],
        "Voxels that may differ from zero, in cgls, sirt and bb: cylinder:X,Y,RADIUS (along z), sphere:X,Y,Z,RADIUS or box:X,Y,Z,WIDTH,DEPTH,HEIGHT, lengths with units, or a file (NPY, TIFF) [z][y][x] with 0 for all other voxels";
    start: Option<PathBuf> = FILE.named("DIR").in_python("ArrayLike", "an array (z, y, x)"), Without("zero"), [ITERATED],
        "Directory of volumes with the same voxels, from which cgls, sirt and bb start";
    rings: bool = SWITCH, Without(""), [], "Remove rings: stripes of single columns in the sinograms";
    keep_views: bool = SWITCH, Without(""), [],
        "Keep views in delta that lost their refraction at flat faces along the beam";
    no_gradient_bias: bool = SWITCH, Without(""), [Program],
        "Do not correct delta for gradients of the attenuation (by kμ, where mu is made, too)";
    beam_hardening: Option<Hardening> = HARDENING, Without("the mean energy of the detected light that the masks modulate"), [],
        "Correct mu for the hardening of a beam with a spectrum in a sample of this material; ENERGY (with a unit, as in water@40keV) is the energy of mu";
    voxel: Option<f64> = LENGTH, Without("the size of a pixel at the axis of rotation"), [], "Side of a voxel";
    size: Option<[usize; 3]> = SIZES, Without("the field of view at the axis"), [], "Voxels along x, y, z";
    origin: Option<[f64; 3]> = LENGTHS, Without("the volume is centred on both"), [],
        "Centre of the first voxel from the axis of rotation and the optical axis";
    centre: Option<Centre> = CENTRE, Without("from geometry.json or the scene"), [],
        "Column of the axis of rotation, counted from 0 at the centre of the first, with a fraction; if views move the sample, of the mean place of its origin; auto finds it from lines that views from both ends measure";
    format: VolumeFormat = choice::<VolumeFormat>("FORMAT", "VolumeFormat"), Usual("tiff"), [Program],
        "File format of the volumes";
    truth: bool = SWITCH, Without(""), [],
        "Add the scene on the same voxels (mu, delta, labels of objects), and the errors by object (errors.csv)";
    geometry: Option<PathBuf> = FILE.named("SCENE"), Without(""), [Program],
        "Scene file of a file of sinograms: angles, distances, pixels";
    set: Vec<String> = TEXTS, Without(""), [Program, Repeated, Needs(&["geometry"])],
        "Change a value of the geometry: key.path=value (may be repeated)";
    memory_limit: Option<u64> = MEMORY, Without("the sinograms and volumes, plus up to 1 GiB on the device"), [Program],
        "Most memory, host and device together, such as \"2 GiB\": slabs of fbp on the device become smaller; what does not fit is refused";
    overwrite: bool = SWITCH, Without(""), [Program], "Replace existing volumes";
    dry_run: bool = SWITCH, Without(""), [Program], "Print the grid, memory and time, and write nothing";
    json: bool = SWITCH, Without(""), [Program, Excludes(&["dry_run"])],
        "Print volume.json instead of a summary";
}

impl ReconstructArguments {
    /// The method with its options.
    #[must_use]
    pub fn method(&self) -> Method {
        let solver = match self.method {
            MethodName::Fbp => {
                return Method::Fbp(
                    FbpOptions::default()
                        .with_filter(self.filter)
                        .with_cut_off(self.cut_off)
                        .with_arm_passes(self.arm_passes)
                        .with_extrapolate(self.extrapolate),
                );
            }
            MethodName::Cgls => Solver::Cgls,
            MethodName::Sirt => Solver::Sirt,
            MethodName::Bb => Solver::Bb,
        };
        let options = IterativeOptions::default()
            .with_solver(solver)
            .with_iterations(self.iterations)
            .with_discrepancy(self.discrepancy)
            .with_non_negative(self.non_negative);
        Method::iterative(options, self.phase)
    }

    /// The plan of volumes of some quantities. The scene gives the energy of the beam; with the width of the curves
    /// of the flat, m of offset, the bias of δ by gradients of μ.
    ///
    /// # Errors
    /// [`Error::Argument`] for a grid that no view sees, and a correction of beam hardening
    /// without a scene or a volume of μ; errors of the spectrum and the material.
    pub fn plan(
        &self,
        quantities: Vec<Quantity>,
        geometry: &ScanGeometry,
        scene: Option<&Scene>,
        flat_width: Option<f64>,
    ) -> Result<VolumePlan> {
        let hardening = match (&self.beam_hardening, scene) {
            (None, _) => None,
            (Some(chosen), Some(scene)) => {
                Some(HardeningChoice::new(scene.clone(), &chosen.material, chosen.energy)?)
            }
            (Some(_), None) => {
                let found = "a geometry without its scene";
                let allowed = "a scene with a spectrum; of older images: retrieve again";
                return Err(Error::argument("beam_hardening", found, allowed));
            }
        };
        let plan = VolumePlan::new(quantities, self.grid().grid(geometry)?, self.method())
            .with_rings(self.rings)
            .with_keep_views(self.keep_views)
            .with_gradient_bias(self.bias(scene, flat_width))
            .with_beam(scene.and_then(|scene| BeamEnergy::of(scene).ok()))
            .with_beam_hardening(hardening)
            .with_mask(self.mask.clone())
            .with_start(self.start.clone());
        plan.check_hardening()?;
        Ok(plan)
    }

    /// Length of the bias of δ by gradients of μ, m, where the scene and the width of the curves give it.
    fn bias(&self, scene: Option<&Scene>, flat_width: Option<f64>) -> Option<f64> {
        let (scene, width) = (scene?, flat_width?);
        let has_masks = scene.sample_mask.is_some() && scene.detector_mask.is_some();
        if self.no_gradient_bias || !has_masks {
            return None;
        }
        gradient_bias(scene, width)
            .inspect_err(|error| log::warn!("delta is not corrected for gradients of mu: {error}"))
            .ok()
    }

    /// The voxels.
    #[must_use]
    pub fn grid(&self) -> GridChoice {
        GridChoice::default().with_voxel(self.voxel).with_size(self.size).with_origin(self.origin)
    }
}

/// Name of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MethodName {
    /// Filtered back-projection.
    #[default]
    Fbp,
    /// Conjugate gradients.
    Cgls,
    /// Simultaneous iterative reconstruction.
    Sirt,
    /// Gradient descent with the steps of Barzilai and Borwein.
    Bb,
}

impl Choice for MethodName {
    const CHOICES: &'static [Self] = &[Self::Fbp, Self::Cgls, Self::Sirt, Self::Bb];

    fn word(self) -> Word {
        let (name, help) = match self {
            Self::Fbp => ("fbp", "Filtered back-projection; FDK in cones"),
            Self::Cgls => ("cgls", "Conjugate gradients"),
            Self::Sirt => ("sirt", "Simultaneous iterative reconstruction; delta by --phase"),
            Self::Bb => ("bb", "Gradient descent with the steps of Barzilai and Borwein"),
        };
        Word { name, help }
    }
}

/// The axis of rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Centre {
    /// It is found in the sinograms.
    Auto,
    /// A column, counted from 0 at the centre of the first.
    Column(f64),
}

const CENTRE: Kind<Centre> =
    Kind::new("auto|PIXELS", "float | Literal[\"auto\"]", "a finite number, or auto", |given| {
        match given.text() {
            Some("auto") => Ok(Centre::Auto),
            _ => (FINITE.read)(given).map(Centre::Column),
        }
    })
    .in_python("float | Literal[\"auto\"]", "a column, counted from 0 with a fraction, or \"auto\"")
    .with_hyphens(Hyphens::Numbers);

/// Quantities; none: all that the images have.
const QUANTITIES: Kind<Vec<Quantity>> = choices(
    Kind::new("QUANTITY", "", "", |given| {
        let mut found = Vec::new();
        for word in words_of(given)? {
            match Quantity::ALL.into_iter().find(|quantity| quantity.name() == word) {
                Some(quantity) => found.push(quantity),
                None if word == "all" => return Ok(Vec::new()),
                None => return Err(Refusal::Form),
            }
        }
        Ok(found)
    }),
    || {
        let names = Quantity::ALL.map(Quantity::name).into_iter().chain(["all"]);
        names.map(|name| Word { name, help: "" }).collect()
    },
);

const MASK: Kind<VoxelMask> =
    Kind::new("SHAPE|FILE", "ArrayLike | str", "a shape or a file", |given| {
        Ok(given.text().ok_or(Refusal::Form)?.parse()?)
    })
    .in_python("ArrayLike | str", "bool, (z, y, x), or a shape");

const HARDENING: Kind<Hardening> = Kind::new(
    "MATERIAL[@ENERGY]",
    "str",
    "a material, or MATERIAL@ENERGY as in water@40keV",
    |given| {
        let text = given.text().ok_or(Refusal::Form)?;
        let (material, energy) = match text.split_once('@') {
            Some((material, energy)) => {
                (material, Some(beamlet_core::units::Dimension::Energy.parse(energy)?))
            }
            None => (text, None),
        };
        match material.trim() {
            "" => Err(Refusal::Form),
            material => Ok(Hardening { material: material.to_owned(), energy }),
        }
    },
);

const SIZES: Kind<[usize; 3]> =
    Kind::new("X,Y,Z", "Sequence[int]", "three whole numbers above 0, as in 256,256,4", |given| {
        numbers_of(given, 1)
    })
    .in_python("Sequence[int]", "three whole numbers of 1 or more, along x, y and z");

const LENGTHS: Kind<[f64; 3]> =
    Kind::new("X,Y,Z", "Lengths", "three lengths, as in '-2 mm, -2 mm, 0 mm'", |given| {
        let items = given.items().ok_or(Refusal::Form)?;
        let lengths: Vec<f64> =
            items.iter().map(any_length).collect::<std::result::Result<_, _>>()?;
        lengths.try_into().map_err(|_| Refusal::Form)
    })
    .in_python("Lengths", "three lengths along x, y and z: numbers in m, or texts with a unit")
    .with_hyphens(Hyphens::Texts);
