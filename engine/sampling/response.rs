//! How a change of a cell's result changes what pixels record: the openings of the sample mask by
//! mask step, and the blurred windows of the analyser.

use super::lattice::Lattice;
use super::patch::part;
use crate::numbers::{self, single};
use crate::optics::{Mask, Optics};

/// Points of the table of a window per period of the windows.
const POINTS_PER_PERIOD: usize = 512;
/// Rectangles that a patch begins with are at least as wide as this share of the period.
const LEAST_SLAB: f32 = 1.0 / 128.0;
/// Strips of a triangle whose light windows see.
const STRIPS: u16 = 4;
/// Windows are sharp where they blur less than this share of the deviation of a piece: then all of its
/// outline counts.
const SHARP: f32 = 0.25;
/// Pieces that share an edge of a sharp window err alike there.
const ALIKE: f32 = 2.0;
/// Half width of the table, periods.
const REACH: usize = 2;
/// Mask steps closer to one another than this share of an aperture see the same.
const STEPS_APART: f64 = 1.0 / 16.0;
/// An opening is seen this many standard deviations beyond its edges.
const SOFT_EDGE: f64 = 2.0;

/// Light that a cell sends through the masks, per mask step and window.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    /// Integral of the light through one window over the landing point, m, at points from
    /// -REACH periods on.
    window: Vec<f32>,
    /// Half width of the windows, m, where they are sharper than points of the table tell.
    sharp: Option<f32>,
    /// Period of the windows on the analyser, m.
    pub(super) period: f32,
    /// Standard deviation of the blur on the analyser, m.
    blur: f32,
    /// From the cell plane to the analyser.
    pub(super) magnification: f32,
    /// Landing point of an undeflected ray through the centre of a beamlet, from the centre of the
    /// nearest window, m, by beamlet of the lattice.
    landing: Vec<f32>,
    /// Opening by mask step in the cell plane, from the nearest period of the sample mask, m; none
    /// without a sample mask.
    openings: Vec<[f32; 2]>,
    /// Period of the sample mask in the cell plane, m.
    mask_period: f32,
    /// Beamlet's centre from the centre of the nearest period of the sample mask, m.
    mask_offset: Vec<f32>,
    /// What the shadow of thick bars takes of each side of an opening, m, by beamlet.
    shadow: Vec<f32>,
    /// How far an opening is seen beyond its edges, m.
    soft: f32,
    /// Half a period of the lattice, m.
    half_period: f32,
    /// Recorded value per metre of open cell plane.
    pub(super) weight: f32,
    /// Cells serve any mask, step and detector: stored moments.
    pub(super) any_masks: bool,
}

/// An interval of x of a beamlet that a mask step opens.
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening {
    pub(super) step: u32,
    pub(super) x: [f32; 2],
}

