//! Exact means of the first order over rectangles: sums over facets, weighted by their area in the
//! rectangle. They need no ray, and no facet is missed between rays.

use super::hardening::Hardening;
use super::lattice::Lattice;
use super::patch::{Axis, Border, Mean, Patch, Residuals, middle};
use super::patch_facet::PatchFacet;
use super::polygon::{Area, Corner, crosses};
use super::sample_facets::SurfaceStep;
use super::sheets::{RectangleSums, SheetFits, WHOLE, flags};
use super::view_context::ViewContext;
use crate::trace::FIRST_ORDER_ERROR;
use beamlet_core::numbers::single;
use beamlet_interface::RayResult;

/// Facets that cover less than this share of a rectangle are left out.
pub(super) const EDGE_ON: f64 = 1e-9;
/// Share of the budget that the first order may leave in a mean.
const FIRST_ORDER_SHARE: f64 = 0.05;
/// An error of the displacement that moves light to other rows, pitches of them.
const FAR_OFF: f64 = 0.1;

/// Height of the band beside a row's border from which light crosses the border, standard deviations of
/// the blur. The weight falls linearly to zero over it, so its mean distance from the border equals the mean for
/// one side of the blur.
const BORDER_BAND: f64 = 2.4;
/// Least height of a band, rows.
const THINNEST_BAND: f64 = 1e-3;

/// Contribution of a facet to the result of a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Added {
    /// Optical depth, displacement (m) and slope along x and z.
    pub(crate) numbers: [f64; 5],
    /// Displacement per step of delta, m.
    moved: [f64; 2],
    /// Change of the optical depth per m of x and per row.
    pub(super) rise: [f64; 2],
    /// Cosine of incidence, over that which the first order needs.
    pub(crate) share: f64,
    /// From the crossing to the analyser, m.
    lever: f64,
}

impl Added {
    /// First-order remainder of the displacement, m.
    pub(super) fn error(&self) -> f64 {
        if self.share < 1.0 {
            FIRST_ORDER_ERROR * self.lever / (self.share * self.share * self.share)
        } else {
            0.0
        }
    }
}

/// A result of these numbers: optical depth, displacement and slope along x and z.
pub(super) fn result_of(
    numbers: [f64; 5],
    signature: u32,
    flags: u32,
    crossings: u32,
) -> RayResult {
    let [optical_depth, displacement_x, displacement_z, slope_x, slope_z] = numbers.map(single);
    RayResult {
        optical_depth,
        displacement_x,
        displacement_z,
        slope_x,
        slope_z,
        signature,
        flags,
        crossings,
        displacement_variance: 0.0,
    }
}

/// Takes means over rectangles of a view.
#[derive(Debug)]
pub(super) struct FacetMeans<'a> {
    pub(super) steps: &'a [SurfaceStep],
    pub(crate) lattice: &'a Lattice,
    /// From source and from analyser to the rotation centre, m.
    rotation: f64,
    analyser: f64,
    /// Error of the displacement that a mean may have, m; and of its light where that is less
    /// than a share of the budget, share of open beam.
    pub(crate) displacement: f64,
    pub(crate) light: f64,
    /// Change of light per displacement, at most, 1/m.
    pub(super) steepest: f64,
    pub(super) hardening: &'a Hardening,
    /// Recorded value per metre of open cell plane.
    pub(crate) weight: f64,
    /// Distance from analyser to detector, m.
    pub(crate) gap: f32,
    /// Pitch of the detector's rows, m, and the same at the rotation centre.
    pub(crate) row_pitch: f64,
    row: f64,
    /// Where the first order may err by more than this, m, nothing is left to it.
    pub(crate) far: f64,
    /// No ray of a mean may need more than the first order.
    pub(super) strict: bool,
}

impl<'a> FacetMeans<'a> {
    pub(super) fn new(view: &ViewContext<'a>, steps: &'a [SurfaceStep]) -> Self {
        let optics = view.optics;
        Self {
            steps,
            lattice: view.lattice,
            rotation: optics.rotation,
            analyser: optics.analyser_place(),
            displacement: FIRST_ORDER_SHARE * view.budget.bounded_displacement(),
            light: FIRST_ORDER_SHARE * view.budget.light,
            steepest: view.response.steepest(),
            hardening: &view.response.hardening,
            weight: f64::from(view.response.weight),
            gap: single(optics.gap()),
            row_pitch: optics.detector.pitch[1],
            row: optics.detector.pitch_at(1, optics.rotation),
            far: FAR_OFF * optics.detector.pitch[1],
            strict: view.recording.is_some(),
        }
    }

