//! Limits of ray optics that `check` states, against propagation of fields by FFT and rays in f64.

use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::waves::field::Grid;
use crate::reference::waves::light::Case;
use crate::reference::waves::setup::{Slits, Spot, Window};
use crate::thin_masks::{LARGE_SPOT, LEAKING, Masks, REFERENCE, SMALL_SPOT};
use beamlet::check::{Check, CheckReport, ObjectLimits, RayLimits, WaveTransport};
use beamlet::scene::{Blur, Scene, Spot as FocalSpot, SpotPart, Transport};

/// Distance of the sample behind the mask, m.
const BEHIND: f64 = 0.0003;

/// Scene of four pixels.
fn scene_of(masks: &Masks, offsets: &[f64], objects: &str) -> Scene {
    masks.scene(4, BEHIND, offsets, objects)
}

fn checked(scene: &Scene) -> CheckReport {
    Check::of(scene).without_estimate().run().expect("a report")
}

/// Light by waves at the steps of a scene.
fn waves(limits: &RayLimits) -> Vec<f64> {
    let flat = limits.flat.as_ref().expect("a flat");
    flat.steps.iter().map(|[_, rays, more]| rays + more).collect()
}

const OFFSETS: [f64; 5] = [-12e-6, -3e-6, 0.0, 7e-6, 14e-6];

fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Light of all apertures is exact in the estimate and on a period of the grid, whose edges lie between samples.
#[test]
fn flats_of_four_set_ups_match_fft_within_2e_7() {
    for masks in [REFERENCE, SMALL_SPOT, LARGE_SPOT, LEAKING] {
        let set_up = masks.set_up();
        let limits = checked(&scene_of(&masks, &OFFSETS, "")).ray_limits;
        // Light of bars and openings interferes with the sine and cosine of a phase: its mean over four phases
        // has none.
        let quarters =
            [0.0, 1.0, 2.0, 3.0].map(|quarter: f64| quarter * std::f64::consts::FRAC_PI_2);
        let all = quarters.map(|phase| masks.by_fft(&set_up, &OFFSETS, phase));
        let mean = |at: usize| all.iter().map(|light| light[at]).sum::<f64>() / 4.0;
        let expected: Vec<f64> = (0..OFFSETS.len()).map(mean).collect();
        let off = apart(&waves(&limits), &expected);
        println!("flat at {} keV: {off:.1e}", masks.energy);
        assert!(off < 2e-7, "{} keV: {off:e}", masks.energy);
        let flat = limits.flat.expect("a flat");
        let bars = (0..OFFSETS.len())
            .map(|at| {
                let [even, odd] =
                    [0, 1].map(|part: usize| 0.5 * (all[part][at] - all[part + 2][at]));
                libm::hypot(even, odd)
            })
            .fold(0.0, f64::max);
        assert!((flat.bars - bars).abs() < 2e-6, "{} keV: {:e} {bars:e}", masks.energy, flat.bars);
        let [with_bars, error] = [bars > 1e-4, flat.relative > 1e-3];
        assert!(with_bars == (masks.leaks[0] > 0.0) && error);
    }
}

/// Two Gaussians of unlike size beside the axis.
#[test]
fn flats_of_a_spot_of_two_gaussians_match_fft_within_2e_7() {
    let mut scene = scene_of(&REFERENCE, &OFFSETS, "");
    let parts = [(3.0, 20e-6, -6e-6), (1.0, 45e-6, 18e-6)];
    let part = |(weight, fwhm, x)| SpotPart::new(weight, [fwhm; 2], [x, 0.0]);
    scene.source.spot = FocalSpot::gaussians(parts.map(part).to_vec());
    let mut set_up = REFERENCE.set_up();
    let of = |(weight, fwhm, centre): (f64, f64, f64)| Spot {
        weight: weight / 4.0,
        centre,
        sigma: fwhm * SIGMA_PER_FWHM,
    };
    set_up.spot = parts.map(of).to_vec();
    let off = apart(&waves(&checked(&scene).ray_limits), &REFERENCE.by_fft(&set_up, &OFFSETS, 0.0));
    println!("flat of two Gaussians: {off:.1e}");
    assert!(off < 2e-7, "{off:e}");
}

