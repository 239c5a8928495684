//! Parts of one mesh that touch or overlap: they are one solid.
//!
//! CAD programs and modellers write assemblies as one file whose parts touch, share edges or contain each
//! other. Such a surface is split into closed shells (`shells`); it is sound if no shell passes through
//! itself (`folds`), and intersecting shells are united by booleans.

mod folds;
mod shells;

use std::sync::OnceLock;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::Component;
use super::body::{is_flat, measure, without_thin};
use super::defects::CrossingPair;
use super::overlap::{ClosedMesh, snap};
use super::search::{Search, winding_by_solid_angle};
use super::surface::{Surface, bounds_of, corners_of, encloses, in_mm};
use super::topology::{self, Edge, join, labels};
use super::tree::Tree;
use beamlet_core::error::{Error, Result};
use beamlet_core::numbers;
use beamlet_core::watch::{LoadStep, Task};

/// Points of a shell that are asked.
const POINTS: usize = 16;
/// Most facets of a shell that is looked at for being a sheet: all pairs of them are tried.
const MOST_OF_SHEET: usize = 5_000;

/// A surface whose parts are united.
pub(super) struct United {
    pub(crate) surface: Surface,
    /// Parts that touched others.
    pub(super) parts: usize,
    /// Parts among these that were inside out.
    pub(super) turned: usize,
}

/// A closed shell of the surface.
struct Shell {
    surface: Surface,
    bounds: [DVec3; 2],
    volume: f64,
    is_flat: bool,
    /// True if it touches, crosses or lies on another one.
    meets: bool,
    /// For a void: the shell that it is in.
    head: Option<u32>,
}

impl Shell {
    /// True if it is a sheet that is folded onto itself: each facet lies on one that looks the other
    /// way. One that passes through itself may have no volume, too.
    fn is_sheet(&self) -> bool {
        let count = self.surface.triangles.len();
        if !self.is_flat || count > MOST_OF_SHEET {
            return false;
        }
        let [low, high] = self.bounds;
        let near = 4.0 * f64::from(f32::EPSILON) * low.abs().max(high.abs()).max_element();
        let corners = |triangle: usize| self.surface.corners(triangle);
        let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).normalize_or_zero();
        (0..count).all(|triangle| {
            let (own, up) = (corners(triangle), normal(corners(triangle)));
            let middle = own.into_iter().sum::<DVec3>() / 3.0;
            let covers = |other: usize| {
                let [a, b, c] = corners(other);
                let down = normal([a, b, c]);
                let is_near = down.dot(middle - a).abs() <= near;
                up.dot(down) < -0.99 && is_near && is_over([a, b, c], down, middle)
            };
            (0..count).any(covers)
        })
    }
}

