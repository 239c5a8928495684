//! Images: sums over rays of every source point, traced one by one.

use super::masks::{self, Bars, Mask, Stretch};
use super::normal::{self, SIGMA_PER_FWHM};
use super::rays::{Order, Sample, Trace};
use rayon::prelude::*;
use std::ops::Range;

/// Source, masks and detector of one view, in the frame of the beam.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Source to rotation centre, m.
    pub source_distance: f64,
    /// FWHM of the focal spot in x and z, m.
    pub spot: [f64; 2],
    /// Its centre in x and z, m.
    pub source_offset: [f64; 2],
    /// Source to detector, m.
    pub detector_distance: f64,
    /// Columns and rows.
    pub pixels: [u32; 2],
    /// Pixel pitch in x and z, m.
    pub pitch: [f64; 2],
    /// Mask before the sample.
    pub sample_mask: Option<Mask>,
    /// Mask before the detector.
    pub detector_mask: Option<Mask>,
}

/// How finely an image is summed.
#[derive(Debug, Clone, Copy)]
pub struct Quadrature {
    /// Rays along x in one period of the detector's pixels. Masks are averaged over a cell, so
    /// few are needed where the sample is smooth.
    pub cells: usize,
    /// Source points in x for each ray target, over `reach` standard deviations on either side.
    pub sources: usize,
    /// Standard deviations of the focal spot that count.
    pub reach: f64,
    /// Lines along z in a pixel, each with a source height of its own; 1: the row's centre
    /// line from the source's centre, for samples that do not change along z.
    pub lines: usize,
    /// Largest displacement of light that is followed along x and z, m at the detector.
    pub farthest: [f64; 2],
}

impl Quadrature {
    /// For whole lines: 1e-5 of open beam where the sample is smooth (kinks of overlapping
    /// edges between source points).
    pub fn line() -> Self {
        Self { cells: 200, sources: 121, reach: 5.0, lines: 1, farthest: [20e-6; 2] }
    }

    /// For single pixels of samples that do not change along z.
    pub fn fine() -> Self {
        Self { cells: 1000, sources: 241, reach: 5.0, lines: 1, farthest: [20e-6; 2] }
    }

    /// For single pixels of samples that change along z.
    pub fn volume() -> Self {
        Self { cells: 100, sources: 81, reach: 5.0, lines: 64, farthest: [20e-6; 2] }
    }

    /// The same with light followed farther along x.
    pub fn following(mut self, farthest: f64) -> Self {
        self.farthest[0] = farthest;
        self
    }

    /// The same with light followed farther along z.
    pub fn following_along_z(mut self, farthest: f64) -> Self {
        self.farthest[1] = farthest;
        self
    }
}

impl Setup {
    /// The paper's: gold bars of 225 um at 30 keV, masks 100/20 and 150/30 um, M = 1.5.
    pub fn paper(pixels: [u32; 2]) -> Self {
        let bars = Bars::Boxes { mu: 53_122.0, thickness: 225e-6 };
        let mut setup = Self {
            source_distance: 1.21,
            spot: [30e-6, 26e-6],
            source_offset: [0.0; 2],
            detector_distance: 1.8,
            pixels,
            pitch: [150e-6; 2],
            sample_mask: None,
            detector_mask: None,
        };
        setup.sample_mask = Some(setup.mask(1.2, 20e-6, bars));
        setup.detector_mask = Some(setup.mask(1.8, 30e-6, bars));
        setup
    }

    /// A mask of one aperture per pixel column, aligned with the columns.
    pub fn mask(&self, distance: f64, aperture: f64, bars: Bars) -> Mask {
        let period = self.pitch[0] * distance / self.detector_distance;
        // Aperture k of C is centred at (k + 1/2 - C/2) periods.
        let origin = if self.pixels[0].is_multiple_of(2) { 0.5 * period } else { 0.0 };
        Mask { distance, period, aperture, origin, bars }
    }

    /// Both masks with bars of this kind.
    pub fn with_bars(mut self, bars: Bars) -> Self {
        for mask in self.sample_mask.iter_mut().chain(self.detector_mask.iter_mut()) {
            mask.bars = bars;
        }
        self
    }

    /// Standard deviation of the focal spot in x and z, m.
    pub fn sigma(&self) -> [f64; 2] {
        self.spot.map(|s| s * SIGMA_PER_FWHM)
    }

    /// The analyser from the source: the detector mask, or the detector.
    pub fn analyser(&self) -> f64 {
        self.detector_mask.map_or(self.detector_distance, |m| m.distance)
    }

