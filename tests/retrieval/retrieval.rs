//! Retrieval as a whole: what each method makes of curves whose contrasts are known, what it
//! refuses, and what becomes of bad pixels.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::draws::Draws;
use crate::reference::fit::gaussian;
use crate::stacks::{even, images_of, sheets};
use crate::support::{Checked, engine_of, free_gaussian};
use beamlet::Cancel;
use beamlet::internals::retrieve::{BackgroundTerm, Fitter, ValueNoise};
use beamlet::retrieve::{Images, Method, Retriever, flags};
use beamlet::scene::Scene;
use ndarray::{Array3, s};

const UM: f64 = 1e-6;
/// M/z of the scene below: 1.5 / 0.59 m.
const ARM: f64 = 1.5 / 0.59;
/// Pixels in the arrays of these tests.
const PIXELS: usize = 9;

fn engine() -> Checked {
    engine_of(beamlet::EngineOptions::default())
}

/// The paper's set-up with hard-edged masks, and offsets in um.
fn scene(offsets: &[f64], sets: &[&str]) -> Scene {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    Scene::from_toml_with(&sheets([PIXELS, 1], offsets), ".", &sets).unwrap()
}

/// Frames of one row, `[step][0][pixel]`, of a curve per pixel; offsets in um.
fn frames(offsets: &[f64], curve: impl Fn(usize, f64) -> f64) -> Array3<f32> {
    Array3::from_shape_fn((offsets.len(), 1, PIXELS), |(step, _, pixel)| {
        curve(pixel, offsets[step] * UM) as f32
    })
}

fn retrieve(
    engine: &Checked,
    scene: &Scene,
    method: Method,
    flat: &Array3<f32>,
    sample: &Array3<f32>,
) -> Images {
    images_of(engine, scene, &free_gaussian().with_method(method), [flat.view(), sample.view()])
}

fn value(images: &Images, name: &str, pixel: usize) -> f64 {
    f64::from(images.get(name).unwrap()[[0, pixel]])
}

/// Transmission, refraction angle and dark field that a pixel of these tests has.
fn truth(pixel: usize) -> [f64; 3] {
    let p = pixel as f64;
    [0.3 + 0.08 * p, (p - 4.0) * 2e-6, p * 3e-12]
}

/// Holds images to the truth: relative for transmission, absolute for the others.
fn hold(images: &Images, tolerance: [f64; 3], what: &str) {
    for pixel in 0..PIXELS {
        let [t, alpha, dark] = truth(pixel);
        let got = ["transmission", "refraction", "dark_field"]
            .map(|name| images.get(name).map_or(f64::NAN, |map| f64::from(map[[0, pixel]])));
        let off = [(got[0] / t - 1.0).abs(), (got[1] - alpha).abs(), (got[2] - dark).abs()];
        println!("{what}, pixel {pixel}: {got:?}, off by {off:?}");
        for k in 0..3 {
            assert!(
                off[k] <= tolerance[k] || tolerance[k].is_infinite(),
                "{what}, pixel {pixel}: {got:?} for {:?}",
                truth(pixel)
            );
        }
        assert_eq!(value(images, "flags", pixel).to_bits(), 0.0_f64.to_bits(), "{what}, {pixel}");
    }
}

/// Gaussians of these contrasts: the deflected curve stands at mu - alpha z / M.
fn gaussians(offsets: &[f64], background: f64) -> [Array3<f32>; 2] {
    let flat = [0.17, 0.7 * UM, 9.0 * UM, background];
    let sample = |pixel| {
        let [t, alpha, dark] = truth(pixel);
        let width = (flat[2] * flat[2] + dark / (ARM * ARM)).sqrt();
        [t * flat[0] * flat[2] / width, flat[1] - alpha / ARM, width, t * background]
    };
    [
        frames(offsets, |_, x| gaussian(&flat, x).0),
        frames(offsets, |pixel, x| gaussian(&sample(pixel), x).0),
    ]
}

/// Curves of the masks: attenuated, shifted and blurred by these contrasts.
fn curves(offsets: &[f64], spot: f64, dark_field: bool) -> [Array3<f32>; 2] {
    let at = |x: f64, variance: f64| {
        let blur = ((0.5 * spot * 0.424_660_900_144_009_5).powi(2) + variance).sqrt();
        blurred_overlap(1.5 * x, 30.0 * UM, 30.0 * UM, blur) / (150.0 * UM)
    };
    [
        frames(offsets, |_, x| at(x, 0.0)),
        frames(offsets, |pixel, x| {
            let [t, alpha, dark] = truth(pixel);
            let dark = if dark_field { dark * 0.59 * 0.59 } else { 0.0 };
            t * at(x + alpha / ARM, dark)
        }),
    ]
}

