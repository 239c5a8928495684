//! The tables of docs/developers/validation.md, "Truth".

use super::cases::{self, Case};
use super::classes::Class;
use super::errors::{ANGLE, Errors, classes_of, displacements, run, truth_of, with_budget};
use crate::reference::rays::{Order, Sample};
use crate::reference::stack::Quadrature;
use crate::support::{Checked, engine};
use beamlet::Backend;
use std::time::Instant;

/// Tolerances, share of open beam.
const TOLERANCES: [f64; 4] = [1e-3, 3e-4, 1e-4, 3e-5];
/// Angle tolerances, rad.
const ANGLES: [f64; 3] = [30e-9, 10e-9, 3e-9];
/// Tolerance of truth, share of open beam: where it was 2e-5 its own errors were half of
/// those that were found at 3e-5.
const TRUTH: f64 = 4e-6;

fn print(case: &Case, limit: f64, class: (Class, &str), errors: &Errors, rays: f64) {
    if errors.count == 0 {
        return;
    }
    let failures = errors.failures(class.0, limit).join(", ");
    println!(
        "| {} | {limit:.0e} | {} | {} | {:.1} % | {:.2} | {:.2} | {:.0} | {failures} | {:?}",
        case.name,
        class.1,
        errors.count,
        100.0 * errors.share(),
        errors.rms / limit,
        errors.worst / limit,
        rays,
        errors.place,
    );
}

fn values(engine: &Checked, case: &Case) {
    let (classes, named) = classes_of(case);
    let begin = Instant::now();
    let truth = run(engine, &truth_of(case, TRUTH));
    let touched = classes.iter().filter(|class| **class != Class::Nothing).count() as f64;
    let beside = run(engine, &with_budget(case, 1e-5, ANGLE));
    let doubt = Errors::of(None, &classes, 1e-5, [&beside.values, &truth.values]);
    println!(
        "# {}: truth {:.0} rays per pixel, {:.1} s; tolerance 1e-5 differs by {:.1e} rms, {:.1e} worst {:?}",
        case.name,
        truth.rays as f64 / touched,
        begin.elapsed().as_secs_f64(),
        doubt.rms,
        doubt.worst,
        doubt.place,
    );
    for tolerance in TOLERANCES {
        let got = run(engine, &with_budget(case, tolerance, ANGLE));
        let rays = got.rays as f64 / touched;
        for class in named {
            let both = [&got.values, &truth.values];
            let errors = Errors::of(Some(class.0), &classes, tolerance, both);
            print(case, tolerance, class, &errors, rays);
        }
        let all = Errors::of(None, &classes, tolerance, [&got.values, &truth.values]);
        if let Some(told) = got.sampling {
            println!(
                "  estimate {:.1e}, true {:.1e}: ratio {:.2} (of all values {:.2})",
                told.rms_error,
                all.of_pixels,
                told.rms_error / all.of_pixels,
                told.rms_error / all.rms,
            );
        }
    }
}

fn angles(engine: &Checked, case: &Case) {
    let scene = &case.scene;
    if scene.sample_mask.is_none() || scene.detector.blur.is_some() {
        return;
    }
    let (classes, _) = classes_of(case);
    let arm = scene.lever_arm();
    let truth = displacements(engine, &truth_of(case, TRUTH)) / arm;
    let touched = classes.iter().filter(|class| **class != Class::Nothing).count() as f64;
    for angle in ANGLES {
        let budget = with_budget(case, 1e-2, angle);
        let got = displacements(engine, &budget) / arm;
        let errors = Errors::of(Some(Class::Interior), &classes, angle, [&got, &truth]);
        let rays = run(engine, &budget).rays as f64 / touched;
        print(case, angle, (Class::Interior, "angle"), &errors, rays);
    }
}

#[test]
#[ignore = "tens of minutes of processor time: tables of docs/developers/validation.md"]
fn table_of_errors_of_values() {
    let engine = engine(Backend::Bvh);
    cases::all().iter().for_each(|case| values(&engine, case));
}

#[test]
#[ignore = "tens of minutes of processor time: tables of docs/developers/validation.md"]
fn table_of_errors_of_angles() {
    let engine = engine(Backend::Bvh);
    cases::all().iter().for_each(|case| angles(&engine, case));
}

#[test]
#[ignore = "minutes: one pixel by the f64 reference, for doubts about a truth"]
/// Light that is bent farther than `BEAMLET_FARTHEST` (um at the detector) is left out.
fn one_pixel_by_the_reference() {
    let place = std::env::var("BEAMLET_PIXEL").expect("BEAMLET_PIXEL=column,row");
    let place: Vec<u32> = place.split(',').map(|n| n.parse().expect("a number")).collect();
    let number = |name: &str, default: usize| {
        std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
    };
    let engine = engine(Backend::Bvh);
    for case in cases::all() {
        let offsets = &case.scene.scan.mask_offsets;
        let sample = Sample::new(&case.bodies, case.scene.source.distance, 0.0);
        let how = Quadrature {
            cells: number("BEAMLET_CELLS", 400),
            lines: number("BEAMLET_LINES", 200),
            sources: number("BEAMLET_SOURCES", 81),
            reach: 5.0,
            farthest: [1e-6 * number("BEAMLET_FARTHEST", 20) as f64; 2],
        };
        let [column, row] = [place[0], place[1]];
        let print = |name: &str, values: Vec<f64>| {
            let values: Vec<String> = values.iter().map(|value| format!("{value:.6}")).collect();
            println!("{name:<16} {}", values.join(" "));
        };
        println!("# {}, pixel {place:?}", case.name);
        let pixel = |scene: &beamlet::scene::Scene| {
            let values = run(&engine, scene).values;
            let column = values.slice(ndarray::s![.., row as usize, column as usize]).to_owned();
            column.to_vec()
        };
        print("rays in order", pixel(&truth_of(&case, TRUTH)));
        for tolerance in [1e-3, 1e-4, 1e-5] {
            print(&format!("{tolerance:e}"), pixel(&with_budget(&case, tolerance, ANGLE)));
        }
        let setup = case.setup.clone();
        let order = Order::Exact;
        print("flat", setup.pixel(None, order, &how, column, row, offsets));
        print("reference", setup.pixel(Some(&sample), order, &how, column, row, offsets));
    }
}
