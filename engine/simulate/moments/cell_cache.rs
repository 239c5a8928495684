//! Cells that one scene made of kept moments, for the next ones that would make the same.

use super::resample::{Covered, Resampled};
use crate::illuminate::EnergyBinning;
use crate::sampling::CellBatch;
use beamlet_interface::{Cell, CellRow};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Some rows of a view.
type RowsOfView = (u32, Range<i64>);

/// Cells of some rows of a view, ready to be illuminated.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// Lists of cell rows, as [`EnergyBinning::lists`] gives them, by block of the file.
    pub(super) lists: Vec<Vec<CellBatch>>,
    pub(super) covered: Covered,
}

impl Part {
    /// The lists, of these rows alone.
    pub(super) fn lists_of(&self, rows: &Range<i64>) -> impl Iterator<Item = Vec<CellBatch>> {
        self.lists.iter().map(|lists| lists.iter().map(|list| list.of_rows(rows)).collect())
    }

    pub(super) fn bytes(&self) -> u64 {
        let of_list = |list: &CellBatch| {
            list.cells.capacity() * size_of::<Cell>()
                + list.cell_rows.capacity() * size_of::<CellRow>()
        };
        let lists: usize = self.lists.iter().flatten().map(of_list).sum();
        (lists + self.covered.bytes()) as u64
    }
}

/// Cells of the first scene, as far as they fit.
#[derive(Debug, Default)]
pub(super) struct CellCache {
    /// Bytes kept at most.
    most: u64,
    kept: Mutex<Made>,
}

#[derive(Debug, Default)]
struct Made {
    by: Option<(Resampled, EnergyBinning)>,
    parts: HashMap<RowsOfView, Arc<Part>>,
    bytes: u64,
}

impl Made {
    fn is_by(&self, resample: &Resampled, spectral: &EnergyBinning) -> bool {
        self.by.as_ref().is_some_and(|(r, s)| r.maps_like(resample) && s.gathers_like(spectral))
    }

    /// True if it is the first scene's or like it, and `bytes` more still fit.
    fn takes(&self, resample: &Resampled, spectral: &EnergyBinning, bytes: u64, most: u64) -> bool {
        self.bytes + bytes <= most && (self.by.is_none() || self.is_by(resample, spectral))
    }
}

impl CellCache {
    pub(super) fn new(most: u64) -> Self {
        Self { most, kept: Mutex::default() }
    }

    fn lock(&self) -> MutexGuard<'_, Made> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Cells made by the same parameters for a place, or for more rows than it has.
    pub(super) fn find(
        &self,
        resample: &Resampled,
        spectral: &EnergyBinning,
        place: &RowsOfView,
    ) -> Option<Arc<Part>> {
        let made = self.lock();
        if !made.is_by(resample, spectral) {
            return None;
        }
        let (view, rows) = place;
        let holds =
            |(own, all): &RowsOfView| own == view && all.start <= rows.start && rows.end <= all.end;
        let containing = || made.parts.iter().find(|(place, _)| holds(place)).map(|(_, part)| part);
        made.parts.get(place).or_else(containing).cloned()
    }

    /// True if a part of some bytes would be kept.
    pub(super) fn takes(&self, resample: &Resampled, spectral: &EnergyBinning, bytes: u64) -> bool {
        self.lock().takes(resample, spectral, bytes, self.most)
    }

    /// Keeps a part, if it is the first scene's or like it, and fits.
    pub(super) fn insert(
        &self,
        resample: &Resampled,
        spectral: &EnergyBinning,
        place: RowsOfView,
        part: Part,
    ) {
        let bytes = part.bytes();
        let mut made = self.lock();
        if made.takes(resample, spectral, bytes, self.most) && !made.parts.contains_key(&place) {
            made.by.get_or_insert_with(|| (resample.clone(), spectral.clone()));
            made.bytes += bytes;
            made.parts.insert(place, Arc::new(part));
        }
    }
}
