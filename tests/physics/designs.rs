//! Masks of several slits: flats against closed forms and random rays through exact boxes, and masks that are
//! written in two ways.

#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(clippy::cast_possible_truncation, reason = "numbers of slits")]

use crate::reference::closed_form::blurred_overlap;
use crate::support::{Checked, Worst, engine};
use beamlet::Backend;
use beamlet::scene::{
    Anode, Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Object, RandomRays, Scan, Scene,
    Scheme, Shape, Source, SpectrumOrigin, SpectrumSpec, Substrate,
};
use ndarray::Array3;

/// Full width at half maximum of a Gaussian over its standard deviation.
const FWHM: f64 = 2.354_820_045;
/// As for thin masks of one slit (`flat.rs`), for each of the slits of a pixel.
const CLOSED_FORM: f64 = 1e-6;

fn mask(distance: f64, pitch: f64, aperture: f64, body: MaskBody) -> MaskSpec {
    MaskSpec::new(distance, pitch * distance / 1.8, aperture, body)
}

fn sheets(pixels: [u32; 2], leak: f64) -> Scene {
    let source = Source::new(1.21, [30e-6, 26e-6], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, pixels, [150e-6; 2]));
    let sheet = || MaskBody::Sheet { transmission: leak };
    scene.sample_mask = Some(mask(1.2, 150e-6, 20e-6, sheet()));
    scene.detector_mask = Some(mask(1.8, 150e-6, 30e-6, sheet()));
    scene.scan = Scan::new(vec![-11e-6, 3e-6], vec![0.0]);
    scene
}

/// Slits of a mask whose places on the detector may matter to a pixel at `x`: their ends, seen on the detector.
fn near(mask: &MaskSpec, columns: u32, x: f64, offset: f64) -> Vec<[f64; 2]> {
    let scale = 1.8 / mask.distance;
    let centre =
        |k: i64| (k as f64 + 0.5 - f64::from(columns) / 2.0) * mask.period + mask.offset + offset;
    let nearest = (x / scale / mask.period + f64::from(columns) / 2.0 - 0.5).round() as i64;
    let shift = |k: i64| match mask.shifts.len() {
        0 => 0.0,
        count => mask.shifts[k.rem_euclid(count as i64) as usize],
    };
    let own = match mask.apertures.is_empty() {
        true => vec![[-0.5 * mask.aperture, 0.5 * mask.aperture]],
        false => mask.apertures.clone(),
    };
    (nearest - 3..=nearest + 3)
        .flat_map(|k| {
            own.iter().map(move |ends| ends.map(|end| (centre(k) + shift(k) + end) * scale))
        })
        .collect()
}

/// Light of a column: overlap of each pair of slits, behind bars that leak.
fn light(scene: &Scene, column: u32, offset: f64) -> f64 {
    let columns = scene.detector.pixels[0];
    let [first, second] =
        [&scene.sample_mask, &scene.detector_mask].map(|mask| mask.as_ref().unwrap());
    let leak = |mask: &MaskSpec| match mask.body {
        MaskBody::Sheet { transmission } => transmission,
        _ => 0.0,
    };
    let [e1, e2] = [first, second].map(leak);
    // At edges of the sample mask, seen on the detector.
    let blur = scene.source.spot.fwhm()[0] / FWHM * (1.8 - 1.2) / 1.2;
    let pitch = 150e-6;
    let middle = (f64::from(column) + 0.5 - f64::from(columns) / 2.0) * pitch;
    let pixel = [middle - 0.5 * pitch, middle + 0.5 * pitch];
    let before = near(first, columns, middle, offset);
    let cut: Vec<[f64; 2]> = near(second, columns, middle, 0.0)
        .into_iter()
        .map(|[low, high]| [low.max(pixel[0]), high.min(pixel[1])])
        .filter(|[low, high]| high > low)
        .collect();
    let overlap = |a: &[f64; 2], b: &[f64; 2]| {
        let apart = 0.5 * (a[0] + a[1] - b[0] - b[1]);
        blurred_overlap(apart, a[1] - a[0], b[1] - b[0], blur)
    };
    let both: f64 = before.iter().flat_map(|a| cut.iter().map(move |b| overlap(a, b))).sum();
    let of_first: f64 = before.iter().map(|a| overlap(a, &pixel)).sum();
    let of_second: f64 = cut.iter().map(|[low, high]| high - low).sum();
    ((1.0 - e1) * (1.0 - e2) * both + e2 * (1.0 - e1) * of_first + e1 * (1.0 - e2) * of_second)
        / pitch
        + e1 * e2
}