/// Every method on curves of its own kind, also at offsets of 10,000 periods: f32 holds a centre of 1 m to 6e-8 m, which
/// are 1.5e-7 rad. f32 frames hold 1e-7 of the peak, which over a width of 9 um is 2e-12 rad. For moments the trapezoid rule
/// is exact to the fourth derivative of the curve: steps of a fifth of its width.
#[test]
fn methods_give_back_the_contrasts_of_curves_of_their_kind_at_any_offset() {
    let engine = engine();
    let eleven = even(11, 25.0);
    for (method, offsets, tolerance) in [
        (Method::Gaussian, eleven.clone(), [1e-6, 1e-10, 2e-15]),
        (Method::ThreeStep, vec![-8.0, 1.0, 11.0], [1e-5, 1e-10, 2e-15]),
        (Method::Moments, even(41, 40.0), [1e-5, 1e-9, 2e-14]),
        (Method::ExactCurve, eleven, [1e-5, 1e-10, 1e-14]),
    ] {
        let [flat, sample] = match method {
            Method::Gaussian => gaussians(&offsets, 0.004),
            Method::ThreeStep => gaussians(&offsets, 0.0),
            _ => curves(&offsets, 30.0 * UM, true),
        };
        for far in [0.0, 1e6, -1e6] {
            let moved: Vec<f64> = offsets.iter().map(|offset| offset + far).collect();
            let images = retrieve(&engine, &scene(&moved, &[]), method, &flat, &sample);
            hold(&images, tolerance, &format!("{method}, {far} um"));
            let centre = value(&images, "sample_centre", 4);
            assert!(method != Method::Gaussian || (centre - 0.7 * UM).abs() < 1e-12, "no periods");
        }
    }
}

#[test]
fn exact_curves_of_counts_settle_and_stay_free_of_bias() {
    // 3000 counts at the peak. 500 draws tell a mean to 0.045 sigma, a spread to 3 %.
    let offsets = even(11, 25.0);
    let [flat, sample] = curves(&offsets, 30.0 * UM, true);
    let mut draws = Draws(11);
    let rows = 500;
    let mut counted = |clean: &Array3<f32>| {
        Array3::from_shape_fn((11, rows, PIXELS), |(step, _, pixel)| {
            draws.poisson(f64::from(clean[[step, 0, pixel]]) / 0.166 * 3000.0) as f32
        })
    };
    let (flat, sample) = (counted(&flat), counted(&sample));
    let options = free_gaussian().with_method(Method::ExactCurve).with_gain(1.0);
    let frames = [flat.view(), sample.view()];
    let images = images_of(&engine(), &scene(&offsets, &[]), &options, frames);
    let without = images.get("refraction").unwrap().iter().filter(|a| a.is_nan()).count();
    assert!(without * 1000 < rows * PIXELS, "{without} without a result");
    for pixel in 0..PIXELS {
        for (name, truth) in
            ["transmission", "refraction", "dark_field"].into_iter().zip(truth(pixel))
        {
            let of = |name: &str| -> Vec<f64> {
                let map = images.get(name).unwrap();
                map.column(pixel).iter().map(|v| f64::from(*v)).filter(|v| v.is_finite()).collect()
            };
            let values = of(name);
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
            let told = of(&format!("{name}_sigma")).iter().map(|s| s * s).sum::<f64>() / n;
            println!(
                "{name}, {pixel}: bias {} spread/told {}",
                (mean - truth) / spread,
                spread / told.sqrt()
            );
            assert!(((mean - truth) / spread).abs() < 0.2, "{name}, {pixel}: {mean} for {truth}");
            // Without weights residuals tell the variance of counts only on average over the curve.
            assert!((0.7..1.4).contains(&(spread / told.sqrt())), "{name}, {pixel}");
        }
    }
}

