//! Windows of beamlets: the pixels nearest to each of them, and the images that they form.

use super::found::{Frame, PlacedLattice};
use beamlet_core::numbers::whole;
use beamlet_core::{Error, Result};
use std::collections::BTreeMap;

/// Distance of beamlets in pixels that a fit of seven unknowns needs along both axes.
const LEAST_PIXELS: f64 = 4.0;

/// Pixels of a beamlet.
#[derive(Debug, Clone)]
pub(super) struct Window {
    /// Centre on the detector by the lattice, m from the middle of the frame.
    pub(super) centre: [f64; 2],
    /// Indices in the lattice.
    pub(super) index: [i64; 2],
    /// Row and column of each pixel.
    pub(super) pixels: Vec<[u32; 2]>,
}

/// Windows in the order of the images: `[row][column]`, the first row with the largest z.
#[derive(Debug)]
pub(super) struct Windows {
    /// Rows and columns of the images.
    pub(super) shape: [usize; 2],
    windows: BTreeMap<[usize; 2], Window>,
}

impl Windows {
    /// Windows of all beamlets whose pixels are all on the frame.
    ///
    /// # Errors
    /// [`Error::Argument`] for lattices of fewer pixels than a fit needs, and where no beamlet is whole.
    pub(super) fn of(placed: &PlacedLattice, frame: &Frame) -> Result<Self> {
        let lattice = &placed.lattice;
        let [px, pz] = frame.pitch;
        let least = LEAST_PIXELS * px.max(pz);
        if lattice.distance() < least * (1.0 - 1e-6) {
            let pixels = lattice.distance() / px.max(pz);
            let found = format!("{pixels:.2} pixels from beamlet to beamlet");
            let allowed = format!("at least {LEAST_PIXELS} pixels for a fit of seven unknowns");
            return Err(Error::argument("lattice", found, allowed));
        }
        let mut found = BTreeMap::new();
        for index in indices(placed, frame) {
            if let Some(window) = window(placed, frame, index) {
                found.insert(cell(placed, index), window);
            }
        }
        let ends = |axis: usize| {
            let all = found.keys().map(move |cell: &[i64; 2]| cell[axis]);
            all.clone().min().zip(all.max())
        };
        let (Some(rows), Some(columns)) = (ends(0), ends(1)) else {
            let um = |sides: [f64; 2]| format!("{:.1} x {:.1} um", 1e6 * sides[0], 1e6 * sides[1]);
            let [rows, columns] = frame.shape.map(|count| count as f64);
            let found =
                format!("a frame of {} without a whole beamlet", um([columns * px, rows * pz]));
            let cell = um(lattice.half_cell().map(|half| 2.0 * half));
            let allowed = format!("a frame that holds all of a beamlet, {cell}");
            return Err(Error::argument("lattice", found, allowed));
        };
        // Rows of the image begin at the largest z.
        let place = |[row, column]: [i64; 2]| {
            [whole::<usize>((rows.1 - row) as f64), whole::<usize>((column - columns.0) as f64)]
        };
        let shape = [rows.1 - rows.0 + 1, columns.1 - columns.0 + 1];
        Ok(Self {
            shape: shape.map(|count| whole::<usize>(count as f64)),
            windows: found.into_iter().map(|(cell, window)| (place(cell), window)).collect(),
        })
    }

    /// Number of places in an image.
    pub(super) const fn count(&self) -> usize {
        self.shape[0] * self.shape[1]
    }

    /// Index in an image and window of each beamlet.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, &Window)> {
        self.windows.iter().map(|([row, column], window)| (row * self.shape[1] + column, window))
    }

    /// Mean x of each column of the images, m from the middle of the frame.
    pub(super) fn columns(&self) -> Vec<f64> {
        let mut sums = vec![[0.0; 2]; self.shape[1]];
        for ([_, column], window) in &self.windows {
            sums[*column][0] += window.centre[0];
            sums[*column][1] += 1.0;
        }
        sums.iter().map(|[sum, count]| sum / count).collect()
    }
}

