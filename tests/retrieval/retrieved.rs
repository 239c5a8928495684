//! What users retrieve from the stacks: transmission and refraction angle by a Gaussian fit,
//! by the engine on its own stacks, and by least squares in f64 on closed forms of the same
//! geometry. The bias of a Gaussian is the same on both, so that only stacks and fits differ.

use crate::reference::closed_form::ThinMasks;
use crate::reference::fit::fit;
use crate::reference::masks::Bars;
use crate::reference::rays::{Order, Sample};
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{Body, body, cuboid, wedge};
use crate::stacks::images_of;
use crate::support::{CARBON, Worst, backends, engine, free_gaussian};
use beamlet::retrieve::Method;

/// 11 steps over +-25 um.
fn offsets() -> Vec<f64> {
    (0..11).map(|i| -25e-6 + 5e-6 * f64::from(i)).collect()
}

/// Transmission and refraction angle (M = 1.5, z = 0.59 m) of a pixel.
fn retrieve(flat: &[f64], sample: &[f64]) -> [f64; 2] {
    let [f, s] = [flat, sample].map(|curve| fit(&offsets(), curve));
    [s[0] * s[2] / (f[0] * f[2]), -1.5 / 0.59 * (s[1] - f[1])]
}

/// Thin masks of the paper and their closed form.
fn set_up() -> (Setup, ThinMasks) {
    let setup = Setup::paper([32, 1]).with_bars(Bars::Sheet { transmission: 0.0 });
    let masks = ThinMasks {
        magnification: 1.5,
        sample: [20e-6, 100e-6],
        detector: [30e-6, 150e-6],
        sigma: setup.sigma()[0],
        leak: [0.0; 2],
    };
    (setup, masks)
}

/// Compares what is retrieved in columns 8 to 23 with the closed form: light of a column is
/// dimmed by the optical depth and displaced by what the f64 reference says of its central ray.
fn compare(of: &Body, transmission: &mut Worst, refraction: &mut Worst) {
    let (setup, masks) = set_up();
    let sample = Sample::new(std::slice::from_ref(of), 1.21, 0.0);
    let flat: Vec<f64> = offsets().iter().map(|f| masks.intensity(*f)).collect();
    for backend in backends() {
        let scene = scenes::scene(&setup, std::slice::from_ref(of), &offsets());
        let engine = engine(backend);
        let stacks = engine.simulate(&scene).unwrap();
        let frames = [stacks.flat.view(), stacks.sample.index_axis(ndarray::Axis(0), 0)];
        let images = images_of(&engine, &scene, &free_gaussian(), frames);
        for column in 8..24_u32 {
            let ray = setup.trace(&sample, [0.0; 2], setup.centre(column, 0), Order::Exact);
            let curve: Vec<f64> = offsets()
                .iter()
                .map(|f| {
                    (-ray.optical_depth).exp() * masks.intensity(f + ray.displacement[0] / 1.5)
                })
                .collect();
            let c = column as usize;
            let [t, a] = ["transmission", "refraction"]
                .map(|name| f64::from(images.get(name).unwrap()[[0, c]]));
            let [t_true, a_true] = retrieve(&flat, &curve);
            transmission.take(t - t_true, || format!("{backend}, column {column}"));
            refraction.take(a - a_true, || format!("{backend}, column {column}"));
        }
    }
}

#[test]
fn refraction_angle_of_a_wedge_is_retrieved_to_1e_9() {
    // f32 stacks hold 1e-7 of a peak of 0.17; over a width of 10 um that is about 1e-11 rad. The
    // design asks for 1e-9; the curve of a wedge without absorption is a closed form.
    let mut transmission = Worst::new("retrieved, wedge, transmission", 1e-5);
    let mut refraction = Worst::new("retrieved, wedge, refraction angle (rad)", 1e-10);
    let wedge = wedge(2.4e-3, 0.8, 6e-3).moved([-1.2e-3, -1.2e-3, 0.0]).rounded();
    compare(&body(wedge, 0.0, CARBON[1]), &mut transmission, &mut refraction);
    transmission.holds();
    refraction.holds();
}

