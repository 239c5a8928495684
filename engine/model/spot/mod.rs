//! The focal spot: a weighted sum of Gaussians. Light is linear in the source, so each part is
//! illuminated alone (docs/physics.md, "Focal spot").

mod fit;
mod picture;
mod profile;

use serde::Serialize;

/// Standard deviation of a Gaussian of this full width at half maximum.
pub fn deviation(fwhm: f64) -> f64 {
    fwhm / (8.0 * std::f64::consts::LN_2).sqrt()
}

/// One Gaussian of a focal spot.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SpotPart {
    /// Share of the light, in any unit. >= 0.
    pub weight: f64,
    /// Full width at half maximum along x and z, m. >= 0; 0 is a point.
    pub fwhm: [f64; 2],
    /// Its centre along x and z, m; the centre of the whole spot is moved to the optical axis.
    pub offset: [f64; 2],
}

impl SpotPart {
    /// A Gaussian of this weight, with FWHM and centre along x and z, m.
    #[must_use]
    pub const fn new(weight: f64, fwhm: [f64; 2], offset: [f64; 2]) -> Self {
        Self { weight, fwhm, offset }
    }
}

/// How well the parts stand for the image or profile that they were made from.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SpotFit {
    /// Where the image or profile was read, or empty.
    pub file: String,
    /// Pixels with light, or samples of the profile's spot.
    pub samples: usize,
    /// Pixels, along x and z, that were summed before.
    pub block: [usize; 2],
    /// Across the slits: how far the twice integrated profiles of parts and image part, m. Times
    /// twice the change of a curve per metre of source this bounds the error of the curve.
    pub error: f64,
    /// The largest of the same along x, z and both diagonals, over the spot's deviation there.
    pub relative_error: f64,
}

/// A focal spot on the optical axis, as a sum of Gaussians. Two spots of the same parts are equal.
#[derive(Debug, Clone)]
pub struct Spot {
    parts: Vec<SpotPart>,
    fit: Option<SpotFit>,
}

/// A part with the spot's centroid on the axis and weights that sum to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedPart {
    /// Share of all light.
    pub share: f64,
    /// Centre from the optical axis, x and z, m.
    pub offset: [f64; 2],
    /// Standard deviation along x and z, m.
    pub deviation: [f64; 2],
}

impl PartialEq for Spot {
    fn eq(&self, other: &Self) -> bool {
        self.parts == other.parts
    }
}

impl From<[f64; 2]> for Spot {
    /// The Gaussian of this FWHM along x and z, m.
    fn from(fwhm: [f64; 2]) -> Self {
        Self::gaussians(vec![SpotPart { weight: 1.0, fwhm, offset: [0.0; 2] }])
    }
}

/// True if parts of a spot blur light otherwise along z, or lie elsewhere.
#[must_use]
pub fn differ_along_z(parts: &[PlacedPart]) -> bool {
    let base = parts.first().map_or(0.0, |part| part.deviation[1]);
    parts.iter().any(|it| it.offset[1].abs() > 0.0 || (it.deviation[1] - base).abs() > 0.0)
}

/// Standard deviations of a Gaussian that count: 2e-9 of its light lies beyond.
const REACH: f64 = 6.0;

impl Spot {
    /// The sum of these Gaussians; [`crate::scene::Scene::validate`] checks their values.
    #[must_use]
    pub const fn gaussians(parts: Vec<SpotPart>) -> Self {
        Self { parts, fit: None }
    }

    /// A Gaussian as a weighted superposition of point sources, evenly spaced over five standard
    /// deviations on either side: `count` of them along x and z, >= 1 each.
    #[must_use]
    pub fn points(fwhm: [f64; 2], count: [u32; 2]) -> Self {
        let along = |axis: usize| -> Vec<[f64; 2]> {
            let (sigma, n) = (deviation(fwhm[axis]), count[axis].max(1));
            if n == 1 || sigma <= 0.0 {
                return vec![[0.0, 1.0]];
            }
            let at = |i: u32| 5.0 * (2.0 * f64::from(i) / f64::from(n - 1) - 1.0);
            (0..n).map(|i| [sigma * at(i), libm::exp(-0.5 * at(i) * at(i))]).collect()
        };
        let (across, up) = (along(0), along(1));
        let point = |[x, u]: [f64; 2], [z, v]: [f64; 2]| SpotPart {
            weight: u * v,
            fwhm: [0.0; 2],
            offset: [x, z],
        };
        Self::gaussians(up.iter().flat_map(|z| across.iter().map(|x| point(*x, *z))).collect())
    }

    /// The parts, as they were given.
    #[must_use]
    pub fn parts(&self) -> &[SpotPart] {
        &self.parts
    }

    /// How the parts were made from an image or a profile, where they were.
    #[must_use]
    pub const fn fit(&self) -> Option<&SpotFit> {
        self.fit.as_ref()
    }

