//! Errors of ray optics at the objects of a sample.

use super::sizes::{self, Sizes};
use super::{ObjectLimits, SetUp};
use beamlet_core::Result;
use beamlet_geometry::{ObjectSummary, Sample};
use beamlet_model::material::{self, Constants};
use beamlet_model::optics::waves::{Bodies, Body, Form, Pixel, Rim};
use beamlet_model::scene::{Object, ShapeOrMesh};
use std::f64::consts::PI;

/// Diameter from which on the dark field of a body is not estimated, m.
const LARGE: f64 = 300e-6;
/// Fill above which bodies are not independent.
const DENSE: f64 = 0.1;

/// Errors at the objects that the scene lists.
pub(super) fn of(set_up: &SetUp<'_>, sample: &Sample) -> Result<Vec<ObjectLimits>> {
    let scene = set_up.scene;
    let all = scene.objects.iter().zip(&sample.objects).enumerate();
    let listed = all.skip(usize::from(scene.region().is_some()));
    listed
        .map(|(index, (object, summary))| limits(set_up, sample, (index, object), summary))
        .collect()
}

fn limits(
    set_up: &SetUp<'_>,
    sample: &Sample,
    (index, object): (usize, &Object),
    summary: &ObjectSummary,
) -> Result<ObjectLimits> {
    let sizes = Sizes::of(index, object, sample);
    let hosts = hosts(set_up, index, summary)?;
    let mut found = ObjectLimits {
        name: summary.name.clone(),
        diameters: sizes.diameters(),
        round: matches!(sizes, Sizes::Round(..)),
        rim: None,
        dark_field: None,
        fitted_dark_field: None,
        fill: sizes::fill(summary),
        rough: object.roughness > 0.0,
        unknown: Vec::new(),
    };
    if let Some(reason) = set_up.unknown_light() {
        found.unknown.push(reason);
        return Ok(found);
    }
    let Some(pixel) = set_up.pixel() else {
        found.unknown.push("without a sample mask there is no illumination curve".into());
        return Ok(found);
    };
    let least = match &sizes {
        Sizes::Unknown(width, reason) => {
            found.unknown.push(reason.clone());
            *width
        }
        _ => found.diameters.map(|[least, _]| least),
    };
    found.rim = rim(set_up, pixel, &sizes, &hosts);
    found.unknown.extend(no_rim(&sizes).filter(|_| found.rim.is_none()).map(Into::into));
    if least.is_some_and(|least| least < LARGE) {
        dark_field(set_up, pixel, (&sizes, summary), &hosts, &mut found);
        if found.fill > DENSE && found.dark_field.is_some() {
            found.unknown.push(format!(
                "bodies fill {:.0} % of their box: above {:.0} % they are not independent, as the estimate of the \
                 dark field assumes",
                100.0 * found.fill,
                100.0 * DENSE
            ));
        }
    }
    let is_mesh = matches!(object.geometry, ShapeOrMesh::Mesh(_));
    if is_mesh && found.dark_field.is_some() {
        found.unknown.push("the surface of the mesh counts as smooth and round".into());
    }
    Ok(found)
}

/// Differences of delta and of the attenuation coefficient of an object to each material around it, by energy
/// node.
fn hosts(set_up: &SetUp<'_>, index: usize, summary: &ObjectSummary) -> Result<Vec<Vec<[f64; 2]>>> {
    let scene = set_up.scene;
    let constants = |name: &str, key: &str| -> Result<Vec<Constants>> {
        let of = |(energy, ..): &(f64, f64, [f64; 2])| {
            material::constants_at_for(scene, name, *energy, key)
        };
        set_up.nodes.iter().map(of).collect()
    };
    let of_object = |index: usize| {
        constants(&scene.objects[index].material, &scene.object_key(index, "material"))
    };
    let own = of_object(index)?;
    let difference = |host: &Option<u32>| -> Result<Vec<[f64; 2]>> {
        let around = match host {
            Some(host) => of_object(*host as usize)?,
            None => constants(&scene.surroundings, scene.surroundings_key())?,
        };
        Ok(own.iter().zip(around).map(|(a, b)| [a.delta - b.delta, a.mu - b.mu]).collect())
    };
    summary.inside.iter().map(difference).collect()
}

