//! Few Gaussians in place of the pixels of an image.
//!
//! Expectation and maximisation with Gaussians along the axes. Every round keeps the sum, the centroid
//! and both variances of the image exactly, so that only the shape is approximated. Gaussians are doubled
//! until the difference is invisible in a curve.

use super::SpotPart;
use crate::spot::deviation;
use rayon::prelude::*;

/// Most Gaussians of an image: each costs as much illumination as a Gaussian spot.
const MOST: usize = 64;
/// Difference of the twice integrated profiles over the spot's deviation that counts as none: a
/// curve whose blur is a tenth of the period then errs by less than 1e-4 of open beam.
pub(super) const TOLERANCE: f64 = 1e-3;
/// Rounds of improvement.
const ROUNDS: usize = 60;
/// Places along each direction where the difference is taken.
const PLACES: u32 = 193;
/// Blobs that one thread takes at a time; sums are made in their order.
const CHUNK: usize = 512;

/// Some light: its share, centroid and variances (x, z), m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Blob {
    pub(crate) weight: f64,
    pub(crate) at: [f64; 2],
    pub(crate) variance: [f64; 2],
}

/// Gaussians fitted to the pixels.
#[derive(Debug)]
pub(super) struct Fitted {
    pub(super) parts: Vec<SpotPart>,
    pub(super) error: f64,
    pub(super) relative_error: f64,
}

pub(super) fn fit(blobs: &[Blob]) -> Fitted {
    let whole = sum(blobs.iter().map(|blob| (1.0, blob)));
    let views: Vec<Profile> =
        DIRECTIONS.iter().map(|along| Profile::new(*along, blobs, &whole)).collect();
    let mut best: Option<(f64, Vec<Blob>)> = None;
    let mut count = 1;
    loop {
        let mut parts = divided(blobs, count);
        if parts.len() > 1 {
            for _ in 0..ROUNDS {
                parts = improved(blobs, &parts);
            }
        }
        let error = views.iter().map(|view| view.error(&parts)).fold(0.0, f64::max);
        if best.as_ref().is_none_or(|(least, _)| error < *least) {
            best = Some((error, parts));
        }
        if error <= TOLERANCE || 2 * count > MOST.min(blobs.len()) {
            break;
        }
        count *= 2;
    }
    let (relative_error, parts) = best.unwrap_or_default();
    let error = views[0].error(&parts) * views[0].deviation;
    let part = |part: &Blob| SpotPart {
        weight: part.weight,
        fwhm: part.variance.map(|variance| variance.sqrt() / deviation(1.0)),
        offset: part.at,
    };
    Fitted { parts: parts.iter().map(part).collect(), error, relative_error }
}

/// Weight, centroid and variance of blobs, each with a share of its light.
fn sum<'a>(blobs: impl Iterator<Item = (f64, &'a Blob)> + Clone) -> Blob {
    let weight: f64 = blobs.clone().map(|(share, blob)| share * blob.weight).sum();
    let mean = |f: &dyn Fn(&Blob) -> f64| {
        blobs.clone().map(|(share, blob)| share * blob.weight * f(blob)).sum::<f64>() / weight
    };
    let at = [0, 1].map(|axis| mean(&|blob| blob.at[axis]));
    let variance = [0, 1].map(|axis| mean(&|p| p.variance[axis] + (p.at[axis] - at[axis]).powi(2)));
    Blob { weight, at, variance }
}

/// The blobs in `count` groups of about the same light, cut across their longer side.
fn divided(blobs: &[Blob], count: usize) -> Vec<Blob> {
    let mut groups = vec![blobs.to_vec()];
    loop {
        // Groups of one pixel stay, so that others may have to be cut once more.
        let before = groups.len();
        let mut room = count - before;
        let mut next = Vec::with_capacity(count);
        for group in groups {
            if room > 0 && group.len() > 1 {
                room -= 1;
                next.extend(halves(group));
            } else {
                next.push(group);
            }
        }
        groups = next;
        if groups.len() == before || groups.len() == count {
            break;
        }
    }
    groups.iter().map(|group| sum(group.iter().map(|blob| (1.0, blob)))).collect()
}