    /// The mean over a rectangle, `list` being the facets that may touch it.
    pub(super) fn over(&self, patch: &Patch, list: &[u32], x: [f32; 2], z: [f32; 2]) -> Mean {
        let Some(all) = &patch.facets else { return Mean::Unknown };
        let [centre, half] = middle(x, z);
        let (x, z) = (x.map(f64::from), z.map(f64::from));
        let facets = || list.iter().map(|index| &all[*index as usize]);
        let is_silhouette = |facet: &PatchFacet| {
            (0..3).any(|edge| {
                let ends = [facet.corners[(edge + 1) % 3], facet.corners[(edge + 2) % 3]];
                facet.silhouette[edge] && crosses(ends, x, z)
            })
        };
        if facets().any(is_silhouette) {
            let whole = Area::of_rectangle(centre, half).area;
            let covered: f64 = facets().map(|facet| facet.within(centre, half).area).sum();
            return Mean::Silhouette { crossings: single(covered / whole) };
        }
        let sums = self.sums(patch, facets(), centre, half);
        let size = half.map(|half| 2.0 * half);
        let Some((result, mut residuals)) = self.fit(&sums, size) else { return Mean::Unknown };
        if !self.strict {
            residuals.borders = self.borders(patch, facets(), [x, z], &result);
        }
        Mean::Fit(result, residuals)
    }

