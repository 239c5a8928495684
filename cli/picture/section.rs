//! The sample seen from above: its section in the plane z = 0, and its convex outline.

use beamlet::geometry::{Component, Sample};
use glam::DVec2;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// An edge of the mesh: its two vertices, the lower one first.
type MeshEdge = (u32, u32);

/// A closed line of a section, in m (x, y), with material to its left.
#[derive(Debug)]
pub(super) struct Loop {
    pub(super) points: Vec<[f64; 2]>,
    /// Object that it bounds, and the one on its other side; `None`: the surroundings.
    pub(super) object: u32,
    pub(super) outside: Option<u32>,
    /// True if it surrounds a region without material: a hole.
    pub(super) hole: bool,
    pub(super) area: f64,
}

/// Section of the sample in the plane z = 0 as closed lines, the largest first, so that filling
/// them one after another leaves holes and inner objects on top.
pub(super) fn section(sample: &Sample) -> Vec<Loop> {
    // From corner to corner of the section; a corner lies on an edge of the mesh, by which both
    // neighbours know it.
    let mut next: HashMap<(MeshEdge, usize), (MeshEdge, [f64; 2])> = HashMap::new();
    let height = |vertex: u32| sample.vertices[vertex as usize][2];
    let corner = |a: u32, b: u32| {
        let (a, b) = (a.min(b), a.max(b));
        let (p, q) = (sample.vertices[a as usize], sample.vertices[b as usize]);
        let share = p[2] / (p[2] - q[2]);
        ((a, b), [0, 1].map(|axis| p[axis] + share * (q[axis] - p[axis])))
    };
    for (triangle, component) in sample.triangles.iter().zip(&sample.triangle_component) {
        let above = triangle.map(|vertex| height(vertex) >= 0.0);
        // The edges where the line comes in and goes out; turned so that material is left.
        let (mut from, mut to) = (None, None);
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            match (above[i], above[(i + 1) % 3]) {
                (true, false) => from = Some(corner(a, b)),
                (false, true) => to = Some(corner(a, b)),
                _ => {}
            }
        }
        if let (Some((from, at)), Some((to, _))) = (from, to) {
            next.insert((from, *component as usize), (to, at));
        }
    }
    let mut loops = Vec::new();
    let mut starts: Vec<_> = next.keys().copied().collect();
    starts.sort_unstable();
    for start in starts {
        let mut points = Vec::new();
        let mut place = start;
        while let Some((to, at)) = next.remove(&place) {
            points.push(at);
            place = (to, start.1);
        }
        if points.len() > 2 {
            let area = signed_area(&points);
            let Component { object, outside, .. } = sample.components[start.1];
            loops.push(Loop { points, object, outside, hole: area < 0.0, area: area.abs() });
        }
    }
    // A hole before what fills it to the last digit, as a bolt fills its bore.
    let rank = |it: &Loop| it.area * if it.hole { 1.0 + 1e-9 } else { 1.0 };
    loops.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
    loops
}

fn signed_area(points: &[[f64; 2]]) -> f64 {
    let turned = points.iter().zip(points.iter().cycle().skip(1));
    turned.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0
}

/// Directions in which the outlines of placed shapes are known: between them a circle is cut off by 0.1 %.
const DIRECTIONS: u32 = 64;

