//! Slit masks: straight box bars, cut exactly by every ray.

/// Bars of a mask.
#[derive(Debug, Clone, Copy)]
pub enum Bars {
    /// Boxes of a linear attenuation coefficient (1/m) and a thickness (m).
    Boxes { mu: f64, thickness: f64 },
    /// A sheet without thickness that lets this fraction through.
    Sheet { transmission: f64 },
}

/// A periodic mask. Aperture k is centred at `origin + k * period` on its centre plane.
#[derive(Debug, Clone, Copy)]
pub struct Mask {
    /// Source to centre plane, m.
    pub distance: f64,
    pub period: f64,
    pub aperture: f64,
    pub origin: f64,
    pub bars: Bars,
}

impl Mask {
    /// The mask displaced along +x.
    pub fn moved(mut self, by: f64) -> Self {
        self.origin += by;
        self
    }

    /// Open length between the mask's origin and `x` (signed).
    fn open_length(&self, x: f64) -> f64 {
        let periods = (x - self.origin) / self.period + 0.5;
        let whole = floor(periods);
        let within = (periods - whole) * self.period - 0.5 * (self.period - self.aperture);
        whole * self.aperture + within.clamp(0.0, self.aperture)
    }

    /// Transmission of a straight ray through `x` on the centre plane with slopes dx/dy, dz/dy.
    /// The ray spends a share of its way between the faces inside bars.
    pub fn transmission(&self, x: f64, slope: [f64; 2]) -> f64 {
        let ray = Stretch { mask: *self, low: x, high: x, slope };
        let inside = ray.bar_share(0.0, self.shadow(slope));
        if inside > 0.0 { (ray.ln_of_bars() * inside).exp() } else { 1.0 }
    }

    /// Lateral way of a ray between the faces, m.
    fn shadow(&self, slope: [f64; 2]) -> f64 {
        match self.bars {
            Bars::Boxes { thickness, .. } => (thickness * slope[0]).abs(),
            Bars::Sheet { .. } => 0.0,
        }
    }

    /// Mean transmission over rays of one slope through `low..high` on the centre plane.
    pub fn mean(&self, low: f64, high: f64, slope: [f64; 2]) -> f64 {
        mean(&[Stretch { mask: *self, low, high, slope }])
    }
}

/// A mask where a thin sheaf of rays of one slope goes through it, in the order of the rays.
#[derive(Debug, Clone, Copy)]
pub struct Stretch {
    pub mask: Mask,
    pub low: f64,
    pub high: f64,
    pub slope: [f64; 2],
}

impl Stretch {
    /// Shares of the stretch where the corner of a bar begins or ceases to shade the ray.
    fn cuts(&self, out: &mut Vec<f64>) {
        let (mask, half) = (&self.mask, 0.5 * self.mask.shadow(self.slope));
        let edge = 0.5 * mask.aperture;
        for corner in [-edge - half, -edge + half, edge - half, edge + half] {
            let first = floor((self.low - mask.origin - corner) / mask.period) + 1.0;
            let mut at = mask.origin + corner + first * mask.period;
            while at < self.high {
                out.push((at - self.low) / (self.high - self.low));
                at += mask.period;
            }
        }
    }

    /// ln of the transmission of a ray that spends all of its way between the faces inside bars.
    fn ln_of_bars(&self) -> f64 {
        match self.mask.bars {
            Bars::Boxes { mu, thickness } => {
                let [x, z] = self.slope;
                -mu * thickness * (1.0 + x * x + z * z).sqrt()
            }
            Bars::Sheet { transmission } => transmission.ln(),
        }
    }

    /// The share of its way between the faces that a ray spends inside bars, where the shadow of a
    /// bar is `shadow` wide. What has no thickness has a ray inside or beside it.
    fn bar_share(&self, share: f64, shadow: f64) -> f64 {
        let mask = &self.mask;
        let x = self.low + share * (self.high - self.low);
        if shadow > 0.0 {
            let open = mask.open_length(x + 0.5 * shadow) - mask.open_length(x - 0.5 * shadow);
            return (1.0 - open / shadow).max(0.0);
        }
        let periods = (x - mask.origin) / mask.period + 0.5;
        let from_centre = (periods - floor(periods) - 0.5) * mask.period;
        if from_centre.abs() < 0.5 * mask.aperture { 0.0 } else { 1.0 }
    }
}

/// As `f64::floor`, which is a call on processors without an instruction for it.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "periods of a mask, which are few"
)]
fn floor(x: f64) -> f64 {
    let whole = x as i64 as f64;
    if whole > x { whole - 1.0 } else { whole }
}

/// Mean of the product of transmissions over a sheaf of rays. The way inside bars is linear
/// between the cuts of all masks, so each piece is integrated exactly.
pub fn mean(masks: &[Stretch]) -> f64 {
    let mut cuts = Vec::with_capacity(16);
    cuts.extend([0.0, 1.0]);
    masks.iter().for_each(|m| m.cuts(&mut cuts));
    cuts.sort_by(f64::total_cmp);
    let of_mask = |m: &Stretch| (m.mask.shadow(m.slope), m.ln_of_bars());
    let [first, second] = [masks.first(), masks.get(1)].map(|m| m.map(|m| (m, of_mask(m))));
    assert!(masks.len() <= 2, "a set-up has two masks");
    // ln of the transmission; opaque bars are infinite, and 0 of them is nothing.
    let ln_through = |share: f64| {
        let of = |(m, (shadow, bars)): &(&Stretch, (f64, f64))| {
            let inside = m.bar_share(share, *shadow);
            if inside > 0.0 { bars * inside } else { 0.0 }
        };
        first.iter().chain(&second).map(of).sum::<f64>()
    };
    let piece = |pair: &[f64]| {
        let width = pair[1] - pair[0];
        if width <= 0.0 {
            return 0.0;
        }
        // Linear, from two inner points, so that hard edges at the ends do no harm.
        let a = ln_through(pair[0] + 0.25 * width);
        let b = ln_through(pair[0] + 0.75 * width);
        if a == f64::NEG_INFINITY || b == f64::NEG_INFINITY {
            return 0.0;
        }
        let fall = 2.0 * (a - b);
        if fall.abs() < 1e-4 {
            return width * (0.5 * (a + b)).exp() * (1.0 + fall * fall / 24.0);
        }
        width * ((1.5 * a - 0.5 * b).exp() - (1.5 * b - 0.5 * a).exp()) / fall
    };
    cuts.windows(2).map(piece).sum()
}
