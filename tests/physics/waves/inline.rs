//! Propagation without a sample mask: edges and slits in closed form, a wire by FFT.

use super::simulate;
use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::waves::body::{Body, Outline};
use crate::reference::waves::fresnel;
use crate::reference::waves::row::Row;
use crate::reference::waves::setup::{Setup, Window};
use crate::support::Worst;
use beamlet::Backend;
use beamlet::scene::Scene;

const COLUMNS: u32 = 60;
/// Pixel at the sample, m.
const PIXEL: f64 = 6e-6;
/// 20 keV, 0.5 + 0.5 m, spot of 10 um.
const ENERGY: f64 = 20.0;
const SPOT: f64 = 10e-6;

fn set_up() -> Setup {
    Setup::new(ENERGY, [0.5, 0.5], SPOT * SIGMA_PER_FWHM)
}

/// Scene without masks; `objects`: shape and place along x (um) of each.
fn scene(objects: &[(&str, f64)], [mu, delta]: [f64; 2], more: &str) -> Scene {
    let object = |(number, (shape, x)): (usize, &(&str, f64))| {
        format!(
            "[[object]]\nname = \"{number}\"\nmaterial = \"matter\"\nshape = {shape}\nposition = [\"{x} um\", \"0 m\", \"0 m\"]\n"
        )
    };
    let objects: String = objects.iter().enumerate().map(object).collect();
    let text = format!(
        "[source]\ndistance = \"0.5 m\"\nspot = \"10 um\"\nenergy = \"{ENERGY} keV\"\n\
         [detector]\ndistance = \"1 m\"\npixels = [{COLUMNS}, 1]\npitch = [\"12 um\", \"120 um\"]\n\
         [sampling]\ntransport = \"wave\"\ntolerance = 2e-5\n\
         [materials.matter]\nmu = \"{mu} /m\"\ndelta = {delta}\n{objects}{more}"
    );
    Scene::from_toml(&text, ".").expect("a scene")
}

/// Light of the columns by the engine.
fn light(scene: &Scene) -> Vec<f64> {
    let stacks = simulate(scene, Backend::Bvh);
    assert!(stacks.flat.iter().all(|value| (value - 1.0).abs() < 1e-6));
    stacks.sample.iter().map(|value| f64::from(*value)).collect()
}

/// Light of the columns behind a slit by Fresnel integrals: mean over the pixel and the focal spot.
fn closed_form(ends: [f64; 2]) -> Vec<f64> {
    let set_up = set_up();
    let area = set_up.wavelength * set_up.effective(set_up.sample, set_up.analyser);
    let blur = set_up.spot[0].sigma * set_up.source_shift().abs();
    // Fringes at the ends of the grid are wider than two steps.
    let step = 50e-9;
    let half = (0.5 * f64::from(COLUMNS) * PIXEL + 6.0 * blur) / step;
    let places = (-half.ceil() as i32..=half.ceil() as i32).map(|at| f64::from(at) * step);
    let fringes: Vec<[f64; 2]> =
        places.map(|x| [x, fresnel::slit(x, ends, area).norm_sqr()]).collect();
    let below = |x: f64| 0.5 * (1.0 + libm::erf(x / blur / std::f64::consts::SQRT_2));
    let column = |index: u32| {
        let centre = (f64::from(index) + 0.5 - 0.5 * f64::from(COLUMNS)) * PIXEL;
        let seen = |x: f64| below(x - centre + 0.5 * PIXEL) - below(x - centre - 0.5 * PIXEL);
        fringes.iter().map(|[x, light]| light * seen(*x)).sum::<f64>() * step / PIXEL
    };
    (0..COLUMNS).map(column).collect()
}

/// Compares light behind a slit with its closed form. Rays sample an edge: it may be displaced by half of their
/// spacing, 6 nm; the displacement of each finite end is fitted.
fn compare(what: &'static str, got: &[f64], ends: [f64; 2]) {
    let step = 20e-9;
    let want = closed_form(ends);
    let slopes: Vec<Vec<f64>> = (0..2)
        .filter(|end| ends[*end].is_finite())
        .map(|end| {
            let mut moved = ends;
            moved[end] += step;
            closed_form(moved).iter().zip(&want).map(|(a, b)| (a - b) / step).collect()
        })
        .collect();
    // Edges are so far apart that their slopes hardly overlap.
    let moved = |slope: &Vec<f64>| {
        let along =
            got.iter().zip(&want).zip(slope).map(|((got, want), slope)| (got - want) * slope);
        along.sum::<f64>() / slope.iter().map(|slope| slope * slope).sum::<f64>()
    };
    let moves: Vec<f64> = slopes.iter().map(moved).collect();
    assert!(moves.iter().all(|it| it.abs() < 8e-9), "{what}: {moves:?}");
    let mut worst = Worst::new(what, 1e-4);
    for (column, (got, want)) in got.iter().zip(&want).enumerate() {
        let shift: f64 = slopes.iter().zip(&moves).map(|(slope, by)| slope[column] * by).sum();
        worst.take(got - want - shift, || format!("column {column}: {got} {want}"));
    }
    worst.holds();
}

const OPAQUE: [f64; 2] = [1e7, 0.0];
const SHEET: &str = "{ box = { size = [\"2 mm\", \"4 um\", \"4 mm\"] } }";

#[test]
fn an_opaque_edge_without_masks_has_the_fringes_of_fresnel_within_1e_4() {
    let got = light(&scene(&[(SHEET, 1000.0)], OPAQUE, ""));
    // A fringe of pixels that are wider than it.
    assert!(got.iter().copied().fold(0.0, f64::max) > 1.005);
    compare("waves, an edge without masks", &got, [f64::NEG_INFINITY, 0.0]);
}

#[test]
fn an_opaque_slit_without_masks_has_the_fringes_of_fresnel_within_1e_4() {
    let got = light(&scene(&[(SHEET, 1036.0), (SHEET, -1024.0)], OPAQUE, ""));
    compare("waves, a slit without masks", &got, [-24e-6, 36e-6]);
}

#[test]
fn a_wire_without_masks_matches_fft_within_5e_5() {
    let matter = [100.0, 1.04e-6];
    let (centre, radius) = (7e-6, 40e-6);
    let wire = "{ cylinder = { radius = \"40 um\", height = \"4 mm\" } }";
    let got = light(&scene(&[(wire, 7.0)], matter, ""));
    let outline = Outline::Cylinder { centre, radius };
    let sample = [Body { outline, delta: matter[1], mu: matter[0] }];
    let row = Row {
        columns: COLUMNS,
        window: Window::open(2.0 * PIXEL),
        aperture: None,
        period: PIXEL,
        leak: 0.0,
    };
    let light = |sample: &[Body]| row.light(&set_up(), sample, 10e-9, &[0.0], None).remove(0);
    // Light from the ends of the grid is in both.
    let (want, empty) = (light(&sample), light(&[]));
    let mut worst = Worst::new("waves, a wire without masks", 5e-5);
    for (column, ((got, want), empty)) in got.iter().zip(&want).zip(&empty).enumerate() {
        worst.take(got - want + empty - 1.0, || format!("column {column}: {got} {want} {empty}"));
    }
    worst.holds();
}
