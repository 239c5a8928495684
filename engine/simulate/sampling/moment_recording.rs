//! Moments of the rays that bound cells.

use super::rectangle::Rectangle;
use crate::trace::{Tracer, component_hash};
use beamlet_core::numbers::single;
use beamlet_core::{Result, parallel};
use beamlet_geometry::Component;
use beamlet_interface::{
    FLAG_EXACT, FLAG_NOT_FINITE, FLAG_UNBALANCED, MOMENTS_HEAD, MOMENTS_PER_MATERIAL, Ray,
    RayResult,
};
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use rayon::prelude::*;

/// Least difference of the constants on both sides of a surface, share of the larger one, by which moments
/// follow from a result.
const LEAST_CONTRAST: f64 = 0.05;

/// What the moments of rays are recorded at, under a spectrum.
#[derive(Debug, Clone)]
pub(crate) struct MomentRecording {
    /// Constants of the materials that rays are walked at.
    reference: Vec<Constants>,
    /// How much more strongly the sample may refract than at these constants, 1 or more.
    pub(super) delta_ratio: f64,
    /// Signatures of a ray through one body alone, with the body's material; sorted.
    single: Vec<(u32, u32)>,
    /// Words of a ray's moments.
    pub(crate) words: usize,
}

impl MomentRecording {
    /// For a sample of `components`, whose rays are walked at the mean constants.
    #[must_use]
    pub(crate) fn new(media: &MaterialTable, components: &[Component]) -> Self {
        let reference = media.mean();
        let of_node = media.constants.iter().flat_map(|node| node.iter().zip(&reference));
        let delta_ratio = of_node
            .filter(|(_, reference)| reference.delta != 0.0)
            .map(|(node, reference)| (node.delta / reference.delta).abs())
            .fold(1.0, f64::max);
        let twice = |component| component_hash(component).wrapping_mul(2);
        let body = |(index, component): (u32, &Component)| (twice(index), component.object);
        let mut of_bodies: Vec<_> = (0..).zip(components).map(body).collect();
        of_bodies.sort_unstable();
        // A signature that two bodies share identifies neither.
        let single = of_bodies
            .chunk_by(|a, b| a.0 == b.0)
            .filter(|same| same.len() == 1)
            .flatten()
            // Results do not say what rough surfaces and materials spread.
            .filter(|(_, object)| {
                media.roughness[*object as usize] <= 0.0 && media.scattering_words().is_empty()
            })
            .map(|(signature, object)| (*signature, media.of_object[*object as usize]))
            .collect();
        Self { reference, delta_ratio, single, words: media.moment_words() }
    }

    /// The material, if the ray crossed exactly one object: its moments are then the result divided
    /// by (mu, delta). `None` for results of exact transport, and of rays that are flagged.
    pub(super) fn single_material(&self, result: &RayResult) -> Option<usize> {
        if result.crossings == 0 {
            return Some(0);
        }
        let unlike = FLAG_EXACT | FLAG_UNBALANCED | FLAG_NOT_FINITE;
        if result.crossings != 2 || result.flags & unlike != 0 {
            return None;
        }
        let at = self.single.binary_search_by_key(&result.signature, |(signature, _)| *signature);
        let material = self.single[at.ok()?].1 as usize;
        let (inside, outside) = (&self.reference[material], &self.reference[0]);
        // A result is the difference of what either side does, rounded.
        let differs = |of: fn(&Constants) -> f64| {
            let (inside, outside) = (of(inside), of(outside));
            (inside - outside).abs() > LEAST_CONTRAST * inside.abs().max(outside.abs())
        };
        (differs(|c| c.mu) && differs(|c| c.delta)).then_some(material)
    }

    /// Appends the moments that follow from a result.
    fn push_from_result(&self, result: &RayResult, material: usize, moments: &mut Vec<f32>) {
        let first = moments.len();
        moments.resize(first + self.words, 0.0);
        if result.crossings == 0 {
            return;
        }
        let (inside, outside) = (&self.reference[material], &self.reference[0]);
        let (mu, delta) = (inside.mu - outside.mu, inside.delta - outside.delta);
        for (i, number) in numbers(result).into_iter().enumerate() {
            let moment = single(number / if i == 0 { mu } else { delta });
            moments[first + material * MOMENTS_PER_MATERIAL + i] = moment;
            moments[first + i] = -moment;
        }
    }

