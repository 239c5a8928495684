//! Normals of the surface that facets stand for.

use beamlet_core::numbers::count;
use glam::DVec3;
use rayon::prelude::*;

/// Cosine of the angle between facets, 30 degrees, beyond which their edge is a crease.
const CREASE: f64 = 0.866_025_403_784_438_6;

/// Normals of the corners of a facet.
pub type CornerNormals = [[f32; 3]; 3];

/// Unit outward normals of the corners of triangles: means over the facets around, weighted by their
/// angles there, that lean against the triangle's own by no more than a crease. Zero for triangles not in
/// `smooth`.
pub fn corner_normals(
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    smooth: impl Fn(usize) -> bool + Sync,
) -> Vec<CornerNormals> {
    let corners = |t: usize| triangles[t].map(|v| vertices[v as usize]);
    let normal = |t: usize| {
        let [a, b, c] = corners(t);
        (b - a).cross(c - a).normalize_or_zero()
    };
    // Triangles by vertex: the list of v ends at ends[v].
    let mut ends = vec![0_u32; vertices.len() + 1];
    triangles.iter().flatten().for_each(|v| ends[*v as usize + 1] += 1);
    for v in 1..ends.len() {
        ends[v] += ends[v - 1];
    }
    let mut around = vec![0_u32; 3 * triangles.len()];
    for (t, triangle) in triangles.iter().enumerate() {
        for v in triangle {
            let end = &mut ends[*v as usize];
            around[*end as usize] = count(t);
            *end += 1;
        }
    }
    let at = |v: u32| {
        let first = v.checked_sub(1).map_or(0, |before| ends[before as usize]);
        &around[first as usize..ends[v as usize] as usize]
    };
    let angle = |t: usize, v: u32| {
        let place = triangles[t].iter().position(|corner| *corner == v).unwrap_or(0);
        let all = corners(t);
        let [a, b, c] = [0, 1, 2].map(|i| all[(place + i) % 3]);
        (b - a).angle_between(c - a)
    };
    let of_triangle = |t: usize| {
        if !smooth(t) {
            return CornerNormals::default();
        }
        let own = normal(t);
        triangles[t].map(|v| {
            let neighbours = at(v).iter().map(|other| *other as usize);
            let near = neighbours.filter(|other| normal(*other).dot(own) >= CREASE);
            let sum: DVec3 = near.map(|other| angle(other, v) * normal(other)).sum();
            sum.try_normalize().unwrap_or(own).as_vec3().to_array()
        })
    };
    (0..triangles.len()).into_par_iter().map(of_triangle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two squares with the common edge x = 0 under an angle.
    fn fold(angle: f64) -> Vec<CornerNormals> {
        let (sin, cos) = angle.sin_cos();
        let vertices = [
            [-1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
            [cos, 0.0, -sin],
            [cos, 1.0, -sin],
        ];
        let triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
        corner_normals(&vertices.map(DVec3::from_array), &triangles, |_| true)
    }

    #[test]
    fn normals_of_an_edge_halve_it_up_to_a_crease() {
        let leans = |normal: [f32; 3]| f64::from(normal[0]).asin().to_degrees();
        let near = fold(29_f64.to_radians());
        assert!((leans(near[0][1]) - 14.5).abs() < 1e-4, "{}", leans(near[0][1]));
        assert!(leans(near[0][0]).abs() < 1e-4 && (leans(near[2][1]) - 29.0).abs() < 1e-4);
        let far = fold(31_f64.to_radians());
        assert!(leans(far[0][1]).abs() < 1e-4 && (leans(far[2][0]) - 31.0).abs() < 1e-4);
    }
}
