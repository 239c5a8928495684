//! Focal spots that are no single Gaussian: against sums over source points that are traced one
//! by one, against closed forms, and against one another.

#![allow(clippy::unwrap_used, reason = "clippy exempts tests, but not what they call")]
#![allow(clippy::cast_possible_truncation, reason = "whole numbers of pixels")]

use crate::reference::closed_form::blurred_overlap;
use crate::reference::masks::Bars;
use crate::reference::normal::cumulative;
use crate::reference::rays::{Order, Sample};
use crate::reference::scenes;
use crate::reference::stack::{Quadrature, Setup};
use crate::reference::surfaces::{Body, body, cuboid, cylinder};
use crate::support::{CARBON, Worst, engine, sample};
use beamlet::Backend;
use beamlet::scene::{RandomRays, Scene, Scheme};
use beamlet::scene::{Spot, SpotPart};
use ndarray::{Array2, array};

const OPAQUE: Bars = Bars::Sheet { transmission: 0.0 };
/// As in tests/physics/sample.rs: kinks of overlapping edges between the source points of the reference,
/// of two narrower Gaussians here.
const INTERIOR: f64 = 5e-5;
/// As in tests/physics/sample.rs: the reference counts whole cells.
const RIM: f64 = 1e-3;

pub(super) const fn part(weight: f64, fwhm: [f64; 2], offset: [f64; 2]) -> SpotPart {
    SpotPart::new(weight, fwhm, offset)
}

/// A wide part to the left, a narrow one to the right; the centroid lies on the axis.
pub(super) const LOPSIDED: [SpotPart; 2] =
    [part(0.6, [14e-6, 10e-6], [-10e-6, 4e-6]), part(0.4, [6e-6, 20e-6], [15e-6, -6e-6])];

pub(super) fn with_spot(setup: &Setup, bodies: &[Body], offsets: &[f64], spot: Spot) -> Scene {
    let mut scene = scenes::scene(setup, bodies, offsets);
    scene.source.spot = spot;
    scene
}

/// Compares flat and sample stack of a lopsided spot with rays from every point of its parts.
fn compare(name: &'static str, setup: &Setup, radius: f64, columns: [std::ops::Range<u32>; 2]) {
    let offsets = match setup.sample_mask {
        Some(_) => vec![-21e-6, -9e-6, 0.0, 4e-6, 16e-6],
        None => vec![0.0],
    };
    let bodies = [body(cylinder(radius, 8e-3, 2048, 0.25).rounded(), CARBON[0], CARBON[1])];
    let scene = with_spot(setup, &bodies, &offsets, Spot::gaussians(LOPSIDED.to_vec()));
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("stacks");
    let sample = Sample::new(&bodies, setup.source_distance, 0.0);
    let how = match setup.sample_mask {
        Some(_) => Quadrature::line(),
        None => Quadrature { cells: 1000, ..Quadrature::line() },
    };
    let reference = |sample: Option<&Sample>, columns: std::ops::Range<u32>| {
        let mut total = vec![vec![0.0; columns.len()]; offsets.len()];
        for part in LOPSIDED {
            let mut setup = setup.clone();
            (setup.spot, setup.source_offset) = (part.fwhm, part.offset);
            let line = setup.line(sample, Order::Exact, &how, columns.clone(), 0, &offsets);
            for (total, line) in total.iter_mut().flatten().zip(line.iter().flatten()) {
                *total += part.weight * line;
            }
        }
        total
    };
    let take =
        |worst: &mut Worst, want: &[Vec<f64>], first: u32, got: &dyn Fn(usize, usize) -> f32| {
            for (step, line) in want.iter().enumerate() {
                for (k, want) in line.iter().enumerate() {
                    let column = first as usize + k;
                    let got = f64::from(got(step, column));
                    worst.take(got - want, || {
                        format!("{name}, column {column}, step {step}: {got} for {want}")
                    });
                }
            }
        };
    let [inside, rim] = columns;
    let mut flat = Worst::new("spots, flat of a lopsided spot", 2e-5);
    let want = reference(None, inside.start..inside.start + 1);
    take(&mut flat, &want, inside.start, &|step, column| stacks.flat[[step, 0, column]]);
    let mut worst = Worst::new("spots, sample, interior", INTERIOR);
    let want = reference(Some(&sample), inside.clone());
    take(&mut worst, &want, inside.start, &|s, c| stacks.sample[[0, s, 0, c]]);
    worst.holds();
    let mut worst = Worst::new("spots, sample, silhouettes", RIM);
    let want = reference(Some(&sample), rim.clone());
    take(&mut worst, &want, rim.start, &|s, c| stacks.sample[[0, s, 0, c]]);
    worst.holds();
    flat.holds();
}

