//! Parts of one mesh that touch or overlap: they are one solid.
//!
//! CAD programs and modellers write assemblies as one file whose parts lie on each other, share
//! edges or stand in each other. Taken apart into closed shells (`shells`), such a surface is sound
//! where no shell passes through itself; those that meet are united by booleans.

mod shells;

use std::collections::BTreeMap;
use std::sync::OnceLock;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::body::{is_flat, without_thin};
use super::overlap::{Solid, snap};
use super::search::{Search, winding_by_solid_angle};
use super::surface::{Surface, bounds_of, encloses, in_mm};
use super::topology::{Edge, root};
use super::tree::Tree;
use super::watch::{LoadStep, Task};
use crate::error::{Error, Result};
use crate::numbers;

/// Mean winding number, around points of it, of a surface that a void lies in: one half on the
/// surface itself.
const INSIDE: f64 = 0.6;
/// Points of a shell that are asked.
const POINTS: usize = 16;

/// A surface whose parts are united.
pub(super) struct United {
    pub(super) surface: Surface,
    /// Parts that met others.
    pub(super) parts: usize,
    /// Of these, such as were inside out.
    pub(super) turned: usize,
}

/// A closed shell of the surface.
struct Shell {
    surface: Surface,
    bounds: [DVec3; 2],
    volume: f64,
    is_flat: bool,
    /// Whether it touches, crosses or lies on another one.
    meets: bool,
    /// For a void: the shell that it is in.
    head: Option<u32>,
}

/// The surface with parts that meet united; `crossing`: the pairs of its triangles that pass through
/// or lie on each other; `resolved`: the length that f32 resolves, m; `world`: from the file to where it stands. `None` where that does not mend it: it is not made of closed shells, one of
/// them passes through itself, or the boolean does not take them.
///
/// # Errors
/// [`Error::Memory`]; [`Error::Interrupted`].
pub(super) fn united(
    surface: &Surface,
    edges: &[Edge],
    crossing: &[[u32; 2]],
    (resolved, world): (f64, DAffine3),
    task: Task<'_>,
) -> Result<Option<United>> {
    let Some((of, count)) = shells::shells(surface, edges, resolved) else { return Ok(None) };
    let pairs = crossing.iter().map(|pair| pair.map(|it| of[it as usize]));
    // Shells along one edge touch; one that does with itself stays refused.
    let shared = edges.chunk_by(|a, b| a.key == b.key).filter(|group| group.len() > 2);
    let shared = shared.flat_map(|group| {
        let shell = |edge: &Edge| of[edge.triangle as usize];
        group.windows(2).map(move |pair| [shell(&pair[0]), shell(&pair[1])])
    });
    let mut contacts: Vec<[u32; 2]> = pairs.clone().chain(shared).collect();
    if count < 2 || pairs.clone().any(|[a, b]| a == b) {
        return Ok(None);
    }
    contacts.retain(|[a, b]| a != b);
    contacts.iter_mut().for_each(|pair| pair.sort_unstable());
    contacts.sort_unstable();
    contacts.dedup();
    // Numbers of the file are short: in its frame faces coincide that no longer do where they are
    // turned.
    let in_file = surface.mapped(world.inverse());
    let mut all = taken_apart(&in_file, &of, count);
    // A sheet that is folded onto itself has no material; bodies are made without it.
    contacts.retain(|pair| !pair.iter().any(|shell| all[*shell as usize].is_flat));
    for shell in contacts.iter().flatten() {
        all[*shell as usize].meets = true;
    }
    find_heads(&mut all);
    let turned = turn_inside_out(&mut all);
    let clusters = clusters(&all, &contacts);
    task.begin(LoadStep::Cutting, clusters.len() as u64)?;
    let mut whole = Surface::default();
    for (number, cluster) in clusters.iter().enumerate() {
        task.reach(number as u64);
        if !cluster.iter().any(|shell| all[*shell as usize].meets) {
            for shell in cluster {
                whole.append(all[*shell as usize].surface.clone());
            }
            continue;
        }
        match one(cluster, &all, task) {
            Ok(united) => whole.append(without_thin(united)),
            Err(Error::Mesh { problem, .. }) => {
                log::info!("parts of a mesh that meet cannot be united: {problem}");
                return Ok(None);
            }
            Err(error) => return Err(error),
        }
    }
    let parts = all.iter().filter(|shell| shell.meets).count();
    Ok(Some(United { surface: whole.mapped(world), parts, turned }))
}

