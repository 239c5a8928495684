//! `moments` at uneven mask offsets: weights follow the offsets, and a warning says what stays wrong.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::draws::Draws;
use crate::stacks;
use crate::support::free_gaussian;
use beamlet::retrieve::{Input, Method, RetrievedArrays, flags};
use beamlet::scene::Scene;
use beamlet::stack::StackFile;
use ndarray::Array4;

const UM: f64 = 1e-6;
/// M/z of the scene below.
const ARM: f64 = 1.5 / 0.59;
const COLUMNS: usize = 2;
/// An angle that moves the curve by a tenth of its width, and a dark field of a twentieth of its variance.
const ALPHA: f64 = 2e-6;
const DARK_FIELD: f64 = 2.5e-11;

/// The paper's masks as sheets at these offsets in um, of the flat and of each view.
fn scene(flat: &[f64], views: &[Vec<f64>]) -> Scene {
    let mut scene = Scene::from_toml(&stacks::sheets([COLUMNS, 1], flat), ".").unwrap();
    scene.scan.angles = (0..views.len()).map(|view| view as f64).collect();
    scene.scan.view_offsets =
        views.iter().map(|offsets| offsets.iter().map(|x| x * UM).collect()).collect();
    scene
}

/// A stack of the curves of two pixels: at offsets of each view, displaced by an angle or widened.
fn stack(name: &str, views: &[Vec<f64>], contrasts: [[f64; 3]; 2]) -> StackFile {
    let blur = 0.5 * 30.0 * UM * 0.424_660_900_144_009_5;
    let value = |x: f64, [t, alpha, dark]: [f64; 3]| {
        let blur = (dark * 0.59_f64).mul_add(0.59, blur * blur).sqrt();
        t * blurred_overlap(1.5 * (x * UM + alpha / ARM), 30.0 * UM, 30.0 * UM, blur) / (150.0 * UM)
    };
    let shape = (views.len(), views[0].len(), 1, COLUMNS);
    let values = Array4::from_shape_fn(shape, |(view, step, _, column)| {
        value(views[view][step], contrasts[column]) as f32
    });
    stacks::stack(name, values)
}

fn retrieved(flat: &[f64], views: &[Vec<f64>], method: Method) -> RetrievedArrays {
    let of_flat = stack("flat", &[flat.to_vec()], [[1.0, 0.0, 0.0]; 2]);
    let contrasts = [[0.6, ALPHA, 0.0], [0.6, 0.0, DARK_FIELD]];
    let sample = stack("sample", views, contrasts);
    let input = Input::measured(&scene(flat, views), of_flat, sample, None).unwrap();
    let options = free_gaussian().with_method(method);
    stacks::retrieved(input, &options).unwrap()
}

/// Relative errors of the angle and of the dark field in a view.
fn errors(found: &RetrievedArrays, view: usize) -> [f64; 2] {
    let of = |name: &str, column: usize| f64::from(found.images[name][[view, 0, column]]);
    [of("refraction", 0) / ALPHA - 1.0, of("dark_field", 1) / DARK_FIELD - 1.0]
}

fn even() -> Vec<f64> {
    (-8..=8).map(|k| 5.0 * f64::from(k)).collect()
}

/// Even offsets, each displaced by a random one of this standard deviation; the ends stay.
fn jittered(deviation: f64, seed: u64) -> Vec<f64> {
    let mut draws = Draws(seed);
    let normal = |draws: &mut Draws| (0..12).map(|_| draws.uniform()).sum::<f64>() - 6.0;
    let place = |x: f64| if x.abs() < 39.0 { x + deviation * normal(&mut draws) } else { x };
    even().into_iter().map(place).collect()
}

fn warning(found: &RetrievedArrays) -> Option<&String> {
    found.record.warnings.iter().find(|line| line.contains("the method moments errs by"))
}

