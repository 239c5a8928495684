//! Hard spheres in equilibrium by a Monte Carlo: places of dense packings, and their pair distribution.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells and bins have the whole part of numbers >= 0"
)]

use super::empty;
use crate::reference::surfaces::Random;
use beamlet::internals::microstructure::{Bodies, variances};
use beamlet::scene::{BodyShape, MaterialSpec, Microstructure, Scene};
use std::f64::consts::PI;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Spheres in a periodic box; lengths in diameters.
struct Fluid {
    size: [f64; 3],
    places: Vec<[f64; 3]>,
    /// Spheres by cells that are wider than a diameter.
    cells: Vec<Vec<usize>>,
    counts: [usize; 3],
    random: Random,
}

impl Fluid {
    /// A face-centred lattice of so many cubes, whose spheres are small enough to leave their order, and then grow.
    fn new(cubes: [u32; 3], fraction: f64, seed: u64) -> Self {
        let cube = (4.0 * PI / 6.0 / fraction).cbrt();
        let size = cubes.map(|count| cube * f64::from(count));
        let corners = [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]];
        let mut places = Vec::new();
        for i in 0..cubes[0] {
            for j in 0..cubes[1] {
                for k in 0..cubes[2] {
                    let low = [i, j, k].map(f64::from);
                    let at = |corner: &[f64; 3]| [0, 1, 2].map(|a| cube * (low[a] + corner[a]));
                    places.extend(corners.iter().map(at));
                }
            }
        }
        let counts = size.map(|side| side.floor() as usize);
        let cells = vec![Vec::new(); counts.iter().product()];
        let mut fluid = Self { size, places, cells, counts, random: Random::new(seed) };
        for index in 0..fluid.places.len() {
            let cell = fluid.cell(fluid.places[index]);
            fluid.cells[cell].push(index);
        }
        // At a fraction of 0.3 the lattice melts.
        let start = (0.3 / fraction).cbrt();
        fluid.sweep(start, 100);
        for step in 1..=20 {
            let diameter = start + (1.0 - start) * f64::from(step) / 20.0;
            while fluid.sweep(diameter, 1) > 0.0 {}
        }
        fluid.sweep(1.0, 150);
        fluid
    }

    /// Numbers of the cell of a place along x, y and z.
    fn numbers(&self, place: [f64; 3]) -> [usize; 3] {
        [0, 1, 2].map(|a| {
            let at = (place[a] / self.size[a] * self.counts[a] as f64) as usize;
            at.min(self.counts[a] - 1)
        })
    }

    fn cell(&self, place: [f64; 3]) -> usize {
        let [i, j, k] = self.numbers(place);
        (i * self.counts[1] + j) * self.counts[2] + k
    }

    /// Square of the distance of two places.
    fn square(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        let along = |axis: usize| {
            let off = (a[axis] - b[axis]).abs();
            off.min(self.size[axis] - off).powi(2)
        };
        along(0) + along(1) + along(2)
    }

    /// Sum over the spheres nearer to a place than a diameter of what they lack.
    fn overlap(&self, own: usize, place: [f64; 3], diameter: f64) -> f64 {
        let at = self.numbers(place);
        let near = |a: usize, by: usize| (at[a] + self.counts[a] + by - 1) % self.counts[a];
        let mut sum = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                for k in 0..3 {
                    let cell =
                        (near(0, i) * self.counts[1] + near(1, j)) * self.counts[2] + near(2, k);
                    for other in &self.cells[cell] {
                        let square = self.square(place, self.places[*other]);
                        if *other != own && square < diameter * diameter {
                            sum += diameter - square.sqrt();
                        }
                    }
                }
            }
        }
        sum
    }

    /// Moves each sphere some times, where overlaps do not grow. Sum of the overlaps that are left.
    fn sweep(&mut self, diameter: f64, times: u32) -> f64 {
        let mut left = 0.0;
        for _ in 0..times {
            left = 0.0;
            for own in 0..self.places.len() {
                let before = self.places[own];
                let place = [0, 1, 2].map(|a| {
                    let moved = before[a] + self.random.between(-0.12, 0.12);
                    moved.rem_euclid(self.size[a])
                });
                let now = self.overlap(own, before, diameter);
                let then = self.overlap(own, place, diameter);
                if then > now {
                    left += now;
                    continue;
                }
                left += then;
                let [from, to] = [self.cell(before), self.cell(place)];
                if from != to {
                    self.cells[from].retain(|other| *other != own);
                    self.cells[to].push(own);
                }
                self.places[own] = place;
            }
        }
        left
    }

    /// Adds the pairs of all spheres to a histogram of distances from 1, in bins of a width; the number of pairs of
    /// independent spheres in each is `expected`.
    fn add_pairs(&self, width: f64, pairs: &mut [f64], expected: &mut [f64]) {
        let volume: f64 = self.size.iter().product();
        let count = self.places.len() as f64;
        for (bin, expected) in expected.iter_mut().enumerate() {
            let [low, high] = [0.0, 1.0].map(|end| 1.0 + width * (bin as f64 + end));
            let shell = 4.0 / 3.0 * PI * (high.powi(3) - low.powi(3));
            *expected += 0.5 * count * (count - 1.0) / volume * shell;
        }
        for (at, a) in self.places.iter().enumerate() {
            for b in &self.places[at + 1..] {
                let bin = (self.square(*a, *b).sqrt() - 1.0) / width;
                if bin < pairs.len() as f64 {
                    pairs[bin.max(0.0) as usize] += 1.0;
                }
            }
        }
    }

    /// Sum of the half chords of the spheres on the line through x and z along y.
    fn half_chords(&self, [x, z]: [f64; 2]) -> f64 {
        let off = |a: f64, b: f64, axis: usize| {
            let off = (a - b).abs();
            off.min(self.size[axis] - off).powi(2)
        };
        let square = |place: &[f64; 3]| off(place[0], x, 0) + off(place[2], z, 2);
        self.places.iter().map(|place| (0.25 - square(place)).max(0.0).sqrt()).sum()
    }
}