/// Greatest error at a rim, of the largest bodies; `None` where they are not round.
fn rim(set_up: &SetUp<'_>, pixel: &Pixel, sizes: &Sizes, hosts: &[Vec<[f64; 2]>]) -> Option<f64> {
    let Sizes::Round(_, bodies) = sizes else { return None };
    let radius = bodies.iter().map(|body| body.radius).fold(0.0, f64::max);
    let of = |constants: &Vec<[f64; 2]>| {
        let rim = Rim { radius, constants: constants.clone() };
        rim.error(pixel, &set_up.nodes, &set_up.offsets)
    };
    hosts.iter().map(of).reduce(|a, b| Some(a?.max(b?)))?
}

/// Reason why the error at rims is unknown, where none has been stated.
const fn no_rim(sizes: &Sizes) -> Option<&'static str> {
    match sizes {
        Sizes::Round(..) => Some("the spot is too small for an estimate at rims"),
        Sizes::Between(..) => Some("rims are estimated for round bodies only"),
        Sizes::Unknown(..) => None,
    }
}

/// Dark field by waves over rays: all hosts, and both cylinders of other shapes.
fn dark_field(
    set_up: &SetUp<'_>,
    pixel: &Pixel,
    (sizes, summary): (&Sizes, &ObjectSummary),
    hosts: &[Vec<[f64; 2]>],
    found: &mut ObjectLimits,
) {
    let kinds = match sizes {
        Sizes::Round(form, bodies) => vec![(*form, bodies)],
        Sizes::Between(inscribed, enclosing) => {
            vec![(Form::Cylinder, inscribed), (Form::Cylinder, enclosing)]
        }
        Sizes::Unknown(..) => return,
    };
    let (mut ratios, mut fitted) = (Vec::new(), Vec::new());
    for constants in hosts {
        for (form, bodies) in &kinds {
            let bodies = Bodies {
                form: *form,
                sizes: (*bodies).clone(),
                delta: constants.iter().map(|[delta, _]| *delta).collect(),
                density: density(*form, bodies, summary),
            };
            ratios.push(bodies.ratio(pixel, &set_up.nodes));
            let fields = bodies.dark_fields(pixel, &set_up.nodes, &set_up.offsets);
            fitted.push(fields.filter(|[_, rays]| *rays > 0.0).map(|[waves, rays]| waves / rays));
        }
    }
    found.dark_field = range(&ratios);
    found.fitted_dark_field = range(&fitted);
    if found.dark_field.is_none() {
        found.unknown.push("its material refracts as the material around it does".into());
    }
}

/// Bodies across the beam: per length for cylinders, 1/m, and per area for spheres, 1/m², from the volume of an
/// object and the side of its box along the beam at rest.
fn density(form: Form, bodies: &[Body], summary: &ObjectSummary) -> f64 {
    let [low, high] = summary.bounds;
    let face = (high[0] - low[0]) * (high[2] - low[2]);
    let each = |body: &Body| {
        body.share
            * match form {
                Form::Cylinder => PI * body.radius.powi(2),
                Form::Sphere => 4.0 / 3.0 * PI * body.radius.powi(3),
            }
    };
    summary.volume / face / bodies.iter().map(each).sum::<f64>()
}

/// Least and greatest of some values; `None` where one is missing.
fn range(values: &[Option<f64>]) -> Option<[f64; 2]> {
    let known: Option<Vec<f64>> = values.iter().copied().collect();
    let known = known.filter(|known| !known.is_empty())?;
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    Some([low, known.into_iter().fold(f64::NEG_INFINITY, f64::max)])
}
