//! Set-ups with thin masks, as scenes and for the propagation of fields by FFT.

use crate::reference::normal::SIGMA_PER_FWHM;
use crate::reference::waves::field::Grid;
use crate::reference::waves::light::Case;
use crate::reference::waves::setup::{Setup, Slits, Window};
use beamlet::cli_support::numbers::whole;
use beamlet::scene::Scene;

/// Set-up with thin masks: energy (keV), distances source to mask to detector (m), FWHM of the spot, aperture and
/// period of the sample mask, aperture of the detector mask, pixel (um), and light that the bars of both masks
/// transmit.
pub(crate) struct Masks {
    pub(crate) energy: f64,
    pub(crate) distances: [f64; 2],
    pub(crate) spot: f64,
    pub(crate) sample: [f64; 2],
    pub(crate) detector: [f64; 2],
    pub(crate) leaks: [f64; 2],
}

/// The set-up of the reference values.
pub(crate) const REFERENCE: Masks = Masks {
    energy: 30.0,
    distances: [1.2, 0.6],
    spot: 30.0,
    sample: [20.0, 100.0],
    detector: [30.0, 150.0],
    leaks: [0.0; 2],
};
/// Fringes wider than the blur.
pub(crate) const SMALL_SPOT: Masks = Masks {
    energy: 20.0,
    distances: [0.5, 0.5],
    spot: 5.0,
    sample: [15.0, 31.0],
    detector: [20.0, 62.0],
    leaks: [0.0; 2],
};
/// Short periods and a large spot.
pub(crate) const LARGE_SPOT: Masks = Masks {
    energy: 21.0,
    distances: [1.6, 0.4],
    spot: 70.0,
    sample: [12.0, 40.0],
    detector: [20.0, 50.0],
    leaks: [0.0; 2],
};
/// The same with apertures far apart.
pub(crate) const LONE: Masks =
    Masks { sample: [12.0, 400.0], detector: [20.0, 500.0], ..LARGE_SPOT };
/// Near neighbours, and bars that transmit.
pub(crate) const LEAKING: Masks = Masks {
    energy: 25.0,
    distances: [1.2, 0.6],
    spot: 30.0,
    sample: [20.0, 60.0],
    detector: [30.0, 90.0],
    leaks: [0.01, 0.02],
};

impl Masks {
    /// Scene of `columns` pixels whose sample lies `behind` the mask (m); `more`: further tables.
    pub(crate) fn scene(&self, columns: u32, behind: f64, offsets: &[f64], more: &str) -> Scene {
        Scene::from_toml(&self.text(columns, behind, offsets, more), ".").expect("a scene")
    }

    pub(crate) fn text(&self, columns: u32, behind: f64, offsets: &[f64], more: &str) -> String {
        let Self { energy, distances: [near, far], spot, sample, detector, leaks } = self;
        let steps: Vec<String> = offsets.iter().map(|it| format!("\"{} um\"", 1e6 * it)).collect();
        format!(
            "[source]\ndistance = \"{} m\"\nspot = \"{spot} um\"\nenergy = \"{energy} keV\"\n\
             [detector]\ndistance = \"{} m\"\npixels = [{columns}, 1]\npitch = \"{} um\"\n\
             [sample_mask]\ndistance = \"{near} m\"\naperture = \"{} um\"\nperiod = \"{} um\"\n\
             transmission = {:?}\n\
             [detector_mask]\ndistance = \"{1} m\"\naperture = \"{} um\"\ntransmission = {:?}\n\
             [scan]\nmask_offsets = [{}]\n{more}",
            near + behind,
            near + far,
            detector[1],
            sample[0],
            sample[1],
            leaks[0],
            detector[0],
            leaks[1],
            steps.join(", ")
        )
    }

    pub(crate) fn set_up(&self) -> Setup {
        Setup::new(self.energy, self.distances, 1e-6 * self.spot * SIGMA_PER_FWHM)
    }

    pub(crate) fn window(&self) -> Window {
        let [aperture, pixel] = self.detector.map(|it| 1e-6 * it);
        Window { aperture, pixel, leak: self.leaks[1] }
    }

    /// Light of the endless mask by FFT on a period, whose bars have a phase (rad).
    pub(crate) fn by_fft(&self, set_up: &Setup, offsets: &[f64], phase: f64) -> Vec<f64> {
        let [aperture, period] = self.sample.map(|it| 1e-6 * it);
        let slits = Slits::periodic(aperture, period, 0).leaking(self.leaks[0], phase);
        let case = Case { setup: set_up, slits: Some(&slits), sample: &[], window: self.window() };
        let spacing = 5e-9;
        let count = whole((period / spacing).round());
        case.curve(Grid { count, spacing, repeats: true }, offsets)
    }
}
