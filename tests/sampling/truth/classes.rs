//! Pixels by what of the sample they see: nothing, its interior, or a silhouette.

use super::cases::Case;
use crate::reference::surfaces::Mesh;
use crate::reference::vector::{Vector, cross, dot, sub};
use ndarray::Array2;
use std::collections::HashMap;

/// Distance of the places on edges and facets that are looked at, pixels.
const STEP: f64 = 0.1;

/// Part of the sample that a pixel sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Class {
    Nothing,
    Interior,
    Silhouette,
}

/// Classes of the pixels, `[row][column]`.
pub(crate) fn classes(case: &Case) -> Array2<Class> {
    let [columns, rows] = case.scene.detector.pixels.map(|n| n as usize);
    let mut found = Array2::from_elem((rows, columns), Class::Nothing);
    for body in &case.bodies {
        for triangle in 0..body.mesh.triangles.len() {
            let corners = body.mesh.corners(triangle).map(|corner| project(case, corner));
            mark(&mut found, &spread_over(&corners), [0.0; 2], Class::Interior);
        }
        for ends in silhouettes(case, &body.mesh) {
            let [a, b] = ends.map(|end| project(case, end));
            mark(&mut found, &spread_along(a, b), case.margin, Class::Silhouette);
        }
    }
    found
}

/// Column and row coordinate on the detector.
fn project(case: &Case, [x, y, z]: Vector) -> [f64; 2] {
    let detector = &case.scene.detector;
    let scale = detector.distance / (case.scene.source.distance + y);
    let [columns, rows] = detector.pixels.map(f64::from);
    [0.5 * columns + x * scale / detector.pitch[0], 0.5 * rows - z * scale / detector.pitch[1]]
}

/// Edges with one facet on either side of the light.
fn silhouettes(case: &Case, mesh: &Mesh) -> Vec<[Vector; 2]> {
    let source = [0.0, -case.scene.source.distance, 0.0];
    let mut fronts: HashMap<[u32; 2], bool> = HashMap::new();
    let mut edges = Vec::new();
    for (triangle, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        let [p, q, r] = mesh.corners(triangle);
        let front = dot(cross(sub(q, p), sub(r, p)), sub(p, source)) < 0.0;
        for [from, to] in [[a, b], [b, c], [c, a]] {
            match fronts.remove(&[to, from]) {
                Some(other) if other != front => {
                    edges.push([from, to].map(|v| mesh.vertices[v as usize]));
                }
                Some(_) => {}
                None => {
                    fronts.insert([from, to], front);
                }
            }
        }
    }
    edges
}

fn steps(length: f64) -> usize {
    (length / STEP).ceil() as usize + 1
}

fn spread_along(a: [f64; 2], b: [f64; 2]) -> Vec<[f64; 2]> {
    let count = steps((a[0] - b[0]).hypot(a[1] - b[1]));
    let at = |share: f64| [0, 1].map(|axis| a[axis] + (b[axis] - a[axis]) * share);
    (0..=count).map(|i| at(i as f64 / count as f64)).collect()
}

fn spread_over(&[a, b, c]: &[[f64; 2]; 3]) -> Vec<[f64; 2]> {
    spread_along(a, b).into_iter().flat_map(|on_edge| spread_along(on_edge, c)).collect()
}

/// Raises the pixels within a margin of places to a class.
fn mark(found: &mut Array2<Class>, places: &[[f64; 2]], margin: [f64; 2], class: Class) {
    let (rows, columns) = found.dim();
    for [x, z] in places {
        let range = |at: f64, margin: f64, count: usize| {
            let from = (at - margin).floor().max(0.0) as usize;
            let to = ((at + margin).floor() + 1.0).clamp(0.0, count as f64) as usize;
            from..to.max(from)
        };
        for row in range(*z, margin[1], rows) {
            for column in range(*x, margin[0], columns) {
                let own = &mut found[[row, column]];
                *own = (*own).max(class);
            }
        }
    }
}
