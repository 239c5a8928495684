//! The reference itself against answers that can be written down.

use crate::flat::{steps, thin};
use crate::reference::closed_form::{
    bars_at_slope, blurred_overlap, critical_angle, cylinder_deflection,
};
use crate::reference::masks::{Bars, Mask};
use crate::reference::normal;
use crate::reference::rays::{Order, Sample, Trace};
use crate::reference::stack::{Quadrature, Setup};
use crate::reference::surfaces::{Body, Mesh, Random, body, cuboid, cylinder, sphere, star, wedge};
use std::f64::consts::FRAC_PI_6;

/// Carbon of 2.0 g/cm3 at 30 keV.
const CARBON: [f64; 2] = [51.235, 4.6092e-7];
/// Water at 30 keV.
const WATER: [f64; 2] = [37.559, 2.5604e-7];

const OPAQUE: Bars = Bars::Sheet { transmission: 0.0 };

fn carbon(mesh: Mesh) -> Body {
    body(mesh, CARBON[0], CARBON[1])
}

/// A parallel ray along y at (x, z), analyser 0.59 m behind the origin.
fn straight(sample: &Sample, x: f64, z: f64, order: Order) -> Trace {
    sample.trace([x, -1.21, z], [0.0, 1.0, 0.0], 0.59, order)
}

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "got {got:e}, want {want:e} within {tolerance:e}");
}

#[test]
fn normal_distribution_has_its_tabulated_values() {
    // Abramowitz and Stegun, table 26.1, and Mills' ratio far out.
    close(normal::cumulative(1.0), 0.841_344_746_068_542_9, 1e-15);
    close(normal::cumulative(-4.0), 3.167_124_183_311_992e-5, 1e-18);
    close(normal::cumulative(-8.0), 6.220_960_574_271_785e-16, 1e-27);
    close(normal::quantile(0.975), 1.959_963_984_540_054, 1e-12);
    // Half of the height at half of the full width.
    close(normal::density(0.5 / normal::SIGMA_PER_FWHM) / normal::density(0.0), 0.5, 1e-15);
    let spread: f64 = normal::nodes(2.0, 161, 5.0).iter().map(|(v, w)| v * v * w).sum();
    // Cut at 5 sigma: 1.5e-5 of the variance is missing.
    close(spread, 4.0, 1e-4);
}

#[test]
fn flat_curve_of_the_paper_peaks_where_it_should() {
    let setup = Setup::paper([128, 128]);
    close(thin(&setup, 0.0).intensity(0.0), 0.166_12, 5e-6);
    let mut point = setup.clone();
    point.spot = [0.0; 2];
    close(thin(&point, 0.0).intensity(0.0), 0.2, 1e-15);
    // The curve's area is a1 a2 / p2, over the one period in which f matters.
    let fine = steps(50e-6, 20_001);
    let area: f64 = fine[1..].iter().map(|&f| thin(&setup, 0.0).intensity(f)).sum();
    close(area * 100e-6 / 20_000.0, 20e-6 * 30e-6 / 150e-6, 1e-12);
}

#[test]
fn numeric_flat_curve_equals_the_closed_form() {
    for (leak, spot) in [(0.0, 30e-6), (0.39, 30e-6), (0.0, 0.0), (0.39, 10e-6)] {
        let mut setup = Setup::paper([128, 128]).with_bars(Bars::Sheet { transmission: leak });
        setup.spot = [spot; 2];
        let steps = steps(40e-6, 9);
        let got = setup.pixel(None, Order::Exact, &Quadrature::fine(), 3, 60, &steps);
        for (got, f) in got.iter().zip(&steps) {
            // A sum over 241 source points meets the kinks of the overlap between them.
            close(*got, thin(&setup, leak).intensity(*f), 6e-6);
        }
    }
}

#[test]
fn thick_bars_match_exact_box_paths_within_2e_5() {
    // The way through bars by clipping the ray against each box, point by point.
    let mask = Mask {
        distance: 1.2,
        period: 100e-6,
        aperture: 20e-6,
        origin: 13e-6,
        bars: Bars::Boxes { mu: 4_000.0, thickness: 225e-6 },
    };
    let mut random = Random::new(3);
    for _ in 0..2000 {
        let (x, slope) = (random.between(-1e-3, 1e-3), random.between(-0.6, 0.6));
        let mut way = 0.0;
        for k in -20..=20 {
            let centre = 13e-6 + (f64::from(k) + 0.5) * 100e-6;
            let at = |edge: f64| (edge - x) / slope;
            let (a, b) = (at(centre - 40e-6), at(centre + 40e-6));
            way += (a.max(b).min(112.5e-6) - a.min(b).max(-112.5e-6)).max(0.0);
        }
        let want = (-4_000.0 * way * (1.0 + slope * slope).sqrt()).exp();
        close(mask.transmission(x, [slope, 0.0]), want, 1e-9);
    }
}

