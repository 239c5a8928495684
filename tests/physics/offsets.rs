//! Mask offsets of many periods: masks repeat with their period.

use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cylinder};
use crate::support::{CARBON, Worst, engine};
use beamlet::Backend;
use beamlet::scene::{RandomRays, Scheme};

/// f64 holds 1 m to 1e-16 m and f32 the rest in a period to 4e-12 m: 4e-7 of open beam, as between
/// the flat and its closed form, and 2e-6 where rays of a sample add up several such terms.
const SAME_FLAT: f64 = 4e-7;
const SAME_SAMPLE: f64 = 2e-6;

#[test]
fn offsets_of_ten_thousand_periods_match_offsets_within_one() {
    let mut flats = Worst::new("flat, offsets of 10,000 periods", SAME_FLAT);
    let mut samples = Worst::new("sample, offsets of 10,000 periods", SAME_SAMPLE);
    let rod = body(cylinder(0.35e-3, 10e-3, 64, 0.1), CARBON[0], CARBON[1]);
    // Beyond half a period, too.
    let offsets: Vec<f64> = (0..9).map(|step| f64::from(step - 4) * 17.3e-6).collect();
    for scheme in [Scheme::Cells, Scheme::Random] {
        let mut near = scenes::scene(&Setup::paper([16, 2]), std::slice::from_ref(&rod), &offsets);
        near.sampling.scheme = scheme;
        near.sampling.rays = RandomRays::Grid([200, 1]);
        let period = near.sample_mask.as_ref().expect("a sample mask").period;
        let engine = engine(Backend::Bvh);
        let wanted = engine.simulate(&near).expect("stacks");
        for periods in [-3.0, 10_000.0] {
            let mut far = near.clone();
            far.scan.mask_offsets.iter_mut().for_each(|offset| *offset += periods * period);
            let got = engine.simulate(&far).expect("stacks");
            let what = |at: &str| format!("{scheme:?}, {periods} periods, {at}");
            for ((at, got), wanted) in got.flat.indexed_iter().zip(&wanted.flat) {
                flats.take(f64::from(got - wanted), || what(&format!("{at:?}")));
            }
            for ((at, got), wanted) in got.sample.indexed_iter().zip(&wanted.sample) {
                samples.take(f64::from(got - wanted), || what(&format!("{at:?}")));
            }
        }
    }
    flats.holds();
    samples.holds();
}
