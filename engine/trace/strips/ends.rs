//! Moments of the rays that bound cells.

#![allow(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]

use super::Span;
use super::refiner::Refiner;
use crate::Result;
use crate::gpu::interface::{
    FLAG_EXACT, FLAG_NOT_FINITE, FLAG_UNBALANCED, Law, MOMENTS_HEAD, MOMENTS_PER_MATERIAL, Ray,
};
use crate::material::Constants;
use crate::parallel;
use crate::trace::line::{Line, Numbers, numbers};
use crate::trace::tracer::Tracer;
use crate::trace::{Media, upload};
use rayon::prelude::*;

/// Of constants on both sides of a surface, by which a law tells moments.
const LEAST_CONTRAST: f64 = 0.05;

/// For what moments are kept.
#[derive(Debug, Clone)]
pub struct Keep {
    /// Constants of the materials that rays are walked at.
    reference: Vec<Constants>,
    /// How much more strongly the sample may refract than at these constants, 1 or more.
    pub(super) stronger: f64,
    /// Share of the grazing incidence of ordered walks below which they are repeated at other
    /// energies, so that their cells stand by themselves.
    pub(super) severe: f64,
    /// Signature of a ray that goes into a body and out of it, and meets no other, with the
    /// body's material; sorted.
    alone: Vec<(u32, u32)>,
}

impl Keep {
    /// For media walked at constants of `reference`; `severe` is the share of the grazing
    /// incidence of ordered walks below which they are repeated at other energies; `in_hand`: how
    /// much more strongly than at its energies the media may refract in another scene.
    #[must_use]
    pub fn new(media: &Media, reference: &[Constants], severe: f64, in_hand: f64) -> Self {
        let of_node = media.constants.iter().flat_map(|node| node.iter().zip(reference));
        let stronger = of_node
            .filter(|(_, reference)| reference.delta != 0.0)
            .map(|(node, reference)| (node.delta / reference.delta).abs())
            .fold(1.0, f64::max);
        let twice = |object| upload::hash(object).wrapping_mul(2);
        let bodies = (0..).zip(&media.of_object);
        let mut alone: Vec<_> =
            bodies.map(|(object, material)| (twice(object), *material)).collect();
        alone.sort_unstable();
        // What two bodies share tells nothing.
        alone = alone
            .chunk_by(|a, b| a.0 == b.0)
            .filter(|same| same.len() == 1)
            .flatten()
            .copied()
            .collect();
        Self { reference: reference.to_vec(), stronger: in_hand * stronger, severe, alone }
    }

    /// Whether a law tells the moments of its ray, and then of which material they are: those of a
    /// ray through one body alone are its numbers over the constants. Nothing is told by ordered
    /// walks, or where the constants do not differ from those of the surroundings.
    fn told_by(&self, law: &Law) -> Option<usize> {
        if law.crossings == 0 {
            return Some(0);
        }
        let unlike = FLAG_EXACT | FLAG_UNBALANCED | FLAG_NOT_FINITE;
        if law.crossings != 2 || law.flags & unlike != 0 {
            return None;
        }
        let at = self.alone.binary_search_by_key(&law.signature, |(signature, _)| *signature);
        let material = self.alone[at.ok()?].1 as usize;
        let (inside, outside) = (&self.reference[material], &self.reference[0]);
        // A law is the difference of what either side does, rounded.
        let tells = |of: fn(&Constants) -> f64| {
            let (inside, outside) = (of(inside), of(outside));
            (inside - outside).abs() > LEAST_CONTRAST * inside.abs().max(outside.abs())
        };
        (tells(|c| c.mu) && tells(|c| c.delta)).then_some(material)
    }

    /// Differences of mu and delta from those of the surroundings.
    fn step(&self, material: usize) -> [f64; 2] {
        let (inside, outside) = (&self.reference[material], &self.reference[0]);
        [inside.mu - outside.mu, inside.delta - outside.delta]
    }