impl Response {
    /// For the scene that is traced; `any_masks`: for moments that are stored, whose masks and
    /// steps are not known yet.
    #[must_use]
    pub(crate) fn new(optics: &Optics, lattice: &Lattice, any_masks: bool) -> Self {
        let Optics { rotation, analyser, detector, .. } = optics;
        let [period, width] = optics.windows();
        let beamlets = lattice.beamlet_geometry(optics);
        let masked = optics.detector_mask.is_some();
        let landing = |c: &crate::interface::BeamletGeometry| {
            if masked { c.aperture_offset } else { c.pixel_offset }
        };
        // Of the whole spot: recorded values are sums over its parts.
        let spot = |part: &crate::spot::PlacedPart| {
            part.share * (part.offset[0].powi(2) + part.deviation[0].powi(2))
        };
        let spot = optics.spot.placed().iter().map(spot).sum::<f64>().sqrt();
        let edge = optics.cutting_plane();
        let magnified = spot * (edge / rotation - 1.0) * analyser / edge;
        let blur = magnified.max(1e-4 * period);
        let soft =
            SOFT_EDGE * optics.spot.narrowest(0) * (rotation - lattice.plane).abs() / rotation;
        let hard = any_masks || optics.sample_mask.is_none();
        let (openings, mask_period) = match &optics.sample_mask {
            Some(mask) if !any_masks => {
                let half = 0.5 * mask.aperture_at(lattice.plane) + soft;
                let opening = |f: &f64| [single(f - half), single(f + half)];
                let offsets = told_apart(&optics.mask_offsets, STEPS_APART * mask.aperture());
                (offsets.iter().map(opening).collect(), mask.period_at(lattice.plane))
            }
            Some(mask) => {
                // Steps that cover the period once.
                let count = (mask.period() / mask.aperture()).ceil().clamp(1.0, 64.0);
                let width = lattice.period / count;
                let steps = 0..numbers::whole::<u32>(count);
                let opening = |step: u32| {
                    let low = f64::from(step) * width - 0.5 * lattice.period;
                    [single(low), single(low + width)]
                };
                (steps.map(opening).collect(), lattice.period)
            }
            None => (Vec::new(), lattice.period),
        };
        Self {
            window: window_integral(period, width, blur),
            sharp: (blur * POINTS_PER_PERIOD as f64 <= period).then_some(single(0.5 * width)),
            period: single(period),
            blur: single(blur),
            magnification: single(analyser / lattice.plane),
            landing: beamlets.iter().map(landing).collect(),
            openings,
            mask_period: single(mask_period),
            mask_offset: if any_masks {
                vec![0.0; beamlets.len()]
            } else {
                beamlets.iter().map(|c| c.sample_offset).collect()
            },
            shadow: beamlets
                .iter()
                .map(|c| if hard { 0.0 } else { shadow(optics, c.slope) })
                .collect(),
            soft: if hard { 0.0 } else { single(soft) },
            half_period: single(0.5 * lattice.period),
            weight: single(detector.distance / (lattice.plane * detector.pitch[0])),
            any_masks,
        }
    }

    /// Largest change of the share of light that passes a window, per displacement, 1/m.
    pub(super) fn steepest(&self) -> f64 {
        0.4 / f64::from(self.blur)
    }

    /// Part of a change of light within a rectangle of this width, m, that windows record although
    /// its mean and slope are right: they are nearly straight over less than the blur.
    pub(super) fn curvature(&self, width: f32) -> f32 {
        (0.1 * (self.magnification * width / self.blur).powi(2)).min(1.0)
    }

    /// Part of the change that a displacement of this standard deviation, m, makes if its mean is
    /// moved by as much, where it blurs light that is known to be blurred by it. Its third moment
    /// is left, the deviation squared times `farthest` at most, m.
    pub(super) fn skew(&self, deviation: f32, farthest: f32) -> f32 {
        (0.1 * deviation * farthest.max(deviation) / self.blur.powi(2)).min(1.0)
    }

    /// What windows record of light that is spread evenly with this standard deviation, m, where a
    /// Gaussian stands for that: its fourth cumulant, -6/5 of the square of the variance.
    pub(super) fn flat(&self, deviation: f32) -> f32 {
        (0.03 * (deviation / self.blur).powi(4)).min(1.0)
    }

    /// Mask steps that differ enough to count.
    pub(super) fn steps(&self) -> usize {
        self.openings.len().max(1)
    }

    /// Openings of the beamlet at `column` of the lattice, inside its period.
    pub(super) fn openings(&self, column: usize) -> Vec<Opening> {
        let half = self.half_period;
        if self.openings.is_empty() {
            return vec![Opening { step: 0, x: [-half, half] }];
        }
        let mut all = Vec::new();
        for (step, [low, high]) in (0_u32..).zip(&self.openings) {
            let [low, high] = [low, high].map(|x| x - self.mask_offset[column]);
            let [low, high] = [low + self.shadow[column], high - self.shadow[column]];
            let mut k = ((-half - high) / self.mask_period).ceil();
            while low + k * self.mask_period < half {
                let shift = k * self.mask_period;
                let x = [(low + shift).max(-half), (high + shift).min(half)];
                if x[1] > x[0] {
                    all.push(Opening { step, x });
                }
                k += 1.0;
            }
        }
        all
    }

