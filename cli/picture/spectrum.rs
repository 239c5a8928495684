//! A spectrum before and after its filters.

use super::axes::{Axes, BELOW, LEFT};
use super::colour::{SET, SMALL};
use super::drawing::{Anchor, Area, Drawing, INK, Paint};
use super::text::short;
use beamlet::spectrum::Spectrum;

/// Bins of the picture.
const BINS: usize = 240;

/// Photons per keV in even bins from 0 to `high` keV. The photons of a row lie between half way to its
/// neighbours, so that rows may have any distance.
fn density(spectrum: &Spectrum, high: f64) -> Vec<f64> {
    let energies = &spectrum.energies_kev;
    let width = high / BINS as f64;
    let middle = |index: usize| match energies.len() {
        1 => energies[0] + (index as f64 - 0.5) * width,
        _ if index == 0 => (3.0 * energies[0] - energies[1]) / 2.0,
        rows if index == rows => (3.0 * energies[rows - 1] - energies[rows - 2]) / 2.0,
        _ => (energies[index - 1] + energies[index]) / 2.0,
    };
    let mut bins = vec![0.0; BINS];
    for (index, weight) in spectrum.weights.iter().enumerate() {
        let (low, top) = (middle(index), middle(index + 1));
        let share = weight / (top - low) / width;
        for (bin, value) in bins.iter_mut().enumerate() {
            let (left, right) = (bin as f64 * width, (bin + 1) as f64 * width);
            *value += share * (right.min(top) - left.max(low)).max(0.0);
        }
    }
    bins
}

/// Draws photons per keV; each spectrum over its own highest bin, as filters take most away.
pub(crate) fn draw(title: &str, before: &Spectrum, after: &Spectrum) -> Drawing {
    let area = Area::new(LEFT + 14.0, 62.0, 700.0, 330.0);
    let mut drawing = Drawing::new(area.right() + 24.0, area.bottom() + BELOW + 8.0);
    drawing.text([area.left, 28.0], title, 17.0, INK, Anchor::Start);
    let high = before.energies_kev.last().copied().unwrap_or(1.0) * 1.02;
    let axes = Axes { area, x: [0.0, high], y: [0.0, 1.05], ..Axes::default() };
    axes.grid(&mut drawing);
    let mut left = area.left;
    let passed: f64 = 100.0 * after.total() / before.total();
    let passed =
        format!(", {} % of the photons", short(format!("{passed:.2e}").parse().unwrap_or(passed)));
    for ((name, share, spectrum), colour) in
        [("before filters", "", before), ("after filters", &passed, after)].into_iter().zip(SET)
    {
        let bins = density(spectrum, high);
        let most = bins.iter().fold(f64::MIN_POSITIVE, |most, value| value.max(most));
        let point =
            |(bin, value): (usize, &f64)| [(bin as f64 + 0.5) * high / BINS as f64, value / most];
        axes.curve(&mut drawing, bins.iter().enumerate().map(point), Paint::line(colour, 1.6));
        let mean = spectrum.mean_energy();
        let marker = [[mean, 0.0], [mean, 1.05]];
        axes.curve(&mut drawing, marker.into_iter(), Paint::dashed(colour, 1.0, 4.0));
        drawing.line([left, 46.0], [left + 22.0, 46.0], Paint::line(colour, 2.0));
        let label = format!("{name}: mean {mean:.1} keV{share}");
        drawing.text([left + 28.0, 50.0], label, SMALL, INK, Anchor::Start);
        left += 330.0;
    }
    axes.frame(&mut drawing, "photon energy [keV]", "photons per keV, highest = 1");
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_keep_the_photons_whatever_the_rows() {
        let energies_kev = vec![10.0, 10.5, 10.6, 11.0, 14.0, 30.0];
        let spectrum = Spectrum { energies_kev, weights: vec![1.0, 2.0, 50.0, 2.0, 3.0, 4.0] };
        let bins = density(&spectrum, 60.0);
        let sum: f64 = bins.iter().sum::<f64>() * 60.0 / BINS as f64;
        assert!((sum - 62.0).abs() < 1e-9, "{sum}");
        let line = Spectrum { energies_kev: vec![20.0], weights: vec![7.0] };
        let sum: f64 = density(&line, 60.0).iter().sum::<f64>() * 60.0 / BINS as f64;
        assert!((sum - 7.0).abs() < 1e-9, "{sum}");
    }
}