#[test]
fn lopsided_spot_is_the_sum_over_its_points() {
    compare("the paper's set-up", &Setup::paper([24, 1]), 1.0e-3, [5..9, 1..4]);
}

#[test]
fn lopsided_spot_is_the_sum_with_the_sample_far_behind_the_mask() {
    // What lies 300 mm behind the mask moves by a fifth of the offset against its apertures.
    let mut setup = Setup::paper([24, 1]);
    setup.source_distance = 1.5;
    compare("300 mm behind the mask", &setup, 1.2e-3, [5..9, 1..4]);
}

#[test]
fn lopsided_spot_is_the_sum_with_the_detector_behind_its_mask() {
    // Apertures 100 mm before the detector and its pixels see the source move differently. In the
    // second and third set-up light falls on the edges between pixels.
    let mut setup = Setup::paper([24, 1]).with_bars(OPAQUE);
    setup.detector_mask = Some(setup.mask(1.7, 30e-6 * 1.7 / 1.8, OPAQUE));
    compare("detector mask 100 mm before", &setup, 1.0e-3, [5..9, 1..4]);
    for mask in setup.sample_mask.iter_mut().chain(setup.detector_mask.iter_mut()) {
        mask.origin = 0.0;
    }
    compare("the same between pixels", &setup, 1.0e-3, [5..9, 1..4]);
    setup.detector_mask = None;
    compare("sample mask alone between pixels", &setup, 1.0e-3, [5..9, 1..4]);
}

#[test]
fn lopsided_spot_is_the_sum_without_one_mask_or_both() {
    let masks = vec![(true, false), (false, true), (false, false)];
    for (sample_mask, detector_mask) in sample(masks, 2) {
        let mut setup = Setup::paper([24, 1]).with_bars(OPAQUE);
        if !sample_mask {
            setup.sample_mask = None;
        }
        if !detector_mask {
            setup.detector_mask = None;
        }
        compare("one mask or none", &setup, 1.0e-3, [6..9, 1..4]);
    }
}