    /// Borders of the rectangles along x that a patch with facets begins with, at `column` of the
    /// lattice: edges of openings, or how near to the edges of windows their blur is felt; `cells`
    /// to the period at least.
    pub(super) fn edges(&self, column: usize, cells: u32) -> Vec<f32> {
        let half = self.half_period;
        let mut inner: Vec<f32> = if self.openings.is_empty() {
            let felt = 2.0 * self.blur / self.magnification;
            if felt < 0.5 * half { vec![felt - half, half - felt] } else { Vec::new() }
        } else {
            let edges = |o: &Opening| [o.x[0] + self.soft, o.x[1] - self.soft];
            self.openings(column).iter().flat_map(edges).collect()
        };
        inner.sort_unstable_by(f32::total_cmp);
        let least = 2.0 * half * LEAST_SLAB;
        let mut borders = vec![-half];
        for edge in inner {
            if edge - borders[borders.len() - 1] > least && half - edge > least {
                borders.push(edge);
            }
        }
        borders.push(half);
        let widest = 2.0 * half / cells as f32;
        let parts = |pair: &[f32]| {
            let range = [pair[0], pair[1]];
            let count = numbers::whole::<u32>(f64::from(
                ((range[1] - range[0]) / widest - LEAST_SLAB).ceil().max(1.0),
            ));
            (0..count).map(move |index| part(range, index, count)[0])
        };
        borders.windows(2).flat_map(parts).chain([half]).collect()
    }

    /// What of light spread evenly over [at - half, at + half] may pass a window more or less if
    /// it is spread otherwise, with the same mean and variance: as over a triangle.
    pub(super) fn outline(&self, at: f32, half: f32) -> f32 {
        if self.any_masks {
            return 0.1;
        }
        let deviation = half / 3.0_f32.sqrt();
        let home = at - (at / self.period).round() * self.period;
        let point = 2.0 * self.period / POINTS_PER_PERIOD as f32;
        let is_sharp = self.blur < SHARP * deviation;
        let change = |window: f32| {
            let at = home - window * self.period;
            if is_sharp {
                let own = self.share(at, half);
                let either =
                    [-deviation, deviation].map(|it| (own - self.share_of_triangle(at, it)).abs());
                return ALIKE * either[0].max(either[1]);
            }
            let [near, far] = [at - 0.75 * deviation, at + 1.333 * deviation];
            let two = 0.64 * self.share(near, point) + 0.36 * self.share(far, point);
            (self.share(at, half.max(point)) - two).abs()
        };
        [-1.0, 0.0, 1.0].map(change).into_iter().fold(0.0, f32::max)
    }

    /// Share of light spread over a triangle that passes the window at 0: of strips of it. From its
    /// side at `-sqrt(2) deviation` the density falls to nothing at twice that on the other side.
    fn share_of_triangle(&self, at: f32, deviation: f32) -> f32 {
        let side = std::f32::consts::SQRT_2 * deviation;
        let half = 1.5 * side / f32::from(STRIPS);
        let strip = |index: u16| {
            let weight = f32::from(2 * (STRIPS - index) - 1) / f32::from(STRIPS * STRIPS);
            weight * self.share(at - side + half * f32::from(2 * index + 1), half.abs())
        };
        (0..STRIPS).map(strip).sum()
    }

    /// Landing point of light of a beamlet displaced by `displacement`, from the centre of a
    /// window, m.
    pub(super) fn landing(&self, column: usize, x: f32, displacement: f32) -> f32 {
        self.magnification * x + displacement + self.landing[column]
    }

    /// Integral of the light through the window at 0 over the landing point.
    fn integral(&self, at: f32) -> f32 {
        if let Some(half) = self.sharp {
            return at.clamp(-half, half);
        }
        let points = POINTS_PER_PERIOD as f32;
        let place = (at / self.period + REACH as f32) * points;
        if place <= 0.0 {
            self.window[0]
        } else if place >= (self.window.len() - 1) as f32 {
            self.window[self.window.len() - 1]
        } else {
            let index = numbers::whole::<usize>(f64::from(place));
            let (a, b) = (self.window[index], self.window[index + 1]);
            a + (b - a) * (place - index as f32)
        }
    }

    /// Share of light spread evenly over [at - half, at + half] that passes the window at 0.
    fn share(&self, at: f32, half: f32) -> f32 {
        (self.integral(at + half) - self.integral(at - half)) / (2.0 * half)
    }

