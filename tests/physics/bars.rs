//! Flats behind bars of every ratio of bar, shadow and aperture, against exact box paths.

use crate::reference::masks::{Bars, Mask};
use crate::reference::rays::Order;
use crate::reference::scenes;
use crate::reference::stack::{Quadrature, Setup};
use crate::support::{Checked, GOLD, Worst, backends, engine, sample};
use beamlet::Backend;
use beamlet::internals::trace::MaterialTable;
use beamlet::material::constants_at;
use beamlet::scene::{Anode, Beam, Filter, MaskBody, Scene, SpectrumOrigin, SpectrumSpec};
use std::path::Path;

/// Largest deviation of flats where bars of a mask are narrower than half of their shadow.
const NARROW: f64 = 1e-5;
/// Largest deviation of flats elsewhere.
const WIDE: f64 = 2e-5;
/// Columns of 150 um, 1.8 m from the source: up to 50 mrad.
const COLUMNS: u32 = 1200;
/// 0, 0.5, 4, 17, 33 and 50 mrad.
const PLACES: [u32; 6] = [600, 606, 650, 800, 1000, 1199];
/// Where edges of pixels stand elsewhere in periods of 6 to 12 um of the detector mask.
const BETWEEN: [u32; 4] = [790, 797, 803, 999];
/// Opaque at 225 um, leaking 0.011, 0.39 and 0.91.
const ATTENUATIONS: [f64; 4] = [GOLD, 20_000.0, 4_185.0, 400.0];
/// Thicknesses of the sample mask and the detector mask, m.
const THICKNESSES: [[f64; 2]; 4] = [[10e-6; 2], [100e-6, 300e-6], [225e-6; 2], [1e-3, 500e-6]];
/// FWHM of the focal spot, m.
const SPOTS: [f64; 3] = [0.0, 30e-6, 90e-6];

/// Two masks with bars of these widths, the first before the sample.
#[derive(Debug, Clone, Copy)]
struct Case {
    bars: [f64; 2],
    thickness: [f64; 2],
    mu: f64,
    spot: f64,
}

impl Case {
    fn setup(&self) -> Setup {
        let mut setup = Setup::paper([COLUMNS, 1]);
        setup.spot = [self.spot; 2];
        let mask = |i: usize, distance| {
            let mut mask = setup.mask(
                distance,
                0.0,
                Bars::Boxes { mu: self.mu, thickness: self.thickness[i] },
            );
            mask.aperture = mask.period - self.bars[i];
            mask
        };
        (setup.sample_mask, setup.detector_mask) = (Some(mask(0, 1.2)), Some(mask(1, 1.8)));
        setup
    }
}

/// True if bars of a mask are narrower than half of their shadow in a column.
fn is_narrow(setup: &Setup, column: u32) -> bool {
    let slope = setup.centre(column, 0)[0] / setup.detector_distance;
    setup.sample_mask.iter().chain(&setup.detector_mask).any(|mask| match mask.bars {
        Bars::Boxes { thickness, .. } => {
            mask.period - mask.aperture < 0.5 * thickness * slope.abs()
        }
        Bars::Sheet { .. } => false,
    })
}

/// Worst deviations of columns where bars are narrower than half of their shadow, and of others.
struct WorstOf {
    narrow: Worst,
    wide: Worst,
}

impl WorstOf {
    fn new(narrow: &'static str, wide: &'static str) -> Self {
        Self { narrow: Worst::new(narrow, NARROW), wide: Worst::new(wide, WIDE) }
    }

    /// Worst deviation of columns of the same kind as this column.
    fn at(&mut self, setup: &Setup, column: u32) -> &mut Worst {
        if is_narrow(setup, column) { &mut self.narrow } else { &mut self.wide }
    }

    fn holds(self) {
        self.narrow.holds();
        self.wide.holds();
    }
}

/// Set-up of a scene whose detector mask lies on the detector: the mask counts as there, as large as it is
/// seen from the source, its shadows too.
fn on_the_detector(mut setup: Setup) -> Setup {
    if let Some(Mask { bars: Bars::Boxes { mu, thickness }, .. }) = &mut setup.detector_mask {
        let scale = 1.8 / (1.8 - 0.5 * *thickness);
        (*mu, *thickness) = (*mu / scale, *thickness * scale);
    }
    setup
}

fn steps(reach: f64, count: u32) -> Vec<f64> {
    (0..count).map(|i| reach * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0)).collect()
}

/// Slopes are those of the middle of a cell; bars are cut exactly. Kinks between the source points
/// leave 1e-6.
fn quadrature() -> Quadrature {
    Quadrature { cells: 60, sources: 481, ..Quadrature::fine() }
}