/// Adds a design to a set-up.
type Design = fn(&mut Scene);

/// Designs by name.
const DESIGNS: [(&str, Design); 5] = [
    ("asymmetric", |scene| {
        scene.sample_mask.as_mut().unwrap().shifts = vec![-15e-6, -5e-6, 5e-6, 15e-6];
    }),
    ("asymmetric before the detector", |scene| {
        scene.detector_mask.as_mut().unwrap().shifts = vec![0.0, 12e-6, -20e-6];
    }),
    ("several slits", |scene| {
        let first = scene.sample_mask.as_mut().unwrap();
        first.apertures = vec![[-40e-6, -25e-6], [2e-6, 20e-6], [30e-6, 41e-6]];
        scene.detector_mask.as_mut().unwrap().apertures = vec![[-60e-6, -30e-6], [5e-6, 25e-6]];
    }),
    ("several shifted slits", |scene| {
        let first = scene.sample_mask.as_mut().unwrap();
        first.apertures = vec![[-30e-6, -10e-6], [5e-6, 25e-6]];
        first.shifts = vec![0.0, 12e-6];
        scene.detector_mask.as_mut().unwrap().shifts = vec![0.0, 3e-6, -4e-6];
    }),
    ("skipped and shifted", |scene| {
        let first = scene.sample_mask.as_mut().unwrap();
        first.period *= 2.0;
        first.offset = 50e-6;
        first.shifts = vec![7e-6, -7e-6, 0.0];
    }),
];

#[test]
fn flats_of_every_design_are_those_of_the_closed_form() {
    let mut worst = Worst::new("flat of a design, closed form", CLOSED_FORM);
    let engine = engine(Backend::Bvh);
    for (name, design) in DESIGNS {
        for (columns, leak, spot) in [(12, 0.0, 30e-6), (13, 0.1, 30e-6), (7, 0.39, 0.0)] {
            let mut scene = sheets([columns, 1], leak);
            scene.source.spot = [spot, 26e-6].into();
            design(&mut scene);
            let flat = engine.simulate(&scene).unwrap().flat;
            for ((step, _, column), got) in flat.indexed_iter() {
                let want =
                    light(&scene, u32::try_from(column).unwrap(), scene.scan.mask_offsets[step]);
                worst.take(f64::from(*got) - want, || {
                    format!("{name}, {columns} columns, leak {leak}, step {step}, column {column}")
                });
            }
        }
    }
    worst.holds();
}

fn gold(scene: &mut Scene, thickness: f64) {
    for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
        mask.body = MaskBody::Bars { material: "gold".into(), thickness };
    }
    scene.detector_mask.as_mut().unwrap().distance = 1.8 - 0.5 * thickness;
    scene.source.beam = Beam::Energy(80.0);
}

pub(super) fn ball(scene: &mut Scene) {
    let carbon = MaterialSpec::Formula { formula: "C".into(), density: 2.0 };
    scene.materials.insert("carbon".into(), carbon);
    scene.objects =
        vec![Object::new("ball", Shape::Sphere { radius: 0.25e-3, sides: None }, "carbon")];
}

