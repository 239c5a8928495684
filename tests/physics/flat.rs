//! The flat stack against the closed form of thin masks and against exact box bars.

use crate::reference::closed_form::{ThinMasks, blurred_overlap};
use crate::reference::masks::Bars;
use crate::reference::rays::Order;
use crate::reference::scenes;
use crate::reference::stack::{Quadrature, Setup};
use crate::support::{Checked, GOLD, Worst, amount, engine, sample};
use beamlet::Backend;
use beamlet::scene::Scene;

/// Closed form against engine, where both treat the same thin masks. The fixed point of the sums
/// holds 2e-10, the distribution function 1e-7 (Abramowitz and Stegun 7.1.26), f32 offsets of
/// edges 4e-12 m, which is 1e-7 of a period: 4e-7 leaves room for a few such terms.
const SAME_MASKS: f64 = 4e-7;
/// Thick bars: the form is good to 1e-5, and the sum over 241 source points of the reference to
/// 6e-6.
const THICK: f64 = 2e-5;
/// A bar of this attenuation (1/m) and 225 um lets 0.39 through, as gold does at 80 keV.
const LEAKING: f64 = 4_185.0;

pub(crate) fn steps(reach: f64, count: u32) -> Vec<f64> {
    (0..count).map(|i| reach * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0)).collect()
}

pub(crate) fn thin(setup: &Setup, leak: f64) -> ThinMasks {
    let (a, b) = setup.sample_mask.zip(setup.detector_mask).expect("both masks");
    ThinMasks {
        magnification: b.distance / a.distance,
        sample: [a.aperture, a.period],
        detector: [b.aperture, b.period],
        sigma: setup.sigma()[0],
        leak: [leak; 2],
    }
}

/// The engine's flat, `[step][row][column]`.
fn flat(engine: &Checked, setup: &Setup, offsets: &[f64]) -> ndarray::Array3<f32> {
    let stacks = engine.simulate(&scenes::scene(setup, &[], offsets)).expect("a flat");
    assert_eq!(stacks.sample.shape()[1..], *stacks.flat.shape());
    // A view without objects is the flat, to the last bit.
    assert!(stacks.sample.iter().zip(&stacks.flat).all(|(a, b)| a.to_bits() == b.to_bits()));
    stacks.flat
}

/// Compares columns of the engine's flat with the reference's exact bars.
fn compare_with_boxes(worst: &mut Worst, setup: &Setup, columns: &[u32], offsets: &[f64]) {
    let got = flat(&engine(Backend::Bvh), setup, offsets);
    let row = setup.pixels[1] / 2;
    for &column in columns {
        let want = setup.pixel(None, Order::Exact, &Quadrature::fine(), column, row, offsets);
        for (i, want) in want.iter().enumerate() {
            let got = f64::from(got[[i, row as usize, column as usize]]);
            worst.take(got - want, || format!("column {column}, step {i}: {got} for {want}"));
        }
    }
}

#[test]
fn thin_masks_give_the_closed_form_in_every_pixel() {
    let mut worst = Worst::new("flat, thin masks, closed form", SAME_MASKS);
    let engine = engine(Backend::Bvh);
    for (leak, spot) in
        [(0.0, 30e-6), (6.4e-6, 30e-6), (0.39, 30e-6), (0.0, 0.0), (0.39, 0.0), (0.0, 90e-6)]
    {
        for pixels in [[16, 3], [7, 1]] {
            let mut setup = Setup::paper(pixels).with_bars(Bars::Sheet { transmission: leak });
            setup.spot[0] = spot;
            // A period and more, with steps that fall on no kink of a point source's curve.
            let offsets = steps(63e-6, 24);
            let got = flat(&engine, &setup, &offsets);
            for ((step, row, column), &got) in got.indexed_iter() {
                let want = thin(&setup, leak).intensity(offsets[step]);
                worst.take(f64::from(got) - want, || {
                    format!("leak {leak}, spot {spot:e}, step {step}, pixel {column}, {row}")
                });
            }
        }
    }
    worst.holds();
}

#[test]
fn flat_curve_of_the_paper_peaks_at_0_16612() {
    let mut worst = Worst::new("flat, peak of the paper's set-up", 5e-6);
    // Thin masks: the printed figure has five digits.
    let setup = Setup::paper([16, 1]).with_bars(Bars::Sheet { transmission: 0.0 });
    let got = flat(&engine(Backend::Bvh), &setup, &[0.0]);
    worst.take(f64::from(got[[0, 0, 8]]) - 0.166_12, || "the axis".into());
    worst.holds();
}

