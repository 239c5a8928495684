//! Heights of lines: bodies that end at borders of rows or by a corner, and light that changes over a row.

use super::rows::{ROW, blur_along_z, compare_with, with};
use super::simulate;
use crate::reference::normal::{SIGMA_PER_FWHM, cumulative};
use crate::reference::waves::body::{Body, Outline};
use crate::support::{Worst, sample};
use beamlet::Backend;
use beamlet::scene::{MaterialSpec, Mesh, Object, Scene, Shape};
use beamlet::stack::Stacks;
use ndarray::s;

/// A body between ends along x, y and z, m.
fn block(name: &str, [x, y, z]: [[f64; 2]; 3]) -> Object {
    let size = [x, y, z].map(|[low, high]| high - low);
    let mut object = Object::new(name, Shape::Box { size }, "matter");
    object.placement.position = [x, y, z].map(|[low, high]| f64::midpoint(low, high));
    object
}

/// A mesh of a polygon of rectangles, between two ends along its axis, m. `place`: a corner at an end.
fn prism(
    corners: &[[f64; 2]],
    rectangles: &[[u32; 4]],
    ends: [f64; 2],
    place: impl Fn([f64; 2], f64) -> [f64; 3],
) -> Object {
    let count = u32::try_from(corners.len()).expect("a number");
    let mut vertices = Vec::new();
    for end in ends {
        vertices.extend(corners.iter().map(|corner| place(*corner, end)));
    }
    let mut triangles = Vec::new();
    for [a, b, c, d] in rectangles {
        triangles.extend([[*a, *b, *c], [*a, *c, *d]]);
        triangles.extend([[*a, *c, *b], [*a, *d, *c]].map(|it| it.map(|v| v + count)));
    }
    for at in 0..count {
        let [a, b] = [at, (at + 1) % count];
        triangles.extend([[b, a, a + count], [b, a + count, b + count]]);
    }
    Object::new("prism", Mesh::Arrays { vertices, triangles }, "matter")
}

const fn along_x([y, z]: [f64; 2], x: f64) -> [f64; 3] {
    [x, y, z]
}

fn scene(objects: Vec<Object>, rows: u32, [mu, delta]: [f64; 2]) -> Scene {
    let mut scene = with(objects, rows);
    scene.materials.insert("matter".into(), MaterialSpec::Constants { mu, delta });
    blur_along_z(&mut scene, 0.0);
    scene
}

/// Compares a row of stacks with a row of other stacks.
fn same(worst: &mut Worst, what: &str, own: (&Stacks, usize), other: (&Stacks, usize)) {
    let [got, want] = [own, other].map(|(it, row)| it.sample.slice(s![0, .., row, ..]));
    for ((place, got), want) in got.indexed_iter().zip(want) {
        worst.take(f64::from(got - want), || format!("{what}, {place:?}: {got} for {want}"));
    }
}

const DENSE: [f64; 2] = [3e3, 4.61e-7];
/// Along the beam, and between two places of an aperture or beyond it.
const DEPTH: [f64; 2] = [-100e-6, 100e-6];
const WIDE: [f64; 2] = [35e-6, 58e-6];
const NARROW: [f64; 2] = [35e-6, 46e-6];
const TALL: f64 = 2e-3;

/// An even number of rows has a border at z = 0.
#[test]
fn bodies_that_end_at_a_border_of_rows_have_the_light_of_each_row() {
    let upright = |x| {
        simulate(&scene(vec![block("block", [x, DEPTH, [-TALL, TALL]])], 2, DENSE), Backend::Bvh)
    };
    let [wide, narrow] = [WIDE, NARROW].map(upright);
    let empty = simulate(
        &scene(vec![block("block", [[3e-3, 4e-3], DEPTH, [-TALL, TALL]])], 2, DENSE),
        Backend::Bvh,
    );
    let one_line = wide.record.tally.most_patch_rays;
    let [[a, b], [_, c]] = [NARROW, WIDE];
    let step = prism(
        &[[a, -TALL], [b, -TALL], [c, -TALL], [c, 0.0], [b, 0.0], [b, TALL], [a, TALL], [a, 0.0]],
        &[[0, 1, 4, 7], [1, 2, 3, 4], [7, 4, 5, 6]],
        DEPTH,
        |[x, z], y| [x, y, z],
    );
    // A box: the light of 1e-9 m. A step of a mesh, of which nothing says where it is: halved to 1/4096 of a row.
    let mut ends = Worst::new("waves, a box that ends at a border of rows", 2e-6);
    let mut steps = Worst::new("waves, a step of a mesh at a border of rows", 5e-5);
    for off in [0.0, 1e-9, -1e-9] {
        let ended = block("block", [WIDE, DEPTH, [-TALL, off]]);
        let mut moved = step.clone();
        moved.placement.position[2] = off;
        for (what, object, upper) in [("box", ended, &empty), ("mesh", moved, &narrow)] {
            let got = simulate(&scene(vec![object], 2, DENSE), Backend::Bvh);
            let (worst, most) = if what == "box" { (&mut ends, 3) } else { (&mut steps, 30) };
            same(worst, &format!("{what} {off:e}"), (&got, 0), (upper, 0));
            same(worst, &format!("{what} {off:e}"), (&got, 1), (&wide, 1));
            let lines = got.record.tally.most_patch_rays / one_line;
            assert!(lines <= most, "{what} {off:e}: {lines} lines");
        }
    }
    ends.holds();
    steps.holds();
}