/// Compares columns of a flat with exact boxes.
fn compare_columns(
    engine: &Checked,
    setup: &Setup,
    columns: impl IntoIterator<Item = u32>,
    offsets: &[f64],
    mut take: impl FnMut(u32, f64, &dyn Fn() -> String),
) {
    let stack = engine.simulate(&scenes::scene(setup, &[], offsets)).expect("a flat").flat;
    let reference = on_the_detector(setup.clone());
    for column in columns {
        let want = reference.pixel(None, Order::Exact, &quadrature(), column, 0, offsets);
        for (step, want) in want.iter().enumerate() {
            let got = f64::from(stack[[step, 0, column as usize]]);
            let place = || format!("column {column}, step {step}: {got} for {want}");
            take(column, got - want, &place);
        }
    }
}

/// Cases with bars of these widths, m, of every thickness, attenuation and spot.
fn cases(bars: &[[f64; 2]]) -> Vec<Case> {
    let mut all = Vec::new();
    for &bars in bars {
        for thickness in THICKNESSES {
            for mu in ATTENUATIONS {
                all.extend(SPOTS.map(|spot| Case { bars, thickness, mu, spot }));
            }
        }
    }
    all
}

#[test]
fn bars_of_every_width_match_exact_box_paths() {
    let mut worst = WorstOf::new("bars, some narrower than half of their shadow", "bars, others");
    let bars = [
        [0.0, 120e-6],
        [80e-6, 0.0],
        [0.2e-6, 120e-6],
        [80e-6, 0.2e-6],
        [1e-6, 80e-6],
        [80e-6, 1e-6],
        [1e-6, 1e-6],
        [3e-6, 3e-6],
        [3e-6, 40e-6],
        [10e-6, 40e-6],
        [40e-6, 10e-6],
        [20e-6, 30e-6],
        [80e-6, 120e-6],
        [97e-6, 145e-6],
        [99e-6, 1e-6],
    ];
    let engine = engine(Backend::Bvh);
    for case in sample(cases(&bars), 67) {
        let setup = case.setup();
        compare_columns(&engine, &setup, PLACES, &steps(47e-6, 5), |column, off, place| {
            worst.at(&setup, column).take(off, || format!("{case:?}, {}", place()));
        });
    }
    worst.holds();
}

/// Most that a column of a flat may differ from the mean of those beside it, away from the axis, where
/// |slope| has a kink: neighbours see the bars under angles that differ by 8e-5, and the number of layers may
/// differ by one.
const BETWEEN_COLUMNS: f64 = NARROW;
/// Columns on either side of the axis that are left out.
const ABOUT_THE_AXIS: u32 = 12;

/// Soft edges are cut into layers, whose number depends on the angle. Apertures that reach from one
/// beamlet into the next had another number in each: where offsets of the sample mask brought them there,
/// single columns were up to 1.5e-3 off.
#[test]
fn neighbouring_columns_of_a_flat_agree_within_1e_5() {
    let mut worst = Worst::new("bars, columns beside one another", BETWEEN_COLUMNS);
    let engine = engine(Backend::Bvh);
    let mut all = Vec::new();
    for mu in ATTENUATIONS {
        for spot in SPOTS {
            let case = Case { bars: [80e-6, 2e-6], thickness: [225e-6, 100e-6], mu, spot };
            all.extend([1, 2].map(|masks| (case, masks)));
        }
    }
    for (case, masks) in sample(all, 5) {
        let mut setup = case.setup();
        setup.detector_mask = setup.detector_mask.filter(|_| masks == 2);
        let scene = scenes::scene(&setup, &[], &steps(50e-6, 41));
        let flat = engine.simulate(&scene).expect("a flat").flat;
        for step in 0..41 {
            for column in (1..COLUMNS - 1).filter(|c| c.abs_diff(600) > ABOUT_THE_AXIS) {
                let at = |column: u32| f64::from(flat[[step, 0, column as usize]]);
                let off = at(column) - 0.5 * (at(column - 1) + at(column + 1));
                worst
                    .take(off, || format!("{case:?}, masks {masks}, step {step}, column {column}"));
            }
        }
    }
    worst.holds();
}

#[test]
fn apertures_as_wide_as_their_period_are_no_mask() {
    // The fixed point of the sums and f32: no bar is there at any angle.
    let mut worst = Worst::new("bars, none", 1e-6);
    for backend in backends() {
        for spot in SPOTS {
            let case = Case { bars: [0.0; 2], thickness: [225e-6; 2], mu: GOLD, spot };
            let scene = scenes::scene(&case.setup(), &[], &steps(47e-6, 5));
            let stack = engine(backend).simulate(&scene).expect("a flat").flat;
            for (place, &got) in stack.indexed_iter() {
                worst.take(f64::from(got) - 1.0, || format!("{case:?}, {place:?}"));
            }
        }
    }
    worst.holds();
}

