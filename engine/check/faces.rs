//! Doubts about scans with views in which flat faces of objects are along the beam.

use beamlet_core::numbers::whole;
use beamlet_core::printed::number;
use beamlet_geometry::Sample;
use beamlet_model::scene::{Motion, Scene};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Angle between a face and the beam below which its refraction is lost, rad: δ/angle leaves the curve, or light is
/// reflected totally.
const ALONG: f64 = 5e-3;
/// Bins of the azimuth of faces, 1 mrad each.
const BINS: usize = 6283;
/// Angles of a scan for volumes.
const LEAST: usize = 8;
/// Least share of the refraction of an object in a view whose loss counts. A facet of a cylinder of 32 has 6 %.
const SHARE: f64 = 0.2;
/// Least mean share over the views.
const MEAN: f64 = 5e-3;
/// Most facets that are looked at, places included.
const MOST: u64 = 20_000_000;
/// Shifts of the angles that are tried, in steps.
const SHIFTS: [f64; 4] = [0.5, 0.25, 0.75, 0.375];
/// Views and objects that a text names.
const NAMED: usize = 8;

/// The doubt about views along faces; none in scans that tilt the sample, and in scans of few angles.
pub(super) fn doubts(scene: &Scene, sample: &Sample) -> Option<String> {
    let motions = motions(scene);
    let is_scan = motions.len() >= LEAST && motions.iter().all(Motion::keeps_upright);
    if !is_scan || sample.triangles_as_meshes() > MOST {
        return None;
    }
    let faces = Faces::of(scene, sample);
    let azimuths: Vec<f64> = motions.iter().map(|motion| azimuth(scene, motion)).collect();
    let along = |shift: f64| -> Vec<f64> {
        azimuths.iter().map(|azimuth| faces.share(azimuth + shift)).collect()
    };
    let mean = |shares: &[f64]| shares.iter().sum::<f64>() / shares.len() as f64;
    let shares = along(0.0);
    if mean(&shares) < MEAN {
        return None;
    }
    let step = step(&scene.scan.angles)?;
    let shift = SHIFTS.into_iter().find(|shift| mean(&along(shift * step)) < 0.5 * mean(&shares));
    let views: Vec<usize> = (0..shares.len()).filter(|view| shares[*view] > 0.0).collect();
    let names = faces.names(views.iter().map(|view| azimuths[*view]));
    let remedy = shift.map_or(String::new(), |shift| remedy(&scene.scan.angles, shift, step));
    Some(format!(
        "flat faces of {} are within {} mrad of the beam at {}: their refraction is lost in these views, and \
         `reconstruct` leaves them out of delta{remedy}",
        list(names.iter().map(|name| format!("\"{name}\"")), names.len()),
        number(ALONG * 1e3),
        list(
            views
                .iter()
                .map(|view| format!("{} deg", number(scene.scan.angles[*view].to_degrees()))),
            views.len()
        ),
    ))
}

/// Shares of the refraction of objects that flat faces have, by the azimuth of the sample in which they are along the
/// beam.
struct Faces {
    /// Name of each object, and shares by bin.
    objects: Vec<(String, Vec<f64>)>,
}

impl Faces {
    fn of(scene: &Scene, sample: &Sample) -> Self {
        let mut objects: Vec<(String, Vec<f64>)> =
            sample.objects.iter().map(|it| (it.name.clone(), vec![0.0; BINS])).collect();
        let reach = scene.field_of_view()[0] / 2.0;
        let mut add = |component: u32, corners: [DVec3; 3]| {
            let body = &sample.components[component as usize];
            let object = body.object as usize;
            let summary = &sample.objects[object];
            let [low, high] = body.bounds.map(DVec3::from_array);
            let face = Face { corners, middle: low.midpoint(high).truncate() };
            let Some((keys, moment)) = face.moment(scene.source.distance, reach) else { return };
            for key in keys {
                objects[object].1[bin(key)] += moment / summary.volume.abs();
            }
        };
        for (triangle, component) in sample.triangles.iter().zip(&sample.triangle_component) {
            let corner = |vertex: u32| DVec3::from_array(sample.vertices[vertex as usize]);
            add(*component, triangle.map(corner));
        }
        for placed in &sample.placed {
            let prototype = &sample.prototypes[placed.prototype as usize];
            for (triangle, component) in prototype.triangle_component.iter().enumerate() {
                let corners = prototype.corners(triangle);
                let corners = corners.map(|corner| placed.place.world_from_own(corner));
                add(placed.component + component, corners);
            }
        }
        // The region that the surroundings fill has no edges in the field.
        let medium = usize::from(scene.region().is_some());
        Self { objects: objects.split_off(medium.min(objects.len())) }
    }