#[test]
fn bars_off_axis_act_as_narrower_and_blurred_thin_ones() {
    for (mu, spot) in [(53_122.0, 30e-6), (53_122.0, 0.0), (4_185.0, 30e-6), (4_185.0, 0.0)] {
        let bars = Bars::Boxes { mu, thickness: 225e-6 };
        let mut setup = Setup::paper([128, 1]).with_bars(bars);
        setup.spot = [spot; 2];
        for column in [0, 20, 63] {
            let slope = setup.centre(column, 0)[0] / 1.8;
            let mut equal = thin(&setup, (-mu * 225e-6_f64).exp());
            let [first, blur_1] = bars_at_slope(equal.sample[0], mu, 225e-6, slope);
            let [second, blur_2] = bars_at_slope(equal.detector[0], mu, 225e-6, slope);
            (equal.sample[0], equal.detector[0]) = (first, second);
            let m = equal.magnification;
            equal.sigma = equal.sigma.hypot((m * m * blur_1 + blur_2).sqrt() / (m - 1.0));
            let steps = steps(40e-6, 17);
            let got = setup.pixel(None, Order::Exact, &Quadrature::fine(), column, 0, &steps);
            for (got, f) in got.iter().zip(&steps) {
                // The third moment of the edges is left out: 7e-5 with a point source, where
                // edges coincide at f = 0; 1e-5 behind a blur.
                close(*got, equal.intensity(*f), if spot > 0.0 { 1e-5 } else { 8e-5 });
            }
        }
    }
}

#[test]
fn mean_over_a_cell_is_the_mean_of_its_points() {
    let mut random = Random::new(4);
    for case in 0..200 {
        let bars = if case % 2 == 0 {
            Bars::Boxes { mu: random.between(500.0, 50_000.0), thickness: 225e-6 }
        } else {
            Bars::Sheet { transmission: 0.2 }
        };
        let mask = Mask { distance: 1.2, period: 100e-6, aperture: 20e-6, origin: 0.0, bars };
        let slope = [random.between(-0.1, 0.1), 0.0];
        let low = random.between(-200e-6, 200e-6);
        let high = low + random.between(0.1e-6, 60e-6);
        let points = 20_000;
        let sum: f64 = (0..points)
            .map(|i| low + (f64::from(i) + 0.5) / f64::from(points) * (high - low))
            .map(|x| mask.transmission(x, slope))
            .sum();
        // A hard edge between two points errs by half a point.
        close(mask.mean(low, high, slope), sum / f64::from(points), 6e-5);
    }
}

#[test]
fn open_set_ups_transmit_the_product_of_their_areas() {
    let setup = Setup::paper([16, 16]).with_bars(OPAQUE);
    let flat =
        |setup: &Setup| setup.pixel(None, Order::Exact, &Quadrature::line(), 5, 5, &[0.0])[0];
    let mut one = setup.clone();
    one.sample_mask = None;
    close(flat(&one), 0.2, 1e-5);
    one.detector_mask = None;
    close(flat(&one), 1.0, 1e-12);
    let mut tracking = setup.clone();
    tracking.detector_mask = None;
    let line = tracking.line(None, Order::Exact, &Quadrature::line(), 0..16, 5, &[40e-6]);
    for got in &line[0] {
        let want: f64 = (-2..=2)
            .map(|k| {
                blurred_overlap(
                    60e-6 + 150e-6 * f64::from(k),
                    30e-6,
                    150e-6,
                    0.5 * setup.sigma()[0],
                )
            })
            .sum();
        close(*got, want / 150e-6, 5e-6);
    }
}

#[test]
fn wedge_deflects_by_delta_times_tan_angle_towards_its_edge() {
    for angle in [0.1, 0.5, 1.0] {
        let sample =
            Sample::new(&[carbon(wedge(2e-3, angle, 2e-3).moved([-1e-3, 0.0, 0.0]))], 1.21, 0.0);
        let got = straight(&sample, 0.3e-3, 0.1e-3, Order::Exact);
        // Enters at right angles; leaves by n sin(angle) = sin(angle + turn).
        let want = ((1.0 - CARBON[1]) * angle.sin()).asin() - angle;
        // f64 holds n to 1e-16, the slope to 2e-16 / cos.
        close(got.slope[0], want.tan(), 1e-14);
        close(want, -CARBON[1] * angle.tan(), 2e-12);
        let first = straight(&sample, 0.3e-3, 0.1e-3, Order::First);
        close(first.slope[0], -CARBON[1] * angle.tan(), 1e-18);
        close(first.path[0], 1.3e-3 * angle.tan(), 1e-15);
        close(first.displacement[0], first.slope[0] * (0.59 - 1.3e-3 * angle.tan()), 1e-20);
        assert!(got.balanced && !got.reflected && got.crossings == 2);
    }
}

