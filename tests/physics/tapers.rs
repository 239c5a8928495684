//! Tapered bars and bars of several layers: flats against paths cut wall by wall in f64, random rays and straight bars.

#![allow(clippy::unwrap_used, reason = "tests")]

use super::designs::{ball, compare_with_random};
use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::walls::{Flat, Walls};
use crate::support::{Checked, GOLD, Worst, amount, engine, sample};
use beamlet::Backend;
use beamlet::internals::trace::MaterialTable;
use beamlet::material::constants_at;
use beamlet::scene::{
    BarLayer, Beam, Detector, MaskBody, MaskSpec, MaterialSpec, Scene, Source, SpectrumOrigin,
    SpectrumSpec,
};

/// As for bars whose walls are parallel to the axis (`bars.rs`).
const TOLERANCE: f64 = 2e-5;
/// Columns of 150 um, 1.8 m from the source: up to 16.6 mrad.
const COLUMNS: u32 = 400;
/// Source to the masks, m.
const DISTANCES: [f64; 2] = [1.2, 1.75];
const APERTURES: [f64; 2] = [20e-6, 29e-6];
/// Walls within the fan of the rays and steeper than it, rad.
const TAPERS: [[f64; 2]; 5] =
    [[0.035, 0.0], [0.0, -0.035], [-0.004, 0.015], [0.015, 0.004], [-0.02, 0.03]];
/// Opaque at 225 um, leaking 0.011, 0.39 and 0.91.
const ATTENUATIONS: [f64; 4] = [GOLD, 20_000.0, 4_185.0, 400.0];

#[derive(Debug, Clone, Copy)]
struct Case {
    tapers: [f64; 2],
    thickness: [f64; 2],
    mu: f64,
    /// Layers of the bars of both masks, from the source on: shares of the thickness, and of `mu`.
    layers: &'static [[f64; 2]],
    spot: f64,
}

/// Bars of one material.
const WHOLE: &[[f64; 2]] = &[[1.0; 2]];

impl Case {
    fn body(&self, thickness: f64) -> MaskBody {
        if self.layers == WHOLE {
            return MaskBody::Bars { material: "bars 0".into(), thickness };
        }
        let layer = |(number, of): (usize, &[f64; 2])| {
            BarLayer::new(format!("bars {number}"), of[0] * thickness)
        };
        MaskBody::Layers { layers: self.layers.iter().enumerate().map(layer).collect() }
    }

    fn scene(&self, pixels: [u32; 2]) -> Scene {
        let source = Source::new(1.21, [self.spot; 2], Beam::Energy(30.0));
        let mut scene = Scene::new(source, Detector::new(1.8, pixels, [150e-6; 2]));
        for (number, [_, share]) in self.layers.iter().enumerate() {
            let constants = MaterialSpec::Constants { mu: share * self.mu, delta: 0.0 };
            scene.materials.insert(format!("bars {number}"), constants);
        }
        let mask = |i: usize| {
            let body = self.body(self.thickness[i]);
            let period = 150e-6 * DISTANCES[i] / 1.8;
            let mut mask = MaskSpec::new(DISTANCES[i], period, APERTURES[i], body);
            mask.taper = self.tapers[i].atan();
            mask
        };
        (scene.sample_mask, scene.detector_mask) = (Some(mask(0)), Some(mask(1)));
        scene.scan.mask_offsets = OFFSETS.into();
        scene
    }

    fn reference(&self) -> Flat {
        let mask = |i: usize| {
            let period = 150e-6 * DISTANCES[i] / 1.8;
            Walls {
                distance: DISTANCES[i],
                period,
                aperture: APERTURES[i],
                origin: 0.5 * period,
                taper: self.tapers[i],
                layers: self
                    .layers
                    .iter()
                    .map(|[thickness, mu]| [mu * self.mu, thickness * self.thickness[i]])
                    .collect(),
            }
        };
        // Hard edges between rays leave 1e-6 of the light.
        let [rays, sources] = if self.spot > 0.0 { [1500, 301] } else { [100_000, 1] };
        Flat {
            masks: vec![mask(0), mask(1)],
            detector: 1.8,
            columns: COLUMNS,
            pitch: 150e-6,
            sigma: self.spot * SIGMA_PER_FWHM,
            rays,
            sources,
        }
    }
}

const OFFSETS: [f64; 3] = [-13e-6, 2e-6, 41e-6];

