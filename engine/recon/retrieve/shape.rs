//! Curves of slits that follow from the masks and the spot.

use super::background::Background;
use super::background_term::BackgroundTerm;
use super::mask_curve::MaskCurve;
use super::model::{Model, of_slits};
use beamlet_core::Result;
use beamlet_model::optics::{self, Optics};
use beamlet_model::scene::Scene;
use beamlet_model::spectrum;
use beamlet_model::spot::deviation;
use std::sync::Arc;

/// Standard deviations of a curve from one to the next from which on a background lies between them.
const SEPARATE: f64 = 6.0;

/// Shape of a curve by the masks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CurveGeometry {
    /// Curve of both masks; `None` with fewer.
    masks: Option<Arc<MaskCurve>>,
    /// Widths of the narrowest apertures of sample and detector mask on the analyser, m.
    pub(crate) projected: [f64; 2],
    /// Blur of the focal spot on the analyser, standard deviation, m.
    pub(crate) blur: f64,
    /// Analyser over sample mask distance.
    pub(super) magnification: f64,
    /// Period of the sample mask in its plane, m; infinite without.
    pub(crate) period: f64,
    /// Background of the curves.
    pub(super) background: BackgroundTerm,
    /// Light that the masks leak, per area of the curve, 1/m.
    pub(super) leak: f64,
}

impl CurveGeometry {
    /// Geometry of the curves of a scene with both masks; zero widths without.
    ///
    /// # Errors
    /// Errors of the materials of tapered masks and of the beam.
    pub(super) fn of(scene: &Scene) -> Result<Self> {
        let magnification = scene.magnification();
        let optics = match scene.masks().any(|(_, mask)| mask.taper != 0.0) {
            true => {
                let nodes = spectrum::nodes(scene)?;
                Optics::of(&*optics::straightened(scene, (&nodes.energies, &nodes.weights))?)
            }
            false => Optics::of(scene),
        };
        Ok(Self {
            masks: MaskCurve::of(&optics).map(Arc::new),
            projected: optics.overlapping_apertures(),
            blur: (magnification - 1.0) * deviation(scene.source.spot.fwhm()[0]),
            magnification,
            period: optics.curve_period(),
            background: BackgroundTerm::Free,
            leak: 0.0,
        })
    }

    /// The geometry with a background of the curves of a scene.
    ///
    /// # Errors
    /// As [`Background::term`].
    pub(super) fn with_background(mut self, background: Background, scene: &Scene) -> Result<Self> {
        self.background = background.term(scene, self.period)?;
        let leak = match self.background {
            _ if self.masks.is_none() => return Ok(self),
            BackgroundTerm::PerArea(_) => self.background,
            BackgroundTerm::Free | BackgroundTerm::Value(_) => {
                Background::Leak.term(scene, self.period)?
            }
        };
        if let BackgroundTerm::PerArea(leak) = leak {
            self.leak = leak;
        }
        Ok(self)
    }

    /// Curve of both masks; `None` with fewer.
    pub(super) const fn masks(&self) -> Option<&Arc<MaskCurve>> {
        self.masks.as_ref()
    }

    /// The curve over mask offsets: the slits behind a blur, or a trapezoid without blur; `None` without two masks.
    pub(super) fn model(&self) -> Option<Model> {
        let masks = self.masks.clone()?;
        Some(match self.blur > 0.0 {
            true => Model::Masks(masks),
            false => Model::Trapezoid { top: self.half_top() / self.magnification },
        })
    }

    /// Variance of the blur of the curve by the geometry, m^2 of mask offset.
    pub(super) fn spread(&self) -> f64 {
        match &self.masks {
            Some(masks) if self.blur > 0.0 => masks.spread(),
            _ => {
                let [base, top] = [self.half_base(), self.half_top()];
                (base * base - top * top) / (6.0 * self.magnification * self.magnification)
            }
        }
    }

    /// True if light of neighbouring apertures leaves room for a background between the curves.
    pub(super) fn is_separate(&self) -> bool {
        self.width().is_none_or(|width| self.period >= SEPARATE * width)
    }

    /// Standard deviation of the curve, m of mask offset; `None` without two masks.
    pub(super) fn width(&self) -> Option<f64> {
        Some(self.model()?.width(&of_slits([1.0, 0.0, self.spread(), 0.0])))
    }

    /// Half the base of the curve without blur, m on the analyser.
    pub(super) fn half_base(&self) -> f64 {
        (self.projected[0] + self.projected[1]) / 2.0
    }

    /// Distance of the centre of a curve from the middle of two offsets `apart` from one another, m of mask offset,
    /// within which both have light of this curve alone.
    pub(super) fn reach_of_two(&self, apart: f64) -> f64 {
        let lit = (self.half_base() + LIT * self.blur) / self.magnification;
        (lit - 0.5 * apart).min(0.5 * (self.period - apart)).max(0.0)
    }

    /// Half its top, m on the analyser.
    pub(super) fn half_top(&self) -> f64 {
        (self.projected[0] - self.projected[1]).abs() / 2.0
    }
}

/// Deviations of the blur beyond the base of a curve where it still has light.
pub(super) const LIT: f64 = 3.0;
