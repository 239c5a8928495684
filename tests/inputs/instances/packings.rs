//! Packings: what they hold, that nothing overlaps or sticks out, sizes, seeds, and what cannot be.

use super::*;
use glam::DVec3;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::f64::consts::PI;

const FIBRES: &str = "cylinder = { radius = \"0.25 mm\", height = \"1 mm\" }";

/// A box in TOML.
fn cube(edge: &str) -> String {
    format!("box = {{ size = [\"{edge}\", \"{edge}\", \"{edge}\"] }}")
}

/// The segment between the middles of the ends of an instance, m; of a sphere a point.
fn axis(it: &InstanceTransform, height: f64) -> [DVec3; 2] {
    [-0.5, 0.5].map(|end| it.affine().transform_point3(DVec3::Z * (end * height)))
}

/// Distance of two segments by a method other than the engine's: bisection on one, where the distance
/// to the other is convex.
fn distance([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> f64 {
    let to_segment = |p: DVec3| {
        let along = d - c;
        let t = ((p - c).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
        (c + along * t - p).length()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let [s, t] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if to_segment(a.lerp(b, s)) < to_segment(a.lerp(b, t)) { high = t } else { low = s }
    }
    to_segment(a.lerp(b, low))
}

/// Least distance of two surfaces over all pairs, m: pairs farther apart than two cells of a grid
/// are not nearer than one.
fn least_gap(found: &[InstanceTransform], radius: f64, height: f64) -> f64 {
    let largest = found.iter().map(|it| it.scale).fold(0.0, f64::max);
    let side = 3.0 * radius * largest;
    let steps = (height / side).ceil();
    let cell = |p: DVec3| (p / side).floor().as_i64vec3().to_array();
    let cells_of = |it: &InstanceTransform| {
        let [a, b] = axis(it, height);
        let mut cells: Vec<_> =
            (0..=steps as usize).map(|k| cell(a.lerp(b, k as f64 / steps.max(1.0)))).collect();
        cells.dedup();
        cells
    };
    let mut grid: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (index, it) in found.iter().enumerate() {
        cells_of(it).into_iter().for_each(|cell| grid.entry(cell).or_default().push(index));
    }
    let mut least = f64::INFINITY;
    for (index, it) in found.iter().enumerate() {
        for [x, y, z] in cells_of(it) {
            for near in 0..125 {
                let cell = [x + near % 5 - 2, y + near / 5 % 5 - 2, z + near / 25 - 2];
                for &other in grid.get(&cell).into_iter().flatten().filter(|other| **other > index)
                {
                    let there = &found[other];
                    let apart = match height > 0.0 && it.rotation != there.rotation {
                        true => distance(axis(it, height), axis(there, height)),
                        false => (it.position - there.position).length(),
                    };
                    least = least.min(apart - radius * (it.scale + there.scale));
                }
            }
        }
    }
    least
}

#[test]
fn parallel_fibres_fill_their_region_and_neither_touch_nor_stick_out() {
    for (fill, more) in
        [(0.05, ""), (0.32, ", gap = \"0.1 um\""), (0.45, ", diameter_spread = 0.2"), (0.5, "")]
    {
        let text = packing("parallel-fibres", FIBRES, &format!("fill = {fill}{more}"));
        let found = instances_of(&fibre("2.5 um", "1 mm"), &text).unwrap();
        let area: f64 = found.iter().map(|it| PI * (2.5e-6 * it.scale).powi(2)).sum();
        let reached = area / (PI * 0.25e-3_f64.powi(2));
        assert!((reached / fill - 1.0).abs() < 0.01, "{reached} for {fill}");
        // The facets of 64 sides stick out of the circle by 0.8 nm per um.
        let corner = (PI / 32.0 / (PI / 32.0).sin()).sqrt();
        let gap = if more.contains("gap") { 0.1e-6 } else { 1e-9 };
        let least = least_gap(&found, 2.5e-6 * corner, 0.0);
        assert!(least >= gap * (1.0 - 1e-6), "{least:e} at {fill}");
        let reach = found.iter().map(|it| it.position.length() + 2.5e-6 * corner * it.scale);
        assert!(reach.fold(0.0, f64::max) <= 0.25e-3 - gap * (1.0 - 1e-6));
        assert!(found.iter().all(|it| it.scale_z == 1.0 && it.position.z == 0.0));
    }
}

#[test]
fn spheres_fill_their_region_and_neither_touch_nor_stick_out() {
    type Inside = fn(DVec3) -> f64;
    let to_box: Inside = |p| 0.2e-3 - p.abs().max_element();
    let to_cylinder: Inside = |p| (0.2e-3 - p.truncate().length()).min(0.15e-3 - p.z.abs());
    let to_sphere: Inside = |p| 0.2e-3 - p.length();
    let volumes = [0.4e-3_f64.powi(3), PI * 0.04e-6 * 0.3e-3, 4.0 / 3.0 * PI * 8e-12];
    let regions = [
        (cube("0.4 mm"), to_box, volumes[0]),
        ("cylinder = { radius = \"0.2 mm\", height = \"0.3 mm\" }".into(), to_cylinder, volumes[1]),
        ("sphere = { radius = \"0.2 mm\" }".into(), to_sphere, volumes[2]),
    ];
    for (region, inside, volume) in regions {
        for (fill, more) in [(0.1, ", diameter_spread = 0.3"), (0.35, "")] {
            let text = packing("spheres", &region, &format!("fill = {fill}{more}"));
            let found = instances_of(&sphere("7 um"), &text).unwrap();
            let ball = |it: &InstanceTransform| 4.0 / 3.0 * PI * (7e-6 * it.scale).powi(3);
            let reached = found.iter().map(ball).sum::<f64>() / volume;
            assert!((reached / fill - 1.0).abs() < 0.01, "{reached} for {fill} in {region}");
            // A faceted sphere of 64 sides reaches 0.12 % farther than its nominal radius.
            let least = least_gap(&found, 7e-6 * 1.0012, 0.0);
            assert!(least >= 1e-9, "{least:e} at {fill} in {region}");
            let clear = found.iter().map(|it| inside(it.position) - 7e-6 * 1.0012 * it.scale);
            assert!(clear.fold(f64::INFINITY, f64::min) >= 1e-9, "{fill} in {region}");
            assert!(found.iter().all(|it| it.scale == it.scale_z));
        }
    }
}

#[test]
fn random_fibres_neither_touch_nor_stick_out_and_point_everywhere() {
    let regions = [
        (cube("0.6 mm"), 0.02, 0.6e-3_f64.powi(3)),
        ("sphere = { radius = \"0.4 mm\" }".into(), 0.01, 4.0 / 3.0 * PI * 0.4e-3_f64.powi(3)),
    ];
    for (region, fill, volume) in regions {
        let text = packing("random-fibres", &region, &format!("fill = {fill}"));
        let found = instances_of(&fibre("2 um", "0.2 mm"), &text).unwrap();
        let reached = found.len() as f64 * PI * 4e-12 * 0.2e-3 / volume;
        assert!((reached / fill - 1.0).abs() < 0.01, "{reached} in {region}");
        assert!(least_gap(&found, 2e-6, 0.2e-3) >= 1e-9, "{region}");
        let reach =
            |p: DVec3| if region.contains("sphere") { p.length() } else { p.abs().max_element() };
        let most = if region.contains("sphere") { 0.4e-3 } else { 0.3e-3 };
        let ends = found.iter().flat_map(|it| axis(it, 0.2e-3)).map(reach);
        assert!(ends.fold(0.0, f64::max) < most - 1e-9, "{region}");
        // Of a uniform direction each component squared has mean 1/3 and variance 4/45.
        let n = found.len() as f64;
        for unit in [DVec3::X, DVec3::Y, DVec3::Z] {
            let square = |it: &InstanceTransform| (it.rotation * DVec3::Z).dot(unit).powi(2);
            let mean = found.iter().map(square).sum::<f64>() / n;
            let z = (mean - 1.0 / 3.0) / (4.0 / 45.0 / n).sqrt();
            assert!(z.abs() < 4.0, "{z} of {unit} in {region}");
        }
    }
}

#[test]
fn a_count_is_met_and_small_regions_hold_what_fits() {
    for count in [1, 2, 10, 1000, 9000] {
        let text = packing("spheres", &cube("0.5 mm"), &format!("count = {count}"));
        assert_eq!(instances_of(&sphere("9 um"), &text).unwrap().len(), count);
    }
    // Six in ten of its radius: the box is wider than the region.
    let text = packing(
        "parallel-fibres",
        "box = { size = [\"30 um\", \"30 um\", \"1 mm\"] }",
        "count = 3",
    );
    assert_eq!(instances_of(&fibre("5 um", "1 mm"), &text).unwrap().len(), 3);
}

#[test]
fn diameters_are_log_normal() {
    for spread in [0.1, 0.3] {
        let text = packing(
            "spheres",
            &cube("1 mm"),
            &format!("count = 20000, diameter_spread = {spread}"),
        );
        let found = instances_of(&sphere("8 um"), &text).unwrap();
        let n = found.len() as f64;
        let logs = || found.iter().map(|it| it.scale.ln());
        let mean = logs().sum::<f64>() / n;
        let sd = (logs().map(|log| (log - mean).powi(2)).sum::<f64>() / n).sqrt();
        // Four standard errors, and 0.05 % that the truncation at four standard deviations takes.
        assert!(mean.abs() < 4.0 * spread / n.sqrt(), "{mean} of {spread}");
        assert!((sd / spread - 0.9995).abs() < 4.0 / (2.0 * n).sqrt(), "{sd} of {spread}");
        // As many below one standard deviation as of a normal distribution: the shape, too.
        let below = logs().filter(|log| *log < -spread).count() as f64 / n;
        assert!((below - 0.158_66).abs() < 4.0 * (0.1335 / n).sqrt(), "{below} of {spread}");
    }
}

/// Packings of each kind, with and without bodies that had to be pushed apart.
fn seeded(seed: u64) -> [(String, String); 4] {
    let more = |amount: &str| format!("{amount}, diameter_spread = 0.1, seed = {seed}");
    [
        (fibre("2.5 um", "1 mm"), packing("parallel-fibres", FIBRES, &more("fill = 0.2"))),
        (fibre("2.5 um", "1 mm"), packing("parallel-fibres", FIBRES, &more("fill = 0.48"))),
        (sphere("7 um"), packing("spheres", &cube("0.3 mm"), &more("fill = 0.34"))),
        (fibre("2 um", "0.2 mm"), packing("random-fibres", &cube("0.5 mm"), &more("fill = 0.01"))),
    ]
}

/// Hash of the bits of all instances.
fn digest(shape: &str, text: &str) -> String {
    let mut hasher = Sha256::new();
    for it in instances_of(shape, text).unwrap() {
        let numbers = [it.position.to_array(), [it.scale, it.scale_z, 0.0]].concat();
        for number in numbers.into_iter().chain(it.rotation.to_array()) {
            hasher.update(number.to_le_bytes());
        }
    }
    hasher.finalize()[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let recorded = ["139d71d81026058c", "295c7918ee4208ae", "5f932161eaf50d47", "ed274547700b9569"];
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| seeded(1).map(|(shape, text)| digest(&shape, &text)));
        assert_eq!(found, recorded, "{threads} threads");
    }
    for ((shape, text), (_, other)) in seeded(1).into_iter().zip(seeded(2)) {
        assert_ne!(digest(&shape, &text), digest(&shape, &other), "{text}");
    }
}
