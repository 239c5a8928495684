//! Summary of a scene, before hours are spent on it: geometry of the set-up, materials at the energy,
//! objects, clearance, and an estimate of the work.

use beamlet_core::Result;
use beamlet_files::{StackShape, ViewAngles};
use beamlet_geometry as geometry;
use beamlet_geometry::{Defects, LoadStep, ObjectSummary, Sample, Swept};
use beamlet_model::optics::{Mask, Optics, modulated};
use beamlet_model::scene::{Scene, Transport};
use beamlet_model::spectrum::{self, Nodes};
use beamlet_model::spot::SpotFit;
use beamlet_recon::retrieve::{RimError, rim_errors};
use beamlet_simulate::detector::{self, DetectorModel};
use beamlet_simulate::run;
use beamlet_simulate::run::memory::{self, MemoryEstimate};
use beamlet_simulate::run::{Control, EdgeBlur, RunEstimate};
use serde::Serialize;
use std::sync::Arc;

mod angles;
mod bodies;
mod builder;
mod costs;
pub(crate) mod display;
mod doubts;
mod estimate;
mod exposure;
mod faces;
mod illumination;
pub(crate) mod inputs;
mod machine;
mod materials;
mod two_directions;
mod waves;

pub use beamlet_model::microstructure::Description as CheckedMicrostructure;
pub use beamlet_simulate::detector::SubpixelGrid;
pub use builder::Check;
pub use costs::CheckedTolerances;
pub use exposure::{MaterialDose, ScanExposure};
pub(crate) use illumination::{DesignCurve, counting_options, design_curve, remove_counts};
pub use illumination::{ExpectedRetrieval, ExpectedUncertainty, IlluminationCurve};
pub use materials::Hardening;
use materials::materials;
pub use two_directions::PlanarUncertainty;
pub use waves::{FlatLimits, ObjectLimits, RayLimits, WaveCriteria, WaveTransport};

/// Summary of a scene. Lengths in metres, angles in radians.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckReport {
    /// Title of the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// The set-up.
    pub setup: Setup,
    /// The illumination curve; nothing without a device, or where a mask is missing.
    pub illumination: Option<IlluminationCurve>,
    /// Expected uncertainties of a retrieval in two directions; nothing without a device or photons, and behind slits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_two_directions: Option<PlanarUncertainty>,
    /// Photons, time and dose; nothing without photons.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure: Option<ScanExposure>,
    /// Errors of ray optics.
    pub ray_limits: RayLimits,
    /// Materials in use, the surroundings first.
    pub materials: Vec<Material>,
    /// Materials in use that have bodies.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub microstructures: Vec<CheckedMicrostructure>,
    /// Objects of the sample, in the order of the scene.
    pub objects: Vec<CheckedObject>,
    /// Error of edges off the rotation centre; `None` where there is none.
    pub edges: Option<EdgeBlur>,
    /// Cost of a run.
    pub work: Work,
    /// Findings that look odd but do not stop a run.
    pub warnings: Vec<String>,
    /// Why a run refuses objects, where it does.
    pub refusals: Vec<String>,
}

/// The set-up in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Setup {
    /// Photon energy, keV; for a spectrum the mean of the detected light that the masks modulate, without
    /// sample.
    pub energy: f64,
    /// Energy nodes; one where there is one energy.
    pub nodes: Nodes,
    /// Mask magnification M = analyser distance / sample mask distance.
    pub magnification: f64,
    /// Magnification of the rotation centre on the detector.
    pub object_magnification: f64,
    /// Rotation centre to analyser, m.
    pub lever_arm: f64,
    /// Full angle of the fan that reaches the detector, in x, rad.
    pub fan_angle: f64,
    /// Field of view in the plane of the rotation centre, x and z, m.
    pub field_of_view: [f64; 2],
    /// The focal spot.
    pub spot: CheckedSpot,
    /// Period and aperture of the sample mask, m.
    pub sample_mask: Option<[f64; 2]>,
    /// Period and aperture of the detector mask, m.
    pub detector_mask: Option<[f64; 2]>,
    /// Distances from the source that the sample sweeps over all views, nearest and farthest,
    /// m; `None` without a sample.
    pub swept: Option<[f64; 2]>,
    /// Objects that pass through the field of view along the slits in every view, such as upright rods.
    pub passing: Vec<String>,
    /// Distances from the source between which it may be: the faces of the masks that are
    /// there, or source and detector, m.
    #[serde(rename = "room")]
    pub clearance: [f64; 2],
    /// Shape of the stacks.
    pub extent: StackShape,
    /// Angles of the views.
    #[serde(flatten)]
    pub view_angles: ViewAngles,
    /// Where the detector blurs, the grid that takes the light.
    #[serde(rename = "light_grid")]
    pub subpixel_grid: Option<SubpixelGrid>,
}