fn taken_apart(surface: &Surface, of: &[u32], count: u32) -> Vec<Shell> {
    let mut members = vec![Vec::new(); count as usize];
    for (triangle, shell) in (0_u32..).zip(of) {
        members[*shell as usize].push(triangle);
    }
    let shell = |members: &Vec<u32>| {
        let surface = surface.part(members);
        let bounds = surface.bounds();
        let middle = bounds[0].midpoint(bounds[1]);
        let (mut volume, mut area) = (0.0, 0.0);
        for triangle in 0..surface.triangles.len() {
            let [a, b, c] = surface.corners(triangle).map(|corner| corner - middle);
            volume += a.dot(b.cross(c)) / 6.0;
            area += (b - a).cross(c - a).length() / 2.0;
        }
        let is_flat = is_flat(volume, area);
        Shell { surface, bounds, volume, is_flat, meets: false, head: None }
    };
    members.par_iter().map(shell).collect()
}

/// Finds the shells that voids are in, the smallest ones.
fn find_heads(all: &mut [Shell]) {
    let boxes: Vec<[DVec3; 2]> = all.iter().map(|shell| shell.bounds).collect();
    let tree = Tree::of_boxes(&boxes);
    let searches: Vec<OnceLock<Search>> = all.iter().map(|_| OnceLock::new()).collect();
    let holds = |outer: u32, void: &Shell| {
        let surface = &all[outer as usize].surface;
        let around = |point| winding_by_solid_angle(surface, 0..surface.triangles.len(), point);
        if !void.meets {
            let point = void.surface.corners(0)[0];
            let search = searches[outer as usize].get_or_init(|| Search::new(surface));
            return match search.crossings(surface, point) {
                Some(hits) => hits.iter().map(|(_, sign)| sign).sum::<i32>() > 0,
                None => around(point) > INSIDE,
            };
        }
        // Some of its points may lie on the other surface.
        let triangles = (0..void.surface.triangles.len())
            .step_by(void.surface.triangles.len().div_ceil(POINTS));
        let middles = triangles.map(|it| void.surface.corners(it).into_iter().sum::<DVec3>() / 3.0);
        let (sum, count) = middles.fold((0.0, 0.0), |it, point| (it.0 + around(point), it.1 + 1.0));
        sum > INSIDE * count
    };
    let head = |void: &Shell| {
        if void.volume > 0.0 {
            return None;
        }
        let mut outers = Vec::new();
        tree.around(void.bounds, |outer| {
            let shell = &all[outer as usize];
            if shell.volume > -void.volume && encloses(shell.bounds, void.bounds) {
                outers.push(outer);
            }
        });
        outers.sort_by(|a, b| {
            let volume = |it: &u32| all[*it as usize].volume;
            volume(a).total_cmp(&volume(b)).then(a.cmp(b))
        });
        outers.into_iter().find(|outer| holds(*outer, void))
    };
    let heads: Vec<Option<u32>> = all.par_iter().map(head).collect();
    for (shell, head) in all.iter_mut().zip(heads) {
        shell.head = head;
    }
}

/// Turns the shells that meet others, are inside out and no voids; gives their number.
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

/// Shells that belong together: those that meet, and voids with what they are in.
fn clusters(all: &[Shell], contacts: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut parent: Vec<u32> = (0..numbers::count(all.len())).collect();
    let heads = (0..).zip(all).filter_map(|(number, shell)| Some([number, shell.head?]));
    for [a, b] in contacts.iter().copied().chain(heads) {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut of: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for shell in 0..numbers::count(all.len()) {
        of.entry(root(&mut parent, shell)).or_default().push(shell);
    }
    of.into_values().collect()
}

/// A cluster as one surface.
fn one(cluster: &[u32], all: &[Shell], task: Task<'_>) -> Result<Surface> {
    let shell = |number: &u32| &all[*number as usize];
    let mut surfaces: Vec<Surface> = cluster.iter().map(|it| shell(it).surface.clone()).collect();
    snap(&mut surfaces);
    let surface_of = |number: u32| {
        let at = cluster.binary_search(&number).unwrap_or_default();
        &surfaces[at]
    };
    let failed = |problem: String| {
        let [low, high] = bounds_of(cluster.iter().flat_map(|it| shell(it).bounds));
        Error::mesh("", problem, format!("near {}", in_mm(low.midpoint(high))))
    };
    let heads = cluster.iter().filter(|it| shell(it).head.is_none());
    let mut solids = Vec::new();
    for head in heads {
        // What lies in it without contact stays as it is; the rest is taken away.
        let mut outer = surface_of(*head).clone();
        let mut cutters = Vec::new();
        for void in cluster.iter().filter(|it| shell(it).head == Some(*head)) {
            let mut surface = surface_of(*void).clone();
            if shell(void).meets {
                turn(&mut surface);
                cutters.push(surface);
            } else {
                outer.append(surface);
            }
        }
        let mut solid = Solid::of(&outer, true);
        for cutter in cutters {
            solid = solid.less(&Solid::of(&cutter, true), task, failed)?;
        }
        solids.push(solid);
    }
    Solid::sum(solids, task, &failed)
}
