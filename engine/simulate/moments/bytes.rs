//! Cells of a view as the blocks of a file of moments.

use super::content::Bounds;
use crate::illuminate::NARROW;
use crate::sampling::{CellBatch, CellMoments, ExactCell};
use beamlet_core::{Error, Result, numbers};
use beamlet_files::moment_file::{
    BLOCK, Block, END, EXACT_WORDS, MomentFile, MomentWriter, RAY, RESULT,
};
use beamlet_interface::{Cell, CellRow, Ray, RayResult};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::ops::Range;

/// Bytes of a cell with this number of words of a ray's moments, without the path of exact rays.
pub(crate) const fn cell_bytes(words: usize) -> usize {
    size_of::<Cell>() + 2 * words * size_of::<f32>()
}

/// Appends the cell rows of some rows of a view, but for whole rows of a beamlet that nothing
/// lies before.
///
/// # Errors
/// [`Error::File`].
pub fn write(
    keep: &mut MomentWriter,
    view: u32,
    words: usize,
    cell_rows: &CellBatch,
) -> Result<()> {
    let seeing: Vec<&CellRow> =
        cell_rows.cell_rows.iter().filter(|s| !is_blank(cell_rows, s, words)).collect();
    if seeing.is_empty() {
        return keep.append(view, words, &[]);
    }
    let mut cells: Vec<u8> = Vec::new();
    let (mut ends, mut heads) = (Vec::new(), Vec::new());
    let (mut wide_exact, mut wide) = (Vec::new(), 0_u32);
    let mut first = 0_u32;
    for cell_row in &seeing {
        let range =
            cell_row.first_cell as usize..(cell_row.first_cell + cell_row.cell_count) as usize;
        heads.push(CellRow { first_cell: first, ..**cell_row });
        cells.extend_from_slice(bytemuck::cast_slice(&cell_rows.cells[range.clone()]));
        ends.extend_from_slice(
            &cell_rows.moments.ends[2 * words * range.start..2 * words * range.end],
        );
        let from = cell_rows.moments.exact.partition_point(|e| (e.cell as usize) < range.start);
        let of_row = cell_rows.moments.exact[from..].iter();
        for exact in of_row.take_while(|e| (e.cell as usize) < range.end) {
            let cell = &cell_rows.cells[exact.cell as usize];
            wide += u32::from(cell.x_high - cell.x_low > NARROW);
            wide_exact.push(ExactCell { cell: exact.cell - cell_row.first_cell + first, ..*exact });
        }
        first += cell_row.cell_count;
    }
    let rows = seeing.iter().map(|s| s.row);
    let (low, high) = (rows.clone().min().unwrap_or(0), rows.max().unwrap_or(0));
    let head: [u32; BLOCK] = [
        numbers::count(heads.len()),
        first,
        wide,
        numbers::count(wide_exact.len()),
        low.cast_unsigned(),
        high.cast_unsigned(),
    ];
    let wide_exact: Vec<u32> = wide_exact.iter().flat_map(words_of).collect();
    let parts: [&[u8]; 5] = [
        bytemuck::cast_slice(&head),
        bytemuck::cast_slice(&heads),
        &cells,
        bytemuck::cast_slice(&ends),
        bytemuck::cast_slice(&wide_exact),
    ];
    keep.append(view, words, &parts)
}

/// True if a cell row is one cell over a whole row and period, without a sample.
fn is_blank(cell_rows: &CellBatch, cell_row: &CellRow, words: usize) -> bool {
    let cells = cell_row.first_cell as usize..(cell_row.first_cell + cell_row.cell_count) as usize;
    let cell = &cell_rows.cells[cells.start];
    let whole = cell_row.cell_count == 1
        && cell_row.top <= 0.0
        && cell_row.bottom >= 1.0
        && cell.x_low.to_bits() == (-cell.x_high).to_bits();
    let mut moments = cell_rows.moments.ends[2 * words * cells.start..2 * words * cells.end].iter();
    whole && moments.all(|moment| moment.abs() <= 0.0)
}

/// An exact cell as words.
fn words_of(cell: &ExactCell) -> Vec<u32> {
    let mut words = vec![cell.cell];
    for (ray, result) in cell.ends.iter().zip(&cell.results) {
        let ray: &[u32] = bytemuck::cast_slice(bytemuck::bytes_of(ray));
        words.extend_from_slice(&ray[..RAY]);
        // What rough surfaces spread is in the moments.
        let result: &[u32] = bytemuck::cast_slice(bytemuck::bytes_of(result));
        words.extend_from_slice(&result[..RESULT]);
    }
    words
}

/// Hands over the blocks of a file that have cell rows in some rows.
///
/// # Errors
/// [`Error::File`] where the file cannot be read, or its numbers cannot belong to the run; errors of
/// `take`.
pub(super) fn read(
    from: &MomentFile,
    rows: &Range<i64>,
    words: usize,
    bounds: Bounds,
    mut take: impl FnMut(CellBatch) -> Result<()>,
) -> Result<()> {
    from.read(rows, words, |block, file| {
        let failed = |error| Error::file(from.path(), "cannot be read", Some(error));
        let cell_rows = unpack(block, words, file).map_err(failed)?;
        bounds.check(&cell_rows, &block.rows()).map_err(|problem| {
            let problem = format!("holds {problem}: simulate again");
            Error::file(from.path(), problem, None)
        })?;
        take(cell_rows)
    })
}

fn unpack(block: &Block, words: usize, file: &mut File) -> std::io::Result<CellBatch> {
    fn take<T: bytemuck::Pod>(file: &mut File, count: usize) -> std::io::Result<Vec<T>> {
        let lacks = |()| std::io::Error::from(ErrorKind::OutOfMemory);
        let mut items = bytemuck::allocation::try_zeroed_vec(count).map_err(lacks)?;
        file.read_exact(bytemuck::cast_slice_mut(&mut items))?;
        Ok(items)
    }
    let [cell_rows, cells, _, exact, ..] = block.head.map(|n| n as usize);
    Ok(CellBatch {
        cell_rows: take(file, cell_rows)?,
        cells: take(file, cells)?,
        moments: CellMoments {
            ends: take(file, 2 * words * cells)?,
            exact: take(file, exact * EXACT_WORDS)?
                .chunks_exact(EXACT_WORDS)
                .map(exact_of)
                .collect(),
        },
        ..CellBatch::default()
    })
}

fn exact_of(words: &[u32]) -> ExactCell {
    let end = |i: usize| &words[1 + END * i..1 + END * (i + 1)];
    let ray = |i: usize| {
        let mut words = [0_u32; size_of::<Ray>() / 4];
        words[..RAY].copy_from_slice(&end(i)[..RAY]);
        bytemuck::cast(words)
    };
    let result = |i: usize| {
        let mut words = [0_u32; size_of::<RayResult>() / 4];
        words[..RESULT].copy_from_slice(&end(i)[RAY..]);
        bytemuck::cast(words)
    };
    ExactCell {
        cell: words[0],
        ends: [ray(0), ray(1)],
        results: [result(0), result(1)],
        range: [0.0, 1.0],
    }
}