#[test]
fn biases_match_the_table_of_retrieval_md() {
    // Contrasts so small that they are slopes; docs/retrieval.md has the table.
    let engine = engine();
    let [alpha, dark] = [1e-6, 1e-12];
    let spot: f64 = 0.5 * 30.0 * UM * 0.424_660_900_144_009_5;
    let at = |x: f64, variance: f64| {
        let blur = (spot * spot + variance).sqrt();
        blurred_overlap(1.5 * x, 30.0 * UM, 30.0 * UM, blur) / (150.0 * UM)
    };
    let cases = [
        (Method::Gaussian, 11, 25.0, 0.9970, 0.8641, 0),
        (Method::Gaussian, 7, 30.0, 0.9562, 1.0755, 0),
        (Method::Gaussian, 21, 40.0, 1.0000, 0.8957, 0),
        (Method::Moments, 11, 25.0, 0.9587, 0.7801, flags::TRUNCATED),
        (Method::ExactCurve, 11, 25.0, 1.0000, 1.0000, 0),
        (Method::ThreeStep, 3, 10.0, 0.9570, 1.0350, 0),
    ];
    for (method, steps, half, shift, blur, bits) in cases {
        let offsets = even(steps, half);
        let flat = frames(&offsets, |_, x| at(x, 0.0));
        let sample = frames(&offsets, |pixel, x| {
            if pixel == 0 { at(x + alpha / ARM, 0.0) } else { at(x, dark * 0.59 * 0.59) }
        });
        let images = retrieve(&engine, &scene(&offsets, &[]), method, &flat, &sample);
        let got = value(&images, "refraction", 0) / alpha;
        println!("{method}, {steps} steps over +-{half} um: refraction {got}");
        assert!((got - shift).abs() < 2e-4, "{method}: refraction {got}");
        let got = value(&images, "dark_field", 1) / dark;
        println!("{method}, {steps} steps over +-{half} um: dark field {got}");
        assert!((got - blur).abs() < 2e-3, "{method}: dark field {got}");
        let found = value(&images, "flags", 0) as u32 & !flags::MISFIT;
        assert_eq!(found, flags::of_pixel(bits, bits), "{method}");
    }
    let [shift, blur] = crate::tracking::of_the_table(&engine, alpha, dark);
    println!("beamlet, pixels of 15 um: {shift}, {blur}");
    assert!((shift - 1.0).abs() < 2e-4 && (blur - 1.0).abs() < 2e-3, "beamlet: {shift}, {blur}");
}

#[test]
fn triangles_and_exact_curves_serve_point_sources() {
    let offsets = even(21, 25.0);
    let engine = engine();
    let point = ["source.spot=[\"0 um\", \"0 um\"]"];
    let [flat, sample] = curves(&offsets, 0.0, false);
    let bare = |pixel: usize| [truth(pixel)[0], truth(pixel)[1]];
    for method in [Method::Triangle, Method::ExactCurve] {
        let images = retrieve(&engine, &scene(&offsets, &point), method, &flat, &sample);
        for pixel in 0..PIXELS {
            let [t, alpha] = bare(pixel);
            assert!((value(&images, "transmission", pixel) / t - 1.0).abs() < 1e-5, "{method}");
            assert!((value(&images, "refraction", pixel) - alpha).abs() < 1e-9, "{method}");
            assert!(value(&images, "dark_field", pixel).abs() < 1e-14, "{method}");
        }
    }
    // Apertures of unlike widths make a true trapezoid.
    let wide = ["source.spot=[\"0 um\", \"0 um\"]", "detector_mask.projected_aperture=\"45 um\""];
    let at = |x: f64| blurred_overlap(1.5 * x, 30.0 * UM, 45.0 * UM, 0.0) / (150.0 * UM);
    let offsets = even(25, 32.0);
    let flat = frames(&offsets, |_, x| at(x));
    let sample = frames(&offsets, |pixel, x| bare(pixel)[0] * at(x + bare(pixel)[1] / ARM));
    let images = retrieve(&engine, &scene(&offsets, &wide), Method::ExactCurve, &flat, &sample);
    for pixel in 0..PIXELS {
        let [t, alpha] = bare(pixel);
        assert!((value(&images, "transmission", pixel) / t - 1.0).abs() < 1e-5);
        assert!((value(&images, "refraction", pixel) - alpha).abs() < 1e-9);
    }
}

#[test]
fn methods_refuse_what_they_cannot_serve_and_say_why() {
    let engine = engine();
    let unlike = ["source.spot=[\"0 um\", \"0 um\"]", "detector_mask.projected_aperture=\"45 um\""];
    let cases: [(Method, usize, &[&str], &str); 7] = [
        (Method::Gaussian, 3, &[], "at least 4"),
        (Method::ThreeStep, 4, &[], "exactly 3"),
        (Method::Moments, 4, &[], "at least 5"),
        (Method::Triangle, 11, &[], "spot"),
        (Method::Triangle, 11, &unlike, "exact-curve"),
        (Method::ExactCurve, 4, &[], "at least 5"),
        (Method::Beamlet, 1, &[], "no detector mask"),
    ];
    for (method, count, sets, word) in cases {
        let offsets = if count == 1 { vec![0.0] } else { even(count, 25.0) };
        let options = free_gaussian().with_method(method);
        let message =
            Retriever::new(&engine, &scene(&offsets, sets), &options).unwrap_err().to_string();
        assert!(message.contains(word), "{method}: {message}");
    }
}