#[test]
fn tapered_bars_match_paths_cut_wall_by_wall() {
    let mut worst = Worst::new("tapered bars", TOLERANCE);
    let engine = engine(Backend::Bvh);
    let mut cases = Vec::new();
    for tapers in TAPERS {
        for thickness in [[225e-6; 2], [60e-6, 150e-6]] {
            for mu in ATTENUATIONS {
                for spot in [0.0, 30e-6, 90e-6] {
                    cases.push(Case { tapers, thickness, mu, layers: WHOLE, spot });
                }
            }
        }
    }
    for case in sample(cases, 29) {
        compare(&engine, &mut worst, case);
    }
    worst.holds();
}

/// Compares columns of a flat with the reference.
fn compare(engine: &Checked, worst: &mut Worst, case: Case) {
    let flat = engine.simulate(&case.scene([COLUMNS, 1])).unwrap().flat;
    let reference = case.reference();
    for column in amount(vec![12, 200, 399], vec![12, 200, 290, 399]) {
        for (step, offset) in sample(OFFSETS.into_iter().enumerate().collect(), 2) {
            let got = f64::from(flat[[step, 0, column as usize]]);
            let want = reference.pixel(column, offset);
            let place = || format!("{case:?}, column {column}, step {step}: {got} for {want}");
            worst.take(got - want, place);
        }
    }
}

/// Gold on silicon and behind it at 30 keV, three layers, and layers that pass all light.
const LAYERS: [&[[f64; 2]]; 4] = [
    &[[0.1, 1.0], [0.9, 0.006]],
    &[[0.9, 0.006], [0.1, 1.0]],
    &[[0.3, 0.05], [0.2, 1.0], [0.5, 0.2]],
    &[[0.5, 0.0], [0.5, 1.0]],
];

#[test]
fn bars_of_layers_match_paths_cut_layer_by_layer() {
    let mut worst = Worst::new("bars of layers", TOLERANCE);
    let engine = engine(Backend::Bvh);
    let mut cases = Vec::new();
    for layers in LAYERS {
        for tapers in [[0.0; 2], [0.0; 2], TAPERS[0], TAPERS[3]] {
            for mu in ATTENUATIONS {
                for spot in [30e-6, 0.0, 90e-6] {
                    cases.push(Case { tapers, thickness: [225e-6; 2], mu, layers, spot });
                }
            }
        }
    }
    for case in sample(cases, 41) {
        compare(&engine, &mut worst, case);
    }
    worst.holds();
}

/// A bar cut into layers of its own material is the same bar: 1e-6 is the fixed point of the sums and the rounding of
/// shares in f32.
#[test]
fn layers_of_one_material_are_one_bar() {
    let mut worst = Worst::new("bars of equal layers", 1e-6);
    let engine = engine(Backend::Bvh);
    for (mu, spot, tapers) in
        [(GOLD, 30e-6, [0.0; 2]), (4_185.0, 0.0, TAPERS[4]), (400.0, 90e-6, [0.0; 2])]
    {
        let flat = |layers| {
            let case = Case { tapers, thickness: [225e-6; 2], mu, layers, spot };
            engine.simulate(&case.scene([COLUMNS, 1])).unwrap().flat
        };
        let whole = flat(WHOLE);
        for (at, got) in flat(&[[0.3, 1.0], [0.2, 1.0], [0.5, 1.0]]).indexed_iter() {
            worst.take(f64::from(got - whole[at]), || format!("{mu}, {spot}, {at:?}"));
        }
    }
    worst.holds();
}

/// Straight bars are tapered ones whose taper goes to 0; 1e-7 is the fixed point of the sums and f32, and walls of
/// 10 nrad move edges by 2 pm.
#[test]
fn flats_are_continuous_where_the_taper_is_0() {
    let mut worst = Worst::new("tapered bars, taper to 0", 1e-6);
    let engine = engine(Backend::Bvh);
    for (mu, spot) in [(GOLD, 30e-6), (4_185.0, 0.0), (400.0, 90e-6), (GOLD, 0.0)] {
        let flat = |taper: f64| {
            let case =
                Case { tapers: [taper, -taper], thickness: [225e-6; 2], mu, layers: WHOLE, spot };
            engine.simulate(&case.scene([COLUMNS, 1])).unwrap().flat
        };
        let straight = flat(0.0);
        for taper in [1e-8, -1e-8] {
            for (at, got) in flat(taper).indexed_iter() {
                worst.take(f64::from(got - straight[at]), || format!("{mu}, {spot}, {at:?}"));
            }
        }
    }
    worst.holds();
}