/// The focal spot.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckedSpot {
    /// Full width at half maximum along x and z of the Gaussian with the spot's variance, m.
    pub fwhm: [f64; 2],
    /// Gaussians that it is the sum of.
    pub parts: usize,
    /// How they were made from an image or a profile, where they were.
    pub fit: Option<SpotFit>,
    /// Where they were and both masks are there: most that they change a flat, of open beam.
    pub curve_error: Option<f64>,
}

/// A material at the energy of the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Material {
    /// Name in the scene.
    pub name: String,
    /// Where it is used.
    pub used_by: Vec<String>,
    /// Linear attenuation coefficient, 1/m.
    pub mu: f64,
    /// Refractive index decrement.
    pub delta: f64,
    /// Critical angle of total reflection from vacuum, sqrt(2 delta), rad.
    pub critical_angle: f64,
    /// Variance of the refraction angle along one axis per path length, rad2/m; of a material with an axis across it.
    pub scattering: f64,
    /// The same along the axis of the material; without one it is `scattering`.
    pub scattering_along: f64,
    /// Its hardening under a spectrum; `None` at one energy, and without an object of it in one place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hardening: Option<Hardening>,
    /// True if an entry of the scene hides a built-in material of this name.
    pub shadows_builtin: bool,
}

/// An object of the sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckedObject {
    /// Name in the scene.
    pub name: String,
    /// Material name.
    pub material: String,
    /// Number of triangles; a mesh in many places counts once.
    pub triangles: usize,
    /// Number of its places; 0 without instances.
    pub instances: usize,
    /// Volume, m3; of whole exact shapes where others cross these, instances of one object too.
    pub volume: f64,
    /// Corners of its bounding box, m.
    pub bounds: [[f64; 3]; 2],
    /// Names of the objects that contain it; empty: none.
    pub inside: Vec<String>,
    /// Names of the later objects that overlap it, and win.
    pub cut_by: Vec<String>,
    /// SHA-256 of its mesh; empty for a shape.
    pub hash: String,
    /// Defects of its surface.
    pub defects: Defects,
}

/// Cost of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Work {
    /// Errors that sampling may leave.
    pub tolerances: CheckedTolerances,
    /// Rays and time, from a sparse look at the scene with the refinement of a run.
    pub estimate: Option<RunEstimate>,
    /// Why there is no estimate, where there is none.
    pub no_estimate: Option<String>,
    /// Memory at the peak and the bands that it allows.
    pub memory: MemoryEstimate,
    /// Bytes of the output on disk.
    pub output_bytes: u64,
}