#[test]
fn shadows_of_more_than_a_period_match_exact_box_paths() {
    // 300 um at 50 mrad: a shadow of 15 um, of one period and of more, where what was dark at a
    // smaller angle is bright and the other way round.
    let mut worst = WorstOf::new(
        "bars, shadows of more than a period",
        "bars of small periods, wider than half of their shadow",
    );
    let columns = || PLACES.into_iter().chain(BETWEEN);
    let engine = engine(Backend::Bvh);
    let fine = [(12e-6, 5e-6), (10e-6, 7e-6), (6e-6, 3e-6)].map(|mask| [(0, mask), (1, mask)]);
    let mut all = Vec::new();
    for mu in ATTENUATIONS {
        for spot in SPOTS {
            let case = Case { bars: [80e-6, 120e-6], thickness: [300e-6; 2], mu, spot };
            all.extend(fine.as_flattened().iter().map(|fine| (case, *fine)));
        }
    }
    for (case, (fine, (period, aperture))) in sample(all, 23) {
        let mut setup = case.setup();
        let masks = [&mut setup.sample_mask, &mut setup.detector_mask];
        let Some(mask) = masks.into_iter().nth(fine).and_then(Option::as_mut) else {
            unreachable!("there are two masks")
        };
        (mask.period, mask.aperture, mask.origin) = (period, aperture, 0.5 * period);
        compare_columns(&engine, &setup, columns(), &steps(47e-6, 5), |column, off, place| {
            let place = || format!("{case:?}, {fine}, {period:e}, {}", place());
            worst.at(&setup, column).take(off, place);
        });
    }
    worst.holds();
}

#[test]
fn column_on_the_axis_matches_exact_box_paths() {
    // The middle of its beamlet is seen under no angle, what stands across its borders under some.
    let mut worst = Worst::new("bars, a column on the axis", WIDE);
    let engine = engine(Backend::Bvh);
    for case in sample(cases(&[[80e-6, 120e-6], [80e-6, 0.0], [3e-6, 40e-6]]), 13) {
        let mut setup = case.setup();
        setup.pixels[0] = 5;
        for mask in setup.sample_mask.iter_mut().chain(&mut setup.detector_mask) {
            mask.origin = 0.0;
        }
        compare_columns(&engine, &setup, 0..5, &steps(50e-6, 11), |_, off, place| {
            worst.take(off, || format!("{case:?}, {}", place()));
        });
    }
    worst.holds();
}

#[test]
fn two_apertures_in_a_pixel_match_exact_box_paths() {
    // Edges of the detector mask's apertures cut the light of either aperture on one side.
    let mut worst = WorstOf::new(
        "bars, two apertures in a pixel, narrow",
        "bars, two apertures in a pixel, others",
    );
    let engine = engine(Backend::Bvh);
    for case in sample(cases(&[[2e-6, 30e-6], [2e-6, 2e-6], [15e-6, 25e-6]]), 29) {
        let mut setup = case.setup();
        let mask = setup.sample_mask.as_mut().expect("a sample mask");
        (mask.period, mask.origin) = (50e-6, 25e-6);
        mask.aperture = 50e-6 - case.bars[0];
        compare_columns(&engine, &setup, PLACES, &steps(47e-6, 5), |column, off, place| {
            worst.at(&setup, column).take(off, || format!("{case:?}, {}", place()));
        });
    }
    worst.holds();
}

/// Photons of several energies.
#[derive(Debug, Clone, Copy)]
enum Light {
    /// A tube of 60 kV behind 1 mm of aluminium, in so many nodes.
    Tube(u32),
    /// Two energies between 28 keV and 58 keV.
    Two,
}

/// The scene of a set-up with bars of `bars_of` under a spectrum; files go into `folder`.
fn under_a_spectrum(
    setup: &Setup,
    offsets: &[f64],
    (light, bars_of): (Light, &str),
    folder: &Path,
) -> Scene {
    let mut scene = scenes::scene(setup, &[], offsets);
    let spectrum = match light {
        Light::Tube(nodes) => {
            let origin = SpectrumOrigin::Tube {
                anode: Anode::Tungsten,
                kvp: 60.0,
                anode_angle: 12.0_f64.to_radians(),
                inherent_filters: Vec::new(),
            };
            let filters = vec![Filter::new("Al", 1e-3)];
            SpectrumSpec::new(origin).with_filters(filters).with_nodes(nodes)
        }
        Light::Two => {
            let path = folder.join("two.csv");
            std::fs::write(&path, "energy_keV,weight\n28,1\n43,0\n58,1\n").expect("a file");
            let origin = SpectrumOrigin::File { path };
            SpectrumSpec::new(origin).with_nodes(2)
        }
    };
    scene.source.beam = Beam::Spectrum(spectrum);
    for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
        if let MaskBody::Bars { material, .. } = &mut mask.body {
            bars_of.clone_into(material);
        }
    }
    scene
}

