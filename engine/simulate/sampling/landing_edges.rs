//! Edges along z that light lands at: of apertures of the detector mask.

use beamlet_model::optics::Optics;

/// Strips of a round aperture whose ends count as edges.
const STRIPS: u32 = 4;

/// Edges of the apertures of the detector mask along z, in rows as seen from the source.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LandingEdges {
    /// Rows from a period to the next.
    pub(crate) period: f64,
    /// Row coordinates in some period.
    pub(crate) edges: Vec<f64>,
}

impl LandingEdges {
    /// The edges of optics; `None` where no aperture of the detector mask ends along z.
    pub(crate) fn of(optics: &Optics) -> Option<Self> {
        let strips = optics.detector_mask.as_ref()?.strips(optics.analyser, STRIPS)?;
        let row = |z: f64| optics.detector.row_at(strips.centre + z, optics.analyser);
        let edges = strips.strips.iter().flat_map(|strip| strip.z).map(row).collect();
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
        let edges = LandingEdges { period: 2.5, edges: vec![0.25, 0.75] };
        assert!(edges.crossed(0, [0.2, 0.3]) && edges.crossed(0, [0.5, 0.8]));
        assert!(!edges.crossed(0, [0.3, 0.7]) && !edges.crossed(0, [0.8, 1.0]));
        // 2.75 to 3.25, and 5.25.
        assert!(edges.crossed(2, [0.7, 0.8]) && edges.crossed(5, [0.2, 0.3]));
        assert!(!edges.crossed(2, [0.8, 0.95]) && !edges.crossed(-1, [0.0, 0.2]));
    }
}
