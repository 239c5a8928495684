//! Triangles of one shell that lie on each other in a plane.

use glam::DVec3;
use rayon::prelude::*;

use crate::defects::CrossingPair;
use crate::search::Search;
use crate::surface::Surface;

/// Most folds that are tried.
const MOST: usize = 4096;
/// Places of a fold that are tried, as shares of the way to the middle of either triangle: a ray at one of
/// them may hit an edge.
const PLACES: [f64; 3] = [0.0, 0.13, 0.37];
/// Sides of a ray that is nearly normal to the fold: along the normal it runs in other faces.
const ASIDE: DVec3 = DVec3::new(0.0127, 0.0311, 0.0173);
/// Crossings closer than these times the resolution are at one place.
const TOGETHER: f64 = 8.0;

/// True if all pairs of triangles of a closed shell that intersect are folds without volume: a ray through
/// one of them is in the shell or outside, never in it twice or less than outside. The numbers of the pairs
/// are of the triangles of `whole`.
pub(super) fn enclose_nothing(
    shell: &Surface,
    whole: &Surface,
    pairs: &[CrossingPair],
    resolved: f64,
) -> bool {
    if pairs.is_empty() {
        return true;
    }
    if pairs.iter().any(|pair| pair.fold.is_none()) {
        return false;
    }
    let search = Search::new(shell);
    let [low, high] = shell.bounds();
    let size = low.distance(high);
    let every = pairs.len().div_ceil(MOST);
    pairs.par_iter().step_by(every).all(|pair| {
        let place = pair.fold.unwrap_or_default();
        let corners = pair.triangles.map(|triangle| whole.corners(triangle as usize));
        let middles = corners.map(|it| it.into_iter().sum::<DVec3>() / 3.0);
        let [a, b, c] = corners[0];
        let direction = ((b - a).cross(c - a).normalize_or_zero() + ASIDE).normalize();
        let places = PLACES.into_iter().flat_map(|share| middles.map(|it| place.lerp(it, share)));
        places
            .filter_map(|at| search.windings(shell, at - 2.0 * size * direction, direction))
            .next()
            .is_none_or(|windings| is_simple(&windings, TOGETHER * resolved))
    })
}

/// True if the winding numbers along a ray, by distance, are 0 and one other; crossings within `together` are
/// at one place.
fn is_simple(windings: &[(f64, i32)], together: f64) -> bool {
    let behind = |at: usize| windings.get(at + 1).is_none_or(|it| it.0 - windings[at].0 > together);
    let last = (0..windings.len()).filter(|at| behind(*at));
    let between: Vec<i32> = last.map(|at| windings[at].1).collect();
    let inside = between.iter().find(|it| **it != 0).map_or(0, |it| it.signum());
    between.iter().all(|winding| [0, inside].contains(winding))
}
