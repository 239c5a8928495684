//! Parts of cell rows, one for each invocation.

use beamlet_core::numbers;
use beamlet_interface::{CellRow, CellRowPart};

/// Most cells of a part.
const CELLS_EACH: u32 = 64;
/// Most cells of a row that stays whole if its light lands near: such light is rounded once for each part.
/// Only rows of unresolved structure have more.
const CELLS_WHOLE: u32 = 512;

/// Parts of cell rows: the first parts of all rows, then their second ones, and so on. Neighbours see the same
/// apertures from several rows, and subgroups wait for one another less. The last part of a row has no end: energies
/// may have more cells.
pub(super) fn parts_of(cell_rows: &[CellRow], far: bool) -> Vec<CellRowPart> {
    let count = |row: &CellRow| match row.cell_count {
        1..=CELLS_WHOLE if !far => 1,
        cells => cells.div_ceil(CELLS_EACH),
    };
    let mut rows: Vec<(u32, &CellRow)> = (0..).zip(cell_rows).collect();
    let mut parts = Vec::with_capacity(rows.len());
    let mut part = 0;
    while !rows.is_empty() {
        rows.retain(|(_, row)| part < count(row));
        for (index, row) in &rows {
            // Parts of a row are about equal.
            let end = |part: u32| {
                let cells = u64::from(row.cell_count) * u64::from(part);
                let end = numbers::low_word(cells / u64::from(count(row)));
                if part == count(row) { u32::MAX } else { end }
            };
            parts.push(CellRowPart { cell_row: *index, first: end(part), last: end(part + 1) });
        }
        part += 1;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(counts: &[u32]) -> Vec<CellRow> {
        let row = |&cell_count: &u32| CellRow { cell_count, ..bytemuck::Zeroable::zeroed() };
        counts.iter().map(row).collect()
    }

    /// Every cell is in one part, and none has many.
    #[test]
    fn parts_cover_their_rows_and_are_small() {
        let rows = rows(&[1, 64, 65, 0, 5000, 512, 513]);
        let far = (true, 64, 1 + 1 + 2 + 79 + 8 + 9);
        let near = (false, 512, 1 + 1 + 1 + 79 + 1 + 9);
        for (far, most, count) in [far, near] {
            let mut parts = parts_of(&rows, far);
            parts
                .iter_mut()
                .for_each(|it| it.last = it.last.min(rows[it.cell_row as usize].cell_count));
            assert!(parts.iter().all(|part| part.last - part.first <= most));
            assert_eq!(parts.len(), count);
            for (index, row) in (0..).zip(&rows) {
                let of_row = parts.iter().filter(|part| part.cell_row == index);
                let cells: Vec<u32> = of_row.flat_map(|part| part.first..part.last).collect();
                assert_eq!(cells, (0..row.cell_count).collect::<Vec<_>>());
            }
            // First parts in the order of their rows, before further parts of long ones.
            let order: Vec<u32> = parts[..6].iter().map(|part| part.cell_row).collect();
            assert_eq!(order, [0, 1, 2, 4, 5, 6]);
        }
    }
}
