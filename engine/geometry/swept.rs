//! Volume that the sample sweeps over the views: whether it clears the masks and fits the detector.

mod outline;

use super::Sample;
use super::sizes::unit_doubt;
use beamlet_core::error::{Error, Result};
use beamlet_model::scene::{Motion, Object, Scene, ShapeOrMesh};
use outline::{Seen, UprightOutline};
use rayon::prelude::*;

/// Outlines of the objects of a sample, enough for their extents in the views of a scan.
#[derive(Debug, Clone)]
pub struct Swept {
    names: Vec<String>,
    motions: Vec<Motion>,
    /// Source to rotation centre, m.
    source: f64,
    outlines: Outlines,
}

#[derive(Debug, Clone)]
enum Outlines {
    /// Outlines by object, where every view keeps +z.
    Upright(Vec<UprightOutline>),
    /// `[view][object]`.
    Seen(Vec<Vec<Seen>>),
}

/// Extent of an object in the beam frame of one view, m from the rotation centre.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct BeamExtent {
    /// Along the beam, source to detector.
    pub y: [f64; 2],
    /// Across the slits.
    pub x: [f64; 2],
    /// Along the slits.
    pub z: [f64; 2],
}

/// The outlines of the objects of a sample, for the views of a scene: in fly scans for each pose, the
/// poses of a view one after the other.
pub fn swept(scene: &Scene, sample: &Sample) -> Swept {
    let motions: Vec<Motion> = scene.poses().collect();
    let source = scene.source.distance;
    let outlines = match motions.iter().all(Motion::keeps_upright) {
        true => Outlines::Upright(outline::upright(sample)),
        false => {
            let seen = |motion| outline::seen(sample, motion, source);
            Outlines::Seen(motions.par_iter().map(seen).collect())
        }
    };
    let names = sample.objects.iter().map(|object| object.name.clone()).collect();
    Swept { names, motions, source, outlines }
}

impl Swept {
    /// Extent of each object in the view of this index, in the order of the objects.
    pub fn extents(&self, view: usize) -> impl Iterator<Item = BeamExtent> {
        (0..self.names.len()).map(move |object| self.seen(view, object).extent)
    }

    fn seen(&self, view: usize, object: usize) -> Seen {
        match &self.outlines {
            Outlines::Upright(outlines) => outlines[object].seen(&self.motions[view], self.source),
            Outlines::Seen(views) => views[view][object],
        }
    }

    /// Upper bound of y of an object in any view, m.
    fn far(&self, object: usize) -> f64 {
        match &self.outlines {
            Outlines::Upright(outlines) => {
                let offset = |motion: &Motion| motion.offset().y;
                outlines[object].far() + self.motions.iter().map(offset).fold(0.0, f64::max)
            }
            Outlines::Seen(views) => {
                views.iter().map(|view| view[object].extent.y[1]).fold(0.0, f64::max)
            }
        }
    }

    fn views(&self) -> std::ops::Range<usize> {
        0..self.motions.len()
    }
}

/// Checks that no object reaches a mask in any view; where a mask is missing, the source or
/// the detector.
///
/// # Errors
/// The first object that does, with the angle and the distances.
pub fn check_clearance(scene: &Scene, sample: &Sample) -> Result<()> {
    swept(scene, sample).check_clearance(scene, sample)
}

/// A body that passes through the field along the slits reaches at most this many times as far as the
/// longer side of the detector.
const PASSING: f64 = 4.0;

