//! Places of the pixels of images on the detector.

use super::super::input::Input;
use super::{Layout, Retriever};

/// Places of the pixels of a view on the detector, x and z from the optical axis, m.
#[derive(Debug)]
pub(in crate::retrieve) enum ImagePlaces {
    /// Places of columns and of rows.
    Grid([Vec<f64>; 2]),
    /// Places of beamlets by row and column; NaN where there is none.
    Lattice(ndarray::Array2<[f64; 2]>),
}

impl ImagePlaces {
    /// Number of rows.
    pub(in crate::retrieve) fn rows(&self) -> usize {
        match self {
            Self::Grid([_, rows]) => rows.len(),
            Self::Lattice(places) => places.nrows(),
        }
    }

    /// Place of a pixel, m.
    pub(in crate::retrieve) fn at(&self, row: usize, column: usize) -> [f64; 2] {
        match self {
            Self::Grid([columns, rows]) => [columns[column], rows[row]],
            Self::Lattice(places) => places[[row, column]],
        }
    }
}

impl Retriever {
    /// Places of the pixels of a view of an input; of a lattice those in the flat.
    pub(in crate::retrieve) fn image_places(&self, input: &Input) -> ImagePlaces {
        if let Layout::Lattice(_, Some(beamlets)) = &self.layout {
            return ImagePlaces::Lattice(beamlets.places());
        }
        let image = input.image_scene();
        let [rows, pitch] = [f64::from(image.detector.pixels[1]), image.detector.pitch[1]];
        let place = |row| (rows / 2.0 - 0.5 - f64::from(row)) * pitch;
        let rows = (0..image.detector.pixels[1]).map(place).collect();
        ImagePlaces::Grid([self.places(input), rows])
    }
}