/// Convex outlines of the objects from above, by object, m; empty where an object has no surface.
pub(super) fn outlines(sample: &Sample) -> Vec<Vec<[f64; 2]>> {
    let mut points: Vec<Vec<[f64; 2]>> = vec![Vec::new(); sample.objects.len()];
    for (triangle, component) in sample.triangles.iter().zip(&sample.triangle_component) {
        let corners = triangle.map(|vertex| {
            let [x, y, _] = sample.vertices[vertex as usize];
            [x, y]
        });
        points[sample.object_of(*component)].extend(corners);
    }
    let direction = |it: u32| DVec2::from_angle(TAU * f64::from(it) / f64::from(DIRECTIONS));
    for along in (0..DIRECTIONS).map(direction) {
        // Only the farthest one of all instances matters.
        let mut farthest: Vec<Option<DVec2>> = vec![None; points.len()];
        for placed in &sample.placed {
            let at = sample.farthest_of_placed(placed, along.extend(0.0)).truncate();
            let best = &mut farthest[sample.object_of(placed.component)];
            if best.is_none_or(|best| best.dot(along) < at.dot(along)) {
                *best = Some(at);
            }
        }
        for (points, farthest) in points.iter_mut().zip(farthest) {
            points.extend(farthest.map(|it| it.to_array()));
        }
    }
    points.into_iter().map(outline).collect()
}

/// Convex outline of points.
fn outline(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && (b[0] - a[0]) * (point[1] - a[1]) <= (b[1] - a[1]) * (point[0] - a[0])
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

/// Points left out in a row at most, each of which is looked at for every one that follows.
const LEFT_OUT: usize = 256;

/// Leaves out points that lie within `tolerance` of the line between their neighbours.
pub(super) fn thinned(points: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    let mut run: Vec<[f64; 2]> = Vec::new();
    for &point in points {
        let Some(&last) = kept.last() else {
            kept.push(point);
            continue;
        };
        let (dx, dy) = (point[0] - last[0], point[1] - last[1]);
        let length = dx.hypot(dy);
        let off = |p: &[f64; 2]| match length > 0.0 {
            true => ((p[0] - last[0]) * dy - (p[1] - last[1]) * dx).abs() / length,
            false => (p[0] - last[0]).hypot(p[1] - last[1]),
        };
        if run.len() == LEFT_OUT || run.iter().any(|p| off(p) > tolerance) {
            kept.extend(run.last().copied());
            run.clear();
        }
        run.push(point);
    }
    kept.extend(run.last().copied());
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet::scene::Scene;

    fn sample(objects: &str) -> Sample {
        let text = format!(
            "source = {{ distance = '1 m', spot = '0 um', energy = '30 keV' }}\n\
             detector = {{ distance = '2 m', pixels = [4, 4], pitch = '1 mm' }}\n{objects}"
        );
        beamlet::geometry::load(&Scene::from_toml(&text, ".").unwrap()).unwrap()
    }

    #[test]
    fn section_of_a_cylinder_has_its_area_and_outline() {
        let sample = sample(
            "[[object]]\nname = 'rod'\nmaterial = 'water'\n\
             shape = { cylinder = { radius = '1 mm', height = '3 mm', sides = 96 } }\n",
        );
        let loops = section(&sample);
        assert_eq!(loops.len(), 1);
        assert!(!loops[0].hole);
        // Shapes have the area of the circle.
        let area = std::f64::consts::PI * 1e-6;
        assert!((loops[0].area / area - 1.0).abs() < 1e-9, "{}", loops[0].area);
        let hull = &outlines(&sample)[0];
        assert!((signed_area(hull).abs() / area - 1.0).abs() < 1e-9);
        let thin = thinned(&loops[0].points, 1e-5);
        assert!(thin.len() < 60 && (signed_area(&thin) / area - 1.0).abs() < 0.02);
    }

    #[test]
    fn an_inner_object_comes_after_the_one_around_it() {
        let sample = sample(
            "[[object]]\nname = 'box'\nmaterial = 'water'\nshape = { box = { size = ['4 mm', '4 mm', '4 mm'] } }\n\
             [[object]]\nname = 'ball'\nmaterial = 'gold'\nshape = { sphere = { radius = '1 mm', sides = 32 } }\n",
        );
        let loops = section(&sample);
        let objects: Vec<u32> = loops.iter().map(|l| l.object).collect();
        assert_eq!(objects, [0, 1]);
        assert!(loops.iter().all(|l| !l.hole));
    }
}
