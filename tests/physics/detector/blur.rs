//! Gaussian blur behind the detector mask against double integrals: light over the analyser, and
//! the share of it that a pixel takes.

use crate::reference::masks::Bars;
use crate::reference::normal::{cumulative, nodes};
use crate::reference::rays::{Order, Sample};
use crate::reference::stack::{Quadrature, Setup};
use crate::reference::surfaces::{body, cuboid, cylinder};
use crate::reference::{closed_form::blurred_overlap, scenes};
use crate::support::{CARBON, Worst, engine};
use beamlet::Backend;
use beamlet::scene::{Blur, RandomRays, Scene};

const PITCH: f64 = 150e-6;

fn blurred(mut scene: Scene, sigma: [f64; 2]) -> Scene {
    scene.detector.blur = Some(Blur::Gaussian { sigma });
    scene
}

/// Share of light at `x` (m, from the centre of a pixel) that the pixel takes.
fn taken(x: f64, sigma: f64) -> f64 {
    cumulative((0.5 * PITCH - x) / sigma) - cumulative((-0.5 * PITCH - x) / sigma)
}

/// Where every pixel gets the same light, blur takes nothing away: what leaves a pixel comes from
/// beside it, at the rim of the detector from light beside the detector.
#[test]
fn blur_changes_no_flat_that_is_the_same_everywhere() {
    // f32 sums of 1e-7 each; parts beyond 6 deviations are left out (2e-9).
    let mut worst = Worst::new("detector, blurred flat of thin masks", 1e-6);
    let setup = Setup::paper([9, 3]).with_bars(Bars::Sheet { transmission: 0.0 });
    let offsets = [-20e-6, 0.0, 7e-6];
    let sharp = scenes::scene(&setup, &[], &offsets);
    let engine = engine(Backend::Bvh);
    let want = engine.simulate(&sharp).unwrap().flat;
    for sigma in [[40e-6, 40e-6], [300e-6, 0.0], [0.0, 200e-6]] {
        let got = engine.simulate(&blurred(sharp.clone(), sigma)).unwrap().flat;
        for ((place, got), want) in got.indexed_iter().zip(&want) {
            worst.take(f64::from(got - want), || format!("{sigma:?}, {place:?}"));
        }
    }
    worst.holds();
}

/// Light behind the detector mask where every second beamlet is missing.
fn skipped(spot: f64) -> Setup {
    let mut setup = Setup::paper([9, 1]).with_bars(Bars::Sheet { transmission: 0.0 });
    setup.spot[0] = spot;
    if let Some(mask) = &mut setup.sample_mask {
        mask.period *= 2.0;
    }
    setup
}

