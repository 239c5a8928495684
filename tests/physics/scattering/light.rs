//! Light behind media, pixel by pixel and step by step.

use super::{Medium, SET_UP, Section, SetUp, add, disc, empty, middle, plate, wedge};
use crate::support::{Worst, backends, engine, sample};
use beamlet::Backend;
use beamlet::scene::{Instances, Scene, Transport};
use beamlet::stack::Stacks;
use std::fs;
use std::rc::Rc;

pub(super) const OFFSETS: &str = "{ from = \"-24 um\", to = \"24 um\", count = 5 }";
/// Share of the open beam.
pub(super) const TOLERANCE: f64 = 1e-5;

/// Takes the differences of the light of a run of a scene, whose sample has these media in its view, from that of
/// quadratures.
pub(super) fn compare(
    what: &str,
    scene: &Scene,
    set_up: SetUp,
    media: &[Medium],
    stacks: &Stacks,
    worst: &mut Worst,
) {
    let columns = stacks.sample.dim().3;
    for ((_, step, _, column), light) in stacks.sample.indexed_iter() {
        let offset = scene.scan.mask_offsets[step];
        let expected = set_up.light(media, middle(columns, column), offset);
        let place = || format!("{what}, step {step}, column {column}");
        worst.take(f64::from(*light) - expected, place);
    }
}

fn scene(columns: u32, media: &[Medium], sides: Option<u32>) -> Scene {
    let mut scene = empty(columns, OFFSETS);
    media.iter().for_each(|medium| add(&mut scene, medium, sides));
    scene
}

/// Bodies alone, inside each other, and crossing: of those at one place the last one counts.
fn bodies() -> Vec<(&'static str, Vec<Medium>)> {
    let whole = || disc([0.0, 0.0], 1e-3, 20.0, 2e-7);
    vec![
        ("a plate", vec![plate([-1e-3, 1e-3], 20.0, 1e-7)]),
        ("a wedge", vec![wedge(2e-7)]),
        ("a disc", vec![whole()]),
        ("a disc without absorption", vec![disc([0.1e-3, 0.0], 1e-3, 0.0, 2e-7)]),
        ("one in another", vec![whole(), disc([0.2e-3, 0.1e-3], 0.5e-3, 0.0, 5e-8)]),
        ("a clear one in another", vec![whole(), disc([-0.2e-3, 0.1e-3], 0.4e-3, 0.0, 0.0)]),
        ("two that cross", vec![whole(), disc([0.7e-3, 0.1e-3], 0.7e-3, 5.0, 4e-7)]),
        ("a wedge in a disc", vec![disc([0.0, 0.0], 3e-3, 0.0, 3e-8), wedge(2e-7)]),
    ]
}

#[test]
fn light_behind_media_is_that_of_quadratures() {
    let mut worst = Worst::new("light behind media that scatter", TOLERANCE);
    let ways = [
        (None, Transport::Auto),
        (Some(4096), Transport::Auto),
        (None, Transport::FirstOrder),
        (None, Transport::Exact),
    ];
    let bodies = bodies();
    let mut all = Vec::new();
    for backend in backends() {
        let engine = Rc::new(engine(backend));
        for body in &bodies {
            all.extend(ways.map(|way| (body, way, backend, Rc::clone(&engine))));
        }
    }
    // A seventh of them has every body and every way.
    for ((name, media), (sides, transport), backend, engine) in sample(all, 7) {
        let mut scene = scene(25, media, sides);
        scene.sampling.transport = transport;
        let what = format!("{name}, {sides:?} sides, {transport:?}, {backend:?}");
        let stacks = engine.simulate(&scene).expect("a run");
        compare(&what, &scene, SET_UP, media, &stacks, &mut worst);
    }
    worst.holds();
}

