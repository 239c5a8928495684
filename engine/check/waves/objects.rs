//! Errors of ray optics at the objects of a sample.

use super::estimates::{Estimates, Subject};
use super::sizes::{self, Sizes};
use super::{ObjectLimits, SetUp};
use beamlet_core::Result;
use beamlet_geometry::{ObjectSummary, Sample};
use beamlet_model::material::{self, Constants};
use beamlet_model::scene::{Object, ShapeOrMesh};

/// Diameter from which on the dark field of a body is not estimated, m.
const LARGE: f64 = 300e-6;
/// Fill above which bodies are not independent.
const DENSE: f64 = 0.1;

/// Errors at the objects that the scene lists.
pub(super) fn of(set_up: &SetUp<'_>, sample: &Sample) -> Result<Vec<ObjectLimits>> {
    let scene = set_up.scene;
    let all = scene.objects.iter().zip(&sample.objects).enumerate();
    let listed = || all.clone().skip(usize::from(scene.region().is_some()));
    let subject = |(index, (object, summary))| -> Result<Subject<'_>> {
        let sizes = Sizes::of(index, object, sample);
        let least = match &sizes {
            Sizes::Unknown(width, _) => *width,
            _ => sizes.diameters().map(|[least, _]| least),
        };
        let has_dark_field = least.is_some_and(|least| least < LARGE);
        Ok(Subject { summary, sizes, hosts: hosts(set_up, index, summary)?, has_dark_field })
    };
    let subjects: Vec<Subject<'_>> = listed().map(subject).collect::<Result<_>>()?;
    let unknown = set_up.unknown_light();
    let mut estimates = set_up
        .pixel()
        .filter(|_| unknown.is_none())
        .map(|it| Estimates::new(set_up, it, &subjects));
    let mut limits = Vec::new();
    for ((_, (object, _)), subject) in listed().zip(&subjects) {
        let mut found = without_estimate(object, subject);
        match (&unknown, &mut estimates) {
            (Some(reason), _) => found.unknown.push(reason.clone()),
            (None, None) => {
                let reason = "without a sample mask there is no illumination curve";
                found.unknown.push(reason.into());
            }
            (None, Some(estimates)) => add_estimate(object, subject, estimates, &mut found),
        }
        limits.push(found);
    }
    Ok(limits)
}

fn without_estimate(object: &Object, subject: &Subject<'_>) -> ObjectLimits {
    ObjectLimits {
        name: subject.summary.name.clone(),
        diameters: subject.sizes.diameters(),
        round: matches!(subject.sizes, Sizes::Round(..)),
        rim: None,
        dark_field: None,
        fitted_dark_field: None,
        fill: sizes::fill(subject.summary),
        rough: object.roughness > 0.0,
        unknown: Vec::new(),
    }
}

/// Adds the estimate of an object, with the reasons why numbers are unknown or may not hold.
fn add_estimate<'a>(
    object: &Object,
    subject: &Subject<'a>,
    estimates: &mut Estimates<'a>,
    found: &mut ObjectLimits,
) {
    let (estimate, other) = estimates.of(subject);
    found.rim = estimate.rim;
    found.dark_field = estimate.dark_field;
    found.fitted_dark_field = estimate.fitted_dark_field;
    let unknown = &mut found.unknown;
    let is_known = match &subject.sizes {
        Sizes::Unknown(_, reason) => {
            unknown.push(reason.clone());
            false
        }
        _ => true,
    };
    unknown.extend(no_rim(&subject.sizes).filter(|_| found.rim.is_none()).map(Into::into));
    if is_known && subject.has_dark_field && found.dark_field.is_none() {
        unknown.push("its material refracts as the material around it does".into());
    }
    if found.fill > DENSE && found.dark_field.is_some() {
        unknown.push(format!(
            "bodies fill {:.0} % of their box: above {:.0} % they are not independent, as the estimate of the \
             dark field assumes",
            100.0 * found.fill,
            100.0 * DENSE
        ));
    }
    if matches!(object.geometry, ShapeOrMesh::Mesh(_)) && found.dark_field.is_some() {
        unknown.push("the surface of the mesh counts as smooth and round".into());
    }
    if let Some(other) = other {
        unknown.push(format!("estimated for the bodies of \"{other}\", of nearly the same size"));
    }
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

/// Reason why the error at rims is unknown, where none has been stated.
const fn no_rim(sizes: &Sizes) -> Option<&'static str> {
    match sizes {
        Sizes::Round(..) => Some("the spot is too small for an estimate at rims"),
        Sizes::Between(..) => Some("rims are estimated for round bodies only"),
        Sizes::Unknown(..) => None,
    }
}