#[test]
fn thick_bars_match_exact_box_paths_within_2e_5() {
    let mut worst = Worst::new("flat, thick bars on and off axis", THICK);
    for mu in [GOLD, LEAKING] {
        let setup = Setup::paper([128, 1]).with_bars(Bars::Boxes { mu, thickness: 225e-6 });
        compare_with_boxes(&mut worst, &setup, &[0, 20, 63, 127], &steps(40e-6, amount(9, 17)));
    }
    worst.holds();
}

/// An invocation on the device takes more or fewer mask steps, as dispatches take time: no bit depends on it.
#[test]
fn a_mask_step_has_the_same_bits_alone_and_beside_others() {
    let offsets = steps(40e-6, 17);
    for spot in [0.0, 30e-6] {
        // 0.043 rad: light of an aperture lands in several beamlets, which see its bars alike.
        let mut setup = Setup::paper([1024, 1]);
        setup.spot[0] = spot;
        let engine = engine(Backend::Bvh);
        let together = flat(&engine, &setup, &offsets);
        for (step, offset) in sample(offsets.iter().enumerate().collect(), 4) {
            let alone = flat(&engine, &setup, &[*offset]);
            for (column, alone) in alone.iter().enumerate() {
                let beside = together[[step, 0, column]];
                let shown = || format!("spot {spot:e}, step {step}, column {column}");
                assert!(alone.to_bits() == beside.to_bits(), "{}: {alone} and {beside}", shown());
            }
        }
    }
}

#[test]
fn rows_see_the_bars_under_their_own_angle() {
    // Blocks of rows share an angle: 1e-7 of open beam is promised for each mask, f32 adds as much.
    // Up to 43 mrad in z the leak falls by 3e-4; the edges of the bars, which the closed form
    // leaves out, are the same in every row but for 1e-3 of their narrowing.
    let mut worst = Worst::new("flat, leak of rows far off the axis", 3e-7);
    let (thickness, offsets) = (225e-6, steps(60e-6, 7));
    let setup = Setup::paper([2, 1024]).with_bars(Bars::Boxes { mu: LEAKING, thickness });
    let got = flat(&engine(Backend::Bvh), &setup, &offsets);
    let intensity = |row: f64, offset: f64| {
        let slope = (row + 0.5 - 512.0) * setup.pitch[1] / setup.detector_distance;
        let leak = (-LEAKING * thickness * (1.0 + slope * slope).sqrt()).exp();
        thin(&setup, leak).intensity(offset)
    };
    for (step, &offset) in offsets.iter().enumerate() {
        for row in [0_u16, 1, 15, 16, 100, 300, 511, 700, 1023] {
            let change = f64::from(got[[step, row.into(), 0]]) - f64::from(got[[step, 512, 0]]);
            let want = intensity(row.into(), offset) - intensity(512.0, offset);
            worst.take(change - want, || format!("row {row}, step {step}: {change} for {want}"));
        }
    }
    worst.holds();
}

#[test]
fn thick_bars_match_exact_box_paths_at_43_mrad() {
    // 0.043 rad: the bars' shadows take half of the apertures.
    let mut worst = Worst::new("flat, thick bars at 43 mrad", THICK);
    let setup = Setup::paper([1024, 1]);
    compare_with_boxes(&mut worst, &setup, &[0, 200, 1023], &steps(40e-6, 17));
    worst.holds();
}

#[test]
fn thick_bars_match_exact_box_paths_with_a_point_source() {
    let mut worst = Worst::new("flat, thick bars, point source", THICK);
    for mu in [GOLD, LEAKING] {
        let mut setup = Setup::paper([128, 1]).with_bars(Bars::Boxes { mu, thickness: 225e-6 });
        setup.spot = [0.0; 2];
        compare_with_boxes(&mut worst, &setup, &[0, 31, 64], &steps(40e-6, 17));
    }
    worst.holds();
}

#[test]
fn sample_mask_alone_passes_its_share_and_spreads_it() {
    let mut worst = Worst::new("flat, sample mask alone", THICK);
    for bars in [
        Bars::Sheet { transmission: 0.0 },
        Bars::Boxes { mu: GOLD, thickness: 225e-6 },
        Bars::Boxes { mu: LEAKING, thickness: 225e-6 },
    ] {
        let mut setup = Setup::paper([128, 1]).with_bars(bars);
        setup.detector_mask = None;
        compare_with_boxes(&mut worst, &setup, &[0, 40, 64], &steps(48e-6, 9));
    }
    worst.holds();
    // Thin and opaque: each pixel's share of the beamlets is a blurred overlap.
    let mut worst = Worst::new("flat, sample mask alone, closed form", SAME_MASKS);
    let mut setup = Setup::paper([16, 1]).with_bars(Bars::Sheet { transmission: 0.0 });
    setup.detector_mask = None;
    let offsets = steps(47e-6, 8);
    let got = flat(&engine(Backend::Bvh), &setup, &offsets);
    for ((step, _, column), &got) in got.indexed_iter() {
        let want: f64 = (-2..=2)
            .map(|k| 1.5 * offsets[step] + 150e-6 * f64::from(k))
            .map(|x| blurred_overlap(x, 30e-6, 150e-6, 0.5 * setup.sigma()[0]))
            .sum();
        worst.take(f64::from(got) - want / 150e-6, || format!("step {step}, column {column}"));
    }
    worst.holds();
}

