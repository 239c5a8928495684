//! The built-in tube against SpekPy 2.5 (tests/tables/tube.py), off the grid of its tables.

use beamlet::scene::{Anode, Filter, Scene};
use beamlet::spectrum::Spectrum;

const REFERENCE: &str = include_str!("../tables/tube.csv");

/// A scene whose materials are the built-in ones.
fn scene() -> Scene {
    let text = "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"30 keV\"\n[detector]\n\
                distance = \"2 m\"\npixels = [1, 1]\npitch = \"100 um\"\n";
    Scene::from_toml(text, ".").unwrap()
}

/// Values of SpekPy for a tube behind filters.
struct Case {
    name: &'static str,
    kvp: f64,
    filtered: bool,
    mean: f64,
    /// mm Al.
    layer: f64,
    spectrum: Spectrum,
}

fn cases() -> Vec<Case> {
    let case = |line: &'static str| {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |index: usize| fields[index].parse::<f64>().unwrap();
        let (_, anode) = Anode::ALL.into_iter().find(|(name, _)| *name == fields[0]).unwrap();
        let filter = |text: &str| {
            let (material, thickness) = text.split_once(':').unwrap();
            let thickness = thickness.parse::<f64>().unwrap() * 1e-3;
            Filter::new(material, thickness)
        };
        let texts = fields[3].split('+').filter(|text| !text.is_empty());
        let filters: Vec<Filter> = texts.map(filter).collect();
        let bare = Spectrum::of_tube(anode, number(1), number(2).to_radians()).unwrap();
        Case {
            name: line,
            kvp: number(1),
            filtered: !filters.is_empty(),
            mean: number(4),
            layer: number(5),
            spectrum: bare.filtered(&scene(), &filters, "filters").unwrap(),
        }
    };
    REFERENCE.lines().filter(|line| !line.starts_with('#')).skip(1).map(case).collect()
}

#[test]
fn mean_energy_is_within_two_percent_and_half_value_layer_within_five() {
    let (mut worst_mean, mut worst_layer) = (0.0_f64, 0.0_f64);
    for case in cases() {
        let mean = case.spectrum.mean_energy() / case.mean - 1.0;
        let layer = case.spectrum.half_value_layer().unwrap() * 1e3 / case.layer - 1.0;
        println!("{}: mean {:+.2} %, layer {:+.2} %", case.name, 100.0 * mean, 100.0 * layer);
        // What the issue asks for; filtered beams are closer, the bare target depends on
        // attenuation coefficients of two sources at 1 keV.
        assert!(mean.abs() < 0.01, "{}", case.name);
        assert!(layer.abs() < 0.03, "{}", case.name);
        worst_mean = worst_mean.max(mean.abs());
        worst_layer = worst_layer.max(layer.abs());
    }
    println!("worst: mean {:.2} %, layer {:.2} %", 100.0 * worst_mean, 100.0 * worst_layer);
    assert!(cases().iter().any(|case| case.filtered && case.kvp > 150.0));
}

#[test]
fn no_photon_has_more_energy_than_the_electrons() {
    for (_, anode) in Anode::ALL {
        let [low, high] = anode.kvp_range();
        for step in 0..=20 {
            let kvp = low + (high - low) * f64::from(step) / 20.0;
            let spectrum = Spectrum::of_tube(anode, kvp, 0.2).unwrap();
            assert!(spectrum.weights.iter().all(|w| w.is_finite() && *w >= 0.0));
            assert!(spectrum.energies_kev.windows(2).all(|pair| pair[0] < pair[1]));
            let last = spectrum.energies_kev.last().unwrap();
            assert!(*last <= kvp && *last > kvp - 0.25, "{last} at {kvp} kV");
        }
    }
}

/// Photons within 10 eV of an energy.
fn line(spectrum: &Spectrum, energy: f64) -> f64 {
    let rows = spectrum.energies_kev.iter().zip(&spectrum.weights);
    rows.filter(|(e, _)| (*e - energy).abs() < 0.01).map(|row| row.1).sum()
}

#[test]
fn lines_appear_at_their_edge_and_grow_with_the_voltage() {
    // K alpha 1 of tungsten and molybdenum, and their K edges.
    for (anode, energy, edge) in
        [(Anode::Tungsten, 59.3188, 69.53), (Anode::Molybdenum, 17.4794, 20.01)]
    {
        let at = |kvp: f64| line(&Spectrum::of_tube(anode, kvp, 0.2).unwrap(), energy);
        let before = at(edge - 0.005);
        let mut last = before;
        for excess in [0.01, 0.5, 2.0, 10.0, 29.0] {
            let now = at(edge + excess);
            assert!(now > last, "{} {excess} kV above the edge: {now} after {last}", anode.name());
            last = now;
        }
        // No step at the edge: the line starts from nothing.
        assert!((at(edge + 0.01) - before).abs() < 1e-3 * last);
    }
}

#[test]
fn self_absorption_cuts_at_the_edge_of_the_target_at_any_voltage() {
    // Above the K edge of tungsten the target absorbs four times as much: the continuum of a
    // shallow angle drops there, and not somewhere near it, between the voltages of the table.
    for kvp in [90.0, 97.3, 131.0] {
        let spectrum = Spectrum::of_tube(Anode::Tungsten, kvp, 7_f64.to_radians()).unwrap();
        let continuum = |from: f64, to: f64| {
            let rows = spectrum.energies_kev.iter().zip(&spectrum.weights);
            let inside = rows.filter(|(energy, _)| (from..to).contains(*energy));
            let (count, sum) = inside.fold((0.0, 0.0), |(n, s), (_, weight)| (n + 1.0, s + weight));
            sum / count
        };
        let (below, above) = (continuum(68.3, 69.1), continuum(69.8, 70.6));
        assert!(above < 0.93 * below, "{kvp} kV: {below} below, {above} above");
    }
}
