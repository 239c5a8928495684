//! Gaussian blobs, whose integrals along lines and whose deflections of light are closed forms.

use std::f64::consts::TAU;

/// `peak` exp(−r²/2σ²) about `centre`, m.
#[derive(Debug, Clone, Copy)]
pub struct Blob {
    pub centre: [f64; 3],
    pub sigma: f64,
    pub peak: f64,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Blob {
    pub fn at(&self, point: [f64; 3]) -> f64 {
        let to = [0, 1, 2].map(|axis| point[axis] - self.centre[axis]);
        self.peak * (-dot(to, to) / (2.0 * self.sigma * self.sigma)).exp()
    }

    /// Turned by an angle about z, then moved along x.
    pub fn placed(&self, angle: f64, along_x: f64) -> Self {
        let ([x, y, z], (sin, cos)) = (self.centre, angle.sin_cos());
        Self { centre: [x * cos - y * sin + along_x, x * sin + y * cos, z], ..*self }
    }

    /// Integral along a line, and the deflection of light along it where the blob is a decrement of
    /// the refractive index: minus the gradient of the integral as the line moves at fixed direction.
    pub fn line(&self, from: [f64; 3], direction: [f64; 3]) -> (f64, [f64; 3]) {
        let to = [0, 1, 2].map(|axis| self.centre[axis] - from[axis]);
        let along = dot(to, direction) / dot(direction, direction);
        let across = [0, 1, 2].map(|axis| to[axis] - along * direction[axis]);
        let square = self.sigma * self.sigma;
        let integral =
            self.peak * self.sigma * TAU.sqrt() * (-dot(across, across) / (2.0 * square)).exp();
        (integral, across.map(|w| -integral * w / square))
    }

    /// Point of a line that is next to the centre, where the mean of the blob along it lies, too.
    pub fn nearest(&self, from: [f64; 3], direction: [f64; 3]) -> [f64; 3] {
        let to = [0, 1, 2].map(|axis| self.centre[axis] - from[axis]);
        let along = dot(to, direction) / dot(direction, direction);
        [0, 1, 2].map(|axis| from[axis] + along * direction[axis])
    }
}