/// The report without an estimate and without edges, the geometry, and the bound of its edges. `device`: its
/// kind.
fn load_lenient(
    scene: &Scene,
    memory_limit: Option<u64>,
    control: &mut Control<'_>,
) -> Result<(CheckReport, Sample, Option<EdgeBlur>)> {
    let extent = StackShape::of(scene)?;
    let detector = DetectorModel::of(scene)?;
    if scene.sampling.transport == Transport::Wave {
        beamlet_simulate::wave::refuse_by_waves(scene)?;
    }
    let nodes = spectrum::nodes(scene)?;
    let modulated = modulated(scene, (&nodes.energies, &nodes.weights))?;
    let energy = nodes.energies.iter().zip(&modulated).map(|(energy, share)| energy * share).sum();
    let mut materials = materials(scene, energy)?;
    let with_bodies = materials.iter().filter_map(|material| {
        CheckedMicrostructure::of(scene, &material.name, energy).transpose()
    });
    let microstructures: Vec<CheckedMicrostructure> = with_bodies.collect::<Result<_>>()?;
    memory::check_before_loading(scene, memory_limit)?;
    let shared = Arc::new(scene.clone());
    let (sample, refusals) =
        run::watching(control.progress.as_deref_mut(), &control.cancel, |watcher| {
            geometry::load_lenient_watched(&shared, watcher)
        })?;
    let (sample, swept) = control.step(LoadStep::Clearance, move || {
        let swept = geometry::swept(&shared, &sample);
        swept.check_clearance(&shared, &sample).map(|()| (sample, swept))
    })??;
    let mut warnings = swept.fov_warnings(scene);
    warnings.extend(geometry::unit_warnings(scene, &sample));
    for material in materials.iter().filter(|material| material.shadows_builtin) {
        warnings.push(format!("materials.{} hides the built-in material", material.name));
    }
    warnings.extend(microstructures.iter().flat_map(CheckedMicrostructure::warnings));
    warnings.extend(scene.source.spot.warnings());
    warnings.extend(scene.middle_line_warning());
    warnings.extend(detector::offset_warning(scene));
    for object in &sample.objects {
        warnings.extend(object.warnings.iter().map(|text| format!("{}: {text}", object.name)));
    }
    if scene.listed_objects().is_empty() {
        warnings.push("the scene has no objects: the sample stack will equal the flat".into());
    }
    materials::add_hardening(&mut materials, scene, &sample, (&nodes.energies, &modulated))?;
    let ray_limits = RayLimits::of(scene, &sample)?;
    let mut report = CheckReport {
        title: scene.title.clone(),
        setup: setup(scene, &swept, extent, nodes, energy, &detector),
        illumination: None,
        in_two_directions: None,
        exposure: scene
            .detector
            .counts
            .map(|counts| ScanExposure::of(scene, &counts))
            .transpose()?,
        ray_limits,
        edges: None,
        work: Work {
            tolerances: costs::tolerances(scene)?,
            estimate: None,
            no_estimate: None,
            memory: memory::estimate(scene, &sample.objects, memory_limit, None)?,
            output_bytes: extent.output_bytes(scene),
        },
        materials,
        microstructures,
        objects: objects(scene, &sample),
        warnings,
        refusals: refusals.iter().map(ToString::to_string).collect(),
    };
    let of_machine = machine::warnings(&report.work);
    report.warnings.splice(0..0, of_machine);
    report.warnings.extend(doubts::doubts(scene, &sample, &report));
    let kinks = beamlet_simulate::wave::facet_kinks(scene, &sample)?;
    report.warnings.extend(kinks.iter().map(ToString::to_string));
    report.warnings.extend(costs::warnings(scene, &report));
    report.warnings.extend(bodies::advice(scene, &report.objects, energy)?);
    let edges = run::edge_blur::bounded(scene, &swept);
    Ok((report, sample, edges))
}

impl CheckReport {
    /// Adds doubts about the masks and the offsets of the scan.
    fn add_doubts_of_scan(&mut self, scene: &Scene) -> Result<()> {
        let curve = self.illumination.as_ref();
        self.warnings.extend(illumination::warnings(scene, &self.setup.nodes, curve)?);
        Ok(())
    }

    /// Adds what holds of most set-ups, behind all others.
    fn add_usual(&mut self, scene: &Scene) {
        self.warnings.extend(rim_errors(scene).iter().map(RimError::warning));
        self.warnings.extend(self.ray_limits.warning());
    }

