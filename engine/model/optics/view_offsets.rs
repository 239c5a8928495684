//! Mask offsets of the views of a scan, each list of them once.

use super::WholePeriods;
use crate::scene::{Exposure, Scan};
use beamlet_core::numbers;
use std::collections::HashMap;

/// Displacements of the sample mask by list and mask step, less whole periods, m: within half a period, so that f32
/// holds them as precisely as positions in a period.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewOffsets {
    /// Offsets along x of the flat first, then each other list.
    lists: Vec<Vec<f64>>,
    /// Offsets along z of each list; empty where they are 0.
    lists_z: Vec<Vec<f64>>,
    /// Index of the list of each view; none where all have the first.
    of_view: Vec<u32>,
    /// Index of the list of each flat.
    of_flat: Vec<u32>,
}

impl ViewOffsets {
    /// `applied`: offsets of an exposure along x and z with its errors; `patterns`: lengths after which the mask
    /// repeats along x and z, m.
    pub(super) fn new(
        scan: &Scan,
        applied: impl Fn(Exposure) -> [Vec<f64>; 2],
        patterns: [f64; 2],
    ) -> Self {
        let reduced = |offset: f64, axis: usize| {
            WholePeriods::in_offset(offset, patterns[axis]).reduced(offset)
        };
        let within = |[mut x, mut z]: [Vec<f64>; 2]| {
            x.iter_mut().for_each(|offset| *offset = reduced(*offset, 0));
            z.iter_mut().for_each(|offset| *offset = reduced(*offset, 1));
            [x, z]
        };
        let bits = |lists: &[Vec<f64>; 2]| {
            lists.each_ref().map(|list| list.iter().map(|it| it.to_bits()).collect::<Vec<_>>())
        };
        let mut lists = vec![within([scan.mask_offsets.clone(), scan.mask_offsets_z.clone()])];
        let mut known = HashMap::from([(bits(&lists[0]), 0)]);
        let errors = &scan.errors;
        let differ = !scan.view_offsets.is_empty()
            || !errors.mask_offsets.is_empty()
            || !errors.mask_offsets_z.is_empty()
            || !errors.source.is_empty();
        let mut index = |exposure| {
            let list = within(applied(exposure));
            *known.entry(bits(&list)).or_insert_with(|| {
                lists.push(list);
                numbers::count(lists.len() - 1)
            })
        };
        let mut indices = |count: usize, stack: Exposure| {
            let count = if differ { numbers::count(count) } else { 0 };
            (0..count).map(|at| index(stack.with_index(at))).collect()
        };
        let of_view = indices(scan.views(), Exposure::Sample(0));
        let of_flat = indices(scan.flat_places().len(), Exposure::Flat(0));
        let (lists, lists_z) = lists.into_iter().map(|[x, z]| (x, z)).unzip();
        Self { lists, lists_z, of_view, of_flat }
    }

    /// Offsets along x of all lists, in the order of their indices.
    pub fn lists(&self) -> &[Vec<f64>] {
        &self.lists
    }

    /// Offsets along z of all lists; a list without any has offsets of 0.
    pub fn lists_z(&self) -> &[Vec<f64>] {
        &self.lists_z
    }

    /// Index of the list of an exposure.
    pub fn list_of(&self, view: Exposure) -> usize {
        let lists = match view {
            Exposure::Sample(_) => &self.of_view,
            Exposure::Flat(_) => &self.of_flat,
            Exposure::Dark(_) => return 0,
        };
        lists.get(view.index() as usize).map_or(0, |list| *list as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_lists_are_kept_once() {
        let mut scan = Scan::new(vec![-1.0, 2.0], vec![0.0; 4]);
        let of = |scan: &Scan| {
            let applied = |exposure| [scan.planned_offsets(exposure).to_vec(), Vec::new()];
            ViewOffsets::new(scan, applied, [10.0, f64::INFINITY])
        };
        assert_eq!(of(&scan).lists(), [[-1.0, 2.0]]);
        assert_eq!(of(&scan).list_of(Exposure::Sample(3)), 0);
        // The third is the first, but for a period.
        scan.view_offsets = vec![vec![3.0, 4.0], vec![-1.0, 2.0], vec![9.0, 2.0], vec![3.0, 4.0]];
        let offsets = of(&scan);
        assert_eq!(offsets.lists(), [[-1.0, 2.0], [3.0, 4.0]]);
        let lists = (0..4).map(|view| offsets.list_of(Exposure::Sample(view)));
        assert_eq!(lists.collect::<Vec<_>>(), [1, 0, 0, 1]);
        assert_eq!(offsets.list_of(Exposure::Flat(0)), 0);
    }
}