/// Rays of 80 mrad have 1.6 % more variance on the analyser than rays along the axis.
#[test]
fn light_off_the_axis_is_that_of_quadratures() {
    let mut worst = Worst::new("light off the axis", TOLERANCE);
    const COLUMNS: u32 = 1921;
    // Only the outermost columns see it.
    let corners = [[-0.1, -1e-3], [-0.096, -1e-3], [-0.096, 1e-3], [-0.1, 1e-3]];
    let section = Section::Polygon(corners.into());
    let media = [Medium { section, ..plate([-1e-3, 1e-3], 20.0, 1e-7) }];
    let mut scene = scene(COLUMNS, &media, None);
    scene.scan.mask_offsets = vec![0.0, 20e-6];
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
    for ((_, step, _, column), light) in stacks.sample.indexed_iter().filter(|it| it.0.3 < 16) {
        let offset = scene.scan.mask_offsets[step];
        let expected = SET_UP.light(&media, middle(COLUMNS as usize, column), offset);
        worst.take(f64::from(*light) - expected, || format!("step {step}, column {column}"));
    }
    let whole = [plate([-1e-3, 1e-3], 20.0, 1e-7)];
    let along = SET_UP.passed(&whole, 0.0).variance;
    let aside = SET_UP.passed(&media, middle(COLUMNS as usize, 0) / SET_UP.analyser).variance;
    assert!((aside / along - 1.016).abs() < 1e-3, "{}", aside / along);
    worst.holds();
}

/// The distance to the analyser falls from 0.55 to 0.15 m: its mean square is an eighth above the square of its mean.
#[test]
fn light_behind_thick_media_has_the_lever_of_each_depth() {
    let mut worst = Worst::new("light behind thick media", TOLERANCE);
    let set_up = SetUp { axis: 1.45, ..SET_UP };
    let media = [plate([-0.2, 0.2], 0.5, 1e-9), disc([0.0, 0.0], 3e-4, 100.0, 2e-7)];
    let mut scene = scene(9, &media, None);
    scene.source.distance = set_up.axis;
    let stacks = engine(Backend::Bvh).simulate(&scene).expect("a run");
    compare("0.4 m", &scene, set_up, &media, &stacks, &mut worst);
    worst.holds();
}

/// A sample that turns, moves, is placed twice, is mirrored or stands elsewhere against the origin.
#[test]
fn light_behind_media_follows_their_motion() {
    let engine = engine(Backend::Bvh);
    let mut worst = Worst::new("light behind media that move", TOLERANCE);
    let media = [wedge(2e-7), disc([0.4e-3, 1.2e-3], 0.5e-3, 5.0, 6e-8)];
    let moved = |angle: f64, by: [f64; 2]| -> Vec<Medium> {
        let of = |it: &Medium| Medium { section: it.section.moved(angle, by), ..it.clone() };
        media.iter().map(of).collect()
    };
    let angle = 0.6_f64;
    let mut turned = scene(25, &media, None);
    turned.scan.angles = vec![angle];
    let stacks = engine.simulate(&turned).expect("a run");
    let of_turned = moved(-angle, [0.0; 2]);
    compare("turned", &turned, SET_UP, &of_turned, &stacks, &mut worst);

    let mut elsewhere = scene(25, &media, None);
    elsewhere.source.distance = 1.25;
    elsewhere.objects.iter_mut().for_each(|object| object.placement.position[1] -= 0.04);
    let stacks = engine.simulate(&elsewhere).expect("a run");
    let set_up = SetUp { axis: 1.25, ..SET_UP };
    compare("origin", &elsewhere, set_up, &moved(0.0, [0.0, -0.04]), &stacks, &mut worst);

    let flip = |it: &Medium| {
        let section = match &it.section {
            Section::Disc([x, y], radius) => Section::Disc([-x, *y], *radius),
            Section::Polygon(corners) => {
                Section::Polygon(corners.iter().rev().map(|[x, y]| [-x, *y]).collect())
            }
        };
        Medium { section, ..it.clone() }
    };
    let flipped: Vec<Medium> = media.iter().map(flip).collect();
    let mirrored = scene(25, &flipped, None);
    let stacks = engine.simulate(&mirrored).expect("a run");
    compare("mirrored", &mirrored, SET_UP, &flipped, &stacks, &mut worst);

    let folder = tempfile::tempdir().expect("a folder");
    let places = folder.path().join("places.csv");
    fs::write(&places, "x_mm,y_mm,z_mm\n-0.9,0,0\n0.7,4,0\n").expect("a file");
    let own = disc([0.0, 0.0], 0.5e-3, 5.0, 6e-8);
    let mut pair = scene(25, std::slice::from_ref(&own), None);
    pair.objects[0].instances = Some(Instances::File(places));
    let two = [[-0.9e-3, 0.0], [0.7e-3, 4e-3]]
        .map(|by| Medium { section: own.section.moved(0.0, by), ..own.clone() });
    let stacks = engine.simulate(&pair).expect("a run");
    compare("two places", &pair, SET_UP, &two, &stacks, &mut worst);
    worst.holds();
}