fn halves(mut group: Vec<Blob>) -> Vec<Vec<Blob>> {
    if group.len() < 2 {
        return vec![group];
    }
    let whole = sum(group.iter().map(|blob| (1.0, blob)));
    let axis = usize::from(whole.variance[1] > whole.variance[0]);
    let other = 1 - axis;
    group.sort_by(|a, b| {
        a.at[axis].total_cmp(&b.at[axis]).then(a.at[other].total_cmp(&b.at[other]))
    });
    let mut light = 0.0;
    let half = group.iter().position(|blob| {
        light += blob.weight;
        light >= 0.5 * whole.weight
    });
    let at = half.unwrap_or(0).clamp(1, group.len() - 1);
    let rest = group.split_off(at);
    vec![group, rest]
}

/// Moments of blobs about the origin, by part: weight, x, z, x2, z2.
type Sums = Vec<[f64; 5]>;

/// One round: light goes to the parts by their density there, and each part takes the moments of its
/// light.
fn improved(blobs: &[Blob], parts: &[Blob]) -> Vec<Blob> {
    let heights: Vec<f64> = parts
        .iter()
        .map(|p| libm::log(p.weight) - 0.5 * libm::log(p.variance[0] * p.variance[1]))
        .collect();
    let some = |blobs: &[Blob]| -> Sums {
        let mut sums = vec![[0.0; 5]; parts.len()];
        let mut density = vec![0.0; parts.len()];
        for blob in blobs {
            let mut most = f64::NEG_INFINITY;
            for ((density, part), height) in density.iter_mut().zip(parts).zip(&heights) {
                let off =
                    |axis: usize| (blob.at[axis] - part.at[axis]).powi(2) / part.variance[axis];
                *density = height - 0.5 * (off(0) + off(1));
                most = most.max(*density);
            }
            density.iter_mut().for_each(|d| *d = libm::exp(*d - most));
            let total: f64 = density.iter().sum();
            for (sums, density) in sums.iter_mut().zip(&density) {
                let light = blob.weight * density / total;
                let square = |axis: usize| blob.at[axis].powi(2) + blob.variance[axis];
                let moments = [1.0, blob.at[0], blob.at[1], square(0), square(1)];
                sums.iter_mut().zip(moments).for_each(|(sum, moment)| *sum += light * moment);
            }
        }
        sums
    };
    let chunks: Vec<Sums> = blobs.par_chunks(CHUNK).map(some).collect();
    let mut all = vec![[0.0; 5]; parts.len()];
    for chunk in chunks {
        for (all, sums) in all.iter_mut().zip(chunk) {
            all.iter_mut().zip(sums).for_each(|(all, sum)| *all += sum);
        }
    }
    let least = blobs.iter().fold([f64::INFINITY; 2], |least, blob| {
        [0, 1].map(|axis| least[axis].min(blob.variance[axis]))
    });
    all.iter()
        .filter(|[weight, ..]| *weight > 0.0)
        .map(|&[weight, x, z, x2, z2]| {
            let at = [x / weight, z / weight];
            // Rounding may take a little from a part that has one pixel.
            let variance = [x2 / weight - at[0] * at[0], z2 / weight - at[1] * at[1]];
            Blob { weight, at, variance: [0, 1].map(|i| variance[i].max(least[i])) }
        })
        .collect()
}

const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// x, z, and both diagonals, which distinguish a slanted spot from an upright one.
const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [DIAGONAL; 2], [DIAGONAL, -DIAGONAL]];

/// The twice integrated profile of the image along a direction.
#[derive(Debug)]
struct Profile {
    along: [f64; 2],
    deviation: f64,
    places: Vec<f64>,
    values: Vec<f64>,
}