    /// Centre of a pixel on the detector, x and z.
    pub fn centre(&self, column: u32, row: u32) -> [f64; 2] {
        let [columns, rows] = self.pixels.map(f64::from);
        [
            (f64::from(column) + 0.5 - 0.5 * columns) * self.pitch[0],
            (0.5 * rows - 0.5 - f64::from(row)) * self.pitch[1],
        ]
    }

    /// Traces the ray from source point `source` (x, z) that would go straight to `target`
    /// (x, z) on the detector.
    pub fn trace(
        &self,
        sample: &Sample,
        source: [f64; 2],
        target: [f64; 2],
        order: Order,
    ) -> Trace {
        let slope = [0, 1].map(|k| (target[k] - source[k]) / self.detector_distance);
        let from = [source[0], -self.source_distance, source[1]];
        let analyser = self.analyser() - self.source_distance;
        sample.trace(from, [slope[0], 1.0, slope[1]], analyser, order)
    }

    /// Intensity of one pixel at each mask offset.
    pub fn pixel(
        &self,
        sample: Option<&Sample>,
        order: Order,
        how: &Quadrature,
        column: u32,
        row: u32,
        offsets: &[f64],
    ) -> Vec<f64> {
        let line = self.line(sample, order, how, column..column + 1, row, offsets);
        line.into_iter().map(|step| step[0]).collect()
    }

    /// Intensities `[step][column - columns.start]` of a stretch of one row: every ray that
    /// lands there counts where it lands, whichever aperture it came through.
    pub fn line(
        &self,
        sample: Option<&Sample>,
        order: Order,
        how: &Quadrature,
        columns: Range<u32>,
        row: u32,
        offsets: &[f64],
    ) -> Vec<Vec<f64>> {
        let heights = self.heights(how, row);
        // Cells are equal lengths on the sample mask (or the rotation centre's plane).
        let plane = self.sample_mask.map_or(self.source_distance, |m| m.distance);
        let magnification = self.detector_distance / plane;
        let cell = self.pitch[0] / magnification / how.cells as f64;
        let mut sources = normal::nodes(self.sigma()[0], how.sources, how.reach);
        sources.iter_mut().for_each(|source| source.0 += self.source_offset[0]);
        let widest = how.reach * self.sigma()[0] + self.source_offset[0].abs();
        let beyond = ((magnification - 1.0) * widest + how.farthest[0]) / magnification;
        let left = (self.centre(columns.start, row)[0] - 0.5 * self.pitch[0]) / magnification;
        let extra = (beyond / cell).ceil();
        let count = columns.len() * how.cells + 2 * extra as usize;
        let width = columns.len();
        let job = Job {
            setup: self,
            sample,
            order,
            offsets,
            sources: &sources,
            heights: &heights,
            plane,
            cell,
            left: left * magnification,
            width,
            row,
        };
        let parts: Vec<Vec<f64>> = (0..count.div_ceil(64))
            .into_par_iter()
            .map(|part| {
                let mut sum = vec![0.0; offsets.len() * width];
                for i in part * 64..count.min(part * 64 + 64) {
                    job.add_cell(left + (i as f64 + 0.5 - extra) * cell, &mut sum);
                }
                sum
            })
            .collect();
        let mut total = vec![0.0; offsets.len() * width];
        for part in parts {
            total.iter_mut().zip(part).for_each(|(t, p)| *t += p);
        }
        total.chunks(width).map(<[f64]>::to_vec).collect()
    }

    /// Lines in z: height on the detector, height of the source, breadth on the detector (0:
    /// the row counts as one) and weight.
    fn heights(&self, how: &Quadrature, row: u32) -> Vec<[f64; 4]> {
        let centre = self.centre(0, row)[1];
        if how.lines == 1 {
            return vec![[centre, self.source_offset[1], 0.0, 1.0]];
        }
        let breadth = self.pitch[1] / how.lines as f64;
        let extra = (how.farthest[1] / breadth).ceil() as usize;
        let count = how.lines + 2 * extra;
        (0..count)
            .map(|i| {
                let at = i as f64 + 0.5 - 0.5 * count as f64;
                // Golden-ratio lattice: source heights spread evenly over any stretch of lines.
                let share = (i as f64 * 0.618_033_988_749_894_9 + 0.5).fract();
                let source = self.source_offset[1] + self.sigma()[1] * normal::quantile(share);
                [centre + at * breadth, source, breadth, breadth / self.pitch[1]]
            })
            .collect()
    }
}

