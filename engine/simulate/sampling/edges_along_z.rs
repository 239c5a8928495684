//! Edges of apertures along z.

use beamlet_model::optics::{Mask, Optics};

/// Strips of a round aperture whose ends count as edges.
const STRIPS: u32 = 4;

/// Edges of the apertures of a mask along z, in rows as seen from the source.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EdgesAlongZ {
    /// Rows from a period to the next.
    pub(crate) period: f64,
    /// Row coordinates in some period.
    pub(crate) edges: Vec<f64>,
}

impl EdgesAlongZ {
    /// The edges of the detector mask, where its apertures end along z: light lands at them.
    pub(crate) fn landing(optics: &Optics) -> Option<Self> {
        Self::of(optics, optics.detector_mask.as_ref()?, optics.analyser)
    }

    /// The edges of a mask seen in the plane at `plane`, m there.
    fn of(optics: &Optics, mask: &Mask, plane: f64) -> Option<Self> {
        let strips = mask.strips(plane, STRIPS)?;
        let row = |z: f64| optics.detector.row_at(strips.centre + z, plane);
        let mut edges: Vec<f64> = strips.strips.iter().flat_map(|strip| strip.z).map(row).collect();
        edges.sort_unstable_by(f64::total_cmp);
        edges.dedup();
        let period = row(0.0) - row(strips.period);
        Some(Self { period, edges })
    }

    /// True if an edge lies between two places, rows from the upper end of a row.
    pub(super) fn crossed(&self, row: i64, [low, high]: [f32; 2]) -> bool {
        let [low, high] = [low, high].map(|at| row as f64 + f64::from(at));
        self.edges.iter().any(|edge| {
            let period = ((low - edge) / self.period).ceil();
            edge + period * self.period <= high
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_repeat_over_the_rows() {
        let edges = EdgesAlongZ { period: 2.5, edges: vec![0.25, 0.75] };
        assert!(edges.crossed(0, [0.2, 0.3]) && edges.crossed(0, [0.5, 0.8]));
        assert!(!edges.crossed(0, [0.3, 0.7]) && !edges.crossed(0, [0.8, 1.0]));
        // 2.75 to 3.25, and 5.25.
        assert!(edges.crossed(2, [0.7, 0.8]) && edges.crossed(5, [0.2, 0.3]));
        assert!(!edges.crossed(2, [0.8, 0.95]) && !edges.crossed(-1, [0.0, 0.2]));
    }
}