    /// Appends the moments that a law tells.
    fn push_told(&self, law: &Law, material: usize, moments: &mut Vec<f32>) {
        let first = moments.len();
        moments.resize(first + self.reference.len() * MOMENTS_PER_MATERIAL, 0.0);
        if law.crossings == 0 {
            return;
        }
        let [mu, delta] = self.step(material);
        for (i, number) in numbers(law).into_iter().enumerate() {
            let moment = (number / if i == 0 { mu } else { delta }) as f32;
            moments[first + material * MOMENTS_PER_MATERIAL + i] = moment;
            moments[first + i] = -moment;
        }
    }
}

impl Refiner<'_> {
    /// Moments at both ends of the segments of spans with these middle lines,
    /// `[segment][end][material][moment]` for each span; nothing where they are not kept. Rays whose
    /// laws do not tell them, few of a line, are traced once more.
    pub(super) fn end_moments(
        &self,
        tracer: &mut Tracer,
        spans: &[Span],
        lines: &[Line],
    ) -> Result<Vec<Vec<f32>>> {
        let Some(keep) = self.view.keep else { return Ok(vec![Vec::new(); spans.len()]) };
        let asked = |(span, line): (&Span, &Line)| -> Vec<Ray> {
            let (mut last, mut rays) = (None, Vec::new());
            for end in line.segments.iter().flat_map(|segment| [&segment.low, &segment.high]) {
                // Neighbours share a ray.
                if last.replace(end.ray) != Some(end.ray) && keep.told_by(&end.law).is_none() {
                    rays.push(self.ray(&span.key(), line.rays.places[end.ray as usize]));
                }
            }
            rays
        };
        let asked: Vec<Vec<Ray>> = spans.par_iter().zip(lines).map(asked).collect();
        let words = tracer.materials() * MOMENTS_PER_MATERIAL;
        let stride = MOMENTS_HEAD + words;
        let all = parallel::concat(&asked);
        let traced = tracer.trace_moments(&all)?;
        let mut rest = &traced[..];
        let of_spans: Vec<&[u32]> = asked
            .iter()
            .map(|rays| {
                let (of_span, after) = rest.split_at(rays.len() * stride);
                rest = after;
                of_span
            })
            .collect();
        let by_segment = |(line, traced): (&Line, &[u32])| {
            let mut traced = traced.chunks_exact(stride);
            let mut moments = Vec::with_capacity(2 * line.segments.len() * words);
            let (mut last, mut of_ray) = (None, &[][..]);
            for segment in &line.segments {
                for (index, end) in [&segment.low, &segment.high].into_iter().enumerate() {
                    let first = moments.len();
                    let new = last.replace(end.ray) != Some(end.ray);
                    match keep.told_by(&end.law) {
                        Some(material) => keep.push_told(&end.law, material, &mut moments),
                        None => {
                            if new {
                                of_ray = traced.next().unwrap_or_default();
                            }
                            let words = of_ray.get(MOMENTS_HEAD..).unwrap_or_default().iter();
                            moments.extend(words.map(|&word| f32::from_bits(word)));
                        }
                    }
                    if let Some(fit) = &segment.fit {
                        let law = numbers(&end.law);
                        let by = std::array::from_fn(|i| fit.ends[index][i] - law[i]);
                        move_law(&mut moments[first..], by, &keep.reference);
                    }
                }
            }
            moments
        };
        Ok(lines.par_iter().zip(of_spans).map(by_segment).collect())
    }
}

/// Moves the law that moments make with these constants, by the material that has the largest part
/// in each of its numbers.
fn move_law(moments: &mut [f32], by: Numbers, constants: &[Constants]) {
    for (i, by) in by.into_iter().enumerate() {
        let constant = |c: &Constants| if i == 0 { c.mu } else { c.delta };
        let part = |(moment, c): &(&mut f32, &Constants)| (f64::from(**moment) * constant(c)).abs();
        let moments = moments[i..].iter_mut().step_by(MOMENTS_PER_MATERIAL).zip(constants);
        if let Some((moment, c)) = moments.max_by(|a, b| part(a).total_cmp(&part(b)))
            && constant(c) != 0.0
        {
            *moment = (f64::from(*moment) + by / constant(c)) as f32;
        }
    }
}
