//! Slit masks: straight box bars, cut exactly by every ray.

/// What the bars are.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Bars {
    /// Boxes of a linear attenuation coefficient (1/m) and a thickness (m).
    Boxes { mu: f64, thickness: f64 },
    /// A sheet without thickness that lets this fraction through.
    Sheet { transmission: f64 },
}

/// A periodic mask. Aperture k is centred at `origin + k * period` on its centre plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mask {
    /// Source to centre plane, m.
    pub(crate) distance: f64,
    pub(crate) period: f64,
    pub(crate) aperture: f64,
    pub(crate) origin: f64,
    pub(crate) bars: Bars,
}

impl Mask {
    /// The mask displaced along +x.
    pub(crate) fn moved(mut self, by: f64) -> Self {
        self.origin += by;
        self
    }

    /// Open length between the mask's origin and `x` (signed).
    fn open_length(&self, x: f64) -> f64 {
        let periods = (x - self.origin) / self.period + 0.5;
        let whole = periods.floor();
        let within = (periods - whole) * self.period - 0.5 * (self.period - self.aperture);
        whole * self.aperture + within.clamp(0.0, self.aperture)
    }

    /// Transmission of a straight ray through `x` on the centre plane with slopes dx/dy, dz/dy.
    /// The ray spends a share of its way between the faces inside bars.
    pub(crate) fn transmission(&self, x: f64, slope: [f64; 2]) -> f64 {
        let shadow = self.shadow(slope);
        let bar_share = if shadow > 0.0 {
            1.0 - (self.open_length(x + 0.5 * shadow) - self.open_length(x - 0.5 * shadow)) / shadow
        } else {
            let periods = (x - self.origin) / self.period + 0.5;
            let from_centre = (periods - periods.floor() - 0.5) * self.period;
            if from_centre.abs() < 0.5 * self.aperture { 0.0 } else { 1.0 }
        };
        self.through(bar_share, slope)
    }

    fn through(&self, bar_share: f64, slope: [f64; 2]) -> f64 {
        match self.bars {
            Bars::Boxes { mu, thickness } => {
                let way = thickness * (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
                (-mu * way * bar_share.max(0.0)).exp()
            }
            Bars::Sheet { transmission } => {
                if bar_share > 0.5 {
                    transmission
                } else {
                    1.0
                }
            }
        }
    }

    /// Lateral way of a ray between the faces, m.
    fn shadow(&self, slope: [f64; 2]) -> f64 {
        match self.bars {
            Bars::Boxes { thickness, .. } => (thickness * slope[0]).abs(),
            Bars::Sheet { .. } => 0.0,
        }
    }

    /// Mean transmission over rays of one slope through `low..high` on the centre plane.
    pub(crate) fn mean(&self, low: f64, high: f64, slope: [f64; 2]) -> f64 {
        mean(&[Stretch { mask: *self, low, high, slope }])
    }
}

/// A mask where a thin sheaf of rays of one slope goes through it, in the order of the rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stretch {
    pub(crate) mask: Mask,
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) slope: [f64; 2],
}

impl Stretch {
    fn at(&self, share: f64) -> f64 {
        let x = self.low + share * (self.high - self.low);
        self.mask.transmission(x, self.slope)
    }

    /// Shares of the stretch where the corner of a bar begins or ceases to shade the ray.
    fn cuts(&self, out: &mut Vec<f64>) {
        let (mask, half) = (&self.mask, 0.5 * self.mask.shadow(self.slope));
        let edge = 0.5 * mask.aperture;
        for corner in [-edge - half, -edge + half, edge - half, edge + half] {
            let first = ((self.low - mask.origin - corner) / mask.period).floor() + 1.0;
            let mut at = mask.origin + corner + first * mask.period;
            while at < self.high {
                out.push((at - self.low) / (self.high - self.low));
                at += mask.period;
            }
        }
    }
}

/// Mean of the product of transmissions over a sheaf of rays. The way inside bars is linear
/// between the cuts of all masks, so each piece is integrated exactly.
pub(crate) fn mean(masks: &[Stretch]) -> f64 {
    let mut cuts = vec![0.0, 1.0];
    masks.iter().for_each(|m| m.cuts(&mut cuts));
    cuts.sort_by(f64::total_cmp);
    let through = |share: f64| masks.iter().map(|m| m.at(share)).product::<f64>();
    let piece = |pair: &[f64]| {
        let width = pair[1] - pair[0];
        // Log-linear, from two inner points, so that hard edges at the ends do no harm.
        let a = through(pair[0] + 0.25 * width);
        let b = through(pair[0] + 0.75 * width);
        if width <= 0.0 || a <= 0.0 || b <= 0.0 {
            return 0.0;
        }
        let fall = 2.0 * (a / b).ln();
        let shape = if fall.abs() < 1e-4 {
            1.0 + fall * fall / 24.0
        } else {
            2.0 * (0.5 * fall).sinh() / fall
        };
        width * (a * b).sqrt() * shape
    };
    cuts.windows(2).map(piece).sum()
}
