//! Ordered walks under a spectrum: made once, repeated at the energies that they do not tell of.

use super::{NodeLaw, Spectral};
use crate::Result;
use crate::interface::{Cell, CellRow, FLAG_NOT_FINITE, Law, Ray};
use crate::material::Constants;
use crate::sampling::{CellBatch, ExactCell};
use crate::scene::{Scene, Transport};
use crate::trace::{MaterialTable, Tracer};
use rayon::prelude::*;

/// Severe cells no wider than this (m) take the mean constants' walk at every node: silhouettes
/// are bisected to it, so that there are many, with next to no light.
pub(crate) const NARROW: f32 = 50e-9;
/// Of the grazing incidence below which the first order leaves 1e-9 rad, where the second order
/// leaves as much: beyond it the error grows by delta^2 / c^3.
const SEVERE: f64 = 0.2154;

/// Ordered walks repeated at some nodes.
#[derive(Debug, Default)]
pub(super) struct Repeated {
    /// Which of the ordered cells, ascending.
    cells: Vec<u32>,
    nodes: Vec<AtNode>,
}

/// Places of the laws of two ends.
type Places = Vec<Option<[usize; 2]>>;

/// Ordered walks at a node.
#[derive(Debug, Default)]
struct AtNode {
    laws: Vec<Law>,
    /// For each of the cells above the laws of its two ends, where they were repeated here.
    places: Places,
}

impl AtNode {
    fn at(&self, cell: usize) -> Option<[&Law; 2]> {
        Some(self.places[cell]?.map(|place| &self.laws[place]))
    }
}

impl Repeated {
    /// Laws at the ends of an ordered cell, by node, where it was repeated at some.
    pub(super) fn of(&self, cell: usize) -> Option<impl Iterator<Item = Option<[&Law; 2]>>> {
        let at = self.cells.binary_search_by_key(&cell, |cell| *cell as usize).ok()?;
        Some(self.nodes.iter().map(move |node| node.at(at)))
    }
}

impl Spectral {
    /// Repeats ordered walks at the nodes where they cannot be told from the one made.
    pub(super) fn repeat(&self, tracer: &mut Tracer, strips: &CellBatch) -> Result<Repeated> {
        let exact = &strips.moments.exact;
        let repeats = |node: usize, width: f32, grazing: f64| {
            (width > NARROW || self.severe[node] > 1.0) && grazing < self.severe[node]
        };
        let asks = |(index, cell): (usize, &ExactCell)| {
            let Cell { x_low, x_high, .. } = strips.cells[cell.cell as usize];
            let (width, grazing) = (x_high - x_low, cell.grazing());
            let nodes: Vec<bool> = (0..self.nodes()).map(|n| repeats(n, width, grazing)).collect();
            nodes.contains(&true).then_some((index as u32, nodes))
        };
        let (cells, asked): (Vec<u32>, Vec<Vec<bool>>) =
            exact.par_iter().enumerate().filter_map(asks).unzip();
        let at_node = |node: usize| {
            let mut rays: Vec<Ray> = Vec::new();
            let mut place = |ray: Ray| {
                // Neighbours share a ray.
                let last = rays.len().saturating_sub(2);
                if let Some(at) = rays[last..].iter().position(|r| *r == ray) {
                    return last + at;
                }
                rays.push(ray);
                rays.len() - 1
            };
            let ends = |(cell, nodes): (&u32, &Vec<bool>)| {
                nodes[node].then(|| exact[*cell as usize].ends.map(&mut place))
            };
            let places = cells.iter().zip(&asked).map(ends).collect();
            (rays, places)
        };
        let (rays, places): (Vec<Vec<Ray>>, Vec<Places>) =
            (0..self.nodes()).into_par_iter().map(at_node).unzip();
        let laws = tracer.walk_at_nodes(&rays)?;
        let nodes = laws.into_iter().zip(places).map(|(laws, places)| AtNode { laws, places });
        Ok(Repeated { cells, nodes: nodes.collect() })
    }