    /// Largest share of an object along the beam at an azimuth of the sample; 0 below the least that counts.
    fn share(&self, azimuth: f64) -> f64 {
        let share = |object: &(String, Vec<f64>)| share(&object.1, azimuth);
        self.objects.iter().map(share).fold(0.0, f64::max)
    }

    /// Names of the objects with faces along the beam at some azimuths.
    fn names(&self, azimuths: impl Iterator<Item = f64> + Clone) -> Vec<&str> {
        let has =
            |of: &&(String, Vec<f64>)| azimuths.clone().any(|azimuth| share(&of.1, azimuth) > 0.0);
        self.objects.iter().filter(has).map(|(name, _)| name.as_str()).collect()
    }
}

/// Sum of the bins along the beam, 0 below the least that counts.
fn share(bins: &[f64], azimuth: f64) -> f64 {
    let reach = whole::<usize>((ALONG / TAU * BINS as f64).round());
    let first = bin(azimuth) + BINS - reach;
    let sum = (first..=first + 2 * reach).map(|at| bins[at % BINS]).sum::<f64>();
    if sum < SHARE { 0.0 } else { sum.min(1.0) }
}

fn bin(azimuth: f64) -> usize {
    whole::<usize>(azimuth.rem_euclid(TAU) / TAU * BINS as f64).min(BINS - 1)
}

/// A facet, with the middle of its body from above.
struct Face {
    corners: [DVec3; 3],
    middle: DVec2,
}

impl Face {
    /// Azimuths of the sample at which its two sides are along the beam of a source at a distance, and its part of the
    /// moment of the refraction there, m³: all parts of an object sum to its volume. `None` for level facets,
    /// and beyond `reach` of the axis.
    fn moment(&self, source: f64, reach: f64) -> Option<([f64; 2], f64)> {
        let [a, b, c] = self.corners;
        let area = (0.5 * (b - a).cross(c - a)).truncate();
        let normal = area.try_normalize()?;
        let centre = ((a + b + c) / 3.0).truncate();
        let distance = normal.dot(centre);
        if distance.abs() > reach {
            return None;
        }
        // Rays through the facet are inclined by its distance from the optical axis.
        let (angle, fan) = (libm::atan2(normal.y, normal.x), distance / source);
        let moment = area.length() * normal.dot(centre - self.middle).abs();
        Some(([angle + fan, angle - fan + PI], moment))
    }
}

/// Motion of the sample at each angle, in the middle of its exposure.
fn motions(scene: &Scene) -> Vec<Motion> {
    let scan = &scene.scan;
    let each = scan.dithers_of_angle() * scan.poses_of_view();
    scene.poses().skip(scan.poses_of_view() / 2).step_by(each).collect()
}

/// Azimuth in the sample that is along +x of the set-up, turned by the inclination of rays beside the axis.
fn azimuth(scene: &Scene, motion: &Motion) -> f64 {
    let [x, y, _] = motion.direction([1.0, 0.0, 0.0]);
    -libm::atan2(y, x) - motion.offset().x / scene.source.distance
}

/// Median step of angles, rad; `None` where they are one.
fn step(angles: &[f64]) -> Option<f64> {
    let mut sorted = angles.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut steps: Vec<f64> = sorted.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().filter(|step| *step > 0.0)
}

/// Angles that avoid the faces, in words.
fn remedy(angles: &[f64], shift: f64, step: f64) -> String {
    let by = (shift * step).to_degrees();
    let part =
        if shift > 0.49 && shift < 0.51 { "half a step".into() } else { format!("{shift} steps") };
    let is_even = angles.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-6 * step);
    let range = match is_even {
        true => {
            let from = angles[0].to_degrees() + by;
            let to = from + step.to_degrees() * angles.len() as f64;
            format!(" (from = \"{} deg\", to = \"{} deg\")", number(from), number(to))
        }
        false => String::new(),
    };
    format!("; scan.angles later by {part}, {} deg, avoid them{range}", number(by))
}

/// The first few of some texts.
fn list(texts: impl Iterator<Item = String>, count: usize) -> String {
    let mut named: Vec<String> = texts.take(NAMED).collect();
    if count > NAMED {
        named.push(format!("… ({count} in all)"));
    }
    named.join(", ")
}