const BIN: f64 = 0.02;

/// A table `r,g` of spheres of a fraction.
fn table(fraction: f64, boxes: u32) -> String {
    let (mut pairs, mut expected) = (vec![0.0; 200], vec![0.0; 200]);
    for seed in 0..boxes {
        let mut fluid = Fluid::new([7, 7, 7], fraction, 11 + u64::from(seed));
        for _ in 0..20 {
            fluid.sweep(1.0, 10);
            fluid.add_pairs(BIN, &mut pairs, &mut expected);
        }
    }
    let g: Vec<f64> =
        pairs.iter().zip(&expected).map(|(pairs, expected)| pairs / expected).collect();
    // Bins have the mean of their middle; contact lies half a bin before the first.
    let mut text = format!("r,g\n1,{}\n", 1.5 * g[0] - 0.5 * g[1]);
    for (bin, g) in g.iter().enumerate() {
        writeln!(text, "{},{g}", 1.0 + BIN * (bin as f64 + 0.5)).expect("a text");
    }
    text
}

fn medium(fraction: f64, diameter: f64, directory: &Path) -> Scene {
    let mut scene = empty(3, "[\"0 um\"]");
    scene.directory = directory.to_path_buf();
    for (name, delta) in [("vacuous", 0.0), ("body", 4.9e-7)] {
        scene.materials.insert(name.into(), MaterialSpec::Constants { mu: 0.0, delta });
    }
    let structure = Microstructure::new(BodyShape::Spheres, "body", diameter, fraction);
    scene.microstructures.insert("vacuous".into(), structure);
    scene
}

/// Where Percus and Yevick hold, a table of the pairs of a Monte Carlo has their variance.
#[test]
fn tables_of_a_monte_carlo_have_the_variance_of_percus_and_yevick() {
    let folder = tempfile::tempdir().expect("a folder");
    for fraction in [0.3, 0.5] {
        fs::write(folder.path().join("pairs.csv"), table(fraction, 2)).expect("a table");
        for diameter in [1e-6, 5e-6, 20e-6] {
            let mut scene = medium(fraction, diameter, folder.path());
            let of = |scene: &Scene| {
                variances(scene, "vacuous", &[30.0]).expect("variances").expect("bodies")[0]
            };
            let theory = of(&scene);
            scene.microstructures.get_mut("vacuous").expect("bodies").pair_distribution =
                Some("pairs.csv".into());
            let ratio = of(&scene) / theory;
            println!("fraction {fraction}, {} um: {ratio:.4}", 1e6 * diameter);
            assert!((ratio - 1.0).abs() < 0.01, "{fraction}, {diameter}: {ratio}");
        }
    }
}

/// Loss of contrast of two rays a shear apart through the spheres themselves, over that of the medium: weak phases.
#[test]
fn chords_of_a_monte_carlo_lose_what_their_medium_does() {
    for (fraction, shear) in [(0.3, 0.11), (0.5, 0.11), (0.5, 0.3)] {
        let mut fluid = Fluid::new([7, 7, 7], fraction, 3);
        let mut ratios = Vec::new();
        let own = Microstructure::new(BodyShape::Spheres, "silica", 1.0, fraction);
        let phase = 1e-3;
        let expected = Bodies::new(&own).loss(phase, shear).value * fluid.size[1];
        for _ in 0..40 {
            fluid.sweep(1.0, 20);
            let sum: f64 = (0..2000)
                .map(|_| {
                    let [x, z] = [0, 2].map(|axis| fluid.random.between(0.0, fluid.size[axis]));
                    let ends = [x, (x + shear) % fluid.size[0]].map(|x| fluid.half_chords([x, z]));
                    0.5 * (phase * (ends[1] - ends[0])).powi(2)
                })
                .sum();
            ratios.push(sum / 2000.0 / expected);
        }
        let count = ratios.len() as f64;
        let mean = ratios.iter().sum::<f64>() / count;
        let square = ratios.iter().map(|it| (it - mean).powi(2)).sum::<f64>();
        let error = (square / (count - 1.0) / count).sqrt();
        println!("fraction {fraction}, shear {shear}: {mean:.4} ± {error:.4}");
        assert!((mean - 1.0).abs() < 0.01 + 3.0 * error, "{fraction}, {shear}: {mean} ± {error}");
    }
}
