//! Pixels that see a beamlet, and the response of each to a frequency.

use super::bars::Bars;
use super::frequencies::{Frequencies, PERIODS};
use crate::sampling::Lattice;
use beamlet_core::numbers::{self, single};
use beamlet_interface::WavePair;
use beamlet_model::optics::Optics;
use glam::DVec2;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::ops::Range;

/// Places that differ by less, m, are one, rounded: borders of windows and of beamlets.
pub(super) const SAME: f64 = 1e-12;
/// Least mean over the images of the focal spot that has a motion.
const LEAST_SEEN: f64 = 1e-7;

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
    /// Pixels at an energy; `bars`: of the detector mask.
    pub(super) fn of(optics: &Optics, lattice: &Lattice, bars: Option<&Bars>) -> Self {
        let width = optics.detector.pitch_at(0, optics.cell_plane);
        let count = optics.detector.pixels[0];
        let left = |column: u32| (f64::from(column) - optics.detector.half(0)) * width;
        let reach = 0.5 * PERIODS * lattice.period;
        let beamlets =
            lattice.beamlet_at(left(0) - reach)..lattice.beamlet_at(left(count) + reach) + 1;
        let openings: Vec<Windows> =
            (0..count).map(|column| windows(optics, bars, column)).collect();
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
        let shared: Vec<DVec2> =
            (0..of.count).map(|j| shared_response(optics, of, rays, j)).collect();
        let of_windows = |windows: &Windows| {
            let (whole, openings) = windows.split_last().expect("a pixel");
            (0..of.count)
                .zip(shared.clone())
                .map(move |(j, shared)| {
                    let f = of.at(j);
                    let open = openings.iter().map(|ends| interval(*ends, f) * (1.0 - leak));
                    let sum = open.fold(interval(*whole, f) * leak, |sum, part| sum + part);
                    pair(sum.rotate(shared) * (share / width))
                })
                .collect::<Vec<_>>()
        };
        self.windows.iter().flat_map(of_windows).collect()
    }
}

/// Windows of a column from the optical axis, in the plane of the sample mask, m.
fn windows(optics: &Optics, bars: Option<&Bars>, column: u32) -> Windows {
    let width = optics.detector.pitch_at(0, optics.cell_plane);
    let left = f64::from(column) - optics.detector.half(0);
    let pixel = [left, left + 1.0].map(|end| end * width);
    let opening = |ends: [f64; 2]| {
        let open = ends.map(|end| end * width);
        let narrowed = bars.map_or(open, |bars| bars.narrowed(open));
        // Borders of the pixel have no bar.
        let is_border = |end: f64, border: f64| (end - border).abs() < SAME;
        [
            if is_border(open[0], pixel[0]) { open[0] } else { narrowed[0] },
            if is_border(open[1], pixel[1]) { open[1] } else { narrowed[1] },
        ]
    };
    let mut parts: Windows = optics.windows_of_column(column).into_iter().map(opening).collect();
    parts.push(pixel);
    parts
}

/// Part of a response that all windows share: step of frequency and length, mean over a cell, blur and images of the
/// focal spot, and the phase of the first pair.
fn shared_response(optics: &Optics, of: &Frequencies, rays: u32, index: u32) -> DVec2 {
    let (f, spacing) = (of.at(index), of.spacing);
    let [spot, _] = images(optics, f);
    let pairs = f64::from(of.pairs) * f64::from(index);
    let first = spacing * (0.5 - 0.5 * f64::from(rays) + 0.5 * pairs);
    let twice = if index == 0 { 1.0 } else { 2.0 };
    let cell = interval([-0.5 * spacing, 0.5 * spacing], f).x;
    spot.rotate(turn(-f * first)) * (twice * of.at(1) * cell)
}

/// Mean of exp(2πifs) over the images s of the focal spot, and the mean of that times the motion of the sample
/// against the mask, m.
fn images(optics: &Optics, f: f64) -> [DVec2; 2] {
    let shrink = 1.0 - optics.cell_plane / optics.analyser;
    let sample = optics.analyser - optics.lever_arm;
    let motion = -(sample - optics.cell_plane) / sample;
    let mut sums = [DVec2::ZERO; 2];
    for part in optics.spot.placed() {
        let (offset, deviation) = (part.offset[0], part.deviation[0]);
        let exponent = -0.5 * (TAU * f * deviation * shrink).powi(2);
        // The image of a source to the right moves to the left.
        let seen = turn(f * offset * shrink) * (part.share * libm::exp(exponent));
        let mean = DVec2::new(offset, TAU * f * shrink * deviation * deviation);
        sums[0] += seen;
        sums[1] += seen.rotate(mean) * motion;
    }
    sums
}

/// Motion of the sample against the mask at each frequency, in spacings, over the mean of the images.
pub(super) fn motions(optics: &Optics, of: &Frequencies) -> Vec<WavePair> {
    let motion = |j: u32| {
        let [seen, moved] = images(optics, of.at(j));
        let square = seen.length_squared();
        if square < LEAST_SEEN * LEAST_SEEN {
            return pair(DVec2::ZERO);
        }
        pair(moved.rotate(DVec2::new(seen.x, -seen.y)) / square / of.spacing)
    };
    (0..of.count).map(motion).collect()
}

/// exp(2πi cycles).
fn turn(cycles: f64) -> DVec2 {
    let angle = TAU * (cycles - cycles.round());
    DVec2::new(libm::cos(angle), libm::sin(angle))
}

fn pair(value: DVec2) -> WavePair {
    WavePair { re: single(value.x), im: single(value.y) }
}

/// ∫ exp(2πifx) dx between two ends.
fn interval([low, high]: [f64; 2], f: f64) -> DVec2 {
    let width = high - low;
    let half = 0.5 * TAU * f * width;
    let sinc = if half.abs() < 1e-8 { 1.0 } else { libm::sin(half) / half };
    turn(f * f64::midpoint(low, high)) * (width * sinc)
}