/// Compares columns of a flat under a spectrum with exact boxes at each of its energies.
fn compare_energies(
    engine: &Checked,
    case: &Case,
    (light, bars_of): (Light, &str),
    worst: &mut WorstOf,
) {
    let (setup, offsets) = (case.setup(), steps(47e-6, 5));
    let folder = tempfile::tempdir().expect("a folder");
    let scene = under_a_spectrum(&setup, &offsets, (light, bars_of), folder.path());
    let media = MaterialTable::of(&scene).expect("media");
    let stack = engine.simulate(&scene).expect("a flat").flat;
    // Columns at 2.5 to 10 mrad besides: somewhere there energies cease to share edges.
    for column in PLACES.into_iter().chain([630, 675, 690, 720]) {
        let mut want = vec![0.0; offsets.len()];
        for (energy, weight) in media.energies.iter().zip(&media.weights) {
            let mu = constants_at(&scene, bars_of, *energy).expect("constants").mu;
            let setup = on_the_detector(Case { mu, ..*case }.setup());
            let of = setup.pixel(None, Order::Exact, &quadrature(), column, 0, &offsets);
            want.iter_mut().zip(of).for_each(|(want, of)| *want += weight * of);
        }
        let worst = worst.at(&setup, column);
        for (step, want) in want.iter().enumerate() {
            let got = f64::from(stack[[step, 0, column as usize]]);
            let place = || {
                format!("{light:?} {bars_of} {case:?}, column {column}, step {step}: {got} {want}")
            };
            worst.take(got - want, place);
        }
    }
}

#[test]
fn bars_under_a_spectrum_match_exact_box_paths() {
    let mut worst = WorstOf::new(
        "bars, some narrower than half of their shadow, spectra",
        "bars, others, spectra",
    );
    let engine = engine(Backend::Bvh);
    let narrow = [[0.0, 120e-6], [1e-6, 120e-6], [80e-6, 1e-6], [3e-6, 3e-6]];
    let mut all: Vec<(Case, Light)> = narrow
        .map(|bars| Case { bars, thickness: [225e-6; 2], mu: GOLD, spot: 30e-6 })
        .map(|case| (case, Light::Tube(3)))
        .into();
    for bars in [[80e-6, 120e-6], [40e-6, 40e-6], [97e-6, 145e-6]] {
        for thickness in THICKNESSES {
            let case = |spot| Case { bars, thickness, mu: GOLD, spot };
            all.extend(SPOTS.map(|spot| (case(spot), Light::Two)));
            all.push((case(30e-6), Light::Tube(4)));
        }
    }
    for (case, light) in sample(all, 19) {
        compare_energies(&engine, &case, (light, "gold"), &mut worst);
    }
    worst.holds();
}

#[test]
fn bars_of_light_materials_under_a_spectrum_are_boxes() {
    // Bars that pass most of the light, at every energy another share of it: aluminium of 225 um
    // passes 0.92 at 28 keV and 0.98 at 58 keV, copper 0.11 and 0.74.
    let mut worst = WorstOf::new(
        "bars of light materials, narrow, spectra",
        "bars of light materials, others, spectra",
    );
    let engine = engine(Backend::Bvh);
    let mut all = Vec::new();
    for bars_of in ["Al", "Cu"] {
        for bars in [[1e-6, 120e-6], [3e-6, 3e-6], [80e-6, 120e-6], [40e-6, 40e-6]] {
            for (thickness, spot) in THICKNESSES.into_iter().zip(SPOTS) {
                let case = Case { bars, thickness, mu: GOLD, spot };
                all.extend([Light::Two, Light::Tube(4)].map(|light| (case, light, bars_of)));
            }
            let case = Case { bars, thickness: [225e-6; 2], mu: GOLD, spot: 0.0 };
            all.push((case, Light::Two, bars_of));
        }
    }
    for (case, light, bars_of) in sample(all, 17) {
        compare_energies(&engine, &case, (light, bars_of), &mut worst);
    }
    worst.holds();
}
