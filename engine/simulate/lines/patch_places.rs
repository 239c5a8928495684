//! Patches on which shadows of bodies fall.

use super::critical::SampleImage;
use super::even::Bodies;
use super::heights::Features;
use crate::sampling::{PatchGrid, ProjectedBounds, ViewContext};
use std::collections::BTreeMap;
use std::ops::Range;

/// Most bodies of a patch of lines: among more, rays are tried that are spread evenly.
const MOST_BODIES: u32 = 32;

/// Patches of some rows that shadows touch.
#[derive(Debug)]
pub(crate) struct PatchPlaces {
    grid: PatchGrid,
    touched: Vec<Option<Touched>>,
}

/// Bodies whose shadows fall on a patch.
#[derive(Debug, Clone, Default)]
struct Touched {
    /// Without changes of light along z where bodies are many.
    features: Features,
    bodies: Bodies,
}

impl Touched {
    fn is_crowded(&self) -> bool {
        self.bodies.count > MOST_BODIES
    }
}

impl PatchPlaces {
    /// Patches of some rows.
    pub(crate) fn new(view: &ViewContext<'_>, rows: Range<i64>) -> Self {
        let grid = PatchGrid { rows, beamlets: view.lattice.beamlets.clone() };
        let touched = vec![None; grid.count()];
        let mut places = Self { grid, touched };
        for shadow in view.projected_bounds {
            for (row, patches) in shadowed(view, &places.grid, shadow) {
                for at in patches {
                    let patch = places.touched[at].get_or_insert_default();
                    patch.bodies.add(shadow);
                    patch.features.add_body(shadow, row);
                }
            }
        }
        let has_few = |it: &Option<Touched>| it.as_ref().is_some_and(|it| !it.is_crowded());
        let of_few: Vec<bool> = places.touched.iter().map(has_few).collect();
        for (at, features) in places.features(view, &of_few) {
            places.touched[at].get_or_insert_default().features = features;
        }
        places
    }

    /// Changes of light along z in a patch. Those of patches of many bodies are made by [`Self::features_of_many`].
    pub(super) fn features_of_few(&self, beamlet: i64, row: i64) -> Option<&Features> {
        self.at(beamlet, row).map(|it| &it.features)
    }

    /// Changes of light along z in patches of many bodies.
    pub(super) fn features_of_many(
        &self,
        view: &ViewContext<'_>,
        patches: &[(i64, i64)],
    ) -> Vec<Features> {
        let at = |(beamlet, row): &(i64, i64)| self.grid.index(*beamlet, *row);
        let mut is_chosen = vec![false; self.touched.len()];
        patches.iter().filter_map(at).for_each(|at| is_chosen[at] = true);
        let mut found: BTreeMap<usize, Features> =
            self.features(view, &is_chosen).into_iter().collect();
        patches
            .iter()
            .map(|place| at(place).and_then(|at| found.remove(&at)).unwrap_or_default())
            .collect()
    }

    /// Features of the chosen patches with the changes of light along z, by index.
    fn features(&self, view: &ViewContext<'_>, is_chosen: &[bool]) -> Vec<(usize, Features)> {
        let mut features: Vec<Option<Features>> = self
            .touched
            .iter()
            .zip(is_chosen)
            .map(|(it, is_chosen)| it.as_ref().filter(|_| *is_chosen).map(|it| it.features.clone()))
            .collect();
        let varies = |it: &Option<Features>| it.as_ref().is_some_and(|it| it.varies);
        let is_wanted: Vec<bool> = features.iter().map(varies).collect();
        let is_selected = view.projected_bounds.iter().map(|shadow| {
            shadowed(view, &self.grid, shadow)
                .any(|(_, mut patches)| patches.any(|at| is_wanted[at]))
        });
        let is_selected: Vec<bool> = is_selected.collect();
        if is_selected.contains(&true) {
            let wanted =
                |beamlet, row| self.grid.index(beamlet, row).is_some_and(|at| is_wanted[at]);
            let image = SampleImage::of_lines(view);
            for it in image.changes(self.grid.rows.clone(), &is_selected, &wanted) {
                let at = self.grid.index(it.beamlet, it.row);
                let features = at.and_then(|at| features[at].as_mut());
                features.into_iter().for_each(|features| features.add(it.change, it.row));
            }
        }
        let with_index = |(at, it): (usize, Option<Features>)| {
            let mut features = it?;
            features.join_creases();
            Some((at, features))
        };
        features.into_iter().enumerate().filter_map(with_index).collect()
    }

    fn at(&self, beamlet: i64, row: i64) -> Option<&Touched> {
        self.grid.index(beamlet, row).and_then(|at| self.touched[at].as_ref())
    }

    /// Bodies whose shadows fall on a patch.
    pub(super) fn bodies(&self, beamlet: i64, row: i64) -> Option<Bodies> {
        self.at(beamlet, row).map(|it| it.bodies)
    }

    /// True if no shadow falls that matters.
    pub(crate) fn is_empty(&self) -> bool {
        self.touched.iter().all(Option::is_none)
    }

    /// True if so many bodies may be in a patch that rays are tried.
    pub(crate) fn is_crowded(&self, beamlet: i64, row: i64) -> bool {
        self.at(beamlet, row).is_some_and(Touched::is_crowded)
    }

    /// True if a shadow falls on a patch.
    pub(crate) fn is_touched(&self, beamlet: i64, row: i64) -> bool {
        self.at(beamlet, row).is_some()
    }
}

/// Rows of a grid on which a shadow falls, as far as they count, with its patches.
fn shadowed(
    view: &ViewContext<'_>,
    grid: &PatchGrid,
    shadow: &ProjectedBounds,
) -> impl Iterator<Item = (i64, Range<usize>)> {
    let beamlets = shadow.patches(view.lattice)[1].clone();
    let recorded = view.recorded_rows();
    let rows: Vec<i64> = shadow.rows_that_count(view.lattice, &recorded, &grid.rows).collect();
    rows.into_iter().map(move |row| (row, grid.in_row(row, beamlets.clone())))
}
