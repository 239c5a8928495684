//! Closed forms: flat illumination curves of thin masks, deflections of simple bodies.

use super::normal::{cumulative, density};

/// Second integral of the Gaussian blur of standard deviation `blur`; max(v, 0) for a point.
fn ramp(v: f64, blur: f64) -> f64 {
    if blur > 0.0 { v * cumulative(v / blur) + blur * density(v / blur) } else { v.max(0.0) }
}

/// Overlap of boxes of widths `w1` and `w2` displaced by `x` and blurred, as a length.
pub fn blurred_overlap(x: f64, w1: f64, w2: f64, blur: f64) -> f64 {
    let (far, near) = (0.5 * (w1 + w2), 0.5 * (w1 - w2));
    ramp(x + far, blur) - ramp(x + near, blur) - ramp(x - near, blur) + ramp(x - far, blur)
}

/// Two thin masks whose projected periods are one pixel.
#[derive(Debug, Clone, Copy)]
pub struct ThinMasks {
    /// Mask magnification.
    pub magnification: f64,
    /// Aperture and period of the sample mask in its plane, m.
    pub sample: [f64; 2],
    /// Aperture and period of the detector mask, m.
    pub detector: [f64; 2],
    /// Standard deviation of the focal spot, m.
    pub sigma: f64,
    /// Transmission of the bars of the sample and the detector mask.
    pub leak: [f64; 2],
}

impl ThinMasks {
    /// Intensity at a mask offset.
    pub fn intensity(&self, offset: f64) -> f64 {
        let ([a1, p1], [a2, p2], [e1, e2]) = (self.sample, self.detector, self.leak);
        let blur = (self.magnification - 1.0) * self.sigma;
        let open: f64 = (-4..=4)
            .map(|k| {
                let x = self.magnification * (offset + f64::from(k) * p1);
                blurred_overlap(x, self.magnification * a1, a2, blur) / p2
            })
            .sum();
        (1.0 - e1) * (1.0 - e2) * open
            + e2 * (1.0 - e1) * a1 / p1
            + e1 * (1.0 - e2) * a2 / p2
            + e1 * e2
    }
}

/// Box bars seen at a slope as hard edges and a blur: the edge of an aperture lets light
/// through as e^(-mu way), the way growing linearly over the shadow's width. Gives the aperture
/// with the same light, bars leaking e = e^(-mu t), and the variance of the edge's place.
pub fn bars_at_slope(aperture: f64, mu: f64, thickness: f64, slope: f64) -> [f64; 2] {
    let (depth, shadow) = (mu * thickness, thickness * slope.abs());
    let leak = (-depth).exp();
    let narrowing = shadow * ((1.0 + leak) / (1.0 - leak) - 2.0 / depth);
    let variance = (shadow / depth).powi(2) - shadow * shadow * leak / (1.0 - leak).powi(2);
    [aperture - narrowing, variance]
}

/// Deflection by a cylinder at `x` from its axis, ray along y.
pub fn cylinder_deflection(delta: f64, radius: f64, x: f64) -> f64 {
    2.0 * delta * x / (radius * radius - x * x).sqrt()
}

/// Grazing angle below which a face reflects totally.
pub fn critical_angle(delta: f64) -> f64 {
    (2.0 * delta - delta * delta).sqrt().asin()
}
