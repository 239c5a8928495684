//! Pixel positions: the only place that computes them.

/// The plane of pixels that takes the light, across the optical axis. Column 0 lies at -x, row 0
/// on top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectorPlane {
    /// Source to detector, m.
    pub distance: f64,
    /// Columns and rows.
    pub pixels: [u32; 2],
    /// Pixel pitch along x and z, m.
    pub pitch: [f64; 2],
}

impl DetectorPlane {
    /// Columns or rows from the edge to the optical axis.
    pub fn half(&self, axis: usize) -> f64 {
        f64::from(self.pixels[axis]) / 2.0
    }

    /// Width (0) or height (1) of all pixels, m.
    pub fn extent(&self, axis: usize) -> f64 {
        self.pitch[axis] * f64::from(self.pixels[axis])
    }

    /// Pitch seen from the source in the plane at `plane`, m.
    pub fn pitch_at(&self, axis: usize, plane: f64) -> f64 {
        self.pitch[axis] * plane / self.distance
    }

    /// Columns that a metre across at `distance` covers as seen from the source.
    pub fn columns_per_metre(&self, distance: f64) -> f64 {
        self.distance / distance / self.pitch[0]
    }

    /// dz/dy of a row's height as seen from the source: the difference of a row and the one below.
    pub fn row_slope(&self) -> f64 {
        self.pitch[1] / self.distance
    }

    /// dz/dy of the straight line from the source to a row coordinate (0 on top).
    pub fn slope_of_row(&self, row: f64) -> f64 {
        (self.half(1) - row) * self.pitch[1] / self.distance
    }

    /// Row coordinate of the straight line from the source through `z` at `distance`, m.
    pub fn row_at(&self, z: f64, distance: f64) -> f64 {
        self.half(1) - z * self.distance / distance / self.pitch[1]
    }

    /// dx/dy of the straight line from the source to the centre of a column.
    pub fn slope_of_column(&self, column: i64) -> f64 {
        (column as f64 + 0.5 - self.half(0)) * self.pitch[0] / self.distance
    }

    /// Column coordinate of the straight line from the source through `x` at `distance`, m.
    pub fn column_at(&self, x: f64, distance: f64) -> f64 {
        x * self.distance / distance / self.pitch[0] + self.half(0)
    }

    /// The column that a straight line from the source reaches, and the distance from that
    /// column's centre as seen in the plane at `plane`, m.
    pub fn column_of_slope(&self, slope: f64, plane: f64) -> [f64; 2] {
        let landing = slope * self.distance / self.pitch[0] + self.half(0);
        let column = landing.floor();
        [column, (landing - column - 0.5) * self.pitch[0] * plane / self.distance]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_and_rows_are_where_their_slopes_lead() {
        let plane = DetectorPlane { distance: 1.8, pixels: [15, 8], pitch: [150e-6, 100e-6] };
        for column in [-2_i64, 0, 7, 20] {
            let slope = plane.slope_of_column(column);
            let [found, off] = plane.column_of_slope(slope, 1.2);
            assert!((found - column as f64).abs() < 0.5 && off.abs() < 1e-15, "{column}: {off}");
            assert!((plane.column_at(1.3 * slope, 1.3) - column as f64 - 0.5).abs() < 1e-9);
        }
        let slope = plane.slope_of_row(2.5);
        assert!(slope > 0.0 && (plane.row_at(0.7 * slope, 0.7) - 2.5).abs() < 1e-9);
    }
}