#[test]
fn transmission_of_a_slab_is_retrieved_to_1e_4() {
    let mut transmission = Worst::new("retrieved, slab, transmission", 1e-5);
    let mut refraction = Worst::new("retrieved, slab, refraction angle (rad)", 1e-10);
    let slab = cuboid([6e-3, 4e-3, 6e-3]).rounded();
    compare(&body(slab, CARBON[0], CARBON[1]), &mut transmission, &mut refraction);
    transmission.holds();
    refraction.holds();
}

/// A sample mask alone, behind it a wedge and a slab, over pixels of 10, 15 and 55 um; masks of
/// gold as well, which narrow apertures by 3 to 4 um at the rims of 480 pixels of 55 um.
#[test]
fn beam_tracking_behind_a_single_mask_gives_the_angle_of_a_wedge_and_the_transmission_of_a_slab() {
    // f32 stacks hold 1e-7 of open beam; what pixels of 55 um make of it is 1e-11 rad. Gold: edges
    // are exponential, the fit's are a Gaussian, and pixels weigh them alike.
    let mut transmission = Worst::new("beam tracking, transmission", 1e-4);
    let mut refraction = Worst::new("beam tracking, refraction angle over the truth, less 1", 1e-4);
    let mut behind_gold = Worst::new("beam tracking behind gold, the same", 2e-3);
    let sheet = Bars::Sheet { transmission: 0.0 };
    let gold = Bars::Boxes { mu: 53_122.0, thickness: 225e-6 };
    for (pitch, columns, period, aperture, bars) in [
        (10e-6, 480, 100e-6, 20e-6, sheet),
        (15e-6, 320, 100e-6, 20e-6, sheet),
        (55e-6, 88, 400e-6 / 1.5, 40e-6, sheet),
        (55e-6, 480, 400e-6 / 1.5, 40e-6, gold),
    ] {
        let mut setup = Setup::paper([columns, 1]);
        setup.detector_mask = None;
        setup.pitch = [pitch, 150e-6];
        setup.sample_mask = setup.sample_mask.map(|mut mask| {
            (mask.period, mask.aperture, mask.bars) = (period, aperture, bars);
            mask.origin = 0.5 * period;
            mask
        });
        let length = f64::from(columns) * pitch;
        // A wedge of 4 mm, of ten times the density of carbon.
        let angle = (4e-3 / length).atan();
        let bodies = [
            body(
                wedge(length, angle, 6e-3).moved([-0.5 * length, -2e-3, 0.0]).rounded(),
                0.0,
                10.0 * CARBON[1],
            ),
            body(cuboid([2.0 * length, 4e-3, 6e-3]).rounded(), CARBON[0], 0.0),
        ];
        for of in &bodies {
            let sample = Sample::new(std::slice::from_ref(of), 1.21, 0.0);
            let scene = scenes::scene(&setup, std::slice::from_ref(of), &[0.0]);
            let engine = engine(backends()[0]);
            let stacks = engine.simulate(&scene).unwrap();
            let options = free_gaussian().with_method(Method::Beamlet);
            let frames = [stacks.flat.view(), stacks.sample.index_axis(ndarray::Axis(0), 0)];
            let images = images_of(&engine, &scene, &options, frames);
            let count = images.get("transmission").unwrap().ncols();
            for beamlet in 3..count - 3 {
                let centre = (beamlet as f64 + 0.5 - 0.5 * count as f64) * 1.5 * period;
                let ray = setup.trace(&sample, [0.0; 2], [centre, 0.0], Order::Exact);
                let [t, a] = ["transmission", "refraction"]
                    .map(|name| f64::from(images.get(name).unwrap()[[0, beamlet]]));
                let about = || format!("{pitch} m, {columns} columns, beamlet {beamlet}: {t}, {a}");
                transmission.take(t - (-ray.optical_depth).exp(), about);
                let angle = ray.displacement[0] / 0.59;
                // The slab deflects by what rounding leaves.
                if angle.abs() > 1e-12 {
                    let worst = if columns == 480 && pitch > 50e-6 {
                        &mut behind_gold
                    } else {
                        &mut refraction
                    };
                    worst.take(a / angle - 1.0, about);
                }
            }
        }
    }
    transmission.holds();
    refraction.holds();
    behind_gold.holds();
}
