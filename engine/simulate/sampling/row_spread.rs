//! How the light of a cell spreads over its row and the two beside it, blurred by the spot.

use super::polygon::Corner;
use beamlet_core::numbers::single;
use std::f64::consts::{PI, SQRT_2};

/// Light farther than this from a border does not cross it, standard deviations of the blur.
const FARTHEST: f64 = 8.0;
/// Ends of an edge that are nearer to one another along z, standard deviations, count as level.
const LEVEL: f64 = 1e-3;
/// A blur above this share of a row takes light beyond the rows beside.
const WIDE: f64 = 1.0 / 6.0;
/// A tilt moves the centroid of an interval by a twelfth of its height.
const BY_TILT: f64 = 1.0 / 12.0;
/// Least motion of a centroid by a tilt, rows.
const LEAST_MOTION: f64 = 1e-6;

/// Light of an interval of a row (coordinates in rows, downwards, 0..1 inside the row).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RowSpread {
    /// Standard deviation of the blur, rows.
    pub(super) blur: f64,
}

/// Change of the density of light over an interval, relative to its mean density, where the optical depth
/// rises by `rise` over it: of the line with the same centroid.
pub(super) fn tilt_by_depth(rise: f64) -> f64 {
    let half = 0.5 * rise;
    let langevin = if half.abs() < 1e-2 { half / 3.0 } else { 1.0 / libm::tanh(half) - 1.0 / half };
    -0.5 * langevin / BY_TILT
}

/// The same of light in an interval of this height, rows, whose centroid lies `aside` from its middle; 0
/// where that is too little to count.
pub(super) fn tilt_by_centroid(aside: f64, height: f64) -> f64 {
    if aside.abs() < LEAST_MOTION {
        return 0.0;
    }
    (aside / height).clamp(-0.5, 0.5) / BY_TILT
}

impl RowSpread {
    /// True if the blur takes light of every interval beyond the rows beside.
    pub(super) fn is_wide(self) -> bool {
        self.blur > WIDE
    }

    /// Shares that land in the row above and in the row below, or `None` where light lands
    /// farther off. `shift` is downwards.
    pub(super) fn shares(self, top: f64, bottom: f64, shift: f64) -> Option<[f32; 2]> {
        let (low, high) = (top + shift, bottom + shift);
        let reach = 6.0 * self.blur;
        if self.is_wide() || low - reach < -1.0 || high + reach > 2.0 {
            return None;
        }
        let above = self.share_below(0.0, low, high);
        let below = 1.0 - self.share_below(1.0, low, high);
        Some([single(above), single(below)])
    }

    /// Share of light spread evenly over [low, high] and blurred that lies before `e`.
    pub(super) fn share_below(self, e: f64, low: f64, high: f64) -> f64 {
        if self.blur <= 0.0 {
            return ((e - low) / (high - low)).clamp(0.0, 1.0);
        }
        let (near, far) = ((e - high) / self.blur, (e - low) / self.blur);
        (ramp(far) - ramp(near)) / (far - near)
    }
}

/// Light that is linear along z.
impl RowSpread {
    /// Integrals over [low, high] of light that falls from 1 to 0 and of light that rises from 0 to 1, times its
    /// share before `e`: by parts, of the first two antiderivatives of the normal distribution function.
    pub(super) fn linear_below(self, e: f64, [low, high]: [f64; 2]) -> [f64; 2] {
        // A point spot has a sharp border.
        let blur = self.blur.max(1e-9);
        let [from, to] = [low, high].map(|end| antiderivatives((e - end) / blur));
        let whole = blur * (from[0] - to[0]);
        let rises = blur * blur * (from[1] - to[1]) / (high - low) - blur * to[0];
        [whole - rises, rises]
    }
}

/// Light of polygons that a blur moves over a border: integrals over their area.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Crossed {
    /// Integral of the share that crosses.
    pub(super) light: f64,
    /// The same, times the distance from the border.
    pub(super) by_distance: f64,
    /// Change of the first as the polygons move over the border, per row.
    pub(super) rise: f64,
}

