//! Options of a retrieval, and its control.

use super::background::Background;
use super::correct::Corrections;
use super::diagnosis::Region;
use super::method::{Method, different_offsets};
use super::planar::{self, Aperture, Lattice};
use super::value_noise::Weights;
use beamlet_core::{Error, Result, setters};
use beamlet_model::scene::Scene;
use ndarray::Array3;
use std::ops::Range;

/// How to retrieve. `RetrieveOptions::default()` takes method and background from the scene, and fits without
/// weights; what differs from it is set in a chain.
///
/// ```
/// use beamlet::retrieve::{Method, RetrieveOptions, Weights};
///
/// let options =
///     RetrieveOptions::default().with_method(Method::Beamlet).with_weights(Weights::Poisson);
/// assert_eq!(options.method, Some(Method::Beamlet));
/// ```
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct RetrieveOptions {
    /// The estimator; `None`: by the scene ([`RetrieveOptions::resolved`]).
    pub method: Option<Method>,
    /// Background of the curves (methods `gaussian` and `exact-curve`). `None`: the light that the masks of the scene
    /// leak, where they are known; else free.
    pub background: Option<Background>,
    /// Weights of the values (methods `gaussian`, `exact-curve` and `beamlet`).
    pub weights: Weights,
    /// Value of one count, where the values are counts: uncertainties of weighted fits and of
    /// closed forms come from it. `None`: values are intensities.
    pub gain: Option<f64>,
    /// True if the gain is a guess: uncertainties follow it, and no warning compares values with it.
    pub gain_assumed: bool,
    /// Standard deviation of a value without light, for uncertainties and weights of counts. >= 0.
    pub read_noise: f64,
    /// Values from here on are left out and flagged.
    pub saturation: Option<f32>,
    /// Pixels of the frames with nothing in the beam: transmission, refraction, dose and drift there go
    /// to the record.
    pub empty_beam: Option<Region>,
    /// Corrections by these pixels or, where none are named, by both sides of the images of a view where
    /// they look empty.
    pub correct: Corrections,
    /// Images of the phase are made, too: refraction angles integrated along the rows.
    pub phase: bool,
    /// Lattice of the beamlets of a sample mask alone, as it is on the detector, for retrieval in two
    /// directions. `None`: the lattice of the scene where its apertures have ends along z, else slits.
    pub lattice: Option<Lattice>,
    /// Aperture of the sample mask in two directions, as it is projected on the detector or, with steps, on the
    /// detector mask (methods `beamlet` and `exact-curve`).
    pub aperture: Option<Aperture>,
    /// Aperture of the detector mask, for `exact-curve` in two directions.
    pub detector_aperture: Option<Aperture>,
    /// Offsets of the sample mask along z, m, one for each of the scene's along x; empty without steps along z.
    pub offsets_z: Vec<f64>,
}

impl RetrieveOptions {
    setters! {
        /// Chooses the estimator.
        with_method(method: impl Into<Option<Method>>);
        /// Chooses the background of the curves.
        with_background(background: impl Into<Option<Background>>);
        /// Chooses the weights of the values.
        with_weights(weights: Weights);
        /// Declares values to be counts, of which one is `gain`.
        with_gain(gain: impl Into<Option<f64>>);
        /// Declares the gain to be a guess.
        with_gain_assumed(gain_assumed: bool);
        /// Sets the standard deviation of noise besides photon noise.
        with_read_noise(read_noise: f64);
        /// Leaves out and flags values from here on.
        with_saturation(saturation: impl Into<Option<f32>>);
        /// Chooses corrections by pixels with nothing in the beam.
        with_correct(correct: Corrections);
        /// Names pixels with nothing in the beam.
        with_empty_beam(empty_beam: impl Into<Option<Region>>);
        /// Makes images of the phase, too.
        with_phase(phase: bool);
        /// Names the lattice of beamlets on the detector.
        with_lattice(lattice: impl Into<Option<Lattice>>);
        /// Names the projected aperture of the sample mask in two directions.
        with_aperture(aperture: impl Into<Option<Aperture>>);
        /// Names the aperture of the detector mask in two directions.
        with_detector_aperture(detector_aperture: impl Into<Option<Aperture>>);
        /// Sets the offsets of the sample mask along z.
        with_offsets_z(offsets_z: Vec<f64>);
    }