    /// Light that crosses the borders of the row that a rectangle touches. It comes from a band beside the
    /// border, and lands where the mean over the band says.
    fn borders<'f>(
        &self,
        patch: &Patch,
        facets: impl Iterator<Item = &'f PatchFacet> + Clone,
        [x, z]: [[f64; 2]; 2],
        result: &RayResult,
    ) -> [Option<Border>; 2] {
        let reach = (BORDER_BAND * self.lattice.row_spread.blur).max(THINNEST_BAND);
        let band = reach.min(z[1] - z[0]);
        // The weight falls linearly to nothing at `reach`; its mean is that at the centroid.
        let mean_weight = 1.0 - 0.5 * band / reach;
        let bands = [(z[0] <= 0.0, [z[0], z[0] + band]), (z[1] >= 1.0, [z[1] - band, z[1]])];
        let border = |end: usize, z: [f64; 2]| {
            let centre = [0.5 * (x[0] + x[1]), 0.5 * (z[0] + z[1])];
            let half = [0.5 * (x[1] - x[0]), 0.5 * (z[1] - z[0])];
            let whole = Area::of_rectangle(centre, half).area * mean_weight;
            let (mut depth, mut landing) = (0.0, 0.0);
            for facet in facets.clone() {
                let part = facet.within(centre, half);
                if part.area > EDGE_ON * whole {
                    let [tau, _, shift, _, slope] = self.added(patch, facet, part.centroid).numbers;
                    let inner =
                        if end == 0 { part.centroid[1] - z[0] } else { z[1] - part.centroid[1] };
                    let weight = part.area * (1.0 - inner / reach) / whole;
                    depth += weight * tau;
                    landing += weight * (shift + f64::from(self.gap) * slope);
                }
            }
            let light = (f64::from(result.optical_depth) - depth).exp();
            Border { landing: single(landing), light: single(light) }
        };
        std::array::from_fn(|end| bands[end].0.then(|| border(end, bands[end].1)))
    }

    /// Integrals over a rectangle.
    fn sums<'f>(
        &self,
        patch: &Patch,
        facets: impl Iterator<Item = &'f PatchFacet>,
        centre: Corner,
        half: [f64; 2],
    ) -> RectangleSums {
        let whole = Area::of_rectangle(centre, half);
        let mut sums = RectangleSums::new(centre, whole.area);
        for facet in facets {
            let part = facet.within(centre, half);
            // Edge-on facets take no light, and their normals say nothing.
            if part.area > EDGE_ON * whole.area && sums.sound {
                sums.sound = self.add(patch, facet, &part, &mut sums).is_some();
            }
        }
        sums
    }

    /// Adds the contribution of a facet over a part of the rectangle; `None` if the first order is
    /// insufficient, or there are too many sheets.
    fn add(
        &self,
        patch: &Patch,
        facet: &PatchFacet,
        part: &Area,
        sums: &mut RectangleSums,
    ) -> Option<()> {
        let Area { area, centroid, moments } = *part;
        let added = self.added(patch, facet, centroid);
        let step = &self.steps[facet.component as usize];
        if added.share < 1.0 {
            if self.strict {
                return None;
            }
            sums.first_order += area * added.error();
        }
        sums.share = sums.share.min(added.share);
        // Over the part the depth is linear.
        let centre = sums.centre;
        let depth = area * added.numbers[0];
        let [rise, rise_z] = added.rise;
        sums.depth_by_x +=
            depth * (centroid[0] - centre[0]) + rise * moments[0] + rise_z * moments[1];
        sums.depth_by_z +=
            depth * (centroid[1] - centre[1]) + rise * moments[1] + rise_z * moments[2];
        let values = added.numbers.map(|value| area * value);
        for (sum, value) in sums.result.iter_mut().zip(values) {
            *sum += value;
        }
        if area >= (1.0 - WHOLE) * sums.area {
            // Nothing changes over the rectangle, whatever other sheets of the component do.
            sums.whole.add(step.hash, facet.front, 1);
            return Some(());
        }
        let sheet = sums.sheet(facet.component, facet.front)?;
        sheet.add(part, centre, added.moved);
        Some(())
    }

    /// Contribution of a facet to the result of the ray through a place (x from the beamlet's centre, m;
    /// fraction of the row).
    pub(super) fn added(&self, patch: &Patch, facet: &PatchFacet, [x, z]: Corner) -> Added {
        let step = &self.steps[facet.component as usize];
        let slope = self.lattice.slopes(patch.beamlet, x, patch.row as f64 + z);
        let normal = facet.normal;
        let across = normal.x * slope[0] + normal.z * slope[1];
        let along = across + normal.y;
        let y = (facet.plane - self.rotation * across) / along;
        let y = y.clamp(facet.depth[0], facet.depth[1]);
        let norm2 = 1.0 + slope[0] * slope[0] + slope[1] * slope[1];
        let length = norm2.sqrt();
        let sign = if facet.front { 1.0 } else { -1.0 };
        let bend = -sign * norm2 / along;
        let per_delta =
            [bend * (normal.x - normal.y * slope[0]), bend * (normal.z - normal.y * slope[1])];
        let slopes = per_delta.map(|slope| step.delta * slope);
        let lever = self.analyser - y;
        let farther = -(self.rotation + y) / along;
        let [by_x, by_z] = self.lattice.slope_steps();
        let depth = -sign * step.mu * length;
        Added {
            numbers: [depth * y, slopes[0] * lever, slopes[1] * lever, slopes[0], slopes[1]],
            moved: per_delta.map(|slope| slope * lever),
            rise: [depth * farther * normal.x * by_x, depth * farther * normal.z * by_z],
            share: along.abs() / length / step.least_cosine.max(1e-30),
            lever,
        }
    }

    /// The best linear result of a rectangle, and its residual; `None` if sheets do not cover all of it,
    /// or the first order is insufficient.
    fn fit(
        &self,
        sums: &RectangleSums,
        [width, height]: [f64; 2],
    ) -> Option<(RayResult, Residuals)> {
        if !sums.sound {
            return None;
        }
        let area = sums.area;
        let [x2, z2] = [width * width / 12.0, height * height / 12.0];
        let SheetFits {
            met,
            slope,
            across,
            slope_z,
            depth,
            depth_z,
            variance,
            variance_z,
            spread,
            farthest: farthest_by,
        } = SheetFits::of(sums, self.steps, self.analyser, [width, height * self.row], [x2, z2])?;
        let error = sums.first_order / area;
        if !error.is_finite() || met.balance != 0 {
            return None;
        }
        let mut numbers = sums.result.map(|sum| sum / area);
        if !self.strict {
            // A cell has no slopes along z: the displacement is weighted by the light, and the light is
            // the mean over the slope.
            let rise_z = sums.depth_by_z / area / z2;
            numbers[1] -= across * rise_z * z2;
            numbers[0] -= (0.5 * rise_z * rise_z * z2).min(numbers[0].max(0.0));
        }
        let result = result_of(numbers, met.signature, flags(sums.share), met.crossings);
        let passed = f64::from(self.hardening.light(result.optical_depth));
        let light = area * self.weight * passed * error * self.steepest;
        if error > self.displacement && light > self.light {
            return None;
        }
        let landing_z = result.landing_z(self.gap);
        let residuals = Residuals {
            slope: single(slope),
            slope_depth: single(sums.depth_by_x / area / x2),
            ends_z: [-0.5, 0.5].map(|end| landing_z + single(end * height * slope_z)),
            rise: single(sums.depth_by_z / area / z2 * height),
            bow: single(depth_z.sqrt()),
            borders: [None; 2],
            depth: single(depth.sqrt()),
            displacement: single(variance.sqrt()),
            across: single((across * across * z2).sqrt()),
            displacement_z: single(variance_z.sqrt()),
            narrower: if spread[1] < spread[0] { Axis::Z } else { Axis::X },
            farthest: [
                single(farthest_by[0] - 0.5 * (slope * width).abs()),
                single(farthest_by[1] - 0.5 * (slope_z * height).abs()),
            ],
        };
        Some((result, residuals))
    }
}