impl RowSpread {
    /// Adds what crosses a border from a polygon, whose corners are given as (x, distance from the
    /// border in rows, negative beyond it).
    ///
    /// By Green's theorem the integrals are sums over the edges, of antiderivatives of the normal
    /// distribution function: exact for any outline.
    pub(super) fn add_crossed(
        self,
        corners: impl Iterator<Item = Corner> + Clone,
        sum: &mut Crossed,
    ) {
        // A point spot has a sharp border.
        let blur = self.blur.max(1e-9);
        if corners.clone().all(|[_, inner]| inner > FARTHEST * blur) {
            return;
        }
        let end = |[x, inner]: Corner| (x, -inner / blur, antiderivatives(-inner / blur));
        let Some(mut from) = corners.clone().last().map(end) else { return };
        let (mut twice, mut own) = (0.0, Crossed::default());
        for to in corners.map(end) {
            let (x, t, [first, second, third]) = from;
            let (next_x, next_t, [next_first, next_second, next_third]) = to;
            let (along, step) = (next_x - x, next_t - t);
            twice += x * next_t - next_x * t;
            // Means over the edge: of the share that crosses, of its antiderivatives, and of t times
            // the first of these, by parts.
            let [share, ramp, bowl, ramp_by_t] = if step.abs() > LEVEL {
                let by_parts = next_t * next_second - t * second - (next_third - third);
                [next_first - first, next_second - second, next_third - third, by_parts]
                    .map(|change| change / step)
            } else {
                let middle = t + 0.5 * step;
                let [ramp, bowl, _] = antiderivatives(middle);
                [normal_share(middle), ramp, bowl, middle * ramp]
            };
            own.rise += along * share;
            own.light += along * ramp;
            own.by_distance += along * (ramp_by_t - bowl);
            from = to;
        }
        // The orientation of the polygon.
        let sign = -twice.signum();
        sum.rise += sign * own.rise;
        sum.light += sign * blur * own.light;
        sum.by_distance -= sign * blur * blur * own.by_distance;
    }
}

/// Origin of the light of a piece in its row, and its shares in the rows beside.
#[derive(Debug, Clone, Copy)]
pub(super) struct PieceRows {
    /// The interval of its centroid and variance.
    pub(super) whole: [f64; 2],
    /// Centroid of its light.
    pub(super) centroid: f64,
    /// Its displacement by the first order, rows, downwards.
    pub(super) down: f64,
    /// Shares that land in the row above and in the row below, with that displacement.
    pub(super) shares: [f64; 2],
    /// Their changes per row of displacement.
    pub(super) rises: [f64; 2],
}

/// Range of the displacement over which shares of a piece are linear, fraction of the blur.
const NEAR_FIRST_ORDER: f64 = 0.3;
/// The same without blur, fraction of the height.
const NEAR_SHARP: f64 = 0.01;
/// Light beyond the rows beside is added to them within this distance in standard deviations of the blur:
/// 2e-4 of a piece that ends there.
const FARTHEST_BESIDE: f64 = 3.5;

impl PieceRows {
    /// Shares of its outline that land in the row above and in the row below when it is displaced
    /// by `down` rows and blurred with a standard deviation of `blur` rows; nothing where it lands
    /// farther off, or elsewhere than the first order says.
    pub(super) fn by_outline(&self, down: f64, blur: f64) -> Option<[f64; 2]> {
        let [top, bottom] = self.whole;
        let off = down - self.down;
        let near = off.abs() <= (NEAR_FIRST_ORDER * blur).max(NEAR_SHARP * (bottom - top));
        let reach = FARTHEST_BESIDE * blur;
        let beside = top + down - reach >= -1.0 && bottom + down + reach <= 2.0;
        let share = |side: usize| (self.shares[side] + off * self.rises[side]).clamp(0.0, 1.0);
        (near && beside).then(|| [share(0), share(1)])
    }
}

/// The normal distribution function.
fn normal_share(t: f64) -> f64 {
    0.5 * libm::erfc(-t / SQRT_2)
}

/// The first three antiderivatives of the normal distribution function that vanish far below.
fn antiderivatives(t: f64) -> [f64; 3] {
    if t < -FARTHEST {
        return [0.0; 3];
    }
    let (share, density) = if t > FARTHEST {
        (1.0, 0.0)
    } else {
        (normal_share(t), libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt())
    };
    [
        t * share + density,
        0.5 * ((t * t + 1.0) * share + t * density),
        (t * (t * t + 3.0) * share + (t * t + 2.0) * density) / 6.0,
    ]
}