/// The surface with touching parts united; `crossing`: the pairs of its triangles that intersect or lie
/// on each other; `resolved`: the resolution of f32, m; `world`: from the file to its place. One shell that
/// touches itself, or is folded within planes, gets edges of two triangles each. `None` if that does not
/// help: it is not made of closed shells, one of them passes through itself, or the boolean refuses them.
///
/// # Errors
/// [`Error::Memory`]; [`Error::Interrupted`].
pub(super) fn united(
    surface: &Surface,
    edges: &[Edge],
    crossing: &[CrossingPair],
    (resolved, world): (f64, DAffine3),
    task: Task<'_>,
) -> Result<Option<United>> {
    // Where all of it is inside out it is turned first.
    let inside_out = measure(surface, &vec![0; surface.triangles.len()], 1, 0)[0].volume < 0.0;
    let whole;
    let (surface, edges) = if inside_out {
        let mut surface = surface.clone();
        turn(&mut surface);
        let edges = topology::edges(&surface);
        whole = (surface, edges);
        (&whole.0, whole.1.as_slice())
    } else {
        (surface, edges)
    };
    let Some(shells) = shells::shells(surface, edges, resolved) else { return Ok(None) };
    let (of, count) = (&shells.of, shells.count);
    let mut split = shells.split(surface, edges);
    let shell_of = |at: u32| of[at as usize];
    let own = |pair: &&CrossingPair| shell_of(pair.triangles[0]) == shell_of(pair.triangles[1]);
    if count < 2 {
        if !folds::enclose_nothing(&split, surface, crossing, resolved) {
            return Ok(None);
        }
        if inside_out {
            turn(&mut split);
        }
        return Ok(Some(United { surface: split, parts: 0, turned: 0 }));
    }
    // Numbers of the file are short: in its frame faces coincide that no longer do where they are
    // turned.
    let mut in_file = [split.mapped(world.inverse())];
    snap(&mut in_file);
    let mut all = taken_apart(&in_file[0], of, count);
    let mut folded: Vec<Vec<CrossingPair>> = vec![Vec::new(); all.len()];
    crossing.iter().filter(own).for_each(|it| folded[shell_of(it.triangles[0]) as usize].push(*it));
    let members = topology::members((of, count));
    let crosses_itself = |shell: usize| {
        let own = || split.part(&members[shell]);
        let folds = &folded[shell];
        !(folds.is_empty()
            || all[shell].is_sheet()
            || folds::enclose_nothing(&own(), surface, folds, resolved))
    };
    if (0..all.len()).any(crosses_itself) {
        return Ok(None);
    }
    let pairs = crossing.iter().map(|it| it.triangles.map(shell_of)).collect();
    let contacts = contacts(&all, pairs, edges, of);
    for shell in contacts.iter().flatten() {
        all[*shell as usize].meets = true;
    }
    let parts = all.iter().filter(|shell| shell.meets).count();
    find_heads(&mut all);
    let turned_here = turn_inside_out(&mut all);
    let turned = if inside_out { parts - turned_here } else { turned_here };
    let Some(whole) = joined(&all, &clusters(&all, &contacts), task)? else { return Ok(None) };
    Ok(Some(United { surface: whole.mapped(world), parts, turned }))
}

/// Pairs of shells with material that cross or touch, each once, the lower number first. `pairs`:
/// those whose triangles cross. `of`: the shell of each triangle.
fn contacts(all: &[Shell], pairs: Vec<[u32; 2]>, edges: &[Edge], of: &[u32]) -> Vec<[u32; 2]> {
    // Shells along one edge touch.
    let shared = edges.chunk_by(|a, b| a.key == b.key).filter(|group| group.len() > 2);
    let shared = shared.flat_map(|group| {
        let shell = |edge: &Edge| of[edge.triangle as usize];
        group.windows(2).map(move |pair| [shell(&pair[0]), shell(&pair[1])])
    });
    // A sheet that is folded onto itself has no material; bodies are made without it.
    let is_solid = |pair: &[u32; 2]| !pair.iter().any(|shell| all[*shell as usize].is_flat);
    let two_solids = |pair: &[u32; 2]| pair[0] != pair[1] && is_solid(pair);
    let mut contacts: Vec<[u32; 2]> = pairs.into_iter().chain(shared).filter(two_solids).collect();
    contacts.iter_mut().for_each(|pair| pair.sort_unstable());
    contacts.sort_unstable();
    contacts.dedup();
    contacts
}