    /// Largest change of the light in any window between two results: light that passes the sample
    /// and landing point of each, spread over 2 `half`.
    pub(super) fn change(&self, a: [f32; 2], b: [f32; 2], half: f32) -> f32 {
        self.change_from(&self.landed(a, half), b)
    }

    /// Light that passes the sample and its landing point, spread over 2 `half`, as windows see it.
    pub(super) fn landed(&self, [light, at]: [f32; 2], half: f32) -> Landed {
        // The table has no points within less; and the quotient below keeps its digits.
        let half = half.max(2.0 * self.period / POINTS_PER_PERIOD as f32);
        let home = (at / self.period).round();
        let windows = if self.any_masks { [0.0; 3] } else { self.windows(light, at, home, half) };
        Landed { light, at, half, home, windows }
    }

    /// What passes the window at `home` and those beside it.
    fn windows(&self, light: f32, at: f32, home: f32, half: f32) -> [f32; 3] {
        [-1.0, 0.0, 1.0].map(|k| light * self.share(at - (home + k) * self.period, half))
    }

    /// Largest change of the light in any window if it had this light and landing point.
    pub(super) fn change_from(&self, own: &Landed, [light, at]: [f32; 2]) -> f32 {
        if self.any_masks {
            let slope = 0.4 / self.blur;
            let moved = ((own.at - at).abs() * slope).min(1.0);
            return (own.light - light).abs() + own.light.max(light) * moved;
        }
        let most = |a: [f32; 3], b: [f32; 3]| {
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        let near = most(own.windows, self.windows(light, at, own.home, own.half));
        let home = (at / self.period).round();
        if (home - own.home).abs() < 0.5 {
            return near;
        }
        let there = self.windows(own.light, own.at, home, own.half);
        near.max(most(there, self.windows(light, at, home, own.half)))
    }
}

/// Light as windows see it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Landed {
    /// That passes the sample, share of what meets it.
    light: f32,
    /// Where it lands, and half of what it is spread over, m.
    at: f32,
    half: f32,
    /// The nearest window, and what passes that and the two beside it.
    home: f32,
    windows: [f32; 3],
}

/// What the shadow of thick bars of the sample mask takes of each side of an aperture, m, seen
/// under an angle of this slope.
fn shadow(optics: &Optics, slope: f32) -> f32 {
    let thickness = optics.sample_mask.as_ref().and_then(Mask::side_shadow);
    thickness.map_or(0.0, |thickness| 0.5 * single(thickness) * slope.abs())
}

/// Those of some offsets of the sample mask, m, that stand farther apart than `least`: what is
/// right at two steps is right at those between.
fn told_apart(offsets: &[f64], least: f64) -> Vec<f64> {
    let mut sorted = offsets.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut kept: Vec<f64> = Vec::new();
    for offset in sorted {
        if kept.last().is_none_or(|last| offset - last > least) {
            kept.push(offset);
        }
    }
    kept
}

/// Integral of a box of this width blurred by a Gaussian, at the points of the table.
fn window_integral(period: f64, width: f64, blur: f64) -> Vec<f32> {
    let last = 2 * REACH * POINTS_PER_PERIOD;
    // Second antiderivative of the Gaussian.
    let ramp = |x: f64| {
        let t = x / blur;
        if t.abs() > 8.0 {
            return x.max(0.0);
        }
        let density = libm::exp(-0.5 * t * t) / (2.0 * std::f64::consts::PI).sqrt();
        x * 0.5 * libm::erfc(-t * std::f64::consts::FRAC_1_SQRT_2) + blur * density
    };
    let at = |point: usize| {
        let x = (point as f64 / POINTS_PER_PERIOD as f64 - REACH as f64) * period;
        single(ramp(x + 0.5 * width) - ramp(x - 0.5 * width))
    };
    (0..=last).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_of_a_window_rises_by_its_width() {
        let table = window_integral(150e-6, 30e-6, 6e-6);
        let rise = f64::from(table[table.len() - 1] - table[0]);
        assert!((rise - 30e-6).abs() < 1e-10, "{rise}");
        assert!(table.is_sorted());
    }
}
