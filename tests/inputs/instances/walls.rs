//! Density of packings up to the wall.
//!
//! The centres of whole bodies lie where such a body fits: at least its radius from the wall. There
//! their density has to be the same everywhere. Centres are counted in layers of half a radius along
//! the wall and in the rest; the sum of (counted - expected)² / expected over the layers is
//! chi-squared distributed with as many degrees of freedom as there are layers for points that know
//! nothing of each other, and smaller for bodies that keep apart.

use super::*;

/// Layers along the wall, half a radius each.
const LAYERS: usize = 12;
/// Chi-squared of 12 degrees of freedom that one in 10,000 exceeds.
const BOUND: f64 = 39.1;

/// Chi-squared of depths below the wall that centres can reach, in layers of `width`. `inside` is the
/// volume of what is at least so far from it.
fn chi_squared(depths: &[f64], width: f64, inside: impl Fn(f64) -> f64) -> f64 {
    let mut counts = [0.0; LAYERS];
    for depth in depths {
        let layer = (depth / width).floor();
        if layer < LAYERS as f64 {
            counts[layer as usize] += 1.0;
        }
    }
    let density = depths.len() as f64 / inside(0.0);
    let term = |(layer, count): (usize, &f64)| {
        let [from, to] = [layer, layer + 1].map(|layer| inside(width * layer as f64));
        let expected = density * (from - to);
        assert!(expected > 50.0, "too few centres: {expected}");
        (count - expected).powi(2) / expected
    };
    counts.iter().enumerate().map(term).sum()
}

#[test]
fn parallel_fibres_have_the_same_density_up_to_the_wall() {
    // Facets of 64 sides and a gap of 1 nm.
    let (radius, outer) = (0.5e-3, 2.5e-6 * 1.000_804 + 1e-9);
    let reach = radius - outer;
    for fill in [0.1, 0.32, 0.5] {
        let mut depths = Vec::new();
        for seed in 1..=6 {
            let region = "cylinder = { radius = \"0.5 mm\", height = \"1 mm\" }";
            let text = packing("parallel-fibres", region, &format!("fill = {fill}, seed = {seed}"));
            let found = instances_of(&fibre("2.5 um", "1 mm"), &text).unwrap();
            depths.extend(found.iter().map(|it| reach - it.position.length()));
        }
        let chi = chi_squared(&depths, 1.25e-6, |depth| (reach - depth).powi(2));
        println!("parallel fibres, fill {fill}: {chi:.1} of {} centres", depths.len());
        assert!(chi < BOUND, "{chi} at {fill}");
    }
}

#[test]
fn spheres_have_the_same_density_up_to_the_wall() {
    let reach = 0.2e-3 - (7e-6 * 1.0011 + 1e-9);
    for fill in [0.1, 0.35] {
        for (region, cubes) in [
            ("box = { size = [\"0.4 mm\", \"0.4 mm\", \"0.4 mm\"] }", true),
            ("sphere = { radius = \"0.2 mm\" }", false),
        ] {
            let mut depths = Vec::new();
            for seed in 1..=4 {
                let text = packing("spheres", region, &format!("fill = {fill}, seed = {seed}"));
                let found = instances_of(&sphere("7 um"), &text).unwrap();
                let depth = |it: &InstanceTransform| match cubes {
                    true => reach - it.position.abs().max_element(),
                    false => reach - it.position.length(),
                };
                depths.extend(found.iter().map(depth));
            }
            let chi = chi_squared(&depths, 3.5e-6, |depth| (reach - depth).powi(3));
            println!("spheres, fill {fill}, {region}: {chi:.1} of {} centres", depths.len());
            assert!(chi < BOUND, "{chi} at {fill} in {region}");
        }
    }
}

/// A case that is refuted: discs added one by one between hard walls crowd along these.
#[test]
fn discs_added_between_hard_walls_fail_the_test() {
    let (reach, diameter, side) = (0.2475e-3, 5e-6, 101);
    let cell = |x: f64| ((x + reach) / diameter).floor() as usize + 1;
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (state >> 11) as f64 / 9_007_199_254_740_992.0
    };
    let mut depths = Vec::new();
    for arrangement in 1..=4 {
        let mut cells: Vec<Vec<[f64; 2]>> = vec![Vec::new(); side * side];
        while depths.len() < 4000 * arrangement {
            let [x, y] = [(); 2].map(|()| (2.0 * uniform() - 1.0) * reach);
            let (row, column) = (cell(y), cell(x));
            let rows = row - 1..=row + 1;
            let near = rows.flat_map(|r| (column - 1..=column + 1).map(move |c| r * side + c));
            let others = near.flat_map(|k| cells.get(k).into_iter().flatten());
            let free = others.into_iter().all(|o| (x - o[0]).hypot(y - o[1]) >= diameter);
            if x.hypot(y) <= reach && free {
                cells[row * side + column].push([x, y]);
                depths.push(reach - x.hypot(y));
            }
        }
    }
    let chi = chi_squared(&depths, 1.25e-6, |depth| (reach - depth).powi(2));
    println!("added between hard walls: {chi:.1}");
    assert!(chi > 2.0 * BOUND, "{chi}");
}