/// Takes the differences between cells and 10,000 random rays of a pixel, flats and sample, and their mean.
pub(super) fn compare_with_random(
    engine: &Checked,
    [worst, mean]: [&mut Worst; 2],
    mut scene: Scene,
    what: &str,
) {
    let cells = engine.simulate(&scene).unwrap();
    scene.sampling.scheme = Scheme::Random;
    scene.sampling.rays = RandomRays::Grid([400, 25]);
    let random = engine.simulate(&scene).unwrap();
    let flats = cells.flat.iter().zip(&random.flat);
    let pairs: Vec<f64> = flats
        .chain(cells.sample.iter().zip(&random.sample))
        .map(|(cells, random)| f64::from(*cells) - f64::from(*random))
        .collect();
    for (at, off) in pairs.iter().enumerate() {
        worst.take(*off, || format!("{what}, value {at}"));
    }
    mean.take(pairs.iter().sum::<f64>() / pairs.len() as f64, || what.into());
}

/// Random rays pass exact boxes: bars that leak 0.38 and a ball. 10,000 rays of a pixel have the noise of at most
/// 5e-3 in it, and of 3e-4 in the mean of the 64 values of a design.
#[test]
fn thick_bars_of_every_design_and_a_ball_match_random_rays() {
    let mut worst = Worst::new("design with thick bars, random rays: a pixel", 1.2e-2);
    let mut mean = Worst::new("design with thick bars, random rays: mean", 1.2e-3);
    let engine = engine(Backend::Bvh);
    for (name, design) in DESIGNS {
        let mut scene = sheets([8, 2], 0.0);
        gold(&mut scene, 225e-6);
        design(&mut scene);
        ball(&mut scene);
        compare_with_random(&engine, [&mut worst, &mut mean], scene, name);
    }
    worst.holds();
    mean.holds();
}

/// Flat and sample of a scene with a ball: `[step][row][column]`.
fn stacks(scene: &Scene) -> [Array3<f32>; 2] {
    let stacks = engine(Backend::Bvh).simulate(scene).unwrap();
    [stacks.flat, stacks.sample.index_axis_move(ndarray::Axis(0), 0)]
}

fn compare(worst: &mut Worst, name: &str, [a, b]: [&Array3<f32>; 2]) {
    for (at, a) in a.indexed_iter() {
        worst.take(f64::from(*a) - f64::from(b[at]), || format!("{name}, {at:?}"));
    }
}

/// The same mask by other keys: flats to the last digits of f32, samples within the tolerance where the beamlets
/// are others.
#[test]
fn one_mask_written_in_several_ways_has_one_image() {
    let mut exact = Worst::new("one mask written in two ways, same beamlets", 2e-7);
    let mut sampled = Worst::new("one mask written in two ways, other beamlets", 3e-4);
    for thick in [false, true] {
        let mut scene = sheets([9, 2], 0.02);
        if thick {
            gold(&mut scene, 225e-6);
        }
        ball(&mut scene);
        let plain = stacks(&scene);
        let first = |change: &dyn Fn(&mut MaskSpec)| {
            let mut scene = scene.clone();
            change(scene.sample_mask.as_mut().unwrap());
            stacks(&scene)
        };
        for (name, other) in [
            ("no shifts", first(&|mask| mask.shifts = vec![0.0; 3])),
            ("a list of one slit", first(&|mask| mask.apertures = vec![[-10e-6, 10e-6]])),
            (
                "shifts for an offset",
                first(&|mask| (mask.offset, mask.shifts) = (-5e-6, vec![5e-6; 2])),
            ),
        ] {
            compare(&mut exact, name, [&plain[0], &other[0]]);
            let worst = if name == "shifts for an offset" { &mut sampled } else { &mut exact };
            compare(worst, name, [&plain[1], &other[1]]);
        }
        let doubled = first(&|mask| {
            let quarter = 0.5 * mask.period;
            mask.apertures = [-quarter, quarter].map(|at| [at - 10e-6, at + 10e-6]).to_vec();
            // With nine columns slits of a period lie beside the axis.
            (mask.period, mask.offset) = (2.0 * mask.period, quarter);
        });
        compare(&mut exact, "two slits of a period twice as long", [&plain[0], &doubled[0]]);
        compare(&mut sampled, "two slits of a period twice as long", [&plain[1], &doubled[1]]);
    }
    exact.holds();
    sampled.holds();
}

