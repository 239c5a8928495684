//! Where a spectrum is cut: at absorption edges that matter to some probe.

use super::probes::Probes;
use super::{Spectrum, TOLERANCE};
use beamlet_core::Result;

/// Ranges of rows between edges, in order, that cover the spectrum.
pub(super) fn segments(
    spectrum: &Spectrum,
    probes: &Probes<'_>,
) -> Result<Vec<std::ops::Range<usize>>> {
    let energies = &spectrum.energies_kev;
    let total = spectrum.total();
    let mut segments = Vec::new();
    let mut start = 0;
    for (edge, medium) in probes.edges()? {
        let at = energies.partition_point(|energy| *energy < edge);
        if at <= start || at >= energies.len() {
            continue;
        }
        let below: f64 = spectrum.weights[..at].iter().sum();
        let least = below.min(total - below) / total;
        // A jump misplaced by one node costs at most the lesser side's weight times its height.
        if least * probes.jump(at, medium) > TOLERANCE / 8.0 {
            segments.push(start..at);
            start = at;
        }
    }
    segments.push(start..energies.len());
    Ok(segments)
}