/// Indices of beamlets whose centres are on the frame.
fn indices(placed: &PlacedLattice, frame: &Frame) -> Vec<[i64; 2]> {
    let [rows, columns] = frame.shape.map(|count| whole::<i64>(count as f64));
    let corners = [[-1, -1], [-1, columns], [rows, -1], [rows, columns]];
    let corners = corners.map(|[row, column]| {
        let [x, z] = frame.place(row, column);
        placed.lattice.indices([x - placed.origin[0], z - placed.origin[1]])
    });
    let range = |axis: usize| {
        let all = corners.map(|corner| corner[axis]);
        let low = all.into_iter().fold(f64::INFINITY, f64::min).floor();
        let high = all.into_iter().fold(f64::NEG_INFINITY, f64::max).ceil();
        whole::<i64>(low)..=whole::<i64>(high)
    };
    range(0).flat_map(|i| range(1).map(move |j| [i, j])).collect()
}

/// Row (ascending with z) and column of a beamlet: rows follow the first vector, and columns stay at one x.
fn cell(placed: &PlacedLattice, [i, j]: [i64; 2]) -> [i64; 2] {
    let [a, b] = placed.lattice.vectors;
    let moved = if a[0].abs() > 0.0 { (j as f64 * b[0] / a[0]).round() } else { 0.0 };
    [j, i + whole::<i64>(moved)]
}

/// Pixels of a beamlet; `None` if some are beyond the frame.
fn window(placed: &PlacedLattice, frame: &Frame, index: [i64; 2]) -> Option<Window> {
    let lattice = &placed.lattice;
    let [x, z] = lattice.place(index.map(|index| index as f64));
    let centre = [x + placed.origin[0], z + placed.origin[1]];
    let half = lattice.half_cell();
    let [top, left] = frame.pixel([centre[0] - half[0], centre[1] + half[1]]);
    let [bottom, right] = frame.pixel([centre[0] + half[0], centre[1] - half[1]]);
    let mut pixels = Vec::new();
    for row in whole::<i64>(top.ceil())..=whole::<i64>(bottom.floor()) {
        for column in whole::<i64>(left.ceil())..=whole::<i64>(right.floor()) {
            let [x, z] = frame.place(row, column);
            if lattice.nearest([x - placed.origin[0], z - placed.origin[1]]) != index {
                continue;
            }
            let [rows, columns] = frame.shape;
            let pixel = (usize::try_from(row).ok(), usize::try_from(column).ok());
            match pixel {
                (Some(r), Some(c)) if r < rows && c < columns => {
                    pixels.push([u32::try_from(r).ok()?, u32::try_from(c).ok()?]);
                }
                _ => return None,
            }
        }
    }
    (!pixels.is_empty()).then_some(Window { centre, index, pixels })
}

#[cfg(test)]
mod tests {
    use super::super::lattice::Lattice;
    use super::*;

    /// Beamlets whose cells are inside of the frame are there once, and each pixel belongs to one at most.
    #[test]
    fn windows_of_any_lattice_share_no_pixel() {
        let frame = Frame { shape: [60, 80], pitch: [1.0, 1.0] };
        for (periods, angle) in [([6.3, 5.6], 0.0), ([7.0, 7.0], 0.06), ([5.0, 9.0], -0.3)] {
            let lattice = Lattice::turned(periods, angle).unwrap();
            let placed = PlacedLattice { lattice, origin: [0.4, 1.2] };
            let windows = Windows::of(&placed, &frame).unwrap();
            let mut all: Vec<[u32; 2]> =
                windows.iter().flat_map(|(_, window)| window.pixels.clone()).collect();
            let count = all.len();
            all.sort_unstable();
            all.dedup();
            assert_eq!(all.len(), count, "{periods:?} {angle}");
            let cells = count as f64 / (periods[0] * periods[1]);
            assert!((cells / windows.iter().count() as f64 - 1.0).abs() < 0.02, "{cells}");
            assert!(count > 60 * 80 / 2, "{count} pixels in windows");
        }
    }

    /// Rows of a hexagonal lattice are horizontal and its columns stay within half a period of one x.
    #[test]
    fn columns_of_hexagonal_lattices_are_upright() {
        let frame = Frame { shape: [100, 100], pitch: [1.0, 1.0] };
        let lattice = Lattice::new([[8.0, 0.0], [4.0, 6.93]]).unwrap();
        let windows = Windows::of(&PlacedLattice { lattice, origin: [0.0; 2] }, &frame).unwrap();
        let columns = windows.columns();
        for ([_, column], window) in &windows.windows {
            assert!((window.centre[0] - columns[*column]).abs() < 4.1, "{column} {window:?}");
        }
        assert!(windows.iter().count() > 9 * 12 && windows.count() <= 13 * 15);
    }
}