#[test]
fn cylinder_and_sphere_displace_light_as_lenses_do() {
    let round = [
        Sample::new(&[carbon(cylinder(4e-3, 16e-3, 20_000, 0.25))], 1.21, 0.0),
        Sample::new(&[carbon(sphere(4e-3, 7))], 1.21, 0.0),
    ];
    for (sample, flatness) in round.iter().zip([2e-4, 1.5e-2]) {
        for x in [-3.5e-3, -2.0e-3, 0.5e-3, 3e-3] {
            let want = cylinder_deflection(CARBON[1], 4e-3, x) * 0.59;
            for order in [Order::First, Order::Exact] {
                let got = straight(sample, x, 0.01e-3, order);
                // Both refractions lie near the rotation centre: levers differ by 4 mm at most,
                // facets by half of their angle.
                close(
                    got.displacement[0],
                    want,
                    flatness * cylinder_deflection(CARBON[1], 4e-3, 3.5e-3) * 0.59,
                );
                close(got.path[0], 2.0 * (16e-6 - x * x).sqrt(), 1e-6);
                assert!(got.displacement[0].signum() == x.signum(), "n < 1 spreads light");
            }
        }
    }
}

#[test]
fn face_reflects_below_the_critical_angle_and_refracts_above() {
    let sample =
        Sample::new(&[carbon(cuboid([2e-3, 8e-3, 4e-3]).moved([-1e-3, 0.0, 0.0]))], 1.21, 0.0);
    let critical = critical_angle(CARBON[1]);
    close(critical, 9.601_2e-4, 1e-8);
    for grazing in [0.2, 0.9, 0.999, 1.001, 1.1, 2.0].map(|f| f * critical) {
        let slope = grazing.tan();
        let ray = sample.trace([slope * 1.21, -1.21, 0.0], [-slope, 1.0, 0.0], 0.59, Order::Exact);
        if grazing < critical {
            assert!(ray.reflected);
            close(ray.slope[0], 2.0 * slope, 1e-15);
            close(ray.displacement[0], 2.0 * slope * 0.59, 1e-14);
            close(ray.optical_depth, 0.0, 0.0);
        } else {
            // Out of the back face by n sin t' = sin t'', with cos t' = cos t / n inside the face.
            let n = 1.0 - CARBON[1];
            let out = (grazing.sin().powi(2) - CARBON[1] * (1.0 + n)).sqrt().asin();
            assert!(!ray.reflected);
            // The reference's root of 1 - sin^2 holds 2e-16, the sine inside 1e-16 / sine.
            close(ray.slope[0], slope - out.tan(), 4e-16 / out);
        }
        assert!(ray.balanced);
    }
}

#[test]
fn inner_bodies_replace_what_lies_around_them() {
    let (shell, core, void) = (cylinder(3e-3, 8e-3, 64, 0.1), cuboid([2e-3; 3]), cuboid([1e-3; 3]));
    let bodies = [carbon(shell), body(core, WATER[0], WATER[1]), body(void, 0.0, 0.0)];
    let sample = Sample::new(&bodies, 1.21, 0.0);
    for order in [Order::First, Order::Exact] {
        let ray = straight(&sample, 0.2e-3, 0.1e-3, order);
        close(ray.path[1], 1e-3, 1e-9);
        close(ray.path[2], 1e-3, 1e-9);
        close(ray.optical_depth, CARBON[0] * ray.path[0] + WATER[0] * 1e-3, 1e-12);
        assert!(ray.balanced && ray.crossings == 6);
    }
    // A void of the surroundings' medium deflects exactly as their difference does.
    let ball = sphere(1e-3, 4);
    let hollow = [carbon(cuboid([4e-3; 3])), body(ball.clone(), 0.0, 0.0)];
    let void = straight(&Sample::new(&hollow, 1.21, 0.0), 0.6e-3, 0.1e-3, Order::First);
    let solid = straight(&Sample::new(&[carbon(ball)], 1.21, 0.0), 0.6e-3, 0.1e-3, Order::First);
    close(void.displacement[0], -solid.displacement[0], 1e-18);
}

