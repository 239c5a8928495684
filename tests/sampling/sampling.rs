//! The two sampling schemes against one another, against closed forms, and against themselves
//! more finely cut.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::masks::Bars;
use crate::reference::normal::{self, cumulative};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, body, cuboid, cylinder, star};
use crate::support::{CARBON, Checked, Worst, engine};
use beamlet::scene::{Blur, RandomRays, Scene, Scheme, Shape, Transport};
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control};
use ndarray::Array4;

const OPAQUE: Bars = Bars::Sheet { transmission: 0.0 };

/// Normal deviations as a test takes them: the mean of n of them spreads by 1 / sqrt(n), their
/// sum of squares about n by sqrt(2 n).
#[derive(Debug, Default)]
struct Scores {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Scores {
    fn take(&mut self, score: f64) {
        self.count += 1.0;
        self.sum += score;
        self.squares += score * score;
    }

    /// Both within four deviations; seeds are fixed, so the outcome is as well.
    fn judge(&self, what: [&'static str; 2], freedom_lost: f64) {
        assert!(self.count > 50.0, "{} scores", self.count);
        let mut mean = Worst::new(what[0], 4.0);
        mean.take(self.sum / self.count.sqrt(), || "the mean".into());
        let mut spread = Worst::new(what[1], 4.0);
        let freedom = self.count - freedom_lost;
        spread.take((self.squares - freedom) / (2.0 * freedom).sqrt(), || "the squares".into());
        mean.holds();
        spread.holds();
    }
}

fn random(mut scene: Scene, rays: [u32; 2], seed: u64) -> Scene {
    scene.sampling.scheme = Scheme::Random;
    scene.sampling.rays = RandomRays::Grid(rays);
    scene.sampling.seed = seed;
    scene
}

fn sample(engine: &Checked, scene: &Scene) -> Array4<f32> {
    engine.simulate(scene).expect("a stack").sample
}

#[test]
fn random_flat_scatters_about_the_closed_form_by_its_known_variance() {
    // Thin opaque masks: a target t on the detector mask is hit if the source offset s has
    // s (1 - 1/M) + t / M in an aperture, with probability p_t; the variance is their mean of
    // p_t (1 - p_t), over N. Steps share their rays, so one step tells.
    let setup = Setup::paper([256, 2]).with_bars(OPAQUE);
    let sigma = setup.sigma()[0];
    let rays = 2000_u32;
    let offset = 8e-6;
    let (mut p, mut variance) = (0.0, 0.0);
    for i in 0..rays {
        let target = 150e-6 * ((f64::from(i) + 0.5) / f64::from(rays) - 0.5);
        if target.abs() < 15e-6 {
            let at = |edge: f64| cumulative((offset + edge - target / 1.5) / (sigma / 3.0));
            let hit = at(10e-6) - at(-10e-6);
            p += hit;
            variance += hit * (1.0 - hit);
        }
    }
    let n = f64::from(rays);
    let (mean, deviation) = (p / n, variance.sqrt() / n);
    let scene = random(scenes::scene(&setup, &[], &[offset]), [rays, 1], 5);
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("a flat");
    // Cells have no noise: they give the mean over even targets up to their own spacing.
    let cells = scenes::scene(&setup, &[], &[offset]);
    let cells = engine(Backend::Bvh).simulate(&cells).expect("a flat").flat;
    // 400 even targets over an aperture, at whose edges the light is all but even.
    let mut worst = Worst::new("sampling, cells against the mean of random rays", 1e-6);
    let mut scores = Scores::default();
    for (got, cell) in stacks.flat.iter().zip(&cells) {
        worst.take(f64::from(*cell) - mean, || "a pixel".into());
        scores.take((f64::from(*got) - mean) / deviation);
    }
    scores.judge(["sampling, random flat, mean score", "sampling, random flat, spread"], 0.0);
    worst.holds();
}

/// Every ray adds a few thousand units of the sums for each energy: rounded down they lost 1.2e-4.
#[test]
fn many_random_rays_of_many_energies_lose_no_light() {
    let scene = r#"
        [source]
        distance = "1.6 m"
        spot = "0 um"
        spectrum = { anode = "tungsten", kvp = "60 kV", nodes = 32 }

        [detector]
        distance = "1.8 m"
        pixels = [2, 2]
        pitch = "150 um"

        [sampling]
        scheme = "random"
        rays = [200, 200]
    "#;
    let scene = Scene::from_toml(scene, ".").expect("a scene");
    let flat = engine(Backend::Bvh).simulate(&scene).expect("a flat").flat;
    let mut worst = Worst::new("sampling, light of many random rays and energies", 1e-6);
    for got in &flat {
        worst.take(f64::from(*got) - 1.0, || format!("{got}"));
    }
    worst.holds();
}

/// An absorber with a horizontal upper edge at height `edge`, thin along the beam.
fn ledge(edge: f64) -> Body {
    let block = cuboid([8e-3, 4e-6, 4e-3]).moved([0.0, 0.0, edge - 2e-3]);
    body(block.rounded(), 1e8, 0.0)
}

#[test]
fn horizontal_edge_is_blurred_by_the_height_of_the_spot() {
    // Without masks: the edge at z = e shades the detector below e * 1.8 / 1.21, blurred by the
    // spot's 0.59 / 1.21. Rows hold shares of a blurred step.
    let mut setup = Setup::paper([64, 6]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    setup.spot = [30e-6, 260e-6];
    let blur = setup.sigma()[1] * 0.59 / 1.21;
    let engine = engine(Backend::Bvh);
    // A cell row in which the edge stands is at least 1/256 of a row.
    let mut worst = Worst::new("sampling, cells, horizontal edge", 1.0 / 512.0);
    let mut scores = Scores::default();
    for edge in [0.0, 0.031e-3, 0.08e-3] {
        let shadow = edge * 1.8 / 1.21;
        let scene = scenes::scene(&setup, &[ledge(edge)], &[0.0]);
        let cells = sample(&engine, &scene);
        let rays = 400_u32;
        let random = sample(&engine, &random(scene, [1, rays], 3));
        for row in 0..6_u32 {
            let centre = setup.centre(0, row)[1];
            // Light of heights above the shadow: an overlap with a very long box.
            let far = 10e-3;
            let want = blurred_overlap(shadow + 0.5 * far - centre, far, 150e-6, blur) / 150e-6;
            let variance: f64 = (0..rays)
                .map(|i| {
                    let part = (f64::from(i) + 0.5) / f64::from(rays) - 0.5;
                    let p = cumulative((centre + 150e-6 * part - shadow) / blur);
                    p * (1.0 - p) / f64::from(rays).powi(2)
                })
                .sum();
            for column in 0..64 {
                let at = [0, 0, row as usize, column];
                worst.take(f64::from(cells[at]) - want, || format!("edge {edge}, row {row}"));
                if variance.sqrt() > 1e-4 {
                    scores.take((f64::from(random[at]) - want) / variance.sqrt());
                }
            }
        }
    }
    scores
        .judge(["sampling, horizontal edge, mean score", "sampling, horizontal edge, spread"], 0.0);
    worst.holds();
}

/// With all targets on the middle line of its row a pixel sees all or nothing of the edge.
#[test]
fn random_rays_by_number_see_the_share_of_a_row_above_an_edge() {
    let mut setup = Setup::paper([4, 3]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    setup.spot = [0.0; 2];
    let engine = engine(Backend::Bvh);
    // Multiples of the square root of 2 leave some 3 of 5000 targets on the wrong side; parts of a
    // pixel, each with a shift of its own, as many of a few hundred, by chance.
    let mut worst = Worst::new("sampling, random rays, share of a row above an edge", 2e-3);
    for covered in [1.0 / 3.0, 0.5, 0.8] {
        // The middle row is lit above this height on the detector.
        let shadow = (covered - 0.5) * 150e-6;
        let mut scene = scenes::scene(&setup, &[ledge(shadow * 1.21 / 1.8)], &[0.0]);
        scene.sampling.scheme = Scheme::Random;
        let blurred = Blur::Gaussian { sigma: [40e-6, 0.0] };
        for blur in [None, Some(blurred)] {
            let parts = blur.is_some();
            scene.detector.blur = blur;
            for ((_, _, row, column), got) in sample(&engine, &scene).indexed_iter() {
                let want = [1.0, 1.0 - covered, 0.0][row];
                let place = || format!("{covered} of row {row}, column {column}, parts: {parts}");
                worst.take(f64::from(*got) - want, place);
            }
        }
    }
    worst.holds();
}

#[test]
fn random_rays_agree_with_cells_behind_a_sample() {
    // The variance is that among 10 seeds, so scores follow Student's t of 9 degrees, of which
    // 6.5 is one in 9,000. Targets stand 0.15 um apart: they are even in every seed, so that a
    // displaced aperture holds more or less of them by half of one, 4e-4 of open beam at most,
    // a third of the noise.
    let mut setup = Setup::paper([12, 2]);
    // 40 mm behind the mask, where the spot blurs by 0.4 um: cells are exact to 1e-4 there.
    setup.source_distance = 1.24;
    let mesh = cylinder(0.483e-3, 3e-3, 256, 0.1).turned([0.0, 1.0, 0.0], 0.3);
    let bodies = [body(mesh.rounded(), CARBON[0], CARBON[1])];
    let scene = scenes::scene(&setup, &bodies, &[6e-6]);
    let engine = engine(Backend::Bvh);
    let cells = sample(&engine, &scene);
    let seeds = 10_u32;
    let runs: Vec<Array4<f32>> = (0..seeds)
        .map(|seed| sample(&engine, &random(scene.clone(), [1000, 3], seed.into())))
        .collect();
    let n = f64::from(seeds);
    let (mut sum, mut count) = (0.0, 0.0_f64);
    let mut worst = Worst::new("sampling, random behind a sample, score of a pixel", 6.5);
    for (place, &cell) in cells.indexed_iter() {
        let values: Vec<f64> = runs.iter().map(|r| f64::from(r[place])).collect();
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let score = (mean - f64::from(cell)) / (variance / n).sqrt();
        worst.take(score, || format!("{place:?}: {mean} for {cell}"));
        sum += score;
        count += 1.0;
    }
    let mut mean = Worst::new("sampling, random behind a sample, mean score", 4.0);
    mean.take(sum / count.sqrt(), || "all pixels".into());
    worst.holds();
    mean.holds();
}

#[test]
fn tighter_tolerances_change_next_to_nothing() {
    let setup = Setup::paper([24, 2]);
    let round = cylinder(0.9e-3, 6e-3, 256, 0.2).turned([0.0, 1.0, 0.0], 0.3);
    let bodies = [body(round.rounded(), CARBON[0], CARBON[1])];
    let scene = scenes::scene(&setup, &bodies, &[-15e-6, 0.0, 15e-6]);
    let engine = engine(Backend::Bvh);
    let run = |tolerance: f64| {
        let mut scene = scene.clone();
        scene.sampling.tolerance = Some(tolerance);
        sample(&engine, &scene)
    };
    let fine = run(1e-5);
    // Five times the tolerance at the worst of the values.
    let mut worst = Worst::new("sampling, against a tighter tolerance", 5e-4);
    for (place, &got) in run(1e-4).indexed_iter() {
        worst.take(f64::from(got - fine[place]), || format!("{place:?}"));
    }
    worst.holds();
}

#[test]
fn narrow_bodies_are_not_stepped_over() {
    // Fibres of 4 um between rays 12 um apart: their light goes missing where rays miss them.
    let setup = Setup::paper([16, 1]);
    let fibres: Vec<Body> = (0..12)
        .map(|i| {
            let at = [-0.6e-3 + 0.107e-3 * f64::from(i), 0.05e-3 * f64::from(i % 3), 0.0];
            body(cylinder(2e-6, 4e-3, 12, 0.3).moved(at).rounded(), 4e4, 0.0)
        })
        .collect();
    let engine = engine(Backend::Bvh);
    let mut scene = scenes::scene(&setup, &fibres, &[0.0, 10e-6, 20e-6, 30e-6, 40e-6]);
    let coarse = sample(&engine, &scene);
    scene.sampling.tolerance = Some(1e-5);
    let fine = sample(&engine, &scene);
    // Five times the tolerance at the worst of the values.
    let mut worst = Worst::new("sampling, fibres between rays", 5e-4);
    for (place, &got) in coarse.indexed_iter() {
        worst.take(f64::from(got - fine[place]), || format!("{place:?}"));
    }
    let flat = engine.simulate(&scene).expect("a stack").flat;
    let seen = fine.iter().zip(&flat).any(|(a, b)| (a - b).abs() > 2e-3);
    assert!(seen, "the fibres leave no trace");
    worst.holds();
}

#[test]
fn light_is_conserved_behind_a_body_that_does_not_attenuate() {
    // Without masks all light lands somewhere, and the body is far from the detector's borders.
    let mut setup = Setup::paper([40, 32]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let bodies = [body(star(0.5e-3, 0.9e-3, 3, 4).rounded(), 0.0, CARBON[1])];
    let stacks = engine(Backend::Bvh).simulate(&scenes::scene(&setup, &bodies, &[0.0]));
    let stacks = stacks.expect("a stack");
    let sum = |values: &mut dyn Iterator<Item = &f32>| values.copied().map(f64::from).sum::<f64>();
    let ratio = sum(&mut stacks.sample.iter()) / sum(&mut stacks.flat.iter());
    let mut worst = Worst::new("sampling, sum of the light", 1e-6);
    worst.take(ratio - 1.0, || "all pixels".into());
    worst.holds();
    let moved = stacks.sample.iter().filter(|value| (**value - 1.0).abs() > 1e-3).count();
    assert!(moved > 100, "the body moves light of {moved} pixels only");
}

/// Sums have 32 binary places. Light of a hundred thousand rays of a pixel, were each rounded down,
/// would lose 1e-5.
#[test]
fn many_rays_of_a_pixel_lose_no_light() {
    let mut setup = Setup::paper([12, 10]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    // Lines need few rays; near grazing incidence rough surfaces draw many, as of this shell of nothing.
    let star = star(0.1e-3, 0.2e-3, 3, 3).rounded();
    let bodies = [body(star.clone(), 0.0, 1e-14), body(star, 0.0, CARBON[1])];
    let mut scene = scenes::scene(&setup, &bodies, &[0.0]);
    scene.objects[0].geometry = Shape::Sphere { radius: 0.5e-3, sides: None }.into();
    scene.objects[0].roughness = 1e-3;
    scene.sampling.transport = Transport::Exact;
    scene.sampling.tolerance = Some(5e-4);
    scene.sampling.max_rays = 1_000_000;
    let engine = engine(Backend::Bvh);
    let mut sink = ArraySink::new();
    let record = engine.run(&scene, &mut sink, Control::default()).expect("a run");
    let stacks = sink.into_stacks().expect("stacks");
    let sum = |values: &mut dyn Iterator<Item = &f32>| values.copied().map(f64::from).sum::<f64>();
    let lost = sum(&mut stacks.flat.iter()) - sum(&mut stacks.sample.iter());
    let rays = record.tally.patch_rays as f64;
    assert!(rays > 1e5, "{rays} rays");
    // A rounding of 2^-32 each, half of it where none is up or down more often; a cell at borders adds to up to six
    // pixels.
    let mut worst = Worst::new("sampling, light lost per ray, shares of a rounding down", 0.2);
    worst.take(lost / (rays * 2.0_f64.powi(-33)), || format!("{rays} rays"));
    worst.holds();
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_stack() {
    let setup = Setup::paper([24, 4]);
    let engine = engine(Backend::Bvh);
    let [left, right] = [-1.0, 1.0].map(|side| {
        let tilted = cylinder(0.5e-3, 3e-3, 64, 0.0).turned([0.0, 1.0, 0.0], 0.3 * side);
        let wire = cuboid([3e-6, 1e-3, 0.2e-3]).moved([side * 0.95e-3, 0.0, 0.03e-3]);
        let bodies = [tilted.moved([side * 0.2e-3, 0.0, 0.0]), wire]
            .map(|mesh| body(mesh.rounded(), CARBON[0], CARBON[1]));
        sample(&engine, &scenes::scene(&setup, &bodies, &[-12e-6 * side, 0.0, 9e-6 * side]))
    });
    // Rectangles are mirrored too, and differ by the rounding of coordinates; those that a rounding
    // splits and its mirror image not differ by what the tolerance leaves.
    let mut worst = Worst::new("sampling, mirrored scene", 1e-4);
    for ((view, step, row, column), value) in left.indexed_iter() {
        let mirrored = right[[view, step, row, 23 - column]];
        worst.take(f64::from(value - mirrored), || format!("step {step}, row {row}, {column}"));
    }
    worst.holds();
}

#[test]
fn another_seed_gives_other_rays() {
    let setup = Setup::paper([8, 1]);
    let bodies = [body(star(0.2e-3, 0.4e-3, 2, 1).rounded(), CARBON[0], CARBON[1])];
    let engine = engine(Backend::Bvh);
    let scene = scenes::scene(&setup, &bodies, &[5e-6]);
    let [a, b] = [1, 2].map(|seed| sample(&engine, &random(scene.clone(), [300, 2], seed)));
    let differing = a.iter().zip(&b).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    assert!(differing >= 6, "{differing} of 8 pixels differ");
}

#[test]
fn normal_quantile_and_distribution_fit_together() {
    // What the variances above stand on.
    let mut worst = Worst::new("sampling, quantile of the distribution", 1e-12);
    for p in [1e-6, 0.1, 0.5, 0.9, 1.0 - 1e-6] {
        worst.take(cumulative(normal::quantile(p)) - p, || format!("{p}"));
    }
    worst.holds();
}
