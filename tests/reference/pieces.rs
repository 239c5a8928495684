//! Pieces of a plane, whose rays cross the same surfaces.

/// Light between two x of a plane, m on the plane of the rotation centre, with the logarithm of the light and the
/// displacement on the detector at both.
pub(super) struct Piece {
    pub x: [f64; 2],
    pub depth: [f64; 2],
    pub moved: [f64; 2],
    pub moved_z: f64,
}

/// Distribution function of the standard normal.
pub(super) fn cumulative(v: f64) -> f64 {
    0.5 * libm::erfc(-v * std::f64::consts::FRAC_1_SQRT_2)
}

impl Piece {
    /// Light at a share of the piece.
    pub(super) fn at(&self, share: f64) -> f64 {
        (-(self.depth[0] + share * (self.depth[1] - self.depth[0]))).exp()
    }

    /// Mean light between two shares of the piece, times their distance.
    pub(super) fn passed(&self, low: f64, high: f64) -> f64 {
        if high <= low {
            return 0.0;
        }
        let [a, b] =
            [low, high].map(|share| self.depth[0] + share * (self.depth[1] - self.depth[0]));
        let fall = b - a;
        let mean = if fall.abs() < 1e-4 {
            (-0.5 * (a + b)).exp() * (1.0 + fall * fall / 24.0)
        } else {
            ((-a).exp() - (-b).exp()) / fall
        };
        mean * (high - low)
    }
}
