//! Masks whose apertures end along z, cut exactly as boxes: light of single pixels by sums over source points and
//! small squares of targets.

use super::normal;
use super::rays::{Order, Sample, Trace};
use super::stack::Setup;
use rayon::prelude::*;

/// A box: ends along x and z.
pub type Ends = [[f64; 2]; 2];

/// A sheet with apertures that repeat along x and z.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// Source to the sheet, m.
    pub distance: f64,
    /// Along x and z, m.
    pub period: [f64; 2],
    /// Centre of a period, x and z, m.
    pub centre: [f64; 2],
    /// Apertures of a period from its centre, which do not overlap, m.
    pub boxes: Vec<Ends>,
    /// Transmission of the bars.
    pub leak: f64,
}

impl Sheet {
    /// The sheet displaced along x and z.
    #[must_use]
    pub fn moved(&self, by: [f64; 2]) -> Self {
        let centre = [0, 1].map(|axis| self.centre[axis] + by[axis]);
        Self { centre, ..self.clone() }
    }

    /// Parts of a box on the sheet that lie in apertures.
    fn open_parts(&self, of: Ends) -> Vec<Ends> {
        let periods = |axis: usize| {
            let [low, high] = of[axis].map(|at| (at - self.centre[axis]) / self.period[axis]);
            low.round() as i64 - 1..=high.round() as i64 + 1
        };
        let mut parts = Vec::new();
        for k in periods(0) {
            for l in periods(1) {
                for aperture in &self.boxes {
                    let at =
                        |axis: usize, of: i64| self.centre[axis] + of as f64 * self.period[axis];
                    let centre = [at(0, k), at(1, l)];
                    let placed = [0, 1].map(|axis| aperture[axis].map(|end| end + centre[axis]));
                    if let Some(part) = overlap(placed, of) {
                        parts.push(part);
                    }
                }
            }
        }
        parts
    }
}

/// Boxes of an ellipse between `count` equally high lines, as wide as its chord in their middles.
#[must_use]
pub fn ellipse(half: [f64; 2], count: u32) -> Vec<Ends> {
    (0..count)
        .map(|k| {
            let [low, high] = [k, k + 1].map(|k| 2.0 * f64::from(k) / f64::from(count) - 1.0);
            let middle = 0.5 * (low + high);
            let width = half[0] * (1.0 - middle * middle).sqrt();
            [[-width, width], [low * half[1], high * half[1]]]
        })
        .collect()
}

fn overlap(a: Ends, b: Ends) -> Option<Ends> {
    let both = [0, 1].map(|axis| [a[axis][0].max(b[axis][0]), a[axis][1].min(b[axis][1])]);
    both.iter().all(|[low, high]| high > low).then_some(both)
}

fn area(of: Ends) -> f64 {
    of.iter().map(|[low, high]| high - low).product()
}

/// How finely a pixel is summed.
#[derive(Debug, Clone, Copy)]
pub struct Fineness {
    /// Squares of a pixel along each side.
    pub squares: u32,
    /// Source points along x and z.
    pub sources: [usize; 2],
    /// Squares beside the pixel whose light may land in it.
    pub beside: u32,
}

