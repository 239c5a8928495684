//! What is known of illumination curves after a fit, whatever the method.

/// Results of many curves, one entry per curve. `NaN` where a method does not tell.
#[derive(Debug, Clone, Default)]
pub struct Curves {
    /// Height A of the peak above the background, intensity or counts.
    pub amplitude: Vec<f32>,
    /// Centre, in the unit of the offsets.
    pub centre: Vec<f32>,
    /// Standard deviation of the curve, in the unit of the offsets: sigma of eq. 1, or that of
    /// the method's own shape.
    pub width: Vec<f32>,
    /// Background b, intensity or counts. It may be negative.
    pub background: Vec<f32>,
    /// Root mean square of what the fit leaves, intensity or counts.
    pub residual: Vec<f32>,
    /// Relative one-sigma uncertainty of the area `amplitude * width`.
    pub area_sigma: Vec<f32>,
    /// One-sigma uncertainty of the centre.
    pub centre_sigma: Vec<f32>,
    /// One-sigma uncertainty of the width.
    pub width_sigma: Vec<f32>,
    /// Condition number of the normal equations, scaled to a unit diagonal.
    pub condition: Vec<f32>,
    /// Bits of [`super::flags`].
    pub flags: Vec<u32>,
}

impl Curves {
    /// Results of `count` curves, all unknown.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let unknown = || vec![f32::NAN; count];
        Self {
            amplitude: unknown(),
            centre: unknown(),
            width: unknown(),
            background: unknown(),
            residual: unknown(),
            area_sigma: unknown(),
            centre_sigma: unknown(),
            width_sigma: unknown(),
            condition: unknown(),
            flags: vec![0; count],
        }
    }

    /// Number of curves.
    #[must_use]
    pub fn len(&self) -> usize {
        self.flags.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.flags.is_empty()
    }
}