#[test]
fn moments_at_uneven_offsets_find_the_angle_or_say_its_error() {
    let dense =
        [-40.0, -40.0, -30.0, -20.0, -10.0, -5.0, 0.0, 0.0, 0.0, 5.0, 10.0, 20.0, 30.0, 40.0];
    let mut draws = Draws(1);
    let random: Vec<f64> = (0..21).map(|_| draws.between(-40.0, 40.0)).collect();
    let mut cases = vec![("even", even(), false), ("dense", dense.to_vec(), false)];
    cases.extend((1..5).map(|seed| ("jitter of 0.5 um", jittered(0.5, seed), false)));
    cases.extend((1..5).map(|seed| ("jitter of 2 um", jittered(2.0, seed), true)));
    cases.push(("21 random", random, true));
    let mut said = 0;
    for (name, offsets, may_warn) in cases {
        let found = retrieved(&offsets, std::slice::from_ref(&offsets), Method::Moments);
        let [angle, dark_field] = errors(&found, 0);
        let warning = warning(&found);
        println!("{name}: angle {angle:+.4}, dark field {dark_field:+.4}, {warning:?}");
        // Trapezoids: 1 % and 3 % at 0.5 um, 4 % and 13 % at 2 um, 5 % in the dense scan.
        assert!(warning.is_some() || (angle.abs() < 0.01 && dark_field.abs() < 0.05), "{name}");
        assert!(warning.is_none() || may_warn, "{name}: {warning:?}");
        if let Some(warning) = warning {
            said += 1;
            // The larger of the errors of both signs of the angle.
            let number = warning.split("errs by ").nth(1).unwrap().split(' ').next().unwrap();
            let number: f64 = number.parse().unwrap();
            assert!(number.abs() + 0.1 > 100.0 * angle.abs(), "{name}: {number} for {angle}");
        }
    }
    assert!(said > 1, "{said} warnings");
}

#[test]
fn moments_at_offsets_of_each_view_have_the_weights_of_the_view() {
    let views: Vec<Vec<f64>> = (1..4).map(|seed| jittered(0.4, seed)).collect();
    let found = retrieved(&even(), &views, Method::Moments);
    for view in 0..views.len() {
        let [angle, dark_field] = errors(&found, view);
        println!("view {view}: angle {angle:+.4}, dark field {dark_field:+.4}");
        let is_said = warning(&found).is_some();
        assert!(is_said || (angle.abs() < 0.01 && dark_field.abs() < 0.05), "view {view}");
    }
    // Wider gaps in one view: the warning names it.
    let views = vec![even(), jittered(2.0, 3)];
    let found = retrieved(&even(), &views, Method::Moments);
    let warning = warning(&found).unwrap();
    assert!(warning.starts_with("1 of 2 views, most in view 1: "), "{warning}");
    let exact = retrieved(&even(), &views, Method::ExactCurve);
    assert!(errors(&exact, 1).iter().all(|error| error.abs() < 1e-3));
}

/// Values that are left out leave gaps, which the weights follow.
#[test]
fn moments_without_saturated_values_keep_area_and_centre() {
    // The values at the peak are left out of every curve.
    let offsets: Vec<f64> = (-16..=16).map(|k| 2.5 * f64::from(k)).collect();
    let views = std::slice::from_ref(&offsets);
    let stacks = || {
        let of_flat = stack("flat", views, [[1.0, 0.0, 0.0]; 2]);
        (of_flat, stack("sample", views, [[1.0, ALPHA, 0.0]; 2]))
    };
    let (flat, sample) = stacks();
    let input = Input::measured(&scene(&offsets, views), flat, sample, None).unwrap();
    let most = stacks().0.frame(0, 15, 0..1).unwrap()[[0, 0]];
    let options = free_gaussian().with_method(Method::Moments).with_saturation(Some(most));
    let found = stacks::retrieved(input, &options).unwrap();
    let bits = flags::of_pixel(flags::SATURATED, flags::SATURATED);
    let value = |name: &str| f64::from(found.images[name][[0, 0, 0]]);
    assert_eq!(value("flags").to_bits(), f64::from(bits).to_bits());
    println!("T {}, angle {}", value("transmission"), value("refraction") / ALPHA);
    // With the weights of the whole scan T is 2 % off and the angle a tenth.
    assert!((value("transmission") - 1.0).abs() < 5e-3);
    assert!((value("refraction") / ALPHA - 1.0).abs() < 0.03);
}