#[test]
fn bad_pixels_are_flagged_and_hold_no_number() {
    let offsets = even(11, 25.0);
    let [mut flat, mut sample] = gaussians(&offsets, 0.004);
    flat.slice_mut(s![.., 0, 0]).fill(0.0);
    flat[[3, 0, 1]] = f32::NAN;
    sample[[5, 0, 2]] = f32::INFINITY;
    sample.slice_mut(s![.., 0, 3]).fill(0.25);
    // Noise without a peak.
    for step in 0..11 {
        sample[[step, 0, 4]] = if step % 2 == 0 { 0.1 } else { 0.1002 };
    }
    // Only three values below the saturation.
    sample.slice_mut(s![..8, 0, 5]).fill(2.0);
    // Two saturated values: the rest tells the same curve.
    sample[[0, 0, 6]] = 2.0;
    sample[[5, 0, 6]] = 1.5;
    let options = free_gaussian().with_saturation(1.5);
    let engine = engine();
    let scene = scene(&offsets, &[]);
    let images = images_of(&engine, &scene, &options, [flat.view(), sample.view()]);
    let bits = |pixel| value(&images, "flags", pixel) as u32 & !flags::MISFIT;
    let of_sample = |bit| flags::of_pixel(0, bit);
    assert_eq!(bits(0), flags::DEAD);
    assert_eq!(bits(1), flags::NOT_FINITE);
    assert_eq!(bits(2), of_sample(flags::NOT_FINITE));
    assert_eq!(bits(3), of_sample(flags::DEAD));
    assert_ne!(bits(4) & of_sample(flags::NO_PEAK | flags::WIDTH | flags::NOT_CONVERGED), 0);
    assert_eq!(bits(5), of_sample(flags::FEW | flags::SATURATED));
    assert_eq!(bits(6), of_sample(flags::SATURATED));
    for pixel in 0..6 {
        for name in ["transmission", "refraction", "dark_field"] {
            assert!(value(&images, name, pixel).is_nan(), "{name} of pixel {pixel}");
        }
    }
    for pixel in 6..PIXELS {
        let [t, alpha, _] = truth(pixel);
        assert!((value(&images, "transmission", pixel) / t - 1.0).abs() < 1e-5);
        assert!((value(&images, "refraction", pixel) - alpha).abs() < 1e-9);
    }
}

#[test]
fn four_steps_about_the_peak_are_singular_and_flagged() {
    let offsets = even(4, 25.0);
    let symmetric =
        |shift: f64| frames(&offsets, move |_, x| gaussian(&[0.17, shift, 9.0 * UM, 0.0], x).0);
    let engine = engine();
    let scene = scene(&offsets, &[]);
    let ill = flags::of_pixel(flags::ILL_CONDITIONED, flags::ILL_CONDITIONED);
    let images = retrieve(&engine, &scene, Method::Gaussian, &symmetric(0.0), &symmetric(0.0));
    assert_eq!(value(&images, "flags", 0) as u32 & ill, ill);
    // Off the middle four steps tell four unknowns, without an uncertainty.
    let off = symmetric(5.0 * UM);
    let options = free_gaussian().with_gain(1.0);
    let images = images_of(&engine, &scene, &options, [off.view(), off.view()]);
    assert_eq!(value(&images, "flags", 0) as u32, 0);
    assert!((value(&images, "transmission", 0) - 1.0).abs() < 1e-6);
    assert!(value(&images, "transmission_sigma", 0).is_nan());
}

#[test]
fn frames_that_do_not_fit_offsets_or_each_other_are_refused() {
    let offsets = even(11, 25.0);
    let engine = engine();
    let [flat, _] = gaussians(&offsets, 0.0);
    let eleven = scene(&offsets, &[]);
    let mut retriever = Retriever::new(&engine, &eleven, &free_gaussian()).unwrap();
    let message = retriever.set_flat_array(flat.slice(s![..9, .., ..])).unwrap_err().to_string();
    assert!(message.contains("11 offsets for 9 frames"), "{message}");
    assert!(retriever.retrieve_array(flat.view()).is_err(), "before the flat");
    retriever.set_flat_array(flat.view()).unwrap();
    let taller = Array3::<f32>::zeros((11, 2, PIXELS));
    assert!(retriever.retrieve_array(taller.view()).is_err());
    let wider = Array3::<f32>::zeros((11, 1, PIXELS + 1));
    assert!(retriever.retrieve_array(wider.view()).is_err());
}

