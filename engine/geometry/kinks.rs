//! Kinks between facets of curved surfaces.

use super::{Sample, across_edges};
use beamlet_core::numbers;
use glam::DVec3;

/// Cosine of the angle between facets, 30 degrees, beyond which their edge is a crease.
const CREASE: f64 = 0.866_025_403_784_438_6;

/// Largest kink of each component, m²: the angle between two facets times the square of the narrower one's width
/// across their common edge. Creases do not count, and exact shapes have none.
#[must_use]
pub fn largest_kinks(sample: &Sample) -> Vec<f64> {
    let mut found = vec![0.0_f64; sample.components.len()];
    let corner = |vertex: u32| DVec3::from_array(sample.vertices[vertex as usize]);
    let own = of_triangles(&sample.triangles, &across_edges(sample), corner);
    for (component, kink) in sample.triangle_component.iter().zip(own) {
        let most = &mut found[*component as usize];
        *most = most.max(kink);
    }
    let of_prototypes: Vec<Vec<f64>> = sample
        .prototypes
        .iter()
        .map(|it| {
            let mut most = vec![0.0_f64; it.components.len()];
            if it.shape.is_none() {
                let kinks = of_triangles(&it.triangles, &it.across, |v| it.vertices[v as usize]);
                for (component, kink) in it.triangle_component.iter().zip(kinks) {
                    let most = &mut most[*component as usize];
                    *most = most.max(kink);
                }
            }
            most
        })
        .collect();
    for placed in &sample.placed {
        let scale = placed.place.scale * placed.place.scale;
        let kinks = &of_prototypes[placed.prototype as usize];
        for (component, kink) in (placed.component as usize..).zip(kinks) {
            found[component] = found[component].max(scale * kink);
        }
    }
    found
}

/// Largest kink at an edge of each triangle, m².
fn of_triangles(
    triangles: &[[u32; 3]],
    across: &[[u32; 3]],
    corner: impl Fn(u32) -> DVec3,
) -> Vec<f64> {
    let area = |t: usize| {
        let [a, b, c] = triangles[t].map(&corner);
        (b - a).cross(c - a)
    };
    let of = |t: usize| {
        let own = area(t);
        let edge = |opposite: usize| {
            let other = across[t][opposite];
            if other == u32::MAX {
                return 0.0;
            }
            let other = area(numbers::length(other.into()));
            let lengths = own.length() * other.length();
            if lengths == 0.0 || own.dot(other) < CREASE * lengths {
                return 0.0;
            }
            let [from, to] = [1, 2].map(|next| corner(triangles[t][(opposite + next) % 3]));
            let width = own.length().min(other.length()) / (to - from).length();
            own.angle_between(other) * width * width
        };
        (0..3).map(edge).fold(0.0, f64::max)
    };
    (0..triangles.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kink_of_a_fold_is_its_angle_times_the_square_of_the_narrower_width() {
        let angle: f64 = 0.2;
        let (sin, cos) = angle.sin_cos();
        let vertices = [
            [-2.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [-2.0, 1.0, 0.0],
            [3.0 * cos, 0.0, -3.0 * sin],
            [3.0 * cos, 1.0, -3.0 * sin],
        ]
        .map(DVec3::from_array);
        let triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
        let across = super::super::adjacency::across(vertices.len(), &triangles);
        let kinks = of_triangles(&triangles, &across, |v| vertices[v as usize]);
        // Triangles beside the fold; the diagonals of the squares are none.
        let want = [0.8, 0.0, 0.0, 0.8];
        for (kink, want) in kinks.iter().zip(want) {
            assert!((kink - want).abs() < 1e-12, "{kinks:?}");
        }
    }
}