    /// The parts with light, their centroid on the axis.
    #[must_use]
    #[doc(hidden)]
    pub fn placed(&self) -> Vec<PlacedPart> {
        let total: f64 = self.parts.iter().map(|part| part.weight).sum();
        let centre = [0, 1].map(|axis| {
            self.parts.iter().map(|part| part.weight * part.offset[axis]).sum::<f64>() / total
        });
        let lit = self.parts.iter().filter(|part| part.weight > 0.0);
        lit.map(|part| PlacedPart {
            share: part.weight / total,
            offset: [0, 1].map(|axis| part.offset[axis] - centre[axis]),
            deviation: part.fwhm.map(deviation),
        })
        .collect()
    }

    /// Where the parts stand for the image less well than they should: why.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let Some(fit) = &self.fit else { return Vec::new() };
        let mut warnings = Vec::new();
        let [x, z] = fit.block;
        if x > 1 || z > 1 {
            warnings.push(format!("focal spot {}: {x} x {z} pixels were summed to one", fit.file));
        }
        if fit.relative_error > fit::TOLERANCE {
            let (parts, error) = (self.parts.len(), fit.relative_error);
            warnings.push(format!(
                "focal spot {}: {parts} Gaussians reproduce its shape within {error:.1e} of its \
                 standard deviation, worse than {:.0e}: smooth the image",
                fit.file,
                fit::TOLERANCE
            ));
        }
        warnings
    }

    /// True if the light along an axis (0: x, 1: z) is one Gaussian.
    #[must_use]
    #[doc(hidden)]
    pub fn is_gaussian(&self, axis: usize) -> bool {
        let mut lit = self.parts.iter().filter(|part| part.weight > 0.0);
        let of = |part: &SpotPart| [part.fwhm[axis], part.offset[axis]].map(f64::to_bits);
        let first = lit.next().map(of);
        lit.all(|part| Some(of(part)) == first)
    }

    /// FWHM along x and z, m, of the Gaussian with the spot's variance.
    #[must_use]
    pub fn fwhm(&self) -> [f64; 2] {
        let placed = self.placed();
        [0, 1].map(|axis| {
            if let (true, Some(part)) = (self.is_gaussian(axis), self.parts.first()) {
                return part.fwhm[axis];
            }
            let of = |p: &PlacedPart| {
                p.share * (p.offset[axis] * p.offset[axis] + p.deviation[axis] * p.deviation[axis])
            };
            placed.iter().map(of).sum::<f64>().sqrt() / deviation(1.0)
        })
    }

    /// Farthest light from the axis along x and z, m.
    #[must_use]
    pub fn reach(&self) -> [f64; 2] {
        let placed = self.placed();
        [0, 1].map(|axis| {
            let of = |p: &PlacedPart| p.offset[axis].abs() + REACH * p.deviation[axis];
            placed.iter().map(of).fold(0.0, f64::max)
        })
    }

    /// Least standard deviation of a part along an axis, m.
    #[must_use]
    pub fn narrowest(&self, axis: usize) -> f64 {
        let widths = self.placed().into_iter().map(|part| part.deviation[axis]);
        widths.reduce(f64::min).unwrap_or(0.0)
    }

    /// The spot blurred along z by a Gaussian of this FWHM, m.
    #[must_use]
    pub(crate) fn blurred_along_z(&self, fwhm: f64) -> Self {
        let blurred = |part: &SpotPart| {
            let [x, z] = part.fwhm;
            SpotPart { fwhm: [x, libm::hypot(z, fwhm)], ..*part }
        };
        Self { parts: self.parts.iter().map(blurred).collect(), fit: self.fit.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centroid_lies_on_the_axis_and_the_variance_is_that_of_the_sum() {
        let part = |weight, fwhm, x| SpotPart { weight, fwhm: [fwhm; 2], offset: [x, 1e-6] };
        let spot = Spot::gaussians(vec![part(3.0, 10e-6, 5e-6), part(1.0, 0.0, 25e-6)]);
        let placed = spot.placed();
        assert!((placed[0].share - 0.75).abs() < 1e-15);
        assert!((placed[0].offset[0] + 5e-6).abs() < 1e-18 && placed[0].offset[1].abs() < 1e-18);
        let sigma = deviation(10e-6);
        let variance = 0.75 * (25e-12 + sigma * sigma) + 0.25 * 225e-12;
        assert!((deviation(spot.fwhm()[0]) - variance.sqrt()).abs() < 1e-12);
        assert!(!spot.is_gaussian(0) && Spot::from([1e-6; 2]).is_gaussian(0));
        // 201 points of a Gaussian have its variance.
        let points = Spot::points([30e-6, 0.0], [201, 1]);
        assert!((points.fwhm()[0] / 30e-6 - 1.0).abs() < 2e-5, "{:?}", points.fwhm());
    }
}