#[test]
fn results_do_not_depend_on_other_curves_of_the_batch() {
    let offsets = even(11, 25.0);
    let [flat, sample] = gaussians(&offsets, 0.004);
    let engine = engine();
    let scene = scene(&offsets, &[]);
    let (noise, free) = (ValueNoise::default(), BackgroundTerm::Free);
    let fitter = Fitter::new(&engine, &scene.scan.mask_offsets, noise, free).unwrap();
    let curves = |count: usize| {
        ndarray::Array2::from_shape_fn((11, count), |(s, c)| sample[[s, 0, c % PIXELS]])
    };
    let few = fitter.fit(curves(PIXELS).view(), &Cancel::default()).unwrap();
    // Across the ends of workgroups, dispatches and uploads.
    let many = fitter.fit(curves((1 << 20) + 77).view(), &Cancel::default()).unwrap();
    for at in [0, 63, 64, 32_767, 32_768, (1 << 20) - 1, 1 << 20, (1 << 20) + 76] {
        assert_eq!(many[at].centre.to_bits(), few[at % PIXELS].centre.to_bits(), "{at}");
        assert_eq!(many[at].width.to_bits(), few[at % PIXELS].width.to_bits(), "{at}");
        assert_eq!(many[at].area_sigma.to_bits(), few[at % PIXELS].area_sigma.to_bits(), "{at}");
    }
    drop(flat);
}

/// Views whose offsets differ from those of the flat, and by whole periods of 100 um.
#[test]
fn views_are_fitted_at_their_own_offsets() {
    let engine = engine();
    let (flat_offsets, near) = (even(9, 25.0), even(9, 22.0));
    let lists: Vec<Vec<f64>> =
        [3.0, 48.0, -700.0].map(|by| near.iter().map(|offset| offset + by).collect()).to_vec();
    let mut scene = scene(&flat_offsets, &[]);
    scene.scan.angles = vec![0.0, 1.0, 2.0];
    scene.scan.view_offsets =
        lists.iter().map(|list| list.iter().map(|offset| offset * UM).collect()).collect();
    // Curves repeat with the period.
    let curve = |t: f64, centre: f64, width: f64| {
        move |_: usize, at: f64| {
            let period = 100.0 * UM;
            let from = (at - centre) - period * ((at - centre) / period).round();
            0.1 * t * (-0.5 * (from / width).powi(2)).exp() + 0.01
        }
    };
    let flat = frames(&flat_offsets, curve(1.0, 2.0 * UM, 9.0 * UM));
    {
        let method = Method::Gaussian;
        let options = free_gaussian().with_method(method);
        let mut retriever = Retriever::new(&engine, &scene, &options).unwrap();
        retriever.set_flat_array(flat.view()).unwrap();
        for (view, list) in lists.iter().enumerate() {
            // The middle view is scanned around its own curve, 48 um away: half a period.
            let centre = if view == 1 { 50.0 } else { 3.5 } * UM;
            let sample = frames(list, curve(0.6, centre, 9.0 * UM));
            let images = retriever.retrieve_array_of(view, sample.view()).unwrap();
            let [t, alpha] = ["transmission", "refraction"].map(|name| value(&images, name, 4));
            let want = -ARM * (centre - 2.0 * UM);
            // Fits leave 1e-5 of a width of 9 um, over a shift of 1.5 um; f32 holds the sums to 1e-5.
            assert!((t / 0.6 - 1.0).abs() < 1e-4, "{method}, view {view}: {t}");
            assert!((alpha / want - 1.0).abs() < 1e-3, "{method}, {view}: {alpha} {want}");
        }
        let beyond = retriever.retrieve_array_of(3, flat.view()).unwrap_err().to_string();
        assert!(beyond.contains("view 3") && beyond.contains("0 to 2"), "{beyond}");
    }
    let refusal = |scene: &Scene, method: Method| {
        let options = free_gaussian().with_method(method);
        Retriever::new(&engine, scene, &options).unwrap_err().to_string()
    };
    scene.scan.view_offsets[1] = vec![7.0 * UM; 9];
    let text = refusal(&scene, Method::Gaussian);
    assert!(text.contains("scan.view_offsets[1]") && text.contains("at least 4"), "{text}");
    scene.scan.mask_offsets = vec![0.0];
    scene.scan.view_offsets = vec![vec![0.0], vec![5.0 * UM], vec![10.0 * UM]];
    let text = refusal(&scene, Method::Gaussian);
    assert!(text.contains("scan.view_offsets") && text.contains("in every view"), "{text}");
}