    /// Moments of the rectangles of patches at both ends of x,
    /// `[rectangle][end][material][moment]` for each patch. Rays whose results do not determine them, few of
    /// a patch, are traced once more.
    pub(super) fn record(
        &self,
        tracer: &mut Tracer,
        rectangles: &[Vec<Rectangle>],
    ) -> Result<Vec<Vec<f32>>> {
        let unknown = |rectangles: &Vec<Rectangle>| -> Vec<Ray> {
            let unknown =
                rectangles.iter().filter(|r| self.single_material(&r.ends.result).is_none());
            unknown.map(|r| r.ray).collect()
        };
        let rays: Vec<Vec<Ray>> = rectangles.par_iter().map(unknown).collect();
        let stride = MOMENTS_HEAD + self.words;
        let traced = tracer.trace_moments(&parallel::concat(&rays))?;
        let mut rest = &traced[..];
        let of_patches: Vec<&[u32]> = rays
            .iter()
            .map(|rays| {
                let (of_patch, after) = rest.split_at(rays.len() * stride);
                rest = after;
                of_patch
            })
            .collect();
        let by_rectangle = |(rectangles, traced): (&Vec<Rectangle>, &[u32])| {
            let mut traced = traced.chunks_exact(stride);
            let mut moments = Vec::new();
            let mut of_ray = Vec::new();
            for rectangle in rectangles {
                let ends = &rectangle.ends;
                of_ray.clear();
                if let Some(material) = self.single_material(&ends.result) {
                    self.push_from_result(&ends.result, material, &mut of_ray);
                } else {
                    let words = traced.next().and_then(|words| words.get(MOMENTS_HEAD..));
                    of_ray
                        .extend(words.unwrap_or_default().iter().map(|word| f32::from_bits(*word)));
                }
                for end in 0..2 {
                    let first = moments.len();
                    moments.extend_from_slice(&of_ray);
                    let mut by = Numbers::default();
                    by[0] = f64::from(ends.depth[end]) - f64::from(ends.result.optical_depth);
                    by[1] =
                        f64::from(ends.displacement[end]) - f64::from(ends.result.displacement_x);
                    move_result(&mut moments[first..], by, &self.reference);
                }
            }
            moments
        };
        Ok(rectangles.par_iter().zip(of_patches).map(by_rectangle).collect())
    }
}

/// The linear model of a rectangle: the result of its ray, and optical depth and displacement at both
/// ends of x.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinearModel {
    pub(crate) result: RayResult,
    pub(crate) depth: [f32; 2],
    pub(crate) displacement: [f32; 2],
}

impl LinearModel {
    /// The same at both ends.
    pub(super) fn even(result: RayResult) -> Self {
        let [depth, displacement] = [result.optical_depth, result.displacement_x].map(|it| [it; 2]);
        Self { result, depth, displacement }
    }

    /// As results.
    pub(super) fn results(&self) -> [RayResult; 2] {
        [0, 1].map(|end| RayResult {
            optical_depth: self.depth[end],
            displacement_x: self.displacement[end],
            ..self.result
        })
    }
}

/// Numbers of a result that light goes by: optical depth, displacement and slope along x and z.
type Numbers = [f64; 5];

/// Numbers of a result, in the order of a ray's moments.
fn numbers(result: &RayResult) -> Numbers {
    [
        result.optical_depth,
        result.displacement_x,
        result.displacement_z,
        result.slope_x,
        result.slope_z,
    ]
    .map(f64::from)
}

/// Moves the result that moments make with these constants, by the material that has the largest part
/// in each of its numbers.
fn move_result(moments: &mut [f32], by: Numbers, constants: &[Constants]) {
    for (i, by) in by.into_iter().enumerate() {
        let constant = |c: &Constants| if i == 0 { c.mu } else { c.delta };
        let part = |(moment, c): &(&mut f32, &Constants)| (f64::from(**moment) * constant(c)).abs();
        let moments = moments[i..].iter_mut().step_by(MOMENTS_PER_MATERIAL).zip(constants);
        if let Some((moment, c)) = moments.max_by(|a, b| part(a).total_cmp(&part(b)))
            && constant(c) != 0.0
        {
            *moment = single(f64::from(*moment) + by / constant(c));
        }
    }
}