/// A curve of skipped beamlets: light over the analyser is a difference of distribution functions,
/// and every pixel integrates it with its share.
#[test]
fn flat_of_skipped_beamlets_is_the_double_integral() {
    let engine = engine(Backend::Bvh);
    let offsets = [-24e-6, -11e-6, -4e-6, 0.0, 6e-6, 13e-6, 27e-6];
    for (spot, sigma) in [(30e-6, 25e-6), (30e-6, 60e-6), (30e-6, 200e-6), (0.0, 45e-6)] {
        let setup = skipped(spot);
        let scene = blurred(scenes::scene(&setup, &[], &offsets), [sigma, 0.0]);
        let simulation = engine.prepare(&scene).unwrap();
        let grid = *beamlet::internals::detector::model(&simulation).grid();
        // The grid says what sharp edges may come to at their worst place. Smooth ones meet the
        // mean of a parabola, two thirds of its peak.
        let tolerance = if spot > 0.0 { 0.7 * grid.error } else { grid.error } + 1e-6;
        assert!(grid.error < 2.1e-4 && grid.parts[0] > 1, "{grid:?}");
        let mut worst = Worst::new("detector, skipped beamlets, double integral", tolerance);
        let got = engine.simulate(&scene).unwrap().flat;
        let blur = 0.5 * setup.sigma()[0];
        let lit = |u: f64, middle: f64| {
            if blur > 0.0 {
                return cumulative((u - middle + 15e-6) / blur)
                    - cumulative((u - middle - 15e-6) / blur);
            }
            f64::from(u8::from((u - middle).abs() <= 15e-6))
        };
        // Columns reach 4 pixels from the middle, blur 8.
        let n = 600;
        let of_aperture = |aperture: i32| {
            let at = move |i: i32| 30e-6 * ((f64::from(i) + 0.5) / f64::from(n) - 0.5);
            (0..n).map(move |i| at(i) + f64::from(aperture) * PITCH)
        };
        let places: Vec<f64> = (-13..=13).flat_map(of_aperture).collect();
        // Beamlets of twice the period: one at 0, where column 4 is.
        let light_at = |u: f64, shift: f64| {
            let nearest = ((u - shift) / (2.0 * PITCH)).round();
            (-1..=1).map(|k| lit(u, shift + 2.0 * PITCH * (nearest + f64::from(k)))).sum()
        };
        let light: Vec<Vec<f64>> = offsets
            .iter()
            .map(|offset| places.iter().map(|u| light_at(*u, 1.5 * offset)).collect())
            .collect();
        let share: Vec<Vec<f64>> = (0..9)
            .map(|column| {
                let centre = (f64::from(column) - 4.0) * PITCH;
                places.iter().map(|u| taken(u - centre, sigma)).collect()
            })
            .collect();
        for ((step, _, column), &got) in got.indexed_iter() {
            let all = light[step].iter().zip(&share[column]);
            let want = all.map(|(light, share)| light * share).sum::<f64>();
            let want = want * 30e-6 / f64::from(n) / PITCH;
            worst.take(f64::from(got) - want, || {
                format!("sigma {sigma:e}, parts {}, step {step}, column {column}", grid.parts[0])
            });
        }
        worst.holds();
    }
}

/// Silhouettes and the inside of a cylinder: the f64 reference on columns of 2.5 um, each of which
/// the pixels take up with the share of its middle.
#[test]
fn blurred_cylinder_is_the_reference_blurred() {
    const FINE: u32 = 60;
    const COLUMNS: u32 = 12;
    let sigma = 45e-6;
    // Kinks between source points of the reference 2e-5, parts of the grid 1e-4.
    let mut inside = Worst::new("detector, blurred cylinder, interior", 1e-4);
    let mut rim = Worst::new("detector, blurred cylinder, silhouettes", 1e-3);
    let setup = Setup::paper([COLUMNS, 1]);
    let rod = body(cylinder(0.35e-3, 10e-3, 256, 0.1), CARBON[0], CARBON[1]);
    let offsets = [-15e-6, 0.0, 12e-6];
    let scene = blurred(scenes::scene(&setup, std::slice::from_ref(&rod), &offsets), [sigma, 0.0]);
    let engine = engine(Backend::Bvh);
    let got = engine.simulate(&scene).unwrap().sample;
    // Without blur the two part as much at silhouettes: the reference counts whole cells there.
    let mut sharp_rim = Worst::new("detector, the same without blur, silhouettes", 1e-3);
    let sharp = scenes::scene(&setup, std::slice::from_ref(&rod), &offsets);
    let sharp = engine.simulate(&sharp).unwrap().sample;
    // Fine columns over six pixels more on either side.
    let more = 3;
    let mut fine = setup.clone();
    fine.pixels[0] = (COLUMNS + 2 * more) * FINE;
    fine.pitch[0] = PITCH / f64::from(FINE);
    let how = Quadrature { cells: 4, ..Quadrature::line() };
    let sample = Sample::new(&[rod], setup.source_distance, 0.0);
    let light = fine.line(Some(&sample), Order::Exact, &how, 0..fine.pixels[0], 0, &offsets);
    let radius = 0.35e-3 * 1.8 / 1.21;
    for column in 0..COLUMNS {
        let centre = (f64::from(column) + 0.5 - 0.5 * f64::from(COLUMNS)) * PITCH;
        for (step, light) in light.iter().enumerate() {
            let want: f64 = light
                .iter()
                .enumerate()
                .map(|(i, light)| {
                    let u = fine.centre(i as u32, 0)[0];
                    light * taken(u - centre, sigma) / f64::from(FINE)
                })
                .sum();
            let off = f64::from(got[[0, step, 0, column as usize]]) - want;
            let place = || format!("step {step}, column {column}: {want}");
            // A silhouette's light reaches a few pixels.
            if (centre.abs() - radius).abs() < 2.0 * PITCH {
                rim.take(off, place);
                let first = ((column + more) * FINE) as usize;
                let want = light[first..first + FINE as usize].iter().sum::<f64>();
                let got = f64::from(sharp[[0, step, 0, column as usize]]);
                sharp_rim.take(got - want / f64::from(FINE), place);
            } else {
                inside.take(off, place);
            }
        }
    }
    inside.holds();
    rim.holds();
    sharp_rim.holds();
}