/// Antiderivative of the normal distribution function: t Phi(t) + phi(t).
fn ramp(t: f64) -> f64 {
    if t > 8.0 {
        return t;
    }
    if t < -8.0 {
        return 0.0;
    }
    // Most light is hardly moved in z: the series is exact to 1e-13 there, and much faster.
    if t.abs() < 0.05 {
        let t2 = t * t;
        let even = 1.0 + t2 * (0.5 - t2 * (1.0 / 24.0 - t2 / 240.0));
        return 0.5 * t + even / (2.0 * PI).sqrt();
    }
    0.5 * t * libm::erfc(-t / SQRT_2) + libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_of_the_ramp_is_its_closed_form() {
        for t in [-0.0499, -1e-3, 0.0, 1e-9, 0.02, 0.0499] {
            let closed =
                0.5 * t * libm::erfc(-t / SQRT_2) + libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt();
            assert!((ramp(t) - closed).abs() < 1e-13, "{t}");
        }
    }

    /// Ramps of light over intervals of any height, blurred by 0 to 1 row, against sums of 1e4 lines.
    #[test]
    fn linear_light_before_a_border_is_the_integral_over_its_lines() {
        for blur in [0.0, 1e-3, 0.1, 0.4, 1.0] {
            let spread = RowSpread { blur };
            for (e, ends) in
                [(0.0, [0.0, 0.5]), (1.0, [0.2, 0.9]), (0.3, [0.25, 0.31]), (2.0, [0.0, 1.0])]
            {
                let height = (ends[1] - ends[0]) / 1e4;
                let mut sums = [0.0; 2];
                for line in 0..10_000 {
                    let share = (f64::from(line) + 0.5) / 1e4;
                    let z = ends[0] + share * (ends[1] - ends[0]);
                    let before = normal_share((e - z) / blur.max(1e-12)) * height;
                    sums[0] += (1.0 - share) * before;
                    sums[1] += share * before;
                }
                let got = spread.linear_below(e, ends);
                for (got, sum) in got.into_iter().zip(sums) {
                    // A sharp border divides a line.
                    assert!((got - sum).abs() < 3e-6, "{blur} {e} {ends:?}: {got} {sum}");
                }
            }
        }
    }

    #[test]
    fn a_whole_row_loses_the_same_share_on_both_sides() {
        let spread = RowSpread { blur: 0.036 };
        let [above, below] = spread.shares(0.0, 1.0, 0.0).unwrap();
        // Each edge loses blur / sqrt(2 pi).
        let lost = 0.036 / (2.0 * PI).sqrt();
        assert!((f64::from(above) - lost).abs() < 1e-8 && (f64::from(below) - lost).abs() < 1e-8);
        assert!(spread.shares(0.0, 1.0, 1.5).is_none());
    }

    /// Polygons that cross a border, touch it and lie off it, either way round, against sums over
    /// lines of their widths: the midpoint rule with 1e5 lines is good to 1e-6 at corners.
    #[test]
    fn what_crosses_a_border_is_the_integral_over_the_polygon() {
        let spread = RowSpread { blur: 0.036 };
        let polygons: [&[Corner]; 4] = [
            &[[0.0, 0.0], [0.3, 0.0], [0.3, 0.2]],
            &[[0.0, 0.01], [0.1, -0.05], [0.4, 0.02], [0.3, 0.3]],
            &[[0.2, 0.3], [0.4, 0.02], [0.1, -0.05]],
            &[[0.0, -0.2], [0.1, -0.3], [0.2, -0.2]],
        ];
        for corners in polygons {
            let mut crossed = Crossed::default();
            spread.add_crossed(corners.iter().copied(), &mut crossed);
            let mut sums = [0.0; 3];
            let step = 1e-5;
            for line in -50_000..50_000 {
                let z = (f64::from(line) + 0.5) * step;
                let mut ends = Vec::new();
                for ([ax, az], [bx, bz]) in corners.iter().zip(corners.iter().cycle().skip(1)) {
                    if (*az > z) != (*bz > z) {
                        ends.push(ax + (bx - ax) * (z - az) / (bz - az));
                    }
                }
                let [from, to] = ends[..] else { continue };
                let t = -z / spread.blur;
                let density = libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt() / spread.blur;
                let all = [normal_share(t), normal_share(t) * z, density];
                for (sum, value) in sums.iter_mut().zip(all) {
                    *sum += value * (to - from).abs() * step;
                }
            }
            let own = [crossed.light, crossed.by_distance, crossed.rise];
            for (own, sum) in own.into_iter().zip(sums) {
                assert!((own - sum).abs() < 1e-5 * sum.abs().max(0.1), "{corners:?}: {own} {sum}");
            }
        }
        // Without a blur what lies beyond the border, here one ninth, crosses it.
        let mut crossed = Crossed::default();
        let corners = [[0.0, -0.1], [0.1, 0.2], [-0.2, 0.2]];
        RowSpread { blur: 0.0 }.add_crossed(corners.into_iter(), &mut crossed);
        assert!((crossed.light - 0.045 / 9.0).abs() < 1e-9, "{crossed:?}");
    }
}