    /// Adds to the laws of the nodes what the ordered walk found beyond the first order: that is
    /// of second order, so it grows with the square of delta.
    pub(super) fn correct(
        &self,
        exact: &ExactCell,
        moments: [&[f32]; 2],
        laws: &mut [[NodeLaw; 2]],
    ) {
        let reference = self.nodes();
        for end in 0..2 {
            let walked = self.walked(exact.laws.each_ref(), exact.range[end]);
            let first = self.law(reference, moments[end]);
            for (node, laws) in laws.iter_mut().enumerate() {
                let delta_ratio = self.delta_ratio[node];
                let law = &mut laws[end];
                // A path that changes by refraction: linear in delta, and in mu.
                if first.depth > 0.0 {
                    law.depth +=
                        (walked.depth - first.depth) * delta_ratio * law.depth / first.depth;
                }
                if exact.grazing() < self.severe[node] {
                    // Narrow, or not repeated: total reflection turns light by as much anywhere.
                    law.x = walked.x;
                } else {
                    law.x += (walked.x - first.x) * delta_ratio * delta_ratio;
                }
            }
        }
    }

    /// Law between the ends that were walked in order.
    fn walked(&self, ends: [&Law; 2], at: f32) -> NodeLaw {
        let [a, b] = ends.map(|law| NodeLaw {
            depth: law.optical_depth.into(),
            x: law.displacement_x.into(),
            z: f64::from(law.displacement_z) + f64::from(law.slope_z) * self.gap,
            slope_x: law.slope_x.into(),
        });
        let mix = |f: fn(&NodeLaw) -> f64| f(&a) + (f(&b) - f(&a)) * f64::from(at);
        NodeLaw {
            depth: mix(|l| l.depth),
            x: mix(|l| l.x),
            z: mix(|l| l.z),
            slope_x: mix(|l| l.slope_x),
        }
    }

    /// The cell of a repeated walk at one node. Where its ends met other surfaces the law is
    /// constant on either side.
    pub(super) fn push_exact(
        &self,
        list: &mut Vec<Cell>,
        strip: &CellRow,
        cell: &Cell,
        ends: [&Law; 2],
        range: [f32; 2],
    ) {
        if ends.iter().any(|law| law.flags & FLAG_NOT_FINITE != 0) {
            return;
        }
        if ends[0].signature == ends[1].signature {
            let laws = range.map(|at| self.walked(ends, at));
            list.push(self.cell(strip, [cell.x_low, cell.x_high], laws));
            return;
        }
        let width = cell.x_high - cell.x_low;
        let share = ((0.5 - range[0]) / (range[1] - range[0])).clamp(0.0, 1.0);
        let middle = cell.x_low + share * width;
        for (x, at) in [([cell.x_low, middle], 0.0), ([middle, cell.x_high], 1.0)] {
            if x[1] > x[0] {
                let law = self.walked(ends, at);
                list.push(self.cell(strip, x, [law, law]));
            }
        }
    }
}

/// Share of the grazing incidence that rays were flagged by, below which an ordered walk at the
/// reference constants does not tell the walk at a node.
pub(super) fn severe(
    scene: &Scene,
    media: &MaterialTable,
    reference: &[Constants],
    flagged: f64,
) -> Vec<f64> {
    if scene.sampling.transport == Transport::Exact {
        return vec![f64::INFINITY; media.constants.len()];
    }
    let strongest = |node: &[Constants]| node.iter().fold(0.0_f64, |m, c| m.max(c.delta.abs()));
    let walked = strongest(reference);
    // The third order is delta^3 / c^5, and counts by the light of the node.
    let share = |(node, weight): (&Vec<Constants>, &f64)| {
        if flagged <= 0.0 || node == reference {
            return 0.0;
        }
        let delta_ratio = strongest(node).max(walked) / flagged;
        SEVERE * libm::pow(weight * delta_ratio.powi(3), 0.2)
    };
    media.constants.iter().zip(&media.weights).map(share).collect()
}
