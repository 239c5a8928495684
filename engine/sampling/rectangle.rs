//! Rectangles of a patch as cells are made of them.

use super::facet_means::Covered;
use super::moment_recording::LawEnds;
use super::neighbours::Slopes;
use super::patch::Node;
use crate::gpu::interface::Law;

/// A rectangle as a cell: its law at both ends of x.
#[derive(Clone, Copy)]
pub(super) struct Rectangle {
    pub(super) x: [f32; 2],
    pub(super) z: [f32; 2],
    /// Coordinates of its ray.
    pub(super) ray: [f32; 2],
    pub(super) ends: LawEnds,
    /// Variance of the displacement about the law, m2.
    pub(super) spread: f32,
    /// Displacement on the detector along z at both ends of z, m.
    pub(super) ends_z: [f32; 2],
}

/// The parts of a rectangle that a silhouette crosses, as rectangles: side by side, or one above
/// the other, with the areas and about the centroids that they have.
pub(super) fn parts(node: &Node, covered: &Covered, gap: f32) -> Vec<Rectangle> {
    let ends_z = |law: &Law| [law.displacement_z + gap * law.slope_z; 2];
    let [x, z] = covered.centroid;
    let (side, beside) = if x.abs() >= z.abs() { (x, true) } else { (z, false) };
    let range = if beside { node.x } else { node.z };
    let share = if side < 0.0 { covered.share } else { 1.0 - covered.share };
    let border = range[0] + share * (range[1] - range[0]);
    if border <= range[0] || border >= range[1] {
        // Thinner than coordinates are exact: one law for all.
        let most = if covered.share > 0.5 { &covered.law } else { &covered.rest };
        let ends = LawEnds::new(most, node.width(), &Slopes::default());
        let whole = Rectangle {
            x: node.x,
            z: node.z,
            ray: node.centre(),
            ends,
            spread: 0.0,
            ends_z: ends_z(most),
        };
        return vec![whole];
    }
    let mut halves = [[range[0], border], [border, range[1]]];
    if side < 0.0 {
        halves.swap(0, 1);
    }
    let laws = [(&node.law, 0.0, 0.0), (&covered.law, covered.covariance, covered.residual)];
    let rectangle = |part: usize| {
        let [x, z] = if beside { [halves[part], node.z] } else { [node.x, halves[part]] };
        let (law, covariance, residual) = laws[part];
        // What rises with x over the covered part is no blur.
        let width = x[1] - x[0];
        let slope = 12.0 * covariance / (width * width);
        let slopes = Slopes { depth: [0.0; 2], displacement: [slope, 0.0] };
        let spread = (residual * residual - slope * covariance).max(0.0);
        let ray = [0.5 * (x[0] + x[1]), 0.5 * (z[0] + z[1])];
        Rectangle {
            x,
            z,
            ray,
            ends: LawEnds::new(law, width, &slopes),
            spread,
            ends_z: ends_z(law),
        }
    };
    if beside && side < 0.0 {
        vec![rectangle(1), rectangle(0)]
    } else {
        vec![rectangle(0), rectangle(1)]
    }
}