    /// The options with the method and the background of a scene where none is chosen: `beamlet` for a sample mask
    /// alone; `exact-curve` where the scene knows the curve of its masks; else `gaussian`.
    ///
    /// # Errors
    /// [`Error::Argument`] for a background that the method does not have; errors of the materials of the masks and of
    /// the beam.
    pub fn resolved(&self, scene: &Scene) -> Result<Self> {
        let method = self.method.unwrap_or_else(|| self.suited_method(scene));
        let background = match self.background {
            Some(background) => background,
            None => Background::of(method, scene)?,
        };
        background.check(method)?;
        Ok(Self { method: Some(method), background: Some(background), ..self.clone() })
    }

    /// The estimator for the masks of a scene.
    fn suited_method(&self, scene: &Scene) -> Method {
        let z = &scene.scan.mask_offsets_z;
        let in_plane = !self.offsets_z.is_empty() || different_offsets(z) > 1;
        let is_list = scene.masks().any(|(_, mask)| mask.list_key().is_some());
        let is_alone = scene.sample_mask.is_some() && scene.detector_mask.is_none();
        let knows_curve = || match in_plane {
            true => planar::knows_curve(scene, self),
            false => Method::ExactCurve
                .check(&scene.of_groups(), &scene.of_groups().scan.mask_offsets)
                .is_ok(),
        };
        if is_list || (is_alone && in_plane) {
            return Method::ExactCurve;
        }
        if is_alone {
            let on_lattice = self.lattice.is_some() || scene.has_heights();
            let is_known = !on_lattice || planar::aperture(scene, self).is_some();
            return if is_known { Method::Beamlet } else { Method::Gaussian };
        }
        if knows_curve() { Method::ExactCurve } else { Method::Gaussian }
    }

    /// The method of resolved options.
    #[must_use]
    pub fn method(&self) -> Method {
        self.method.unwrap_or_default()
    }

    /// The background of resolved options.
    #[must_use]
    pub fn background(&self) -> Background {
        self.background.unwrap_or(Background::Free)
    }

    /// Refuses weights that the method does not have, and noise and saturation that cannot be.
    ///
    /// # Errors
    /// [`Error::Argument`].
    pub(super) fn check_values(&self) -> Result<()> {
        let method = self.method();
        if self.weights == Weights::Poisson && !method.weighs() {
            let allowed = "poisson with gaussian, exact-curve or beamlet";
            return Err(Error::argument("weights", format!("poisson with {method}"), allowed));
        }
        if let Some(gain) = self.gain.filter(|gain| !(gain.is_finite() && *gain > 0.0)) {
            return Err(Error::argument("gain", gain.to_string(), "a finite number above 0"));
        }
        if !(self.read_noise.is_finite() && self.read_noise >= 0.0) {
            let found = format!("{}", self.read_noise);
            return Err(Error::argument("read_noise", found, "a finite number of 0 or more"));
        }
        self.check_saturation()
    }

    /// # Errors
    /// [`Error::Argument`] for a saturation that is no finite number above 0.
    pub(super) fn check_saturation(&self) -> Result<()> {
        match self.saturation.filter(|value| !(value.is_finite() && *value > 0.0)) {
            Some(value) => {
                Err(Error::argument("saturation", value.to_string(), "a finite number above 0"))
            }
            None => Ok(()),
        }
    }
}

/// Reads rows of a stack, `[step][row][column]`.
pub type ReadRows<'a> = dyn FnMut(Range<u32>) -> Result<Array3<f32>> + 'a;
