//! Shells of an object that lie in others: material, voids, or neither.
//!
//! A shell is oriented against the shells around it. One that faces inwards where there is material bounds
//! a void; one that faces outwards there is filled with the material, and has no effect. One that faces
//! inwards where there is no material is turned, with the shells in it.

use glam::DVec3;
use rayon::prelude::*;

use super::Component;
use super::search::{Search, winding_by_solid_angle};
use super::surface::{Surface, corners_of, encloses, in_mm};
use super::tree::Tree;

/// Points of a shell that must lie in another one: a part that pokes into another is not inside.
const POINTS: usize = 8;

/// Changes to the shells of an object.
#[derive(Debug)]
pub(super) struct Orientation {
    /// Shells to turn.
    pub(super) turned: Vec<bool>,
    /// Shells without effect.
    pub(crate) filled: Vec<bool>,
}

impl Orientation {
    /// The changes that `components` need; `around`: the shells that each lies in.
    pub(super) fn of(components: &[Component], around: &[Vec<u32>]) -> Self {
        let count = components.len();
        let mut order: Vec<usize> = (0..count).collect();
        let size = |it: &usize| components[*it].volume.abs();
        // The shells around a shell are larger.
        order.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.cmp(b)));
        let mut made = Self { turned: vec![false; count], filled: vec![false; count] };
        // Winding number inside, and whether that shell and those in it are turned.
        let mut inside = vec![(0_i32, false); count];
        for shell in order {
            let parent = around[shell]
                .iter()
                .map(|it| *it as usize)
                .min_by(|a, b| size(a).total_cmp(&size(b)));
            let (outside, mut is_turned) = parent.map_or((0, false), |it| inside[it]);
            let mut faces_out = (components[shell].volume > 0.0) != is_turned;
            if outside == 0 && !faces_out {
                (is_turned, faces_out) = (!is_turned, true);
            }
            let within = if faces_out { outside + 1 } else { outside - 1 };
            inside[shell] = (within, is_turned);
            made.filled[shell] = outside.min(within) > 0;
            made.turned[shell] = is_turned && !made.filled[shell];
        }
        made
    }

    /// The changes in words.
    pub(super) fn warnings(&self, components: &[Component]) -> Vec<String> {
        let all = components.len();
        let list = |of: &[bool]| (0..all).filter(|it| of[*it]).collect::<Vec<_>>();
        let first = |of: &[usize]| {
            let [low, high] = corners_of(&components[of[0]]);
            format!("(the first around {})", in_mm(low.midpoint(high)))
        };
        let (turned, filled) = (list(&self.turned), list(&self.filled));
        let holes: Vec<usize> =
            turned.iter().copied().filter(|it| components[*it].volume > 0.0).collect();
        let mut warnings = Vec::new();
        if !turned.is_empty() {
            let count = turned.len();
            let places = first(&turned);
            warnings.push(format!(
                "{count} of {all} parts were inside out and have been turned {places}"
            ));
        }
        if !holes.is_empty() {
            let (count, places) = (holes.len(), first(&holes));
            warnings.push(format!(
                "{count} of {all} parts became holes, since the parts around them were inside out \
                 {places}; to keep such a part as material make it an object of its own"
            ));
        }
        if !filled.is_empty() {
            let (count, places) = (filled.len(), first(&filled));
            warnings.push(format!(
                "{count} of {all} parts inside others are in their material by orientation and were \
                 filled: they are no holes {places}; for a hole turn the triangles of the part inwards, or make it \
                 an object of its own of the material \"vacuum\", listed later"
            ));
        }
        warnings
    }
}

/// The other components of the object that each component lies in; `of`: the component of each triangle.
pub(super) fn around(
    surface: &Surface,
    search: &mut Option<Search>,
    of: &[u32],
    components: &[Component],
) -> Vec<Vec<u32>> {
    if components.len() == 1 {
        return vec![Vec::new()];
    }
    let boxes: Vec<[DVec3; 2]> = components.iter().map(corners_of).collect();
    let tree = Tree::of_boxes(&boxes);
    let around: Vec<Vec<u32>> = components
        .par_iter()
        .map(|inner| {
            let mut around = Vec::new();
            let bounds = corners_of(inner);
            tree.around(bounds, |outer| {
                let volume = components[outer as usize].volume;
                if volume.abs() > inner.volume.abs() && encloses(boxes[outer as usize], bounds) {
                    around.push(outer);
                }
            });
            around.sort_unstable();
            around
        })
        .collect();
    if around.iter().all(Vec::is_empty) {
        return around;
    }
    let mut members = vec![Vec::new(); components.len()];
    for (triangle, component) in of.iter().enumerate() {
        members[*component as usize].push(triangle);
    }
    let search = search.get_or_insert_with(|| Search::new(surface));
    let contained = |inner: usize| {
        let mut outers = around[inner].clone();
        let triangles = &members[inner];
        for triangle in triangles.iter().step_by(triangles.len().div_ceil(POINTS)) {
            if outers.is_empty() {
                break;
            }
            let point = just_inside(surface.corners(*triangle), &components[inner]);
            match search.crossings(surface, point) {
                Some(hits) => {
                    let mut met: Vec<u32> =
                        hits.iter().map(|(triangle, _)| of[*triangle]).collect();
                    met.sort_unstable();
                    let odd = |outer: &u32| {
                        let first = met.partition_point(|it| it < outer);
                        met[first..].iter().take_while(|it| *it == outer).count() % 2 == 1
                    };
                    outers.retain(odd);
                }
                None => outers.retain(|outer| {
                    let shell = members[*outer as usize].iter().copied();
                    winding_by_solid_angle(surface, shell, point).abs() > 0.5
                }),
            }
        }
        outers
    };
    (0..components.len()).into_par_iter().map(contained).collect()
}

/// A point inside a shell, near the middle of one of its triangles: corners, edges and faces may lie on the shell
/// around it, and are neither inside nor outside of that.
fn just_inside([a, b, c]: [DVec3; 3], shell: &Component) -> DVec3 {
    /// Distance from the triangle as a share of the size of the shell: above rounding, below its walls.
    const DEPTH: f64 = 1e-6;
    let [low, high] = corners_of(shell);
    let outwards = (b - a).cross(c - a).normalize_or_zero() * shell.volume.signum();
    (a + b + c) / 3.0 - DEPTH * low.distance(high) * outwards
}