/// Without a detector mask a blur of the pixels is a larger spot; four pixels see a period of the mask.
#[test]
fn flats_of_blurred_pixels_match_fft_within_2e_7() {
    let masks = Masks { detector: [37.5, 37.5], ..REFERENCE };
    let sigma = 6e-6;
    let mut scene = scene_of(&masks, &OFFSETS, "");
    scene.detector_mask = None;
    scene.detector.blur = Some(Blur::Gaussian { sigma: [sigma, 0.0] });
    let found = waves(&checked(&scene).ray_limits);
    let mut set_up = masks.set_up();
    let blur = sigma / set_up.magnification() / set_up.source_shift();
    set_up.spot[0].sigma = libm::hypot(set_up.spot[0].sigma, blur);
    let slits = Slits::periodic(20e-6, 100e-6, 0);
    let case =
        Case { setup: &set_up, slits: Some(&slits), sample: &[], window: Window::open(37.5e-6) };
    let grid = Grid { count: 20_000, spacing: 5e-9, repeats: true };
    let pixels = [-1.5, -0.5, 0.5, 1.5].map(|at| at * 37.5e-6);
    let light = case.curves(grid, &pixels, &OFFSETS);
    let of_pixel = |pixel: usize| light.iter().map(|row| row[pixel]).collect::<Vec<_>>();
    let off = (0..4).map(|pixel| apart(&found, &of_pixel(pixel))).fold(f64::INFINITY, f64::min);
    println!("flat of blurred pixels: {off:.1e}");
    assert!(off < 2e-7, "{off:e}");
}

#[test]
fn a_spectrum_is_the_mean_of_its_nodes_with_their_weights() {
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("two.csv"), "energy_keV,weight\n20,1\n40,3\n")
        .expect("a file");
    let fibre = "[[object]]\nname = \"fibre\"\nmaterial = \"carbon\"\n\
                 shape = { cylinder = { radius = \"5 um\", height = \"1 mm\" } }\n";
    let one = |energy: f64| checked(&scene_of(&Masks { energy, ..REFERENCE }, &OFFSETS, fibre));
    let text = REFERENCE
        .text(4, BEHIND, &OFFSETS, fibre)
        .replace("energy = \"30 keV\"", "spectrum = \"two.csv\"");
    let path = directory.path().join("scene.toml");
    std::fs::write(&path, text).expect("a file");
    let report = checked(&Scene::load(&path).expect("a scene"));
    let nodes = &report.setup.nodes;
    assert_eq!(nodes.energies.len(), 2);
    let singles: Vec<CheckReport> = nodes.energies.iter().map(|energy| one(*energy)).collect();
    let mean = |at: usize| {
        let lights = singles.iter().map(|single| waves(&single.ray_limits)[at]);
        lights.zip(&nodes.weights).map(|(light, weight)| light * weight).sum::<f64>()
    };
    let expected: Vec<f64> = (0..OFFSETS.len()).map(mean).collect();
    assert!(apart(&waves(&report.ray_limits), &expected) < 1e-12);
    let ratio = |report: &CheckReport| report.ray_limits.objects[0].dark_field.expect("fibres")[0];
    let [low, both, high] = [&singles[0], &report, &singles[1]].map(ratio);
    assert!((both - low) * (both - high) < 0.0, "{low} {both} {high}");
}

/// Warnings of a scene outside ray optics.
fn outside(report: &CheckReport) -> Vec<&String> {
    report.warnings.iter().filter(|text| text.contains("outside ray optics")).collect()
}

#[test]
fn a_small_spot_is_warned_of_until_the_remedies_hold() {
    let mut scene = scene_of(&SMALL_SPOT, &OFFSETS, "");
    let report = checked(&scene);
    let warnings = outside(&report);
    assert!(warnings.len() == 1 && warnings[0].contains("a focal spot of"), "{warnings:?}");
    let flat = report.ray_limits.flat.as_ref().expect("a flat");
    scene.source.spot = [flat.least_spot.expect("a spot"); 2].into();
    assert!(outside(&checked(&scene)).is_empty());
    let factor = flat.distance_factor.expect("a factor");
    let distances = SMALL_SPOT.distances.map(|distance| factor * distance);
    let nearer = scene_of(&Masks { distances, ..SMALL_SPOT }, &OFFSETS, "");
    assert!(outside(&checked(&nearer)).is_empty());
}

