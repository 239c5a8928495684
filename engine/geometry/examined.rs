//! The surface of one object, welded, placed and looked at for defects.

use super::defects::{self, Defects};
use super::placement;
use super::search::Search;
use super::surface::{Defect, Surface};
use super::topology::{self, Edge};
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
}

/// Welds, places and examines a surface; `crossings`: also for crossing itself. A surface that
/// cannot be placed is the inner error.
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
    let defects = defects::find(&surface, &edges, &welded, resolved, search.as_ref(), task)?;
    Ok(Ok(Examined { surface, edges, search, defects }))
}
