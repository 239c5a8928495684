//! Mask offsets of the views of a scan, each list of them once.

use crate::scene::{Exposure, Scan};
use beamlet_core::numbers;
use std::collections::HashMap;

/// Displacements of the sample mask by list and mask step, less whole periods, m.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewOffsets {
    /// Offsets of the flat first, then each other list.
    lists: Vec<Vec<f64>>,
    /// Index of the list of each view; none where all have the first.
    of_view: Vec<u32>,
    /// Index of the list of each flat.
    of_flat: Vec<u32>,
}

impl ViewOffsets {
    /// `applied`: offsets of an exposure with its errors; `within`: an offset less whole periods.
    pub(super) fn new(
        scan: &Scan,
        applied: impl Fn(Exposure) -> Vec<f64>,
        within: impl Fn(f64) -> f64,
    ) -> Self {
        let reduced = |list: &[f64]| list.iter().map(|offset| within(*offset)).collect();
        let bits = |list: &Vec<f64>| list.iter().map(|it| it.to_bits()).collect::<Vec<_>>();
        let mut lists = vec![reduced(&scan.mask_offsets)];
        let mut known = HashMap::from([(bits(&lists[0]), 0)]);
        let errors = &scan.errors;
        let differ = !scan.view_offsets.is_empty()
            || !errors.mask_offsets.is_empty()
            || !errors.source.is_empty();
        let mut index = |exposure| {
            let list = reduced(&applied(exposure));
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
        Self { lists, of_view, of_flat }
    }

    /// All lists, in the order of their indices.
    pub fn lists(&self) -> &[Vec<f64>] {
        &self.lists
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
            let applied = |exposure| scan.planned_offsets(exposure).to_vec();
            ViewOffsets::new(scan, applied, |offset| libm::remainder(offset, 10.0))
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