/// Eight slits in a period of 40 pixels, from a file and by steps: columns behind them have the light of a mask that
/// repeats, and the rest lies behind bars.
#[test]
fn a_list_of_slits_in_a_long_period_is_a_part_of_the_mask_that_repeats() {
    let mut exact = Worst::new("list of slits, mask that repeats: flat", 2e-7);
    let mut sampled = Worst::new("list of slits, mask that repeats: sample", 3e-4);
    let folder = tempfile::tempdir().unwrap();
    for thick in [false, true] {
        let mut scene = sheets([12, 2], 0.0);
        scene.scan.mask_offsets = vec![-6e-6, 5e-6];
        if thick {
            gold(&mut scene, 225e-6);
            scene.source.beam = Beam::Energy(30.0);
        }
        ball(&mut scene);
        let plain = stacks(&scene);
        let centre = |slit: i32| (f64::from(slit) - 3.5) * 100e-6;
        let ends = (0..8).map(|slit| [centre(slit) - 10e-6, centre(slit) + 10e-6]);
        let first = scene.sample_mask.as_mut().unwrap();
        (first.apertures, first.period) = (ends.collect(), 40.0 * first.period);
        // Twelve columns are an even number: a period lies beside the axis.
        first.offset = -0.5 * first.period;
        let own = first.apertures.clone();
        let lines: String =
            own.iter().map(|[low, high]| format!("{:.9},{:.9}\n", low * 1e6, high * 1e6)).collect();
        std::fs::write(folder.path().join("slits.csv"), format!("end_0_um,end_1_um\n{lines}"))
            .unwrap();
        let list = stacks(&scene);
        for (at, value) in list[0].indexed_iter() {
            let behind = (2..10).contains(&at.2);
            let want = f64::from(plain[0][at]);
            // Leaks of gold, and neighbours of the outer slits.
            let is_inner = (3..9).contains(&at.2) || at.2 == 0 || at.2 == 11;
            if is_inner {
                if behind {
                    exact.take(f64::from(*value) - want, || format!("{at:?}"));
                }
                assert!(behind || *value < 1e-4, "{at:?}: {value}");
            }
            if (3..9).contains(&at.2) {
                sampled
                    .take(f64::from(list[1][at]) - f64::from(plain[1][at]), || format!("{at:?}"));
            }
        }
        let text = "[source]\ndistance = \"1.21 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n[detector]\n\
             distance = \"1.8 m\"\npixels = [12, 2]\npitch = \"150 um\"\n[sample_mask]\n\
             distance = \"1.2 m\"\ntransmission = 0.0\nperiod = \"4 mm\"\napertures = \"slits.csv\"\n";
        let read = Scene::from_toml(text, folder.path()).unwrap().sample_mask.unwrap().apertures;
        let off = read.as_flattened().iter().zip(own.as_flattened()).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-15);
    }
    exact.holds();
    sampled.holds();
}

/// Shifts of the detector mask against shifts of the sample mask by as much the other way: the mask is moved by
/// its offset, and every pixel sees its point of the curve.
#[test]
fn a_shifted_aperture_samples_the_curve_at_its_shift() {
    let mut worst = Worst::new("pixel behind a shifted aperture, curve of the mask", 1e-6);
    let shifts = [-15e-6, -5e-6, 5e-6, 15e-6];
    let mut scene = sheets([8, 1], 0.0);
    scene.scan.mask_offsets = shifts.to_vec();
    let curve = stacks(&scene)[0].clone();
    scene.sample_mask.as_mut().unwrap().shifts = shifts.to_vec();
    scene.scan.mask_offsets = vec![0.0];
    let shot = stacks(&scene)[0].clone();
    for column in 0..8 {
        let want = f64::from(curve[[column % 4, 0, column]]);
        worst.take(f64::from(shot[[0, 0, column]]) - want, || format!("column {column}"));
    }
    worst.holds();
}