#[test]
fn sorted_triangles_give_what_all_triangles_give() {
    let bodies: Vec<Body> = (0..3)
        .map(|i| {
            carbon(star(1e-3, 2e-3, 3, i).moved([1e-3 * (i as f64 - 1.0), 0.5e-3 * i as f64, 0.0]))
        })
        .collect();
    let (sorted, all) = (Sample::new(&bodies, 1.21, 0.4), Sample::brute_force(&bodies, 1.21, 0.4));
    let mut random = Random::new(9);
    for _ in 0..3000 {
        let source = [random.between(-1e-4, 1e-4), -1.21, random.between(-1e-4, 1e-4)];
        let to = [random.between(-3e-3, 3e-3), 1.21, random.between(-2e-3, 2e-3)];
        for order in [Order::First, Order::Exact] {
            let (a, b) =
                (sorted.trace(source, to, 0.59, order), all.trace(source, to, 0.59, order));
            assert!(a.balanced && b.balanced);
            assert_eq!(a.crossings, b.crossings);
            close(a.optical_depth, b.optical_depth, 1e-13);
            close(a.displacement[0], b.displacement[0], 1e-15);
            close(a.slope[1], b.slope[1], 1e-15);
        }
    }
}

#[test]
fn exact_and_first_order_differ_by_second_order_alone() {
    let mesh = star(1e-3, 1.5e-3, 2, 5);
    let difference = |delta: f64| {
        let sample = Sample::new(&[body(mesh.clone(), 0.0, delta)], 1.21, 0.0);
        let (mut worst, mut random) = (0.0_f64, Random::new(6));
        for _ in 0..500 {
            let (x, z) = (random.between(-1e-3, 1e-3), random.between(-1e-3, 1e-3));
            let (a, b) =
                (straight(&sample, x, z, Order::Exact), straight(&sample, x, z, Order::First));
            if a.grazing > 0.1 && a.crossings == b.crossings && b.crossings == 2 {
                worst = worst.max((a.slope[0] - b.slope[0]).abs());
            }
        }
        worst
    };
    // Four times the difference at twice delta; large deltas, so that f64 sees it.
    close(difference(4e-6) / difference(2e-6), 4.0, 0.05);
}

#[test]
fn view_turns_the_sample_backwards() {
    let rod = cuboid([1e-3, 1e-3, 4e-3]).moved([2e-3, 0.0, 0.0]);
    // At +30 degrees the beam has turned towards +y of the world's x axis: the rod is seen at
    // x = 2 cos 30, y = -2 sin 30.
    let sample = Sample::new(&[carbon(rod)], 1.21, FRAC_PI_6);
    let hit = straight(&sample, 2e-3 * FRAC_PI_6.cos(), 0.0, Order::First);
    let missed = straight(&sample, -2e-3 * FRAC_PI_6.cos(), 0.0, Order::First);
    assert_eq!((hit.crossings, missed.crossings), (2, 0));
    // The four faces have the lever of their hits: the mean is that of the rod's centre.
    let back = hit.displacement[0] / hit.slope[0] - 0.59;
    assert!(hit.slope[0].abs() < 1e-20 || back > 0.0);
}

#[test]
fn deflected_light_is_counted_once_wherever_it_lands() {
    let mut setup = Setup::paper([24, 1]).with_bars(OPAQUE);
    setup.detector_mask = None;
    let prism = carbon(wedge(0.6e-3, 1.45, 2e-3).moved([-0.3e-3, 0.0, 0.0]));
    let how = Quadrature { cells: 200, sources: 41, ..Quadrature::line() };
    let sum = |delta: f64| -> f64 {
        let sample = Sample::new(&[Body { delta, ..prism.clone() }], 1.21, 0.0);
        setup.line(Some(&sample), Order::Exact, &how, 0..24, 0, &[0.0])[0].iter().sum()
    };
    // 2.2 um of displacement inside the detector: no light is lost or counted twice.
    close(sum(CARBON[1]), sum(0.0), 1e-6);
}

#[test]
fn line_is_made_of_its_pixels() {
    let setup = Setup::paper([32, 4]);
    let sample = Sample::new(&[carbon(cylinder(0.8e-3, 4e-3, 512, 0.3))], 1.21, 0.0);
    let how = Quadrature { cells: 200, sources: 41, ..Quadrature::line() };
    let steps = [-10e-6, 0.0, 15e-6];
    let line = setup.line(Some(&sample), Order::Exact, &how, 0..32, 1, &steps);
    for column in [0, 9, 22] {
        let pixel = setup.pixel(Some(&sample), Order::Exact, &how, column, 1, &steps);
        for (step, got) in pixel.iter().enumerate() {
            close(*got, line[step][column as usize], 1e-9);
        }
    }
}