/// A horizontal edge, no masks: rows hold shares of a step that the detector blurs.
#[test]
fn horizontal_edge_is_blurred_by_the_detector() {
    // A cell row in which the edge stands is at least 1/256 of a row.
    let mut worst = Worst::new("detector, blurred horizontal edge", 1.0 / 512.0);
    let mut setup = Setup::paper([8, 8]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    setup.spot = [30e-6, 40e-6];
    let spot = setup.sigma()[1] * 0.59 / 1.21;
    let engine = engine(Backend::Bvh);
    for (edge, sigma) in [(0.0, 50e-6), (0.031e-3, 120e-6)] {
        let ledge = body(cuboid([9e-3, 1e-3, 8e-3]).moved([0.0, 0.0, edge - 4e-3]), 1e6, 0.0);
        let scene = blurred(scenes::scene(&setup, &[ledge], &[0.0]), [0.0, sigma]);
        let got = engine.simulate(&scene).unwrap().sample;
        // Its near face shades the most.
        let shadow = edge * 1.8 / 1.2095;
        let blur = spot.hypot(sigma);
        for row in 0..8_u32 {
            let centre = setup.centre(0, row)[1];
            let far = 10e-3;
            let want = blurred_overlap(shadow + 0.5 * far - centre, far, PITCH, blur) / PITCH;
            worst.take(f64::from(got[[0, 0, row as usize, 4]]) - want, || {
                format!("edge {edge:e}, sigma {sigma:e}, row {row}")
            });
        }
    }
    worst.holds();
}

/// Random rays agree with cells where the detector blurs, within their noise.
#[test]
fn random_rays_agree_with_cells_where_the_detector_blurs() {
    let setup = Setup::paper([8, 2]);
    let rod = body(cylinder(0.3e-3, 10e-3, 128, 0.1), CARBON[0], CARBON[1]);
    let scene = blurred(scenes::scene(&setup, &[rod], &[-10e-6, 5e-6]), [50e-6, 50e-6]);
    let engine = engine(Backend::Bvh);
    let cells = engine.simulate(&scene).unwrap().sample;
    let mut random = scene;
    random.sampling.scheme = beamlet::scene::Scheme::Random;
    random.sampling.rays = RandomRays::Grid([20_000, 2]);
    let random = engine.simulate(&random).unwrap().sample;
    // 40,000 rays of transmission 0.16: sqrt(0.16 * 0.84 / 40,000) = 0.0018, five times that.
    let mut worst = Worst::new("detector, random rays with blur", 9e-3);
    let mut mean = 0.0;
    for ((place, cells), random) in cells.indexed_iter().zip(&random) {
        worst.take(f64::from(cells - random), || format!("{place:?}"));
        mean += f64::from(cells - random) / 32.0;
    }
    worst.holds();
    // 32 values.
    let mut worst = Worst::new("detector, random rays with blur, mean", 1.5e-3);
    worst.take(mean, || "all".into());
    worst.holds();
    // The nodes of the reference's normal distribution sum to 1, or nothing above means much.
    assert!((nodes(1.0, 241, 5.0).iter().map(|n| n.1).sum::<f64>() - 1.0).abs() < 1e-9);
}