/// Random rays pass the exact walls. 10,000 rays of a pixel have the noise of at most 5e-3 in it, and of 3e-4 in the
/// mean of the values of a case.
#[test]
fn flats_and_a_ball_behind_tapered_bars_match_random_rays() {
    let mut worst = Worst::new("tapered bars and a ball, random rays: a pixel", 1.2e-2);
    let mut mean = Worst::new("tapered bars and a ball, random rays: mean", 1.2e-3);
    let engine = engine(Backend::Bvh);
    let layered = LAYERS.map(|layers| ([0.0; 2], layers, GOLD));
    let tapered = TAPERS.map(|tapers| (tapers, WHOLE, 4_185.0));
    // Every other; all with `BEAMLET_ALL`.
    for (tapers, layers, mu) in sample(tapered.into_iter().chain(layered).collect(), 2) {
        let case = Case { tapers, thickness: [225e-6; 2], mu, layers, spot: 30e-6 };
        let mut scene = case.scene([8, 2]);
        ball(&mut scene);
        compare_with_random(&engine, [&mut worst, &mut mean], scene, &format!("{case:?}"));
    }
    worst.holds();
    mean.holds();
}

/// Two energies between 28 keV and 58 keV share edges near the axis where bars stop both alike, and nowhere else.
#[test]
fn tapered_bars_under_a_spectrum_match_paths_at_each_energy() {
    let mut worst = Worst::new("tapered bars under a spectrum", TOLERANCE);
    let engine = engine(Backend::Bvh);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.csv");
    std::fs::write(&path, "energy_keV,weight\n28,1\n43,0\n58,1\n").unwrap();
    let cases = vec![("gold", [1e-4, 0.0]), ("gold", [-0.01, 0.01]), ("Cu", [0.03, -0.02])];
    for (material, tapers) in sample(cases, 2) {
        let case = Case { tapers, thickness: [225e-6; 2], mu: 0.0, layers: WHOLE, spot: 30e-6 };
        let mut scene = case.scene([COLUMNS, 1]);
        let origin = SpectrumOrigin::File { path: path.clone() };
        scene.source.beam = Beam::Spectrum(SpectrumSpec::new(origin).with_nodes(2));
        for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
            mask.body = MaskBody::Bars { material: material.into(), thickness: 225e-6 };
        }
        let media = MaterialTable::of(&scene).unwrap();
        let flat = engine.simulate(&scene).unwrap().flat;
        for column in [200, 215, 399] {
            for (step, offset) in sample(OFFSETS.into_iter().enumerate().collect(), 2) {
                let energies = media.energies.iter().zip(&media.weights);
                let want: f64 = energies
                    .map(|(energy, weight)| {
                        let mu = constants_at(&scene, material, *energy).unwrap().mu;
                        weight * Case { mu, ..case }.reference().pixel(column, offset)
                    })
                    .sum();
                let got = f64::from(flat[[step, 0, column as usize]]);
                worst.take(got - want, || {
                    format!(
                        "{material}, {tapers:?}, column {column}, step {step}: {got} for {want}"
                    )
                });
            }
        }
    }
    worst.holds();
}

/// Energies see gold and silicon of other attenuations, and pass them one by one.
#[test]
fn bars_of_layers_under_a_spectrum_match_paths_at_each_energy() {
    let mut worst = Worst::new("bars of layers under a spectrum", TOLERANCE);
    let case =
        Case { tapers: [0.0; 2], thickness: [225e-6; 2], mu: 0.0, layers: WHOLE, spot: 30e-6 };
    let mut scene = case.scene([COLUMNS, 1]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.csv");
    std::fs::write(&path, "energy_keV,weight\n28,1\n43,0\n58,1\n").unwrap();
    scene.source.beam =
        Beam::Spectrum(SpectrumSpec::new(SpectrumOrigin::File { path }).with_nodes(2));
    let layers = [("gold", 25e-6), ("silicon", 200e-6)];
    for mask in scene.sample_mask.iter_mut().chain(&mut scene.detector_mask) {
        let layers = layers.map(|(material, thickness)| BarLayer::new(material, thickness));
        mask.body = MaskBody::Layers { layers: layers.into() };
    }
    let media = MaterialTable::of(&scene).unwrap();
    let flat = engine(Backend::Bvh).simulate(&scene).unwrap().flat;
    for column in [200, 399] {
        for (step, offset) in OFFSETS.into_iter().enumerate() {
            let of_energy = |(energy, weight): (&f64, &f64)| {
                let mut reference = case.reference();
                let layer = |(material, thickness)| {
                    [constants_at(&scene, material, *energy).unwrap().mu, thickness]
                };
                reference.masks.iter_mut().for_each(|it| it.layers = layers.map(layer).into());
                weight * reference.pixel(column, offset)
            };
            let want: f64 = media.energies.iter().zip(&media.weights).map(of_energy).sum();
            let got = f64::from(flat[[step, 0, column as usize]]);
            worst.take(got - want, || format!("column {column}, step {step}: {got} for {want}"));
        }
    }
    worst.holds();
}
