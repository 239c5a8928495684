//! Response of a method in two directions, by the curve of the masks.

use super::super::background::Background;
use super::super::equations::Unknowns;
use super::super::images::contrasts;
use super::super::method::Method;
use super::super::noise_factors::NoiseFactors;
use super::super::response::{PHOTONS, Response, SHIFT, TRANSMISSION, WIDENED};
use super::super::strips::Tables;
use super::super::value_noise::ValueNoise;
use super::fit::PlanarFit;
use super::geometry::knows_curve;
use super::models::curve_model;
use super::retriever::PlanarRetriever;
use beamlet_core::Result;
use beamlet_core::numbers::single;
use beamlet_model::scene::Scene;

impl PlanarRetriever {
    /// The response at the offsets of the scan, the worse of both directions; `None` where the curve of the masks is not
    /// known, and of beamlets and lists of apertures.
    ///
    /// # Errors
    /// Errors of the materials of the masks and of the beam.
    pub(crate) fn response(&self, scene: &Scene) -> Result<Option<Response>> {
        let exact = self.options().clone().with_method(Method::ExactCurve);
        let exact = exact.with_background(Background::Leak);
        let Some(pairs) = self.pairs().filter(|_| knows_curve(scene, &exact)) else {
            return Ok(None);
        };
        let truth = curve_model(scene, &exact, pairs)?;
        let noise = ValueNoise::of(self.options(), NoiseFactors::ONE);
        let scan = self.model().scan(pairs.to_vec(), noise);
        let own = truth.model.own_variances();
        let blur = truth.blur.unwrap_or_default();
        let blur = [0, 1].map(|axis| blur[axis].max(1e-4 * own[axis]));
        let widths = [0, 1].map(|axis| (own[axis] + blur[axis]).sqrt());
        let peak = truth.model.peak(&scan.points, &[1.0, 0.0, 0.0, blur[0], blur[1], 0.0, 0.0]);
        let scale = self.options().gain.map_or(1.0, |gain| PHOTONS * gain) / peak;
        let fit = |change: &dyn Fn(&mut Unknowns), flat: Option<&PlanarFit>| {
            let mut p = [scale, 0.0, 0.0, blur[0], blur[1], 0.0, 0.0];
            change(&mut p);
            p[6] = truth.background.of_area(p[0]).unwrap_or(0.0);
            let mut tables = Tables::default();
            let values = truth.model.evaluate(&scan.points, &p, &mut tables).iter();
            self.model().fit(&scan, values.map(|value| single(value[0])), flat, None)
        };
        let angle = self.angle_per_shift();
        let flat = fit(&|_| (), None);
        let of = |change: &dyn Fn(&mut Unknowns)| {
            contrasts(&flat.curve, &fit(change, Some(&flat)).curve, angle)
        };
        let along = |axis: usize| {
            let (shift, widened) = (SHIFT * widths[axis], WIDENED * widths[axis].powi(2));
            [
                of(&|p| p[1 + axis] += shift)[1 + axis] / (angle * shift),
                of(&|p| p[3 + axis] += widened)[3 + axis] / (angle * angle * widened),
            ]
        };
        let [x, z] = [along(0), along(1)];
        let worse = |k: usize| match (z[k] - 1.0).abs() > (x[k] - 1.0).abs() || z[k].is_nan() {
            true => z[k],
            false => x[k],
        };
        Ok(Some(Response {
            transmission: of(&|p| p[0] *= TRANSMISSION)[0] / TRANSMISSION,
            refraction: worse(0),
            dark_field: Some(worse(1)),
        }))
    }
}
