//! Images of dithered views: the columns of all dithers of an angle side by side.

use super::images::Images;
use beamlet_model::scene::Scene;
use ndarray::{Array2, ArrayView2};

/// Which column of which dither each column of a joined image is.
#[derive(Debug, Clone, PartialEq)]
pub struct JoinedColumns {
    /// Column and dither of each, in the order of their places.
    order: Vec<[usize; 2]>,
    /// Places on the detector, x from the optical axis, m, ascending.
    places: Vec<f64>,
}

impl JoinedColumns {
    /// Columns of the dithers of a scene whose views have columns at `places`; `None` without dithers.
    ///
    /// A sample that is moved by d is seen at x as one at rest is at `x - d z_d / z_c`, with the distances
    /// of detector and axis of rotation from the source.
    pub fn of(scene: &Scene, places: &[f64]) -> Option<Self> {
        let dithers = &scene.scan.dithers;
        if dithers.is_empty() {
            return None;
        }
        let magnification = scene.detector.distance / scene.axis_distance();
        let mut columns: Vec<(f64, [usize; 2])> = Vec::with_capacity(places.len() * dithers.len());
        for (column, place) in places.iter().enumerate() {
            for (dither, by) in dithers.iter().enumerate() {
                columns.push((place - by * magnification, [column, dither]));
            }
        }
        columns.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (places, order) = columns.into_iter().unzip();
        Some(Self { order, places })
    }

    /// Column and dither of each column.
    pub fn order(&self) -> &[[usize; 2]] {
        &self.order
    }

    /// Places of the columns, m.
    pub fn places(&self) -> &[f64] {
        &self.places
    }

    /// The images of an angle from the images of its dithers, in their order.
    pub(crate) fn images(&self, of_dithers: &[Images]) -> Images {
        let names = of_dithers.first().map_or_else(Vec::new, |images| images.names().to_vec());
        let rows = of_dithers.first().map_or(0, Images::rows);
        let mut joined = Images::new(names, rows, self.order.len());
        for (at, [column, dither]) in self.order.iter().enumerate() {
            joined.copy_column(at, &of_dithers[*dither], *column);
        }
        joined
    }

    /// An image of the flat, which is the same for all dithers.
    pub(crate) fn flat(&self, image: ArrayView2<'_, f32>) -> Array2<f32> {
        let shape = (image.nrows(), self.order.len());
        Array2::from_shape_fn(shape, |(row, at)| image[[row, self.order[at][0]]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_model::scene::{Beam, Detector, Source};

    #[test]
    fn columns_are_in_the_order_of_their_places() {
        let source = Source::new(1.2, [0.0; 2], Beam::Energy(30.0));
        let mut scene = Scene::new(source, Detector::new(1.8, [2, 1], [150e-6; 2]));
        assert_eq!(JoinedColumns::of(&scene, &[-75e-6, 75e-6]), None);
        // 20 um are 30 um on the detector; the last one passes the next column.
        scene.scan.dithers = vec![0.0, 20e-6, -120e-6];
        let joined = JoinedColumns::of(&scene, &[-75e-6, 75e-6]).unwrap();
        assert_eq!(joined.order(), [[0, 1], [0, 0], [1, 1], [1, 0], [0, 2], [1, 2]]);
        let um: Vec<f64> = joined.places().iter().map(|place| (place * 1e6).round()).collect();
        assert_eq!(um, [-105.0, -75.0, 45.0, 75.0, 105.0, 255.0]);
        let flat = joined.flat(ndarray::array![[1.0, 2.0]].view());
        assert_eq!(flat, ndarray::array![[1.0, 1.0, 2.0, 2.0, 1.0, 2.0]]);
    }
}
