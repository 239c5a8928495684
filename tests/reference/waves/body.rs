//! Bodies that are the same at all z: path lengths along y over x.

/// Outline of a body in the plane of the sample, m.
#[derive(Debug, Clone, Copy)]
pub enum Outline {
    /// Cylinder along z.
    Cylinder { centre: f64, radius: f64 },
    /// Slab with faces across x.
    Slab { low: f64, high: f64, thickness: f64 },
    /// Wedge whose thickness grows from 0 at `low` by `slope` per length up to `high`.
    Wedge { low: f64, high: f64, slope: f64 },
}

/// A body of one material.
#[derive(Debug, Clone, Copy)]
pub struct Body {
    pub outline: Outline,
    /// Decrement of the refractive index, relative to the host.
    pub delta: f64,
    /// Linear attenuation coefficient relative to the host, 1/m.
    pub mu: f64,
}

impl Outline {
    /// Ends along x.
    pub fn ends(&self) -> [f64; 2] {
        match *self {
            Self::Cylinder { centre, radius } => [centre - radius, centre + radius],
            Self::Slab { low, high, .. } | Self::Wedge { low, high, .. } => [low, high],
        }
    }

    /// Path length along y (m) and its derivative, between the ends.
    pub fn path(&self, x: f64) -> [f64; 2] {
        match *self {
            Self::Cylinder { centre, radius } => {
                let from = x - centre;
                let half = ((radius - from.abs()).max(0.0) * (radius + from.abs())).sqrt();
                [2.0 * half, -2.0 * from / half]
            }
            Self::Slab { thickness, .. } => [thickness, 0.0],
            Self::Wedge { low, slope, .. } => [slope * (x - low), slope],
        }
    }
}

/// Slice of a sphere at a height z above its centre: a line along x sees a cylinder.
pub fn slice(centre: f64, radius: f64, height: f64) -> Option<Outline> {
    let square = radius * radius - height * height;
    (square > 0.0).then(|| Outline::Cylinder { centre, radius: square.sqrt() })
}

/// Parallel cylinders of one radius with uniform random centres between `low` and `high`.
pub fn stack(count: u32, radius: f64, [low, high]: [f64; 2], seed: u64) -> Vec<Outline> {
    let mut draws = super::super::draws::Draws(seed);
    (0..count).map(|_| Outline::Cylinder { centre: draws.between(low, high), radius }).collect()
}

/// Bodies of one material.
pub fn bodies(outlines: &[Outline], delta: f64, mu: f64) -> Vec<Body> {
    outlines.iter().map(|&outline| Body { outline, delta, mu }).collect()
}
