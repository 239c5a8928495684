//! Exact shapes whose surfaces cross: which ones, by their places.

use std::collections::BTreeMap;

/// Shapes whose surfaces cross others, by their indices among the placed surfaces of a sample.
///
/// Their surfaces are not cut: the material outside a surface depends on the point, and rays find it by
/// the partners that contain the point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Partners {
    lists: BTreeMap<u32, Vec<u32>>,
}

impl Partners {
    /// Partners of pairs, each once.
    pub(super) fn of_pairs(pairs: impl Iterator<Item = [u32; 2]>) -> Self {
        let mut lists: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for [a, b] in pairs {
            lists.entry(a).or_default().push(b);
            lists.entry(b).or_default().push(a);
        }
        lists.values_mut().for_each(|it| it.sort_unstable());
        Self { lists }
    }

    /// Each shape that others cross, with those.
    pub fn lists(&self) -> impl Iterator<Item = (u32, &[u32])> {
        self.lists.iter().map(|(at, of)| (*at, of.as_slice()))
    }

    /// The shapes that cross one.
    pub fn of(&self, at: u32) -> Option<&[u32]> {
        self.lists.get(&at).map(Vec::as_slice)
    }

    /// True if no shapes cross.
    pub(crate) fn is_empty(&self) -> bool {
        self.lists.is_empty()
    }
}