/// Light of a pixel (column, row) at each pair of offsets of the sample sheet. Masks of the set-up do not count.
#[must_use]
pub fn pixel(
    setup: &Setup,
    sheets: [Option<&Sheet>; 2],
    sample: Option<&Sample>,
    how: Fineness,
    [column, row]: [u32; 2],
    offsets: &[[f64; 2]],
) -> Vec<f64> {
    let centre = setup.centre(column, row);
    let own = [0, 1].map(|axis| [-0.5, 0.5].map(|side| centre[axis] + side * setup.pitch[axis]));
    let count = how.squares + 2 * how.beside;
    let moved: Vec<Option<Sheet>> =
        offsets.iter().map(|by| sheets[0].map(|sheet| sheet.moved(*by))).collect();
    let nodes = [0, 1].map(|axis| normal::nodes(setup.sigma()[axis], how.sources[axis], 5.0));
    let light = |square: u32| -> Vec<f64> {
        let at = [square % count, square / count];
        let target = [0, 1].map(|axis| {
            let side = setup.pitch[axis] / f64::from(how.squares);
            let low = own[axis][0] + (f64::from(at[axis]) - f64::from(how.beside)) * side;
            [low, low + side]
        });
        let mut sums = vec![0.0; offsets.len()];
        for &(source_x, weight_x) in &nodes[0] {
            for &(source_z, weight_z) in &nodes[1] {
                let source = [source_x, source_z];
                let through =
                    light_of(setup, [&moved, &[sheets[1].cloned()]], sample, source, target, own);
                sums.iter_mut()
                    .zip(through)
                    .for_each(|(sum, light)| *sum += weight_x * weight_z * light);
            }
        }
        sums
    };
    let parts: Vec<Vec<f64>> = (0..count * count).into_par_iter().map(light).collect();
    let pitch = setup.pitch[0] * setup.pitch[1];
    (0..offsets.len())
        .map(|step| parts.iter().map(|part| part[step]).sum::<f64>() / pitch)
        .collect()
}

/// Area of a square of targets, seen from a source point, that passes the sheets and lands in `own`, times the
/// transmission of the sample.
fn light_of(
    setup: &Setup,
    [before, behind]: [&[Option<Sheet>]; 2],
    sample: Option<&Sample>,
    source: [f64; 2],
    target: Ends,
    own: Ends,
) -> Vec<f64> {
    let middle = target.map(|[low, high]| 0.5 * (low + high));
    let far = setup.detector_distance;
    let trace =
        sample.map_or_else(Trace::default, |s| setup.trace(s, source, middle, Order::First));
    // Displacement at a plane: the trace has it at the detector.
    let rest = far - setup.analyser();
    let landed = |axis: usize, plane: f64| {
        trace.displacement[axis] + trace.slope[axis] * (rest - (far - plane))
    };
    let on_sheet = |plane: f64, of: Ends, moves: [f64; 2]| {
        [0, 1].map(|axis| {
            of[axis].map(|at| source[axis] + (at - source[axis]) * plane / far + moves[axis])
        })
    };
    // Back from a part of a sheet to targets.
    let back = |plane: f64, of: Ends, moves: [f64; 2]| {
        [0, 1].map(|axis| {
            of[axis].map(|at| source[axis] + (at - moves[axis] - source[axis]) * far / plane)
        })
    };
    let on_pixel = [0, 1].map(|axis| own[axis].map(|at| at - landed(axis, far)));
    let none = vec![0.0; before.len()];
    let Some(lands) = overlap(target, on_pixel) else { return none };
    let passed = (-trace.optical_depth).exp();
    let open = |sheet: &Sheet, moves: [f64; 2]| -> Vec<Ends> {
        let parts = sheet.open_parts(on_sheet(sheet.distance, lands, moves));
        parts.into_iter().map(|part| back(sheet.distance, part, moves)).collect()
    };
    let behind = behind[0].as_ref();
    let second = behind
        .map(|sheet| (sheet.leak, open(sheet, [0, 1].map(|axis| landed(axis, sheet.distance)))));
    before
        .iter()
        .map(|sheet| {
            let first = sheet.as_ref().map(|sheet| (sheet.leak, open(sheet, [0.0; 2])));
            let whole = vec![lands];
            let (leak, first) = first.as_ref().map_or((0.0, &whole), |(leak, open)| (*leak, open));
            let (leak_behind, second) =
                second.as_ref().map_or((0.0, &whole), |(leak, open)| (*leak, open));
            let sum = |parts: &[Ends]| parts.iter().map(|part| area(*part)).sum::<f64>();
            let both: f64 = first
                .iter()
                .flat_map(|a| second.iter().filter_map(|b| Some(area(overlap(*a, *b)?))))
                .sum();
            passed
                * (leak * leak_behind * area(lands)
                    + leak * (1.0 - leak_behind) * sum(second)
                    + leak_behind * (1.0 - leak) * sum(first)
                    + (1.0 - leak) * (1.0 - leak_behind) * both)
        })
        .collect()
}