impl Swept {
    /// As [`check_clearance`], of the sample that this is of.
    ///
    /// # Errors
    /// The same.
    pub fn check_clearance(&self, scene: &Scene, sample: &Sample) -> Result<()> {
        let [(near, near_name), (far, far_name)] = scene.clearance();
        // A unit that is wrong makes most samples too large.
        let doubt = |number: usize| {
            let (object, summary) = scene.objects.get(number).zip(sample.objects.get(number))?;
            Some(format!("; it {}", unit_doubt(scene, object, summary)?))
        };
        for view in self.views() {
            for (number, extent) in self.extents(view).enumerate() {
                let [first, last] = extent.y.map(|y| scene.source.distance + y);
                if first > near && last < far {
                    continue;
                }
                let (side, wall) =
                    if first > near { ("back", far_name) } else { ("front", near_name) };
                return Err(Error::scene(
                    scene.object_key(number, ""),
                    format!(
                        "\"{}\", {}, from {:.6} m to {:.6} m from the source: its {side} touches or passes {wall}",
                        self.names[number],
                        at(scene, view),
                        first,
                        last
                    ),
                    format!(
                        "from {near:.6} m ({near_name}) to {far:.6} m ({far_name}){}",
                        doubt(number).unwrap_or_default()
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Numbers of the objects, without the region that the surroundings fill: that is as wide as it is,
    /// and has no edges in the field.
    fn listed(&self, scene: &Scene) -> std::ops::Range<usize> {
        usize::from(scene.region().is_some())..self.names.len()
    }

    /// Name and extent of each object in a view, without the region that the surroundings fill.
    #[doc(hidden)]
    pub fn extents_of_objects(
        &self,
        scene: &Scene,
        view: usize,
    ) -> impl Iterator<Item = (&str, BeamExtent)> {
        self.listed(scene).map(move |it| (&*self.names[it], self.seen(view, it).extent))
    }

    /// Parts of the sample that may lie outside the field of view, in words; at most one sentence for
    /// each object and direction. Objects of [`Self::passing`] are ignored along the slits.
    #[must_use]
    pub fn fov_warnings(&self, scene: &Scene) -> Vec<String> {
        let half = scene.detector.size().map(|side| side / 2.0);
        let mut warnings = Vec::new();
        for object in self.listed(scene) {
            let name = &self.names[object];
            let is_mesh = |o: &&Object| matches!(o.geometry, ShapeOrMesh::Mesh(_));
            let mesh = scene.objects.iter().filter(is_mesh).find(|it| it.name == *name);
            let Reach { worst, passes, outside } = self.reach(scene, object);
            let ends = worst.into_iter().zip(half).zip(["x", "z"]).zip(outside);
            for ((((reach, view), half), axis), outside) in ends {
                if reach > half && !(axis == "z" && passes) {
                    let lies = if outside { "lies in all views" } else { "reaches" };
                    let is_off = mesh.map(|it| outside && !it.placement.center);
                    let doubt = match is_off {
                        Some(true) => {
                            "`center = true` puts a mesh on the axis; is its `unit` (or `scale`) the right one"
                        }
                        Some(false) => "is its `unit` (or `scale`) the right one",
                        None => "are its size and place the right ones",
                    };
                    warnings.push(format!(
                        "\"{name}\" {lies} outside the field of view: {:.3} mm from the centre of the \
                         detector in {axis} {}, where the detector ends at {:.3} mm; if it should not, \
                         {doubt}?",
                        reach * 1e3,
                        at(scene, view),
                        half * 1e3,
                    ));
                }
            }
        }
        warnings
    }

    /// Names of the objects that pass through the field of view along the slits in every view, such as
    /// fibres and upright rods: nothing changes along them.
    #[must_use]
    pub fn passing(&self, scene: &Scene) -> Vec<String> {
        let passing = self.listed(scene).filter(|object| self.reach(scene, *object).passes);
        passing.map(|object| self.names[object].clone()).collect()
    }

    fn reach(&self, scene: &Scene, object: usize) -> Reach {
        let half = scene.detector.size().map(|side| side / 2.0);
        let mut worst = [(0.0, 0); 2];
        let least = scene.detector.distance / (scene.source.distance + self.far(object));
        let mut passes = true;
        let mut outside = [true; 2];
        for view in self.views() {
            let Seen { extent, slopes } = self.seen(view, object);
            for ((outside, ends), half) in outside.iter_mut().zip([extent.x, extent.z]).zip(half) {
                let [low, high] = ends.map(|end| end * least);
                *outside = *outside && (low > half || high < -half);
            }
            for (worst, slope) in worst.iter_mut().zip(slopes) {
                let reach = slope * scene.detector.distance;
                if reach > worst.0 {
                    *worst = (reach, view);
                }
            }
            let [low, high] = extent.z.map(|z| z * least);
            passes = passes && low < -half[1] && high > half[1];
        }
        // One that is many times as long as the detector is large has the wrong unit.
        let passes = passes && worst[1].0 < PASSING * half[0].max(half[1]);
        Reach { worst, passes, outside }
    }
}

/// How far an object reaches on the detector.
struct Reach {
    /// Greatest distance from the detector's centre in x and z over the views, m, and its view.
    worst: [(f64, usize); 2],
    /// True if it passes through the field along the slits in every view.
    passes: bool,
    /// Outside of the field in every view, in x and z.
    outside: [bool; 2],
}

/// The pose in words.
fn at(scene: &Scene, pose: usize) -> String {
    let angle = format!("at angle {:.3} deg", scene.scan.angle_of_pose(pose).to_degrees());
    let view = scene.scan.view_of(pose);
    match scene.scan.moves() {
        false => angle,
        true => format!("{angle}, moved as in view {view}"),
    }
}
