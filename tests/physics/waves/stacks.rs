//! Stacks of many fibres.

use super::{BY_WAVES, FIBRE, row};
use crate::reference::waves::body::{Outline, bodies, stack};
use crate::support::{Worst, engine, sample};
use crate::thin_masks::REFERENCE;
use beamlet::Backend;
use beamlet::scene::Scene;
use std::fmt::Write;

const RADIUS: f64 = 2.5e-6;
/// Depth of a layer of fibres, m.
const LAYER: f64 = 5.1e-6;
/// Fibres lie from here to there, m: over four pixels and the reach of their light.
const ENDS: [f64; 2] = [-250e-6, 250e-6];
const OFFSETS: [f64; 2] = [0.0, 20e-6];
/// Points of the focal spot: a blur alone errs by 4e-5 behind 50 crossings.
const POINTS: Option<usize> = Some(64);

/// Places (x, y), m, of fibres at random x that rays cross `crossings` times: each in the first layer with room.
fn places(crossings: f64, seed: u64) -> Vec<[f64; 2]> {
    let count = (crossings * (ENDS[1] - ENDS[0]) / (2.0 * RADIUS)).round() as u32;
    let mut layers: Vec<Vec<f64>> = Vec::new();
    let mut placed = Vec::new();
    for fibre in stack(count, RADIUS, ENDS, seed) {
        let x = fibre.ends()[0] + RADIUS;
        let has_room = |layer: &Vec<f64>| layer.iter().all(|other| (x - other).abs() > LAYER);
        let at = layers.iter().position(has_room).unwrap_or(layers.len());
        if at == layers.len() {
            layers.push(Vec::new());
        }
        layers[at].push(x);
        placed.push([x, at as f64]);
    }
    let middle = 0.5 * (layers.len() as f64 - 1.0);
    placed.into_iter().map(|[x, at]| [x, (at - middle) * LAYER]).collect()
}

/// Scene of these fibres, with their list in a folder.
fn scene(places: &[[f64; 2]], behind: f64, folder: &std::path::Path) -> Scene {
    let mut list = String::from("x_um,y_um,z_um\n");
    for [x, y] in places {
        writeln!(list, "{},{},0", 1e6 * x, 1e6 * y).expect("text");
    }
    std::fs::write(folder.join("fibres.csv"), list).expect("a file");
    let object = format!(
        "{BY_WAVES}[materials.fibre]\nmu = \"{} /m\"\ndelta = {}\n[[object]]\nname = \"fibres\"\n\
         material = \"fibre\"\nshape = {{ cylinder = {{ radius = \"2.5 um\", height = \"4 mm\" }} }}\n\
         instances = \"fibres.csv\"\n",
        FIBRE[1], FIBRE[0]
    );
    Scene::from_toml(&REFERENCE.text(4, behind, &OFFSETS, &object), folder).expect("a scene")
}

/// Light of stacks of 5,000 fibres, with `BEAMLET_ALL` of 20,000, too. The reference has all fibres
/// in one plane, where rays from the source see them; their layers are up to 1.5 mm deep.
/// Propagation between mask and sample, which waves neglect, changes light by 4e-5 over 1 mm behind
/// 50 crossings.
#[test]
fn stacks_of_50_and_200_crossings_match_fft_within_5e_5_and_2e_4() {
    let cases = vec![(50.0, 3, 0.0003, 5e-5), (200.0, 4, 0.0009, 2e-4)];
    for (crossings, seed, behind, allowed) in sample(cases, 2) {
        let places = places(crossings, seed);
        let folder = tempfile::tempdir().expect("a folder");
        let scene = scene(&places, behind, folder.path());
        let stacks = engine(Backend::Bvh).simulate(&scene).expect("stacks");
        let centre_plane = 1.2 + behind;
        let seen = |[x, y]: &[f64; 2]| Outline::Cylinder {
            centre: x * centre_plane / (centre_plane + y),
            radius: RADIUS,
        };
        let centres = places.iter().map(seen);
        let fibres = bodies(&centres.collect::<Vec<_>>(), FIBRE[0], FIBRE[1]);
        let mut set_up = REFERENCE.set_up();
        set_up.sample = centre_plane;
        let want = row(&REFERENCE, 4).light(&set_up, &fibres, 20e-9, &OFFSETS, POINTS);
        let mut worst = Worst::new("waves, stacks of fibres", allowed);
        let mut by_fibres = 0.0_f64;
        for (step, want) in want.iter().enumerate() {
            for (column, want) in want.iter().enumerate() {
                let got = f64::from(stacks.sample[[0, step, 0, column]]);
                by_fibres = by_fibres.max((want - f64::from(stacks.flat[[step, 0, column]])).abs());
                worst.take(got - want, || {
                    format!("{crossings}, step {step}, {column}: {got} {want}")
                });
            }
        }
        assert!(by_fibres > 5e-3, "{by_fibres:e}");
        worst.holds();
    }
}