#[test]
fn the_reference_set_up_is_within_ray_optics() {
    let rod = "[materials.plastic]\nmu = \"25 /m\"\ndelta = 2.4e-7\n[[object]]\nname = \"rod\"\n\
               shape = { cylinder = { radius = \"0.2 mm\", height = \"1 mm\" } }\nmaterial = \"plastic\"\n";
    let report = checked(&scene_of(&REFERENCE, &[-20e-6, -10e-6, 0.0, 10e-6, 20e-6], rod));
    assert!(outside(&report).is_empty(), "{:?}", report.warnings);
    let criteria = report.ray_limits.criteria.expect("a sample mask");
    assert!((criteria.fresnel_number - 24.2).abs() < 0.05 && criteria.blur_over_fringe > 1.03);
    assert!((criteria.shear - 0.286e-6).abs() < 1e-9);
    let text = report.to_string();
    for words in ["limits of ray optics", "Fresnel number", "24.2 of the aperture", "0.286 um"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(text.contains("diameter 400 um"), "{text}");
}

/// Carbon differs from the polyethylene around it by less than from vacuum.
#[test]
fn the_fibres_of_the_fifth_experiment_are_outside_ray_optics() {
    let scene = Scene::load("docs/experiments/tomography/scene.toml").expect("a scene");
    let report = checked(&scene);
    let warnings = outside(&report);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].starts_with("\"fibres\" is outside ray optics"), "{warnings:?}");
    assert!(warnings[0].contains("bodies of 5 um by rays is 2.4 times"), "{warnings:?}");
    assert!(warnings[0].contains("but refuses the rough object \"matrix\""), "{warnings:?}");
    let fibres = &report.ray_limits.objects[1];
    assert!(fibres.rough && fibres.fill > 0.2 && fibres.unknown[0].contains("not independent"));
    assert!(report.to_string().contains("slopes without a length"));
}

#[test]
fn warnings_name_waves_where_they_compute_the_scene() {
    let fibres = "[[object]]\nname = \"fibres\"\nmaterial = \"carbon\"\n\
                  shape = { cylinder = { radius = \"2.5 um\", height = \"1 mm\" } }\n";
    let mut scene = scene_of(&SMALL_SPOT, &OFFSETS, fibres);
    let report = checked(&scene);
    let warnings = outside(&report);
    assert!(
        report.ray_limits.waves == WaveTransport::Possible && warnings.len() == 1,
        "{warnings:?}"
    );
    let key = "; sampling.transport = \"wave\" computes it";
    assert!(warnings.iter().all(|text| text.ends_with(key)), "{warnings:?}");
    scene.sampling.transport = Transport::Wave;
    let by_waves = checked(&scene);
    assert!(outside(&by_waves).is_empty() && by_waves.ray_limits.waves == WaveTransport::Used);
    // The bars of gold would cast a shadow wider than an aperture.
    let text =
        SMALL_SPOT.text(4000, 0.01, &[0.0], "").replace("distance = \"1 m\"\naperture", "aperture");
    let thick = text.replace("transmission = 0.0", "material = \"gold\"\nthickness = \"5 mm\"");
    let report = checked(&Scene::from_toml(&thick, ".").expect("a scene"));
    let WaveTransport::Refused(found) = &report.ray_limits.waves else { panic!("{report}") };
    assert!(found.contains("shadow") && outside(&report)[0].contains(found), "{found}");
}

/// Limits at the one object of a scene.
fn of_object(shape: &str) -> ObjectLimits {
    let object = format!("[[object]]\nname = \"it\"\nmaterial = \"carbon\"\nshape = {shape}\n");
    checked(&scene_of(&REFERENCE, &OFFSETS, &object)).ray_limits.objects.remove(0)
}

#[test]
fn shapes_have_a_value_a_range_or_a_reason() {
    let sphere = of_object("{ sphere = { radius = \"5 um\" } }");
    let [low, high] = sphere.dark_field.expect("a sphere");
    assert!((low - 0.55).abs() < 0.015 && (high - low).abs() < 1e-12, "{low} {high}");
    let cone =
        of_object("{ cone = { radius = \"5 um\", top_radius = \"2.5 um\", height = \"0.1 mm\" } }");
    let [mean, _] = cone.dark_field.expect("a cone");
    assert!(mean > 0.49 && mean < 0.58, "{mean}");
    let tube = of_object("{ tube = { outer = \"10 um\", inner = \"5 um\", height = \"0.1 mm\" } }");
    let [low, high] = tube.dark_field.expect("a tube");
    assert!(!tube.round && (low - 0.49).abs() < 0.02 && (high - 0.67).abs() < 0.02, "{low} {high}");
    let cuboid = of_object("{ box = { size = [\"9 um\", \"9 um\", \"9 um\"] } }");
    assert!(cuboid.dark_field.is_none() && cuboid.unknown[0].contains("flat faces"));
    let thick = of_object("{ cylinder = { radius = \"0.15 mm\", height = \"1 mm\" } }");
    assert!(thick.dark_field.is_none() && thick.unknown.is_empty());
}

#[test]
fn without_a_sample_mask_dark_fields_are_unknown() {
    let mut scene = scene_of(
        &REFERENCE,
        &[0.0],
        "[[object]]\nname = \"it\"\nmaterial = \"carbon\"\nshape = { sphere = { radius = \"5 um\" } }\n",
    );
    scene.sample_mask = None;
    let limits = checked(&scene).ray_limits;
    assert!(limits.criteria.is_none() && limits.flat.is_none());
    let object = &limits.objects[0];
    assert!(object.dark_field.is_none() && !object.unknown.is_empty());
}
