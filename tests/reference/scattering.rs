//! Light of media that scatter behind two thin masks: each ray through the centre of the source is widened by the sum of
//! the variances on its way, by Simpson's rule; sums over rays in f64. Bodies are convex, upright along z and endless,
//! and refract not at all.

use super::normal::{cumulative, nodes};

/// Cross-section of a body in the plane z = 0, m.
#[derive(Debug, Clone)]
pub enum Section {
    /// Centre and radius.
    Disc([f64; 2], f64),
    /// Corners of a convex polygon, counter-clockwise.
    Polygon(Vec<[f64; 2]>),
}

/// A body with its attenuation coefficient (1/m) and its variance of angles per length (rad2/m).
#[derive(Debug, Clone)]
pub struct Medium {
    pub section: Section,
    pub mu: f64,
    pub scattering: f64,
    pub axis: Option<Axis>,
}

/// Axis along which a body scatters more than across it.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    /// Unit vector.
    pub direction: [f64; 3],
    /// Variance of angles per length along it less that across it, rad2/m.
    pub excess: f64,
}

impl Medium {
    /// Variance of angles per length of a ray in the plane z = 0 that is turned in this plane, rad2/m: in it the unit
    /// vector across the ray is (1, -slope, 0)/√(1 + slope²).
    fn scattering_of(&self, slope: f64) -> f64 {
        self.axis.map_or(self.scattering, |Axis { direction: [x, y, _], excess }| {
            self.scattering + excess * (x - slope * y).powi(2) / (1.0 + slope * slope)
        })
    }
}

impl Section {
    /// Where the ray x = slope (source + y) is inside along y.
    fn chord(&self, source: f64, slope: f64) -> Option<[f64; 2]> {
        match self {
            Self::Disc([x, y], radius) => {
                let (off, square) = (slope * source - x, 1.0 + slope * slope);
                let half = y - slope * off;
                let root = half * half - square * (off * off + y * y - radius * radius);
                let root = (root > 0.0).then(|| root.sqrt())?;
                Some([(half - root) / square, (half + root) / square])
            }
            Self::Polygon(corners) => {
                let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
                for (at, [x, y]) in corners.iter().enumerate() {
                    let next = corners[(at + 1) % corners.len()];
                    let [along_x, along_y] = [next[0] - x, next[1] - y];
                    // Left of the edge: `constant + rate y` is above 0.
                    let constant = -along_x * y - along_y * (slope * source - x);
                    let rate = along_x - along_y * slope;
                    if rate > 0.0 {
                        low = low.max(-constant / rate);
                    } else if rate < 0.0 {
                        high = high.min(-constant / rate);
                    } else if constant < 0.0 {
                        return None;
                    }
                }
                (low < high).then_some([low, high])
            }
        }
    }

    /// The section turned about the origin by an angle, then displaced.
    pub fn moved(&self, angle: f64, by: [f64; 2]) -> Self {
        let (sin, cos) = angle.sin_cos();
        let at = |[x, y]: [f64; 2]| [cos * x - sin * y + by[0], sin * x + cos * y + by[1]];
        match self {
            Self::Disc(centre, radius) => Self::Disc(at(*centre), *radius),
            Self::Polygon(corners) => Self::Polygon(corners.iter().map(|it| at(*it)).collect()),
        }
    }
}

/// Two thin opaque masks of one aperture a pixel and a Gaussian spot; distances from the source, m.
#[derive(Debug, Clone, Copy)]
pub struct SetUp {
    pub axis: f64,
    pub sample_mask: f64,
    pub analyser: f64,
    /// Deviation of the spot, m.
    pub spot: f64,
    /// Both apertures and the pixel, as seen on the analyser, m.
    pub apertures: [f64; 2],
    pub pixel: f64,
}

/// Optical depth and variance of the displacement on the analyser, m2.
#[derive(Debug, Clone, Copy)]
pub struct Passed {
    pub depth: f64,
    pub variance: f64,
}

impl SetUp {
    /// What the ray of a slope passes; of media at one place the last one counts.
    pub fn passed(&self, media: &[Medium], slope: f64) -> Passed {
        let chords: Vec<Option<[f64; 2]>> =
            media.iter().map(|it| it.section.chord(self.axis, slope)).collect();
        let mut ends: Vec<f64> = chords.iter().flatten().flatten().copied().collect();
        ends.sort_by(f64::total_cmp);
        let (length, lever) = ((1.0 + slope * slope).sqrt(), self.analyser - self.axis);
        let mut passed = Passed { depth: 0.0, variance: 0.0 };
        for pair in ends.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]);
            let is_inside = |chord: &Option<[f64; 2]>| {
                chord.is_some_and(|[low, high]| low < middle && middle < high)
            };
            let Some(at) = chords.iter().rposition(is_inside) else { continue };
            let path = (pair[1] - pair[0]) * length;
            passed.depth += media[at].mu * path;
            // A small angle v in the plane of the ray moves it by v (lever - y) (1 + slope²) on the analyser.
            let square = |y: f64| ((lever - y) * (1.0 + slope * slope)).powi(2);
            let mean = (square(pair[0]) + 4.0 * square(middle) + square(pair[1])) / 6.0;
            passed.variance += media[at].scattering_of(slope) * mean * path;
        }
        passed
    }

    /// Light of a pixel whose middle is at `x` on the detector, which is the analyser, at an offset of the sample mask;
    /// share of open beam. A ray from beside the centre of the source passes what the ray from the centre through the
    /// same point of the plane of the axis passes.
    pub fn light(&self, media: &[Medium], x: f64, offset: f64) -> f64 {
        const RAYS: usize = 2000;
        const SPOT: usize = 31;
        const REACH: f64 = 5.0;
        let scale = self.analyser / self.sample_mask;
        // By an offset of the source, on the analyser: how far the mask moves against a ray of the centre through a
        // point of the sample, and how far its light lands aside.
        let moves = self.analyser * (1.0 / self.sample_mask - 1.0 / self.axis);
        let lands = scale - 1.0 - moves;
        let half = self.apertures.map(|it| 0.5 * it);
        let reach = REACH * self.spot * moves;
        let step = 2.0 * (half[0] + reach) / RAYS as f64;
        let spot = nodes(self.spot, SPOT, REACH);
        let sum: f64 = (0..RAYS)
            .map(|ray| {
                let from_mask = (ray as f64 + 0.5) * step - half[0] - reach;
                let place = scale * offset + from_mask;
                let Passed { depth, variance } = self.passed(media, (x + place) / self.analyser);
                let blur = variance.sqrt();
                let within = |from: f64, blur: f64| {
                    cumulative((half[1] - from) / blur) - cumulative((-half[1] - from) / blur)
                };
                let light = if from_mask.abs() < half[0] - reach {
                    within(place, (lands * self.spot).hypot(blur))
                } else if blur > 0.0 {
                    let of = |(source, weight): &(f64, f64)| {
                        // Share of the ray's cell that the mask lets through.
                        let open = (half[0] - (from_mask + moves * source).abs()) / step + 0.5;
                        weight * open.clamp(0.0, 1.0) * within(place - lands * source, blur)
                    };
                    spot.iter().map(of).sum()
                } else {
                    // Offsets of the source whose light the mask and the window let through.
                    let low = ((-half[0] - from_mask) / moves).max((place - half[1]) / lands);
                    let high = ((half[0] - from_mask) / moves).min((place + half[1]) / lands);
                    let below = |source: f64| cumulative(source / self.spot);
                    (below(high) - below(low)).max(0.0)
                };
                (-depth).exp() * light
            })
            .sum();
        sum * step / self.pixel
    }
}