    /// Adds tolerances far below the noise, with the time that a run takes without them where `seconds` gives
    /// it.
    fn add_needless(
        &mut self,
        scene: &Scene,
        seconds: impl FnOnce(&Scene) -> Result<Option<f64>>,
    ) -> Result<()> {
        let of = self.work.tolerances;
        if let Some(faster) = costs::by_noise(scene, &of)? {
            let instead = (faster.sampling.tolerances(), seconds(&faster)?);
            self.warnings.extend(costs::needless(scene, &of, instead));
        }
        Ok(())
    }

    /// Takes the error of edges off the rotation centre, with its warning.
    fn add_edges(&mut self, scene: &Scene, edges: Option<&EdgeBlur>) {
        self.warnings.extend(edges.and_then(|it| it.warning(scene.sampling.tolerances().light)));
        self.edges = edges.cloned();
    }
}

fn setup(
    scene: &Scene,
    swept: &Swept,
    extent: StackShape,
    nodes: Nodes,
    energy: f64,
    detector: &DetectorModel,
) -> Setup {
    let reach = (0..scene.scan.poses()).flat_map(|view| swept.extents(view)).fold(
        None,
        |reach: Option<[f64; 2]>, extent| {
            let [low, high] = extent.y.map(|y| scene.source.distance + y);
            Some(reach.map_or([low, high], |[a, b]| [a.min(low), b.max(high)]))
        },
    );
    let optics = Optics::of(scene);
    let openings = |mask: &Mask| mask.without_shifts(mask.distance());
    let mask = |mask: &Option<Mask>| {
        let openings = mask.as_ref().map(openings);
        openings.map(|openings| [openings.period[0], openings.narrowest(0)])
    };
    Setup {
        energy,
        nodes,
        magnification: scene.magnification(),
        object_magnification: scene.detector.distance / scene.axis_distance(),
        lever_arm: scene.lever_arm(),
        fan_angle: scene.fan_angle(),
        field_of_view: scene.field_of_view(),
        spot: spot(scene, &optics),
        sample_mask: mask(&optics.sample_mask),
        detector_mask: mask(&optics.detector_mask),
        swept: reach,
        passing: swept.passing(scene),
        clearance: scene.clearance().map(|(distance, _)| distance),
        extent,
        view_angles: ViewAngles::of(scene),
        subpixel_grid: scene.detector.blur.as_ref().map(|_| *detector.grid()),
    }
}

fn spot(scene: &Scene, optics: &Optics) -> CheckedSpot {
    let spot = &scene.source.spot;
    let fit = spot.fit().cloned();
    // The overlap of two apertures changes by as much per metre of source, and has four kinks.
    let slope =
        optics.detector_mask.as_ref().filter(|_| optics.sample_mask.is_some()).map(|mask| {
            (scene.magnification() - 1.0) / mask.without_shifts(mask.distance()).period[0]
        });
    CheckedSpot {
        fwhm: spot.fwhm(),
        parts: spot.parts().len(),
        curve_error: fit.as_ref().zip(slope).map(|(fit, slope)| 2.0 * slope * fit.error),
        fit,
    }
}

fn objects(scene: &Scene, sample: &Sample) -> Vec<CheckedObject> {
    let names = |objects: &mut dyn Iterator<Item = u32>| {
        let mut names: Vec<String> = Vec::new();
        for object in objects {
            let name = scene.objects.get(object as usize).map(|object| object.name.clone());
            names.extend(name.filter(|name| !names.contains(name)));
        }
        names
    };
    let winners = |object: usize| {
        let own = sample.overlaps.iter().filter(move |it| it[0] as usize == object);
        own.map(|it| it[1])
    };
    let checked = |(index, summary): (usize, &ObjectSummary)| CheckedObject {
        name: summary.name.clone(),
        material: scene.objects.get(index).map(|o| o.material.clone()).unwrap_or_default(),
        triangles: summary.triangles,
        instances: summary.instances,
        volume: summary.volume,
        bounds: summary.bounds,
        inside: names(&mut summary.inside.iter().flatten().copied()),
        cut_by: names(&mut winners(index)),
        hash: summary.hash.clone(),
        defects: summary.defects.clone(),
    };
    sample.objects.iter().enumerate().map(checked).collect()
}