#[test]
fn detector_mask_alone_passes_its_share() {
    // Nothing blurs, and no edge meets another: what is left is f32.
    let mut worst = Worst::new("flat, detector mask alone", 2e-6);
    for bars in [
        Bars::Sheet { transmission: 0.0 },
        Bars::Sheet { transmission: 0.39 },
        Bars::Boxes { mu: GOLD, thickness: 225e-6 },
        Bars::Boxes { mu: LEAKING, thickness: 225e-6 },
    ] {
        let mut setup = Setup::paper([128, 1]).with_bars(bars);
        setup.sample_mask = None;
        compare_with_boxes(&mut worst, &setup, &[0, 40, 64], &[0.0]);
    }
    worst.holds();
}

#[test]
fn detector_mask_before_the_detector_casts_its_shadow_there() {
    // Light of two apertures may reach one pixel, and one aperture two pixels.
    let mut worst = Worst::new("flat, detector mask 50 mm before the detector", THICK);
    let bars = Bars::Boxes { mu: GOLD, thickness: 225e-6 };
    let mut setup = Setup::paper([64, 1]);
    setup.detector_mask = Some(setup.mask(1.75, 30e-6, bars));
    compare_with_boxes(&mut worst, &setup, &[0, 31, 50], &steps(40e-6, 9));
    worst.holds();
}

#[test]
fn other_periods_and_offsets_match_exact_box_paths() {
    // The sample mask serves every second column and stands 13 um aside.
    let mut worst = Worst::new("flat, skipped columns and an offset", THICK);
    let mut setup = Setup::paper([32, 1]);
    if let Some(mask) = &mut setup.sample_mask {
        // Aperture 0 of the lattice of 32 stands half a period from the axis.
        mask.period *= 2.0;
        mask.origin = 0.5 * mask.period + 13e-6;
    }
    compare_with_boxes(&mut worst, &setup, &[0, 1, 15, 16, 31], &steps(60e-6, 9));
    worst.holds();
}

#[test]
fn open_beam_is_one() {
    let mut worst = Worst::new("flat, no masks", 1e-6);
    let mut setup = Setup::paper([33, 5]);
    (setup.sample_mask, setup.detector_mask) = (None, None);
    let got = flat(&engine(Backend::Bvh), &setup, &[0.0]);
    for (place, &got) in got.indexed_iter() {
        worst.take(f64::from(got) - 1.0, || format!("{place:?}"));
    }
    worst.holds();
}

#[test]
fn fibres_that_do_nothing_leave_the_flat_however_finely_they_cut_cells() {
    // Soft edges of thick bars move light beyond cells that are narrower than they: 18 mm off the
    // axis they are 0.3 um deep. With light kept within its cell values were 4.6e-5 off.
    let mut worst =
        Worst::new("behind fibres that do nothing against the flat, of open beam", 1e-6);
    for spot in ["30 um", "2 um"] {
        let text = format!(
            "{}\n[detector]\ndistance = \"1.8 m\"\npixels = [400, 1]\npitch = \"150 um\"\n\
             [scan]\nmask_offsets = {{ from = \"-25 um\", to = \"25 um\", count = 5 }}\n\
             [sampling]\ntolerance = 1e-2\n\
             [materials.nothing]\nformula = \"C\"\ndensity = \"1e-9 g/cm3\"\n\
             [[object]]\nname = \"fibres\"\nmaterial = \"nothing\"\nposition = [\"18 mm\", \"0 mm\", \"0 mm\"]\n\
             shape = {{ cylinder = {{ radius = \"2.5 um\", height = \"1 mm\" }} }}\n\
             instances = {{ packing = \"parallel-fibres\", count = 1000, seed = 1, \
             region = {{ box = {{ size = [\"0.5 mm\", \"0.4 mm\", \"1 mm\"] }} }} }}\n",
            include_str!("../support/masks.toml")
                .replace("\"30 um\", \"26 um\"", &format!("\"{spot}\", \"{spot}\"")),
        );
        let scene = Scene::from_toml(&text, ".").expect("a scene");
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("a stack");
        let tally = &stacks.record.tally;
        assert!(tally.patches > 3 && tally.rays > 100, "no fibres in the beam: {tally:?}");
        for ((place, flat), sample) in stacks.flat.indexed_iter().zip(&stacks.sample) {
            worst.take(f64::from(sample - flat), || format!("spot {spot}, {place:?}"));
        }
    }
    worst.holds();
}
