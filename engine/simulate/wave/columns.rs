//! Pixels that see a beamlet, and the response of each to a frequency.

use super::frequencies::{Frequencies, PERIODS};
use crate::sampling::Lattice;
use beamlet_core::numbers::{self, single};
use beamlet_interface::WavePair;
use beamlet_model::optics::Optics;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::ops::Range;

/// Places that differ by less are one, m.
const SAME: f64 = 1e-12;

/// Windows of a pixel from the centre of a beamlet, in the plane of the sample mask, m: openings of the detector
/// mask, behind them the pixel.
type Windows = Vec<[f64; 2]>;

/// Pixels of all beamlets.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    /// Beamlets whose light reaches a pixel.
    pub beamlets: Range<i64>,
    /// First pixel of each beamlet, and the number of its pixels.
    pub pixels: Vec<(u32, u32)>,
    /// Index of the windows of each pixel of each beamlet.
    pub windows_of: Vec<u32>,
    windows: Vec<Windows>,
    /// Most pixels of a beamlet.
    pub most: u32,
}

impl Columns {
    pub(super) fn of(optics: &Optics, lattice: &Lattice) -> Self {
        let width = optics.detector.pitch_at(0, optics.cell_plane);
        let count = optics.detector.pixels[0];
        let left = |column: u32| (f64::from(column) - optics.detector.half(0)) * width;
        let reach = 0.5 * PERIODS * lattice.period;
        let beamlets =
            lattice.beamlet_at(left(0) - reach)..lattice.beamlet_at(left(count) + reach) + 1;
        let openings: Vec<Windows> = (0..count).map(|column| windows(optics, column)).collect();
        let mut known: HashMap<Vec<i64>, u32> = HashMap::new();
        let mut made = Self {
            beamlets: beamlets.clone(),
            pixels: Vec::new(),
            windows_of: Vec::new(),
            windows: Vec::new(),
            most: 1,
        };
        for beamlet in beamlets {
            let centre = lattice.centre(beamlet);
            // Pixels whose centres are at most half of the repetition away, one end excluded.
            let first =
                |x: f64| ((x / width + optics.detector.half(0) - 0.5 - 1e-6).ceil()).max(0.0);
            let columns = numbers::whole::<u32>(first(centre - reach)).min(count)
                ..numbers::whole::<u32>(first(centre + reach)).min(count);
            made.pixels.push((columns.start, columns.end - columns.start));
            made.most = made.most.max(columns.end - columns.start);
            for column in columns {
                let ends = &openings[column as usize];
                let own: Windows = ends.iter().map(|ends| ends.map(|x| x - centre)).collect();
                let key = own.iter().flatten().map(|x| numbers::whole((x / SAME).round()));
                let next = numbers::count(made.windows.len());
                let index = *known.entry(key.collect()).or_insert(next);
                if index == next {
                    made.windows.push(own);
                }
                made.windows_of.push(index);
            }
        }
        made
    }

    /// Response of all windows to the frequencies of an energy, `[windows][frequency]`. `rays`: of a line; `share`:
    /// light of the energy; `leak`: light that the bars of the detector mask transmit.
    pub(super) fn responses(
        &self,
        optics: &Optics,
        of: &Frequencies,
        rays: u32,
        [share, leak]: [f64; 2],
    ) -> Vec<WavePair> {
        let width = optics.detector.pitch_at(0, optics.cell_plane);
        let shared: Vec<[f64; 2]> =
            (0..of.count).map(|j| shared_response(optics, of, rays, j)).collect();
        let of_windows = |windows: &Windows| {
            let (whole, openings) = windows.split_last().expect("a pixel");
            (0..of.count)
                .zip(shared.clone())
                .map(move |(j, shared)| {
                    let f = of.at(j);
                    let mut sum = times_real(interval(*whole, f), leak);
                    for ends in openings {
                        let part = times_real(interval(*ends, f), 1.0 - leak);
                        sum = [sum[0] + part[0], sum[1] + part[1]];
                    }
                    let [re, im] = times_real(times(sum, shared), share / width);
                    WavePair { re: single(re), im: single(im) }
                })
                .collect::<Vec<_>>()
        };
        self.windows.iter().flat_map(of_windows).collect()
    }
}

/// Windows of a column from the optical axis, in the plane of the sample mask, m.
fn windows(optics: &Optics, column: u32) -> Windows {
    let width = optics.detector.pitch_at(0, optics.cell_plane);
    let left = f64::from(column) - optics.detector.half(0);
    let mut parts = optics.windows_of_column(column);
    parts.push([left, left + 1.0]);
    parts.into_iter().map(|ends| ends.map(|end| end * width)).collect()
}

/// Part of a response that all windows share: step of frequency and length, mean over a cell, blur and images of the
/// focal spot, and the phase of the first pair.
fn shared_response(optics: &Optics, of: &Frequencies, rays: u32, index: u32) -> [f64; 2] {
    let (f, spacing) = (of.at(index), of.spacing);
    let shrink = 1.0 - optics.cell_plane / optics.analyser;
    let mut spot = [0.0; 2];
    for part in optics.spot.placed() {
        let exponent = -0.5 * (TAU * f * part.deviation[0] * shrink).powi(2);
        // The image of a source to the right moves to the left.
        let turned = turn(f * part.offset[0] * shrink);
        let seen = times_real(turned, part.share * libm::exp(exponent));
        spot = [spot[0] + seen[0], spot[1] + seen[1]];
    }
    let pairs = f64::from(of.pairs) * f64::from(index);
    let first = spacing * (0.5 - 0.5 * f64::from(rays) + 0.5 * pairs);
    let twice = if index == 0 { 1.0 } else { 2.0 };
    let cell = interval([-0.5 * spacing, 0.5 * spacing], f)[0];
    times_real(times(spot, turn(-f * first)), twice * of.at(1) * cell)
}

/// exp(2πi cycles).
fn turn(cycles: f64) -> [f64; 2] {
    let angle = TAU * (cycles - cycles.round());
    [libm::cos(angle), libm::sin(angle)]
}

fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

fn times_real(a: [f64; 2], b: f64) -> [f64; 2] {
    a.map(|it| it * b)
}

/// ∫ exp(2πifx) dx between two ends.
fn interval([low, high]: [f64; 2], f: f64) -> [f64; 2] {
    let width = high - low;
    let half = 0.5 * TAU * f * width;
    let sinc = if half.abs() < 1e-8 { 1.0 } else { libm::sin(half) / half };
    times_real(turn(f * f64::midpoint(low, high)), width * sinc)
}