#[test]
fn heights_of_parts_move_shadows_down_and_up() {
    // The edge at z = e shades the detector below e * 1.8 / 1.21 - s * 0.59 / 1.21 for a source
    // at height s: rows hold the sum of blurred steps. The parts are moved by 40 um and by three
    // rows, and one is a point.
    let mut setup = Setup::paper([8, 10]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let parts = [part(3.0, [10e-6, 200e-6], [0.0, -80e-6]), part(1.0, [10e-6, 0.0], [0.0, 880e-6])];
    let spot = Spot::gaussians(parts.to_vec());
    // A cell row in which the edge stands is at least 1/256 of a row.
    let mut worst = Worst::new("spots, horizontal edge", 1.0 / 512.0);
    let engine = engine(Backend::Bvh);
    for edge in [0.0, 0.11e-3, -0.2e-3] {
        let ledge = cuboid([8e-3, 4e-6, 4e-3]).moved([0.0, 0.0, edge - 2e-3]);
        let bodies = [body(ledge.rounded(), 1e8, 0.0)];
        let scene = with_spot(&setup, &bodies, &[0.0], spot.clone());
        let got = engine.simulate(&scene).expect("a stack").sample;
        for row in 0..10_u32 {
            let centre = setup.centre(0, row)[1];
            let mut want = 0.0;
            // The centroid, 160 um up, is put on the axis.
            for (share, fwhm, height) in [(0.75, 200e-6, -240e-6), (0.25, 0.0, 720e-6)] {
                let shadow = edge * 1.8 / 1.21 - height * 0.59 / 1.21;
                let blur = fwhm * 0.424_660_9 * 0.59 / 1.21;
                let far = 10e-3;
                let at = shadow + 0.5 * far - centre;
                want += share * blurred_overlap(at, far, 150e-6, blur) / 150e-6;
            }
            for column in 2..6 {
                let got = f64::from(got[[0, 0, row as usize, column]]);
                worst.take(got - want, || format!("edge {edge}, row {row}: {got} for {want}"));
            }
        }
    }
    worst.holds();
}

fn image_of(side: usize, pixel: f64, value: impl Fn(f64, f64) -> f64) -> Array2<f64> {
    let middle = 0.5 * (side as f64 - 1.0);
    Array2::from_shape_fn((side, side), |(row, column)| {
        value((column as f64 - middle) * pixel, (middle - row as f64) * pixel)
    })
}

pub(super) const OFFSETS: [f64; 6] = [-25e-6, -12e-6, -5e-6, 0.0, 8e-6, 19e-6];

#[test]
fn image_of_a_gaussian_gives_the_stacks_of_the_gaussian() {
    // A pixel of 1 um spreads its value: the deviation grows by 1 in 4,000, which the peak feels
    // as 1.5e-5 of open beam; 2e-3 of the light lies beyond 3.2 deviations.
    let normal = |x: f64, fwhm: f64| (-4.0 * std::f64::consts::LN_2 * (x / fwhm).powi(2)).exp();
    let image = image_of(121, 1e-6, |x, z| normal(x, 30e-6) * normal(z, 26e-6));
    let spot = Spot::of_image(&image, [1e-6; 2]).unwrap();
    assert_eq!(spot.parts().len(), 1, "{spot:?}");
    let setup = Setup::paper([24, 1]);
    let bodies = [body(cylinder(1e-3, 8e-3, 512, 0.25).rounded(), CARBON[0], CARBON[1])];
    let engine = engine(Backend::Bvh);
    let run = |spot| engine.simulate(&with_spot(&setup, &bodies, &OFFSETS, spot)).expect("stacks");
    let (got, want) = (run(spot), run([30e-6, 26e-6].into()));
    let mut flat = Worst::new("spots, image of a Gaussian, flat", 5e-5);
    let mut sample = Worst::new("spots, image of a Gaussian, sample", 5e-5);
    for (place, value) in want.flat.indexed_iter() {
        flat.take(f64::from(got.flat[place] - value), || format!("{place:?}"));
    }
    for (place, value) in want.sample.indexed_iter() {
        sample.take(f64::from(got.sample[place] - value), || format!("{place:?}"));
    }
    flat.holds();
    sample.holds();
}

#[test]
fn large_and_pixelated_spot_images_are_reported() {
    // Two spots far apart, of one pixel each: 300 pixels a side are summed to 100, which keeps
    // centroid and variances.
    let mut image = Array2::zeros((300, 300));
    (image[[150, 20]], image[[150, 279]]) = (1.0, 3.0);
    let spot = Spot::of_image(&image, [1e-6; 2]).unwrap();
    assert_eq!(spot.fit().unwrap().block, [3, 3]);
    assert!(spot.warnings().iter().any(|text| text.contains("3 x 3 pixels")));
    let variance = 0.1875 * 259e-6_f64.powi(2) + 1e-12 / 12.0;
    assert!((spot.fwhm()[0] * 0.424_660_9 / variance.sqrt() - 1.0).abs() < 1e-6);
    // A board of single pixels is no smooth spot.
    let board = image_of(81, 1e-6, |x, z| {
        let at = |v: f64| (v / 1e-6).round() as i64;
        if at(x) % 10 == 0 && at(z) % 10 == 0 { 1.0 } else { 0.0 }
    });
    let spot = Spot::of_image(&board, [1e-6; 2]).unwrap();
    assert!(spot.parts().len() <= 64);
    assert!(spot.warnings().iter().any(|text| text.contains("smooth the image")), "{spot:?}");
}

/// The flat of thin opaque masks for point sources at some offsets along x, with weights.
fn flat_of_points(points: &[[f64; 2]], offset: f64) -> f64 {
    let of = |[at, weight]: &[f64; 2]| {
        // Light through the aperture at f lands at M f - (M - 1) s.
        weight * blurred_overlap(1.5 * offset - 0.5 * at, 30e-6, 30e-6, 0.0) / 150e-6
    };
    points.iter().map(of).sum()
}

#[test]
fn image_gives_the_flat_of_its_pixels_as_point_sources() {
    // A disc of 40 um with a hot spot on one side: few Gaussians against 2,000 point sources.
    // 1e-4 is what a flat has to reach.
    let value = |x: f64, z: f64| {
        let hot = (-((x - 10e-6).powi(2) + (z + 4e-6).powi(2)) / 30e-12).exp();
        if x.hypot(z) < 20e-6 { 1.0 + 3.0 * hot } else { 0.0 }
    };
    let image = image_of(61, 1e-6, value);
    let spot = Spot::of_image(&image, [1e-6; 2]).unwrap();
    let fit = spot.fit().unwrap().clone();
    assert!(spot.parts().len() > 1 && spot.parts().len() <= 64);
    assert!(fit.relative_error <= 1e-3, "{fit:?}");
    // 0.5 / 150 um is what a metre of source changes the overlap by.
    assert!(2.0 * 0.5 / 150e-6 * fit.error < 1e-4, "{fit:?}");
    let sum = image.sum();
    let weights = image.sum_axis(ndarray::Axis(0)) / sum;
    let centre: f64 = weights.iter().enumerate().map(|(i, w)| w * (i as f64 - 30.0) * 1e-6).sum();
    let points: Vec<[f64; 2]> =
        weights.iter().enumerate().map(|(i, w)| [(i as f64 - 30.0) * 1e-6 - centre, *w]).collect();
    let setup = Setup::paper([4, 1]).with_bars(OPAQUE);
    let offsets: Vec<f64> = (-30..=30).map(|i| f64::from(i) * 1e-6).collect();
    let got = engine(Backend::Bvh).simulate(&with_spot(&setup, &[], &offsets, spot)).unwrap().flat;
    let mut worst = Worst::new("spots, image against its pixels as point sources", 1e-4);
    for (step, offset) in offsets.iter().enumerate() {
        let got = f64::from(got[[step, 0, 1]]);
        worst.take(got - flat_of_points(&points, *offset), || format!("offset {offset:e}"));
    }
    worst.holds();
}

#[test]
fn tail_of_the_spot_towards_x_is_a_tail_of_the_curve_towards_the_same_offsets() {
    // The aperture at f is seen through from s where M f = (M - 1) s: the curve is the spot,
    // (M - 1) / M = 1/3 as wide, not turned over, and overlapped with boxes that have no skew. So
    // is its third moment. Columns run along +x, row 0 is on top.
    let image = array![[9.0, 4.0, 3.0, 2.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]];
    let pixel = [12e-6, 10e-6];
    let spot = Spot::of_image(&image, pixel).unwrap();
    let moment = |axis: usize, power: i32| -> f64 {
        let cells = || {
            image.indexed_iter().map(|((row, column), w)| {
                (w / image.sum(), [column as f64 * pixel[0], -(row as f64) * pixel[1]][axis])
            })
        };
        let mean: f64 = cells().map(|(w, at)| w * at).sum();
        cells().map(|(w, at)| w * (at - mean).powi(power)).sum()
    };
    assert!(moment(0, 3) > 0.0 && moment(1, 3) < 0.0);
    // About the centroid, which the engine puts on the optical axis.
    let mean = |of: &dyn Fn(f64) -> f64| {
        let total: f64 = spot.parts().iter().map(|part| part.weight).sum();
        spot.parts().iter().map(|part| part.weight * of(part.offset[1])).sum::<f64>() / total
    };
    let centre = mean(&|z| z);
    let up = mean(&|z| (z - centre).powi(3));
    assert!(up < 0.0, "most light on top leaves a tail downwards: {up:e}");
    let setup = Setup::paper([4, 1]).with_bars(OPAQUE);
    let offsets: Vec<f64> = (-80..=80).map(|i| f64::from(i) * 0.5e-6).collect();
    let got = engine(Backend::Bvh).simulate(&with_spot(&setup, &[], &offsets, spot)).unwrap().flat;
    let curve: Vec<f64> = (0..offsets.len()).map(|step| got[[step, 0, 2]].into()).collect();
    let area: f64 = curve.iter().sum();
    let mean = |f: &dyn Fn(f64) -> f64| {
        curve.iter().zip(&offsets).map(|(light, at)| light * f(*at)).sum::<f64>() / area
    };
    let centre = mean(&|f| f);
    let mut centroid = Worst::new("spots, centroid of the curve of a lopsided image, m", 1e-9);
    centroid.take(centre, || "the curve".into());
    // Few coarse pixels: Gaussians keep two moments of each, of the third 1 %.
    let mut third = Worst::new("spots, third moment of the curve over that of the image", 1e-2);
    let got = mean(&|f| (f - centre).powi(3)) * 27.0 / moment(0, 3);
    third.take(got - 1.0, || format!("{got}"));
    centroid.holds();
    third.holds();
}

#[test]
fn gaussian_as_a_weighted_superposition_of_point_sources() {
    // Points stand 10 / (n - 1) deviations apart. Between two of them the curve is a straight
    // line: a comb of mass 0.4 h / sigma changes it by twice 0.4 h^2 / (8 sigma) 0.5 / 150 um,
    // 2.6e-4 for 41 points and 1.6e-5 for 161.
    let setup = Setup::paper([24, 1]);
    let bodies = [body(cylinder(1e-3, 8e-3, 512, 0.25).rounded(), CARBON[0], CARBON[1])];
    let engine = engine(Backend::Bvh);
    let run = |spot| {
        let mut scene = with_spot(&setup, &bodies, &OFFSETS, spot);
        // Every stack has its own cells: they leave a tenth of what is compared.
        (scene.sampling.tolerance, scene.sampling.angle_tolerance) = (Some(3e-6), Some(1e-9));
        engine.simulate(&scene).expect("stacks")
    };
    let want = run([30e-6, 0.0].into());
    for (points, name, tolerance) in
        [(41, "spots, 41 point sources", 2.6e-4), (161, "spots, 161 point sources", 3e-5)]
    {
        let got = run(Spot::points([30e-6, 0.0], [points, 1]));
        let mut worst = Worst::new(name, tolerance);
        for (place, value) in want.flat.indexed_iter() {
            worst.take(f64::from(got.flat[place] - value), || format!("flat {place:?}"));
        }
        for (place, value) in want.sample.indexed_iter() {
            worst.take(f64::from(got.sample[place] - value), || format!("sample {place:?}"));
        }
        worst.holds();
    }
}

#[test]
fn random_rays_draw_the_parts_of_the_spot() {
    // As for one Gaussian (tests/sampling/sampling.rs): a target t on the detector mask is hit if the
    // source offset s has s (1 - 1/M) + t / M in an aperture.
    let setup = Setup::paper([256, 2]).with_bars(OPAQUE);
    let (rays, offset) = (2000_u32, 8e-6);
    let (mut p, mut variance) = (0.0, 0.0);
    for i in 0..rays {
        let target = 150e-6 * ((f64::from(i) + 0.5) / f64::from(rays) - 0.5);
        if target.abs() < 15e-6 {
            let hit: f64 = LOPSIDED
                .iter()
                .map(|part| {
                    let sigma = part.fwhm[0] * 0.424_660_9 / 3.0;
                    let at = |edge: f64| offset + edge - target / 1.5 - part.offset[0] / 3.0;
                    let [high, low] = [10e-6, -10e-6].map(|edge| cumulative(at(edge) / sigma));
                    part.weight * (high - low)
                })
                .sum();
            p += hit;
            variance += hit * (1.0 - hit);
        }
    }
    let n = f64::from(rays);
    let (mean, deviation) = (p / n, variance.sqrt() / n);
    let mut scene = with_spot(&setup, &[], &[offset], Spot::gaussians(LOPSIDED.to_vec()));
    let engine = engine(Backend::Bvh);
    // Evenly spaced targets, 400 to an aperture: 1e-6 for a spot of 30 um; this one is narrower.
    let mut cells = Worst::new("spots, cells against the mean of random rays", 5e-6);
    for got in &engine.simulate(&scene).expect("a flat").flat {
        cells.take(f64::from(*got) - mean, || "a pixel".into());
    }
    (scene.sampling.scheme, scene.sampling.rays, scene.sampling.seed) =
        (Scheme::Random, RandomRays::Count(rays), 11);
    let random = engine.simulate(&scene).expect("a flat").flat;
    let scores: Vec<f64> = random.iter().map(|got| (f64::from(*got) - mean) / deviation).collect();
    let count = scores.len() as f64;
    let mut score = Worst::new("spots, random flat, mean score", 4.0);
    score.take(scores.iter().sum::<f64>() / count.sqrt(), || "the mean".into());
    let mut spread = Worst::new("spots, random flat, spread", 4.0);
    let squares: f64 = scores.iter().map(|score| score * score).sum();
    spread.take((squares - count) / (2.0 * count).sqrt(), || "the squares".into());
    cells.holds();
    score.holds();
    spread.holds();
}

#[test]
fn spectrum_of_a_lopsided_spot_is_the_sum_over_its_energies() {
    // Two lines are two nodes. Cells of both energies are gathered where the displacement differs
    // by up to 15 % of the narrowest part's blur: 2e-4 of the light of an edge.
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("lines.csv"), "energy_keV,weight\n30,0.6\n45,0.4\n").unwrap();
    let mask = "material = \"gold\"\nthickness = \"225 um\"\nprojected_aperture = \"30 um\"\n";
    let scene = |beam: &str| {
        let text = format!(
            "[source]\ndistance = \"1.21 m\"\n{beam}\nspot = \"0 um\"\n[detector]\n\
             distance = \"1.8 m\"\npixels = [24, 3]\npitch = \"150 um\"\n[sample_mask]\n\
             distance = \"1.2 m\"\n{mask}[detector_mask]\n{mask}[scan]\n\
             mask_offsets = [\"-9 um\", \"4 um\"]\n[materials.carbon]\nformula = \"C\"\n\
             density = \"2 g/cm3\"\n[[object]]\nname = \"ball\"\nmaterial = \"carbon\"\n\
             shape = {{ sphere = {{ radius = \"1 mm\", sides = 256 }} }}\n"
        );
        let mut scene = Scene::from_toml(&text, place.path()).unwrap();
        scene.source.spot = Spot::gaussians(LOPSIDED.to_vec());
        // Every stack has its own cells: they leave a tenth of what is compared.
        (scene.sampling.tolerance, scene.sampling.angle_tolerance) = (Some(3e-6), Some(1e-9));
        scene
    };
    let engine = engine(Backend::Bvh);
    let run = |beam: &str| engine.simulate(&scene(beam)).expect("stacks");
    let both = run("spectrum = { file = \"lines.csv\", nodes = 2 }");
    let [low, high] = [run("energy = \"30 keV\""), run("energy = \"45 keV\"")];
    let mut flat = Worst::new("spots, flat of two energies", 2e-5);
    for (place, got) in both.flat.indexed_iter() {
        let want = 0.6 * f64::from(low.flat[place]) + 0.4 * f64::from(high.flat[place]);
        flat.take(f64::from(*got) - want, || format!("{place:?}"));
    }
    // At silhouettes rectangles as narrow as f32 allows (2 nm) leave 2e-5 in either stack.
    let mut sample = Worst::new("spots, sample of two energies", 4e-5);
    for (place, got) in both.sample.indexed_iter() {
        let want = 0.6 * f64::from(low.sample[place]) + 0.4 * f64::from(high.sample[place]);
        sample.take(f64::from(*got) - want, || format!("{place:?}"));
    }
    flat.holds();
    sample.holds();
}
