//! The surface of one object, welded, placed and looked at for defects.

use super::defects::{self, DefectCount, Defects, MOST_PAIRS};
use super::joins::{join_corners, nearest_corners};
use super::junctions::divide_at_junctions;
use super::placement;
use super::repeated::remove_repeated;
use super::search::Search;
use super::surface::{Defect, Surface, Welded, rounded};
use super::topology::{self, Edge};
use super::united::{United, united};
use beamlet_core::error::Result;
use beamlet_core::watch::{LoadStep, Task};
use beamlet_model::scene::Placement;

/// Size of a surface over the length that its coordinates resolve, below which it is a warning.
const DIGITS: f64 = 1e3;

/// A surface in the world, examined.
pub(super) struct Examined {
    pub(super) surface: Surface,
    pub(super) edges: Vec<Edge>,
    /// Where it was examined for crossing itself.
    pub(super) search: Option<Search>,
    pub(crate) defects: Defects,
    /// Least distance of corners at open edges that no edge joins, m.
    pub(super) apart: Option<f64>,
    /// Changes made to it.
    pub(super) warnings: Vec<String>,
}

/// Welds, places and examines a surface; `crossings`: also joins its corners within rounding, removes
/// repeated triangles, looks for intersections, and unites its parts. A surface that cannot be placed is the
/// inner error.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn examine(
    mut surface: Surface,
    unit: f64,
    placement: &Placement,
    crossings: bool,
    task: Task<'_>,
) -> Result<std::result::Result<Examined, Defect>> {
    task.begin(LoadStep::Joining, 0)?;
    let Welded { mut dropped, grain } = surface.weld();
    let reach = |surface: &Surface| {
        surface.vertices.iter().fold(0.0_f64, |most, vertex| most.max(vertex.abs().max_element()))
    };
    let world = match placement::place(&mut surface, unit, placement) {
        Ok(world) => world,
        Err(defect) => return Ok(Err(defect)),
    };
    for (_, place) in &mut dropped {
        *place = world.transform_point3(*place);
    }
    // Length that f32 resolves, in the file and in the world.
    let [in_file, in_world] = [grain.reach * unit * placement.scale, reach(&surface)]
        .map(|it| f64::from(f32::EPSILON) * it);
    let resolved = in_file.max(in_world);
    let mut warnings: Vec<String> =
        digits_lost(&surface, [in_file, in_world]).into_iter().collect();
    let (mut edges, mut search) =
        rayon::join(|| topology::edges(&surface), || crossings.then(|| Search::new(&surface)));
    let (mut repeated, mut apart) = (None, None);
    if crossings && !edges.chunk_by(|a, b| a.key == b.key).all(topology::is_balanced) {
        let step = grain.step * unit * placement.scale;
        if let Some(joined) = join_corners(&mut surface, &edges, step) {
            warnings.push(joined.to_string());
            dropped.extend(joined.dropped);
            edges = topology::edges(&surface);
        }
        let twice = defects::duplicate(&surface);
        if remove_repeated(&mut surface, &edges) > 0 {
            repeated = Some(twice);
            edges = topology::edges(&surface);
        }
        let divided = divide_at_junctions(&mut surface, &edges, step);
        if divided > 0 {
            let s = if divided == 1 { "" } else { "s" };
            warnings.push(format!(
                "{divided} edge{s} with corners of neighbours in the middle (T-junctions) were divided there"
            ));
            edges = topology::edges(&surface);
        }
        apart = nearest_corners(&surface, &edges, step);
        search = Some(Search::new(&surface));
    }
    let (mut defects, crossing) =
        defects::find(&surface, &edges, &dropped, [in_file, resolved], search.as_ref(), task)?;
    if let Some(repeated) = &repeated {
        defects.duplicate_triangles = repeated.clone();
    }
    let found = Examined { surface, edges, search, defects, apart, warnings };
    let may_unite = crossings && found.defects.refused() && found.defects.not_finite.count == 0;
    if may_unite && crossing.len() < MOST_PAIRS {
        let united = united(&found.surface, &found.edges, &crossing, (resolved, world), task)?;
        if let Some(sound) = united.and_then(|united| sound(united, &found, repeated)) {
            return Ok(Ok(sound));
        }
    }
    Ok(Ok(found))
}

/// A warning where the coordinates of a surface resolve little of its size, in its file or in the world.
fn digits_lost(surface: &Surface, [in_file, in_world]: [f64; 2]) -> Option<String> {
    let [low, high] = surface.bounds();
    let size = (high - low).max_element();
    if size >= DIGITS * in_file.max(in_world) {
        return None;
    }
    let (lost, remedy) = if in_file >= in_world {
        (in_file, "its numbers in the file are 32-bit and large: export it near the origin")
    } else {
        (in_world, "it is far from the rotation centre: set center = true, or position")
    };
    let (size, lost) = (rounded(size), rounded(lost));
    Some(format!("digits are lost: {size} across, its coordinates resolve {lost}; {remedy}"))
}

/// A surface of united parts, if it is closed; `found`: the surface before, `repeated`: triangles that were
/// given twice in it. Faces that nearly coincided may still lie on each other within f32: rays are not
/// affected.
fn sound(united: United, found: &Examined, repeated: Option<DefectCount>) -> Option<Examined> {
    let United { surface, parts, turned } = united;
    let edges = topology::edges(&surface);
    if !edges.chunk_by(|a, b| a.key == b.key).all(topology::is_balanced) {
        return None;
    }
    let mut warnings = found.warnings.clone();
    let mut defects = Defects::default();
    if parts > 0 {
        defects.duplicate_triangles = repeated.unwrap_or_default();
        warnings.push(format!("{parts} of its parts touch or overlap: they are one solid"));
    } else {
        defects.duplicate_triangles = found.defects.duplicate_triangles.clone();
        defects.degenerate_triangles = found.defects.degenerate_triangles.clone();
        let Defects { non_manifold_edges, self_intersections, .. } = &found.defects;
        for (count, noun, what) in [
            (non_manifold_edges.count, "edge", "along which it touches itself"),
            (self_intersections.count, "pair", "of triangles folded within a plane"),
        ] {
            let s = if count == 1 { "" } else { "s" };
            if count > 0 {
                warnings.push(format!("{count} {noun}{s} {what} (harmless)"));
            }
        }
    }
    if turned > 0 {
        warnings.push(format!("{turned} of these were inside out and have been turned"));
    }
    Some(Examined { surface, edges, search: None, defects, apart: None, warnings })
}
