//! Apertures of a mask as waves see them: edges under the angle of the rays, and amplitude of the bars.

use beamlet_core::{Error, Result};
use beamlet_interface::{EDGE_FLATNESS, EDGE_SKEWNESS};
use beamlet_model::optics::{Mask, MaskShape, Optics};
use beamlet_model::scene::Scene;

/// Leaks below this share of the tolerance are left out.
const LEFT_OUT: f64 = 0.1;

/// A mask at an energy, in the plane of the sample mask. The bars of a thick mask have one soft edge, at its mean
/// place and with its variance (docs/physics.md, "Thick bars and off-axis shadow").
#[derive(Debug, Clone, Copy)]
pub(super) struct Bars {
    /// Ends of an aperture from the centre of its period, m.
    pub ends: [f64; 2],
    /// Period, m.
    pub period: f64,
    /// Light that the bars transmit.
    pub leak: f64,
    /// Narrowing of an aperture at each edge, m per |dx/dy|.
    side: f64,
    /// Variance of an edge, m² per squared dx/dy.
    variance: f64,
    /// Distance of the plane from the source, m.
    plane: f64,
    /// Shadow of a bar, m per |dx/dy|.
    shadow: f64,
    name: &'static str,
}

impl Bars {
    /// The bars of a mask at an energy, keV.
    ///
    /// # Errors
    /// As [`MaskShape::of`].
    pub(super) fn of(scene: &Scene, optics: &Optics, mask: &Mask, energy: f64) -> Result<Self> {
        let plane = optics.cell_plane;
        let shape = MaskShape::of(scene, mask, plane, Some(energy))?;
        let leak = shape.leak(1.0);
        let small = LEFT_OUT * scene.sampling.tolerances().light;
        Ok(Self {
            ends: shape.openings.ends().next().unwrap_or([0.0; 2]),
            period: shape.openings.period[0],
            leak: if leak < small { 0.0 } else { leak },
            side: 0.5 * shape.thickness * shape.narrowing(1.0, leak),
            variance: shape.thickness * shape.thickness * shape.edge_variance(),
            plane,
            shadow: shape.thickness,
            name: mask.name(),
        })
    }

    /// No mask: bars that transmit all light. `period`: of the beamlets, m.
    pub(super) fn none(optics: &Optics, period: f64) -> Self {
        Self {
            ends: [-0.5 * period, 0.5 * period],
            period,
            leak: 1.0,
            side: 0.0,
            variance: 0.0,
            plane: optics.cell_plane,
            shadow: 0.0,
            name: "sample_mask",
        }
    }

    /// Width of the bars, m.
    pub(super) fn bar(&self) -> f64 {
        self.period - (self.ends[1] - self.ends[0])
    }

    /// Ends of an opening at x (m), narrowed under the angle of each.
    pub(super) fn narrowed(&self, [low, high]: [f64; 2]) -> [f64; 2] {
        let inset = |x: f64| self.side * (x / self.plane).abs();
        [low + inset(low), high - inset(high)]
    }

    /// Change of the narrowing of an edge near x as the mask moves, per metre.
    pub(super) fn tilt(&self, x: f64) -> f64 {
        self.side * x.signum() / self.plane
    }

    /// Variance of the edges near x, m².
    pub(super) fn variance(&self, x: f64) -> f64 {
        self.variance * (x / self.plane).powi(2)
    }

    /// Refuses bars whose edges at x (m) are not one soft edge. `blur`: of the focal spot, m.
    pub(super) fn check(&self, x: f64, blur: f64, tolerance: f64) -> Result<()> {
        let refuse = |found: String| {
            let found = format!("\"wave\" with {found} in {}", self.name);
            let allowed = "fewer columns, thinner bars or a larger tolerance";
            Err(Error::scene("sampling.transport", found, allowed))
        };
        let shadow = self.shadow * (x / self.plane).abs();
        let narrowest = self.bar().min(self.ends[1] - self.ends[0]);
        if shadow > narrowest {
            return refuse(format!("a shadow of {:.1} um of bars", 1e6 * shadow));
        }
        // As by `layers_of` in light/mask.glsl, for one layer.
        let variance = self.variance(x);
        let share = variance / (variance + blur * blur).max(1e-24);
        let error = (1.0 - self.leak) * variance.sqrt() / self.period
            * (EDGE_SKEWNESS * share + EDGE_FLATNESS * share * share);
        if error > tolerance {
            return refuse(format!("soft edges that err by {error:.1e} of the open beam"));
        }
        Ok(())
    }
}
