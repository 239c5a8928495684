//! Excess noise of an integrating detector: photons of different signal.

use super::nodes::detected;
use super::response::{response, responses};
use crate::scene::{Beam, Detector, DetectorMode, Scene};
use beamlet_core::{Error, Result};

/// Excess noise factor F of the signal of an open pixel: its variance is F times the variance of the same
/// number of photons of equal signal. `rows` are the energies (keV) of the beam and the signal of each, photons
/// times [`response`] on any scale.
///
/// With r the signal of a detected photon, `F = <r^2> / <r>^2 / A`, where A is the Swank factor of
/// the light that a photon of one energy makes. A counting detector has F = 1.
#[must_use]
pub fn excess_noise(detector: &Detector, rows: &[[f64; 2]]) -> f64 {
    let swank = detector.counts.as_ref().map_or(1.0, |counts| counts.swank);
    if detector.mode != DetectorMode::Integrating {
        return 1.0;
    }
    // Shares of the signal over the energy are shares of the detected photons.
    let moment = |power: i32| rows.iter().map(|[e, w]| w * e.powi(power - 1)).sum::<f64>();
    let spread = moment(2) * moment(0) / (moment(1) * moment(1));
    spread.max(1.0) / swank
}

/// Energies (keV) of all rows of the spectrum behind filters and path, and the signal of each in an open pixel on any
/// scale.
///
/// # Errors
/// As [`nodes`](super::nodes); [`Error::Scene`] where no photon makes a signal.
pub fn open_beam(scene: &Scene) -> Result<Vec<[f64; 2]>> {
    let energy = match &scene.source.beam {
        Beam::Energy(energy) => *energy,
        Beam::Spectrum(spec) => {
            let rows = detected(scene, spec, |energies| responses(scene, energies))?;
            return Ok(rows.energies_kev.into_iter().zip(rows.weights).map(Into::into).collect());
        }
    };
    let signal = response(scene, energy)?;
    if signal > 0.0 {
        return Ok(vec![[energy, 1.0]]);
    }
    Err(Error::scene(
        "detector",
        format!("no signal from photons of {energy} keV"),
        "thresholds around the energy of the beam, and an absorber that absorbs",
    ))
}

/// Variance of a detector number over its mean above the dark: the gain times the excess
/// noise factor of the open beam. 1 without counts.
///
/// # Errors
/// As [`open_beam`].
pub fn variance_per_value(scene: &Scene) -> Result<f64> {
    let gain = scene.detector.counts.map_or(1.0, |counts| counts.gain);
    Ok(gain * excess_noise(&scene.detector, &open_beam(scene)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Counts;

    #[test]
    fn photons_of_two_energies_make_the_excess_of_their_moments() {
        let mut detector = Detector::new(1.0, [1, 1], [1e-4; 2]);
        // Equal numbers of photons of 20 and of 60 keV: signals 1 and 3 around 2.
        let nodes = [[20.0, 0.25], [60.0, 0.75]];
        assert!((excess_noise(&detector, &nodes) - 1.0).abs() < 1e-15);
        detector.mode = DetectorMode::Integrating;
        assert!((excess_noise(&detector, &nodes) - 5.0 / 4.0).abs() < 1e-12);
        detector.counts = Some(Counts { swank: 0.8, ..Counts::of_photons(10.0) });
        assert!((excess_noise(&detector, &nodes) - 5.0 / 4.0 / 0.8).abs() < 1e-12);
        assert!((excess_noise(&detector, &[[30.0, 1.0]]) - 1.0 / 0.8).abs() < 1e-12);
    }

    /// Moments over all rows of the spectrum that arrives, however few energy nodes serve the sample.
    #[test]
    fn excess_is_that_of_all_rows_behind_filters_and_path() {
        let scene = |nodes: &str, behind: &str| {
            let text = format!(
                "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nspectrum = {{ anode = \"tungsten\", \
                 kvp = \"60 kV\", filters = [{{ material = \"Al\", thickness = \"1 mm\" }}]{nodes} }}\n\
                 [detector]\ndistance = \"2 m\"\npixels = [1, 1]\npitch = \"1 mm\"\nphotons = 10\n\
                 gain = 3\nmode = \"integrating\"\n{behind}"
            );
            Scene::from_toml(&text, ".").unwrap()
        };
        let mut found = Vec::new();
        for behind in ["", "[surroundings]\npath_material = \"water\"\n"] {
            let all = scene("", behind);
            let Beam::Spectrum(spec) = &all.source.beam else { panic!("one energy") };
            let rows = crate::spectrum::Spectrum::after_filters(&all, spec).unwrap();
            let moment = |power: i32| -> f64 {
                rows.energies_kev.iter().zip(&rows.weights).map(|(e, n)| n * e.powi(power)).sum()
            };
            let expected = 3.0 * moment(2) * moment(0) / moment(1).powi(2);
            for nodes in ["", ", nodes = 1", ", nodes = 3"] {
                let got = variance_per_value(&scene(nodes, behind)).unwrap();
                assert!((got / expected - 1.0).abs() < 1e-9, "{nodes} {behind}: {got} {expected}");
            }
            found.push(expected / 3.0);
        }
        // A tube at 60 kV; water hardens it.
        assert!(found[0] > 1.05 && found[1] > 1.0 && found[1] < found[0] - 0.01, "{found:?}");
    }
}