/// Shells as one surface, each cluster united; `None` if that fails.
fn joined(all: &[Shell], clusters: &[Vec<u32>], task: Task<'_>) -> Result<Option<Surface>> {
    let covered = covered(all, clusters);
    task.begin(LoadStep::Cutting, clusters.len() as u64)?;
    let mut whole = Surface::default();
    for (number, cluster) in clusters.iter().enumerate() {
        task.reach(number as u64);
        if !cluster.iter().any(|shell| all[*shell as usize].meets) {
            for shell in cluster.iter().filter(|shell| !covered[**shell as usize]) {
                whole.append(all[*shell as usize].surface.clone());
            }
            continue;
        }
        match one(cluster, all, task) {
            Ok(united) => whole.append(without_thin(united)),
            Err(Error::Mesh { problem, .. }) => {
                log::info!("touching parts of a mesh cannot be united: {problem}");
                return Ok(None);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(Some(whole))
}

fn taken_apart(surface: &Surface, of: &[u32], count: u32) -> Vec<Shell> {
    let measured = measure(surface, of, count, 0);
    let shell = |(members, component): (&Vec<u32>, &Component)| Shell {
        surface: surface.part(members),
        bounds: corners_of(component),
        volume: component.volume,
        is_flat: is_flat(component.volume, component.area),
        meets: false,
        head: None,
    };
    topology::members((of, count)).par_iter().zip(&measured).map(shell).collect()
}

/// Containment of points in shells.
struct Containment<'a> {
    all: &'a [Shell],
    tree: Tree,
    searches: Vec<OnceLock<Search>>,
}

impl<'a> Containment<'a> {
    fn new(all: &'a [Shell]) -> Self {
        let boxes: Vec<[DVec3; 2]> = all.iter().map(|shell| shell.bounds).collect();
        let searches = all.iter().map(|_| OnceLock::new()).collect();
        Self { all, tree: Tree::of_boxes(&boxes), searches }
    }

    /// Winding number of a shell around a point off its surface.
    fn winding(&self, shell: u32, point: DVec3) -> f64 {
        let surface = &self.all[shell as usize].surface;
        let search = self.searches[shell as usize].get_or_init(|| Search::new(surface));
        match search.crossings(surface, point) {
            Some(hits) => f64::from(hits.iter().map(|(_, sign)| sign).sum::<i32>()),
            None => winding_by_solid_angle(surface, 0..surface.triangles.len(), point),
        }
    }

    /// True if a shell lies in another, and touches it at most: its points are asked.
    fn holds(&self, outer: u32, points: &[DVec3]) -> bool {
        let sum: f64 = points.iter().map(|point| self.winding(outer, *point)).sum();
        sum > 0.5 * points.len() as f64
    }

    /// Shells with material whose boxes contain the box of a shell.
    fn around(&self, inner: &Shell) -> Vec<u32> {
        let mut around = Vec::new();
        self.tree.around(inner.bounds, |outer| {
            let shell = &self.all[outer as usize];
            if shell.volume > inner.volume.abs() && encloses(shell.bounds, inner.bounds) {
                around.push(outer);
            }
        });
        around.sort_unstable();
        around
    }
}

/// Points that a shell encloses, off its surface and off others that touch it: in the middle of
/// chords along the normals of its largest facets.
fn points_within(shell: &Shell) -> Vec<DVec3> {
    let surface = &shell.surface;
    let normal = |triangle: usize| {
        let [a, b, c] = surface.corners(triangle);
        (b - a).cross(c - a)
    };
    let mut largest: Vec<usize> = (0..surface.triangles.len()).collect();
    largest.sort_by(|a, b| {
        let area = |it: &usize| normal(*it).length_squared();
        area(b).total_cmp(&area(a)).then(a.cmp(b))
    });
    let inwards = if shell.volume > 0.0 { -1.0 } else { 1.0 };
    let chord = |triangle: usize| {
        let start = surface.corners(triangle).into_iter().sum::<DVec3>() / 3.0;
        let along = inwards * normal(triangle).normalize_or_zero();
        let length = (0..surface.triangles.len())
            .filter(|other| *other != triangle)
            .filter_map(|other| distance_along(start, along, surface.corners(other)))
            .fold(f64::INFINITY, f64::min);
        length.is_finite().then(|| start + 0.5 * length * along)
    };
    largest.into_iter().take(POINTS).filter_map(chord).collect()
}

/// Distance to the intersection of a line with a triangle ahead of its start.
fn distance_along(start: DVec3, along: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let normal = (b - a).cross(c - a);
    let slope = normal.dot(along);
    let distance = normal.dot(a - start) / slope;
    let place = start + distance * along;
    let inside = is_over([a, b, c], normal, place);
    (slope != 0.0 && distance > 0.0 && inside).then_some(distance)
}

/// True if a point lies in a triangle, as seen along its normal.
fn is_over([a, b, c]: [DVec3; 3], normal: DVec3, point: DVec3) -> bool {
    let left = |[from, to]: [DVec3; 2]| (to - from).cross(point - from).dot(normal) >= 0.0;
    [[a, b], [b, c], [c, a]].into_iter().all(left)
}

/// Finds the shells that voids are in, the smallest ones.
fn find_heads(all: &mut [Shell]) {
    let containment = Containment::new(all);
    let head = |void: &Shell| {
        if void.volume > 0.0 || void.is_flat {
            return None;
        }
        let mut outers = containment.around(void);
        outers.sort_by(|a, b| {
            let volume = |it: &u32| containment.all[*it as usize].volume;
            volume(a).total_cmp(&volume(b)).then(a.cmp(b))
        });
        let points =
            if void.meets { points_within(void) } else { vec![void.surface.corners(0)[0]] };
        outers.into_iter().find(|outer| containment.holds(*outer, &points))
    };
    let heads: Vec<Option<u32>> = all.par_iter().map(head).collect();
    for (shell, head) in all.iter_mut().zip(heads) {
        shell.head = head;
    }
}

/// Shells inside at least two shells of a cluster, without contact: in material, and not in a void of the
/// cluster.
fn covered(all: &[Shell], clusters: &[Vec<u32>]) -> Vec<bool> {
    let mut cluster_of = vec![0_u32; all.len()];
    for (number, cluster) in (0..).zip(clusters) {
        cluster.iter().for_each(|shell| cluster_of[*shell as usize] = number);
    }
    let containment = Containment::new(all);
    let is_covered = |shell: &Shell| {
        if shell.meets || shell.volume < 0.0 || shell.is_flat {
            return false;
        }
        let point = [shell.surface.corners(0)[0]];
        let mut around: Vec<u32> = containment
            .around(shell)
            .into_iter()
            .filter(|outer| all[*outer as usize].meets && containment.holds(*outer, &point))
            .map(|outer| cluster_of[outer as usize])
            .collect();
        around.sort_unstable();
        around.chunk_by(|a, b| a == b).any(|same| same.len() > 1)
    };
    all.par_iter().map(is_covered).collect()
}

/// Turns inside-out shells that touch others and are not voids; returns their number.
fn turn_inside_out(all: &mut [Shell]) -> usize {
    let inside_out = |it: &&mut Shell| it.meets && it.volume < 0.0 && it.head.is_none();
    let turned = all.iter_mut().filter(inside_out).map(|shell| {
        turn(&mut shell.surface);
        shell.volume = -shell.volume;
    });
    turned.count()
}

fn turn(surface: &mut Surface) {
    surface.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
}

/// Shells that belong together: touching ones, and voids with the shells around them.
fn clusters(all: &[Shell], contacts: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut parent: Vec<u32> = (0..numbers::count(all.len())).collect();
    let heads = (0..).zip(all).filter_map(|(number, shell)| Some([number, shell.head?]));
    contacts.iter().copied().chain(heads).for_each(|pair| join(&mut parent, pair));
    let (of, count) = labels(&mut parent);
    topology::members((&of, count))
}

/// A cluster as one surface.
fn one(cluster: &[u32], all: &[Shell], task: Task<'_>) -> Result<Surface> {
    let shell = |number: &u32| &all[*number as usize];
    let failed = |problem: String| {
        let [low, high] = bounds_of(cluster.iter().flat_map(|it| shell(it).bounds));
        Error::mesh("", problem, format!("near {}", in_mm(low.midpoint(high))))
    };
    let heads = cluster.iter().filter(|it| shell(it).head.is_none());
    let mut solids = Vec::new();
    for head in heads {
        // What lies in it without contact stays as it is; the rest is taken away.
        let mut outer = shell(head).surface.clone();
        let mut cutters = Vec::new();
        for void in cluster.iter().filter(|it| shell(it).head == Some(*head)) {
            let mut surface = shell(void).surface.clone();
            if shell(void).meets {
                turn(&mut surface);
                cutters.push(surface);
            } else {
                outer.append(surface);
            }
        }
        let mut solid = ClosedMesh::of(&outer, true);
        for cutter in cutters {
            solid = solid.less(&ClosedMesh::of(&cutter, true), task, failed)?;
        }
        solids.push(solid);
    }
    ClosedMesh::sum(solids, task, &failed)
}