struct Job<'a> {
    setup: &'a Setup,
    sample: Option<&'a Sample>,
    order: Order,
    offsets: &'a [f64],
    sources: &'a [(f64, f64)],
    heights: &'a [[f64; 4]],
    /// Plane of the cells, from the source.
    plane: f64,
    /// Width of a cell there.
    cell: f64,
    /// Left edge of the stretch on the detector.
    left: f64,
    /// Columns.
    width: usize,
    row: u32,
}

impl Job<'_> {
    /// Light through the cell centred at `x1`, from every source point.
    fn add_cell(&self, x1: f64, sum: &mut [f64]) {
        let setup = self.setup;
        if self.is_blocked(x1) {
            return;
        }
        let far = setup.detector_distance;
        for &[height, source_z, breadth, weight_z] in self.heights {
            let slope_z = (height - source_z) / far;
            for &(source_x, weight_x) in self.sources {
                let slope_x = (x1 - source_x) / self.plane;
                let target = source_x + slope_x * far;
                let trace = match self.sample {
                    Some(sample) => {
                        setup.trace(sample, [source_x, source_z], [target, height], self.order)
                    }
                    None => Trace::default(),
                };
                let rest = far - setup.analyser();
                let landing = [target, height];
                let landing =
                    [0, 1].map(|k| landing[k] + trace.displacement[k] + trace.slope[k] * rest);
                let mut weight = weight_x * weight_z * (-trace.optical_depth).exp();
                if breadth > 0.0 {
                    weight *= self.share_of_row(landing[1], breadth);
                }
                if weight == 0.0 {
                    continue;
                }
                let slope = [slope_x + trace.slope[0], slope_z + trace.slope[1]];
                self.land(x1, [slope_x, slope_z], landing[0], slope, weight, sum);
            }
        }
    }

    /// True if an opaque sheet covers the cell centred at `x1` at every step, whatever the source point.
    fn is_blocked(&self, x1: f64) -> bool {
        let Some(mask) = self.setup.sample_mask else { return false };
        let Bars::Sheet { transmission: 0.0 } = mask.bars else { return false };
        let half = 0.5 * self.cell + 1e-12;
        let through = |by: &f64| mask.moved(*by).mean(x1 - half, x1 + half, [0.0; 2]);
        self.offsets.iter().all(|by| through(by) == 0.0)
    }

    fn share_of_row(&self, z: f64, breadth: f64) -> f64 {
        let half = 0.5 * self.setup.pitch[1];
        let from = z - self.setup.centre(0, self.row)[1];
        let (low, high) = ((from - 0.5 * breadth).max(-half), (from + 0.5 * breadth).min(half));
        (high - low).max(0.0) / breadth
    }

    /// Shares the light of a cell, as wide as it is on the detector, among pixels and steps.
    fn land(
        &self,
        x1: f64,
        before: [f64; 2],
        at: f64,
        after: [f64; 2],
        weight: f64,
        sum: &mut [f64],
    ) {
        let setup = self.setup;
        let (pitch, far) = (setup.pitch[0], setup.detector_distance);
        let spread = self.cell * far / self.plane;
        let (low, high) = (at - 0.5 * spread, at + 0.5 * spread);
        let first = ((low - self.left) / pitch).floor().max(0.0) as usize;
        for column in first..self.width {
            let edge = self.left + column as f64 * pitch;
            let (a, b) = (low.max(edge), high.min(edge + pitch));
            if a >= high {
                break;
            }
            if b <= a {
                continue;
            }
            // Where this light went through the masks.
            let on_first = |d: f64| x1 + (d - at) * self.plane / far;
            let back = after[0] * setup.detector_mask.map_or(0.0, |m| far - m.distance);
            let second = setup.detector_mask.map(|mask| Stretch {
                mask,
                low: a - back,
                high: b - back,
                slope: after,
            });
            if second.is_some_and(|s| masks::mean(&[s]) == 0.0) {
                continue;
            }
            for (step, offset) in self.offsets.iter().enumerate() {
                let first = setup.sample_mask.map(|mask| Stretch {
                    mask: mask.moved(*offset),
                    low: on_first(a),
                    high: on_first(b),
                    slope: before,
                });
                let through = match (first, second) {
                    (None, None) => 1.0,
                    (Some(m), None) | (None, Some(m)) => masks::mean(&[m]),
                    (Some(m), Some(n)) => masks::mean(&[m, n]),
                };
                sum[step * self.width + column] += weight * through * (b - a) / pitch;
            }
        }
    }
}