/// Silicon of 2.33 g/cm3 in a plate of 0.5 mm, under the angle of each pixel.
#[test]
fn a_substrate_attenuates_flat_and_sample_along_the_ray() {
    let mut worst = Worst::new("flat behind substrates, exp(-mu t sec)", 3e-7);
    let mut random = Worst::new("flat behind substrates, random rays", 2.5e-3);
    let engine = engine(Backend::Bvh);
    for leak in [0.0, 0.1] {
        let mut scene = sheets([64, 2], leak);
        scene.detector.pitch = [1e-3, 150e-6];
        for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
            mask.period *= 1e-3 / 150e-6;
            mask.aperture *= 5.0;
        }
        let bare = engine.simulate(&scene).unwrap().flat;
        let silicon = beamlet::material::constants_over(&scene, "silicon", &[30.0]).unwrap()[0];
        for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
            mask.substrate = Some(Substrate::new("silicon", 0.5e-3));
        }
        let behind = engine.simulate(&scene).unwrap().flat;
        scene.sampling.scheme = Scheme::Random;
        scene.sampling.rays = RandomRays::Grid([400, 25]);
        let rays = engine.simulate(&scene).unwrap().flat;
        for (at, value) in behind.indexed_iter() {
            let slope = (at.2 as f64 + 0.5 - 32.0) * 1e-3 / 1.8;
            let share = libm::exp(-2.0 * silicon.mu * 0.5e-3 * (1.0 + slope * slope).sqrt());
            worst.take(f64::from(*value) - share * f64::from(bare[at]), || {
                format!("{leak}, {at:?}")
            });
            random.take(f64::from(*value) - f64::from(rays[at]), || format!("{leak}, {at:?}"));
        }
    }
    worst.holds();
    random.holds();
}

/// A tube at 60 kV: the flat behind a plate equals the light behind a slab of the same thickness, and the plate
/// hardens the light that passes a slab behind it.
#[test]
fn a_substrate_hardens_the_light_of_a_tube() {
    let tube = SpectrumOrigin::Tube {
        anode: Anode::Tungsten,
        kvp: 60.0,
        anode_angle: 0.2,
        inherent_filters: Vec::new(),
    };
    let with = |plate: Option<f64>, slab: Option<f64>| {
        let mut scene = sheets([8, 1], 0.0);
        gold(&mut scene, 225e-6);
        scene.source.beam = Beam::Spectrum(SpectrumSpec::new(tube.clone()).with_nodes(8));
        scene.sample_mask.as_mut().unwrap().substrate =
            plate.map(|it| Substrate::new("silicon", it));
        let size = slab.map(|thickness| [40e-3, thickness, 40e-3]);
        let object = |size| Object::new("slab", Shape::Box { size }, "silicon");
        scene.objects = size.map(object).into_iter().collect();
        let stacks = engine(Backend::Bvh).simulate(&scene).unwrap();
        [f64::from(stacks.flat[[0, 0, 4]]), f64::from(stacks.sample[[0, 0, 0, 4]])]
    };
    let [flat, _] = with(None, None);
    let [_, slab] = with(None, Some(1e-3));
    let [_, both] = with(None, Some(3e-3));
    let [plate, behind] = with(Some(1e-3), Some(2e-3));
    // Energies of a tube with other materials in the way are other nodes.
    let mut worst = Worst::new("plate of a mask over a slab of the sample, less 1", 3e-4);
    worst.take(plate / flat / (slab / flat) - 1.0, || "flat".into());
    worst.take(behind / plate / (both / slab) - 1.0, || "slab behind the plate".into());
    assert!(slab / flat < 0.8 * both / slab, "the slab hardens: {slab} {both}");
    worst.holds();
}
