//! The surface of one object, welded, placed and looked at for defects.

use super::defects::{self, Defects, MOST_PAIRS};
use super::placement;
use super::search::Search;
use super::surface::{Defect, Surface};
use super::topology::{self, Edge};
use super::united::{United, united};
use super::watch::{LoadStep, Task};
use crate::error::Result;
use crate::scene::Placement;

/// A surface in the world, examined.
pub(super) struct Examined {
    pub(super) surface: Surface,
    pub(super) edges: Vec<Edge>,
    /// Where it was examined for crossing itself.
    pub(super) search: Option<Search>,
    pub(super) defects: Defects,
    /// Changes made to it.
    pub(super) warnings: Vec<String>,
}

/// Welds, places and examines a surface; `crossings`: also looks for intersections, and unites its parts.
/// A surface that cannot be placed is the inner error.
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
    let mut welded = surface.weld();
    let reach = |surface: &Surface| {
        surface.vertices.iter().fold(0.0_f64, |most, vertex| most.max(vertex.abs().max_element()))
    };
    let in_file = reach(&surface) * unit * placement.scale;
    let world = match placement::place(&mut surface, unit, placement) {
        Ok(world) => world,
        Err(defect) => return Ok(Err(defect)),
    };
    for (_, place) in &mut welded.dropped {
        *place = world.transform_point3(*place);
    }
    // What f32 resolves, of the file and of the world.
    let resolved = f64::from(f32::EPSILON) * in_file.max(reach(&surface));
    let (edges, search) =
        rayon::join(|| topology::edges(&surface), || crossings.then(|| Search::new(&surface)));
    let (defects, crossing) =
        defects::find(&surface, &edges, &welded, resolved, search.as_ref(), task)?;
    let found = Examined { surface, edges, search, defects, warnings: Vec::new() };
    let may_unite = crossings && found.defects.refused() && found.defects.not_finite.count == 0;
    if may_unite && crossing.len() < MOST_PAIRS {
        let united = united(&found.surface, &found.edges, &crossing, (resolved, world), task)?;
        if let Some(sound) = united.and_then(sound) {
            return Ok(Ok(sound));
        }
    }
    Ok(Ok(found))
}

/// A surface of united parts, if it is closed. Faces that nearly coincided may still lie on each other
/// within f32: rays are not affected.
fn sound(united: United) -> Option<Examined> {
    let United { surface, parts, turned } = united;
    let edges = topology::edges(&surface);
    if !edges.chunk_by(|a, b| a.key == b.key).all(topology::is_manifold) {
        return None;
    }
    let mut warnings = Vec::new();
    if parts > 0 {
        warnings.push(format!("{parts} of its parts touch or overlap: they are one solid"));
    }
    if turned > 0 {
        warnings.push(format!("{turned} of these were inside out and have been turned"));
    }
    Some(Examined { surface, edges, search: None, defects: Defects::default(), warnings })
}