/// The lower edge of a box leans by 2 degrees and enters a row from above in the middle of an aperture: 0.0035 rows at
/// its end.
#[test]
fn a_corner_of_2_degrees_matches_lines_by_fft_within_2e_5() {
    let (angle, x, [mu, _]) = (2.0_f64.to_radians(), 50e-6, DENSE);
    let height = 1e-3;
    let mut object = Object::new("box", Shape::Box { size: [3e-3, 200e-6, height] }, "matter");
    object.placement.rotate = vec![([0.0, 1.0, 0.0], angle)];
    let [sine, cosine] = [angle.sin(), angle.cos()];
    let half = 0.5 * height;
    object.placement.position = [x + half * sine, 0.0, 0.5 * ROW + half * cosine];
    let scene = scene(vec![object], 1, [mu, 0.0]);
    // The edge crosses x where samples of fields meet, at the heights of the lines.
    let step = 4e-6;
    let count = 65;
    let line = |at: u32| {
        let low = x + (f64::from(at) + 0.5) * step;
        let outline = Outline::Slab { low, high: 1e-3, thickness: 200e-6 };
        (step * angle.tan() / ROW, vec![Body { outline, delta: 0.0, mu }])
    };
    let below = (1.0 - f64::from(count) * step * angle.tan() / ROW, Vec::new());
    let worst = Worst::new("waves, a corner of 2 degrees", 2e-5);
    compare_with(worst, &scene, (0..count).map(line).chain([below]));
}

/// Light of a wedge without refraction is that of its thickness: rows beside have one line, or those of small bodies
/// of nothing.
#[test]
fn ramps_over_borders_of_rows_blur_as_their_integral_within_1e_5() {
    let (mu, x, y) = (3e4, [-2e-3, 2e-3], 40e-6);
    let [low, high] = [-0.83 * ROW, 0.91 * ROW];
    let thickness = |z: f64| y * (0.1 + 0.9 * ((z - low) / (high - low)).clamp(0.0, 1.0));
    let ends = [thickness(low), thickness(high)];
    let objects = || {
        let wedge = prism(
            &[[0.0, low], [0.0, high], [ends[1], high], [ends[0], low]],
            &[[0, 1, 2, 3]],
            x,
            along_x,
        );
        let below = block("below", [x, [0.0, ends[0]], [-3e-3, low]]);
        vec![wedge, below, block("above", [x, [0.0, ends[1]], [high, 3e-3]])]
    };
    let mut worst = Worst::new("waves, ramps over borders of rows", 1e-5);
    let cases = vec![(0.1, false), (0.1, true), (0.4, true), (1.0, false)];
    // Every other; all with `BEAMLET_ALL`.
    for (blur, small) in sample(cases, 2) {
        let mut scene = scene(objects(), 5, [mu, 0.0]);
        scene.scan.mask_offsets = vec![6.665e-6];
        scene.sampling.tolerance = Some(2e-5);
        let magnified = SIGMA_PER_FWHM * (1.8 - 1.2003) / 1.2003 / 150e-6;
        blur_along_z(&mut scene, blur / magnified);
        if small {
            scene
                .materials
                .insert("nothing".into(), MaterialSpec::Constants { mu: 0.0, delta: 0.0 });
            for row in [-1.0, 1.0] {
                let ball = Shape::Sphere { radius: 12e-6, sides: None };
                let mut ball = Object::new(format!("ball {row}"), ball, "nothing");
                ball.placement.position = [50e-6, 1e-3, row * 1.1 * ROW];
                scene.objects.push(ball);
            }
        }
        let stacks = simulate(&scene, Backend::Bvh);
        for (row, top) in (0..5).zip(0..5_u32) {
            // 4,000 lines a row over six deviations and more.
            let (mut passed, steps) = (0.0, 4000.0);
            for line in 0..80_000 {
                let place = (f64::from(line) + 0.5) / steps - 7.5;
                let below = |border: f64| cumulative((border - place) / blur);
                let share = below(f64::from(top) + 1.0) - below(top.into());
                passed += share * (-mu * thickness((2.5 - place) * ROW)).exp() / steps;
            }
            for column in 0..4 {
                let flat = f64::from(stacks.flat[[0, row, column]]);
                let got = f64::from(stacks.sample[[0, 0, row, column]]);
                worst.take(got - passed * flat, || {
                    format!("blur {blur}, row {row}, column {column}: {got} for {}", passed * flat)
                });
            }
        }
    }
    worst.holds();
}

/// A thin prism whose upper edge lies 0.04 rows below a border: faces that slant along both axes, against the mean of
/// rows a 64th as high.
#[test]
fn a_prism_that_ends_near_a_border_matches_low_rows_within_its_tolerance() {
    let edge = 0.46 * ROW;
    let light = |parts: u32| {
        let corners =
            [[0.0, edge], [20e-6, edge - 60e-6], [0.0, edge - 120e-6], [-20e-6, edge - 60e-6]];
        let mut prism = prism(&corners, &[[0, 1, 2, 3]], [-2e-3, 2e-3], along_x);
        prism.placement.rotate = vec![([0.0, 1.0, 0.0], 0.01)];
        let mut scene = scene(vec![prism], parts, [3e3, 1e-5]);
        scene.detector.pitch[1] /= f64::from(parts);
        let stacks = simulate(&scene, Backend::Bvh);
        stacks.sample.mapv(f64::from).mean_axis(ndarray::Axis(2)).expect("rows")
    };
    let (own, low) = (light(1), light(64));
    let mut worst = Worst::new("waves, a prism near a border of rows", 5e-5);
    for ((place, own), low) in own.indexed_iter().zip(&low) {
        worst.take(own - low, || format!("{place:?}: {own} for {low}"));
    }
    worst.holds();
}
