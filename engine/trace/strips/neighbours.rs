//! Rays of lines in an order that keeps neighbours together: they meet the same triangles, and
//! devices trace them side by side.

#![allow(clippy::cast_possible_truncation, reason = "a block has few rays")]

use super::Key;
use super::refiner::Refiner;
use crate::Result;
use crate::gpu::interface::{Law, Ray};
use crate::parallel;
use crate::trace::tracer::Tracer;
use rayon::prelude::*;

/// Lines whose rays go together: cells are narrow and rows high, so that rays at one x of a few
/// lines are closer than those of one line.
const LINES: usize = 4;

/// Places of rays of a line.
pub(super) type Wanted = (Key, Vec<f32>);

impl Refiner<'_> {
    /// Laws of rays at places of lines, one line after another.
    pub(super) fn trace_places(&self, tracer: &mut Tracer, lines: &[Wanted]) -> Result<Vec<Law>> {
        let block = |lines: &[Wanted]| -> (Vec<u32>, Vec<Ray>) {
            let rays: Vec<(&Key, f32)> = lines
                .iter()
                .flat_map(|(key, places)| places.iter().map(move |x| (key, *x)))
                .collect();
            let order = by_place(lines);
            let in_order = |&at: &u32| {
                let (key, x) = rays[at as usize];
                self.ray(key, x)
            };
            let rays = order.iter().map(in_order).collect();
            (order, rays)
        };
        let (orders, rays): (Vec<Vec<u32>>, Vec<Vec<Ray>>) =
            lines.par_chunks(LINES).map(block).unzip();
        let all = parallel::concat(&rays);
        drop(rays);
        let traced = tracer.trace(&all)?;
        drop(all);
        let mut laws: Vec<Law> = bytemuck::zeroed_vec(traced.len());
        let (mut from, mut to) = (&traced[..], &mut laws[..]);
        let mut blocks = Vec::with_capacity(orders.len());
        for order in &orders {
            let (traced, after) = from.split_at(order.len());
            let (laws, rest) = to.split_at_mut(order.len());
            blocks.push((order, traced, laws));
            (from, to) = (after, rest);
        }
        blocks.into_par_iter().for_each(|(order, traced, laws): (_, _, &mut [Law])| {
            for (at, law) in order.iter().zip(traced) {
                laws[*at as usize] = *law;
            }
        });
        Ok(laws)
    }
}

/// Indices of the rays of lines, counted one line after another, by x.
fn by_place(lines: &[Wanted]) -> Vec<u32> {
    let places = &lines[0].1;
    let (count, lines_count) = (places.len() as u32, lines.len() as u32);
    if lines.iter().all(|(_, others)| others == places) {
        return (0..count).flat_map(|ray| (0..lines_count).map(move |l| l * count + ray)).collect();
    }
    let all = lines.iter().flat_map(|(_, places)| places);
    let mut order: Vec<(f32, u32)> = all.copied().zip(0..).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    order.into_iter().map(|(_, ray)| ray).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ray_goes_once_and_by_its_place() {
        let line = |places: &[f32]| ((0, 0), places.to_vec());
        let alike = [line(&[-1.0, 0.0, 1.0]), line(&[-1.0, 0.0, 1.0])];
        assert_eq!(by_place(&alike), [0, 3, 1, 4, 2, 5]);
        let unlike = [line(&[-1.0, 1.0]), line(&[]), line(&[-2.0, 0.0, 3.0])];
        assert_eq!(by_place(&unlike), [2, 0, 3, 1, 4]);
    }
}