impl Profile {
    fn new(along: [f64; 2], blobs: &[Blob], whole: &Blob) -> Self {
        let onto = |blob: &Blob| along[0] * blob.at[0] + along[1] * blob.at[1];
        let spread = |blob: &Blob| {
            along[0] * along[0] * blob.variance[0] + along[1] * along[1] * blob.variance[1]
        };
        let centre = onto(whole);
        let variance: f64 = blobs
            .iter()
            .map(|blob| blob.weight * (spread(blob) + (onto(blob) - centre).powi(2)))
            .sum();
        let ends = blobs
            .iter()
            .map(onto)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |e, at| [e[0].min(at), e[1].max(at)]);
        let room = variance.sqrt();
        let step = (ends[1] - ends[0] + 2.0 * room) / f64::from(PLACES - 1);
        let places: Vec<f64> = (0..PLACES).map(|i| ends[0] - room + step * f64::from(i)).collect();
        let value = |at: &f64| {
            blobs
                .iter()
                .map(|blob| {
                    // Even light over 2 h; across a diagonal one of the same variance.
                    let (d, h) = ((at - onto(blob)).abs(), (3.0 * spread(blob)).sqrt());
                    blob.weight * if d >= h { d } else { 0.5 * (d * d + h * h) / h }
                })
                .sum::<f64>()
        };
        let values = places.par_iter().map(value).collect();
        Self { along, deviation: variance.sqrt(), places, values }
    }

    /// Range of the difference from Gaussians, over the deviation.
    fn error(&self, parts: &[Blob]) -> f64 {
        let along = self.along;
        let range =
            self.places.iter().zip(&self.values).fold([0.0_f64; 2], |range, (at, value)| {
                let of = |part: &Blob| {
                    let middle = along[0] * part.at[0] + along[1] * part.at[1];
                    let variance = along[0] * along[0] * part.variance[0]
                        + along[1] * along[1] * part.variance[1];
                    part.weight * mean_distance(at - middle, variance.sqrt())
                };
                let off = 0.5 * (value - parts.iter().map(of).sum::<f64>());
                [range[0].min(off), range[1].max(off)]
            });
        (range[1] - range[0]) / self.deviation
    }
}

/// Mean distance of a normal variable from a place `d` beside its mean.
fn mean_distance(d: f64, sigma: f64) -> f64 {
    let t = d / sigma;
    let density = libm::exp(-0.5 * t * t) / std::f64::consts::TAU.sqrt();
    d * libm::erf(t * std::f64::consts::FRAC_1_SQRT_2) + 2.0 * sigma * density
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: impl Fn(f64, f64) -> f64) -> Vec<Blob> {
        let places = || (-30..=30).map(|i| f64::from(i) * 1e-6);
        let all = places().flat_map(|z| places().map(move |x| [x, z]));
        let mut blobs: Vec<Blob> = all
            .map(|at| Blob { weight: value(at[0], at[1]), at, variance: [1e-12 / 12.0; 2] })
            .filter(|blob| blob.weight > 0.0)
            .collect();
        let sum: f64 = blobs.iter().map(|blob| blob.weight).sum();
        blobs.iter_mut().for_each(|blob| blob.weight /= sum);
        blobs
    }

    #[test]
    fn moments_stay_and_shapes_take_as_many_as_they_need() {
        let normal = |x: f64, s: f64| (-0.5 * x * x / s / s).exp();
        let gaussian = image(|x, z| normal(x, 7e-6) * normal(z, 5e-6));
        assert_eq!(fit(&gaussian).parts.len(), 1);
        let slanted = image(|x, z| normal(x + z, 10e-6) * normal(x - z, 4e-6));
        let disc = image(|x, z| if x * x + z * z < 4e-10 { 1.0 } else { 0.0 });
        for blobs in [slanted, disc] {
            let fitted = fit(&blobs);
            assert!(fitted.parts.len() > 1 && fitted.relative_error <= 2e-3, "{fitted:?}");
            let whole = sum(blobs.iter().map(|blob| (1.0, blob)));
            let sigma = deviation(1.0);
            let parts: Vec<Blob> = fitted
                .parts
                .iter()
                .map(|p| Blob {
                    weight: p.weight,
                    at: p.offset,
                    variance: p.fwhm.map(|f| (f * sigma).powi(2)),
                })
                .collect();
            let kept = sum(parts.iter().map(|part| (1.0, part)));
            assert!((kept.weight - 1.0).abs() < 1e-12);
            for axis in 0..2 {
                assert!((kept.at[axis] - whole.at[axis]).abs() < 1e-16);
                assert!((kept.variance[axis] / whole.variance[axis] - 1.0).abs() < 1e-9);
            }
        }
    }
}
