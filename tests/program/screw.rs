//! A mesh as CAD programs write it.

use std::f64::consts::{FRAC_PI_3, PI};
use std::fmt::Write;

/// A screw as a surface over angle and height: a shaft with a thread and a hexagonal head, closed
/// by caps.
pub(crate) fn stl() -> String {
    const AROUND: usize = 48;
    const ALONG: usize = 60;
    let height = |i: usize| match i {
        i if i < ALONG => -1.1 + 1.6 * i as f64 / (ALONG - 1) as f64,
        i if i == ALONG => 0.5,
        _ => 0.9,
    };
    let radius = |i: usize, j: usize| {
        let turn = j as f64 / AROUND as f64;
        if i < ALONG {
            let thread = (height(i) / 0.25 - turn).rem_euclid(1.0);
            let cut = 0.25 + 1.2 * (height(i) + 1.1);
            return (0.35 + 0.12 * (1.0 - (2.0 * thread - 1.0).abs())).min(cut);
        }
        let side = (2.0 * PI * turn + FRAC_PI_3 / 2.0).rem_euclid(FRAC_PI_3) - FRAC_PI_3 / 2.0;
        0.75 * (FRAC_PI_3 / 2.0).cos() / side.cos()
    };
    let point = |i: usize, j: usize| {
        let angle = 2.0 * PI * (j % AROUND) as f64 / AROUND as f64;
        let r = radius(i, j % AROUND);
        [r * angle.cos(), r * angle.sin(), height(i)]
    };
    let last = ALONG + 1;
    let mut facets = Vec::new();
    for j in 0..AROUND {
        for i in 0..last {
            let [a, b, c, d] = [point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)];
            facets.extend([[a, b, c], [a, c, d]]);
        }
        facets.push([[0.0, 0.0, height(0)], point(0, j + 1), point(0, j)]);
        facets.push([[0.0, 0.0, height(last)], point(last, j), point(last, j + 1)]);
    }
    let mut text = String::from("solid screw\n");
    for facet in facets {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in facet {
            writeln!(text, "vertex {x:.6} {y:.6} {z:.6}").unwrap();
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid screw\n"
}
