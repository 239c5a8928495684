//! Errors of ray optics at the objects of a sample.

use super::sizes::{self, Sizes};
use super::{ObjectLimits, SetUp};
use beamlet_core::Result;
use beamlet_geometry::{ObjectSummary, Sample};
use beamlet_model::material;
use beamlet_model::optics::waves::{Bodies, Pixel};
use beamlet_model::scene::{Object, ShapeOrMesh};
use rayon::prelude::*;

/// Diameter from which on the dark field of a body is not estimated, m.
const LARGE: f64 = 300e-6;
/// Fill above which bodies are not independent.
const DENSE: f64 = 0.1;

/// Errors at the objects that the scene lists.
pub(super) fn of(set_up: &SetUp<'_>, sample: &Sample) -> Result<Vec<ObjectLimits>> {
    let unknown = match set_up.pixel() {
        None if set_up.unknown_light().is_none() => {
            Some("without a sample mask there is no illumination curve".into())
        }
        _ => set_up.unknown_light(),
    };
    let first = usize::from(set_up.scene.region().is_some());
    let listed = first..set_up.scene.objects.len().min(sample.objects.len());
    let limits = |index: usize| {
        let (object, summary) = (&set_up.scene.objects[index], &sample.objects[index]);
        let sizes = Sizes::of(index, object, sample);
        let mut found = without_estimate(object, summary, &sizes);
        match (&unknown, set_up.pixel()) {
            (Some(reason), _) => found.unknown.push(reason.clone()),
            (None, Some(pixel)) => {
                let hosts = hosts(set_up, index, summary)?;
                found.dark_field = dark_field(set_up, pixel, &sizes, &hosts);
                found.unknown = doubts(object, &sizes, &found);
            }
            (None, None) => {}
        }
        Ok(found)
    };
    listed.into_par_iter().map(limits).collect()
}

fn without_estimate(object: &Object, summary: &ObjectSummary, sizes: &Sizes) -> ObjectLimits {
    ObjectLimits {
        name: summary.name.clone(),
        diameters: sizes.diameters(),
        round: matches!(sizes, Sizes::Round(..)),
        dark_field: None,
        fill: sizes::fill(summary),
        rough: object.roughness > 0.0,
        unknown: Vec::new(),
    }
}

/// Least and greatest dark field by waves over rays, of all forms of the bodies and materials around them; `None`
/// where one is unknown.
fn dark_field(
    set_up: &SetUp<'_>,
    pixel: &Pixel,
    sizes: &Sizes,
    hosts: &[Vec<f64>],
) -> Option<[f64; 2]> {
    sizes.diameters().filter(|[least, _]| *least < LARGE)?;
    let forms = sizes.forms();
    let pairs = hosts.iter().flat_map(|delta| forms.iter().map(move |form| (delta, *form)));
    let ratio = |(delta, (form, sizes)): (&Vec<f64>, _)| {
        Bodies { form, sizes, delta }.ratio(pixel, &set_up.nodes)
    };
    let ratios: Vec<f64> = pairs.map(ratio).collect::<Option<_>>()?;
    let least = ratios.iter().copied().reduce(f64::min)?;
    Some([least, ratios.into_iter().fold(least, f64::max)])
}

/// Reasons why the dark field is unknown or may not hold.
fn doubts(object: &Object, sizes: &Sizes, found: &ObjectLimits) -> Vec<String> {
    if let Sizes::Unknown(reason) = sizes {
        return vec![reason.clone()];
    }
    if found.dark_field.is_none() {
        let is_small = found.diameters.is_some_and(|[least, _]| least < LARGE);
        let reason = "its material refracts as the material around it does";
        return is_small.then(|| reason.into()).into_iter().collect();
    }
    let mut doubts = Vec::new();
    let has_neighbours =
        object.instances.is_some() || matches!(object.geometry, ShapeOrMesh::Mesh(_));
    if found.fill > DENSE && has_neighbours {
        doubts.push(format!(
            "bodies fill {:.0} % of their box: above {:.0} % they are not independent, as the estimate of the \
             dark field assumes",
            100.0 * found.fill,
            100.0 * DENSE
        ));
    }
    if matches!(object.geometry, ShapeOrMesh::Mesh(_)) {
        doubts.push("the surface of the mesh counts as smooth and round".into());
    }
    doubts
}

/// Differences of delta of an object to each material around it, by energy node.
fn hosts(set_up: &SetUp<'_>, index: usize, summary: &ObjectSummary) -> Result<Vec<Vec<f64>>> {
    let scene = set_up.scene;
    let deltas = |name: &str, key: &str| -> Result<Vec<f64>> {
        let of = |(energy, ..): &(f64, f64, [f64; 2])| {
            Ok(material::constants_at_for(scene, name, *energy, key)?.delta)
        };
        set_up.nodes.iter().map(of).collect()
    };
    let of_object =
        |index: usize| deltas(&scene.objects[index].material, &scene.object_key(index, "material"));
    let own = of_object(index)?;
    let difference = |host: &Option<u32>| -> Result<Vec<f64>> {
        let around = match host {
            Some(host) => of_object(*host as usize)?,
            None => deltas(&scene.surroundings, scene.surroundings_key())?,
        };
        Ok(own.iter().zip(around).map(|(a, b)| a - b).collect())
    };
    summary.inside.iter().map(difference).collect()
}
