//! Images of a retrieval made ready: pixels without a value filled, and −ln of the transmission.

use super::geometry::{ScanGeometry, same_shape};
use super::quantity::Quantity;
use crate::retrieve::flags;
use beamlet_core::numbers::{single, whole};
use beamlet_core::{Error, Result, reserve};
use ndarray::{Array2, Array3, ArrayView1, ArrayView2, ArrayView3, ArrayViewMut2, Axis, s};
use serde::{Deserialize, Serialize};

/// Pixels of the sinograms of one quantity, over all views.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PixelCounts {
    /// All pixels.
    pub pixels: u64,
    /// Pixels without a result of the retrieval (NaN), filled from the pixels beside them.
    pub without_answer: u64,
    /// Pixels whose transmission is not above 0, filled likewise.
    pub dark: u64,
    /// Pixels with a result that are flagged as misfits. For μ they are filled likewise: on a
    /// silhouette the transmission may be off by a third. Refraction and dark field keep their values,
    /// for silhouettes hold much of the integral of refraction.
    pub misfits: u64,
}

/// Makes the views of a scan ready one after another.
#[derive(Debug)]
pub(super) struct Preparation<'a> {
    /// Places of the columns, ascending, and of the rows, descending, m.
    columns: &'a [f64],
    rows: &'a [f64],
    is_transmission: bool,
    /// Misfits of the view that comes next, `[row][column]`; none where there are no flags.
    misfits: Array2<bool>,
    counts: PixelCounts,
}

impl<'a> Preparation<'a> {
    /// `is_transmission`: values are transmissions, and become their −ln.
    pub(super) fn new(geometry: &'a ScanGeometry, is_transmission: bool) -> Self {
        Self::of_places(&geometry.columns, &geometry.rows, is_transmission)
    }

    /// The same for images with these places of columns and rows.
    pub(super) fn of_places(columns: &'a [f64], rows: &'a [f64], is_transmission: bool) -> Self {
        let misfits = Array2::default((rows.len(), columns.len()));
        Self { columns, rows, is_transmission, misfits, counts: PixelCounts::default() }
    }

    /// Takes a column of flags of the view that comes next.
    pub(super) fn flags_of_column(&mut self, column: usize, flags: ArrayView1<'_, f32>) {
        let is_misfit = |value: &f32| whole::<u32>(f64::from(*value)) & flags::MISFIT != 0;
        self.misfits.column_mut(column).assign(&flags.mapv(|value| is_misfit(&value)));
    }

    /// Takes the flags of a view, where there are any.
    fn flags_of_view(&mut self, view: usize, flags: Option<&ArrayView3<'_, f32>>) {
        let Some(flags) = flags else { return };
        for column in 0..self.columns.len() {
            self.flags_of_column(column, flags.slice(s![view, .., column]));
        }
    }

    pub(super) const fn counts(&self) -> PixelCounts {
        self.counts
    }

    /// Makes a view ready, `[row][column]`.
    ///
    /// # Errors
    /// Why it cannot be, in words: no pixel has a value.
    pub(super) fn view(
        &mut self,
        image: &mut ArrayViewMut2<'_, f32>,
    ) -> std::result::Result<(), &'static str> {
        self.counts.pixels += image.len() as u64;
        for (value, misfit) in image.iter_mut().zip(&self.misfits) {
            let has_value = value.is_finite();
            self.counts.misfits += u64::from(*misfit && has_value);
            self.counts.without_answer += u64::from(!has_value);
            if !self.is_usable(*value, *misfit) {
                self.counts.dark += u64::from(has_value && !misfit);
                *value = f32::NAN;
            } else if self.is_transmission {
                *value = single(-libm::log(f64::from(*value)));
            }
        }
        if image.iter().all(|value| value.is_nan()) {
            return Err("has no pixel with a value");
        }
        let mut empty = Vec::new();
        for (row, mut values) in image.outer_iter_mut().enumerate() {
            let mut line: Vec<f32> = values.to_vec();
            if !fill(&mut line, self.columns) {
                empty.push(row);
            }
            values.iter_mut().zip(line).for_each(|(to, from)| *to = from);
        }
        // Rows without any value take the values of the rows above and below.
        if !empty.is_empty() {
            let places: Vec<f64> = self.rows.iter().map(|place| -place).collect();
            for mut column in image.columns_mut() {
                let mut line = column.to_vec();
                fill(&mut line, &places);
                column.iter_mut().zip(line).for_each(|(to, from)| *to = from);
            }
        }
        Ok(())
    }

    /// Fills a view, `[row][column]`: pixels without a usable value get that of [`Preparation::view`], as
    /// a transmission for transmissions; all others keep theirs.
    ///
    /// # Errors
    /// As [`Preparation::view`].
    pub(super) fn fill(
        &mut self,
        image: &mut ArrayViewMut2<'_, f32>,
    ) -> std::result::Result<(), &'static str> {
        let retrieved = image.to_owned();
        self.view(image)?;
        for (at, value) in image.indexed_iter_mut() {
            if self.is_usable(retrieved[at], self.misfits[at]) {
                *value = retrieved[at];
            } else if self.is_transmission {
                *value = single(libm::exp(-f64::from(*value)));
            }
        }
        Ok(())
    }

    /// Pixels of each row of a view that [`Preparation::view`] fills.
    pub(super) fn gaps(&self, image: ArrayView2<'_, f32>) -> Vec<usize> {
        let of_row = |(values, misfits): (ArrayView1<'_, f32>, ArrayView1<'_, bool>)| {
            values
                .iter()
                .zip(misfits)
                .filter(|(value, misfit)| !self.is_usable(**value, **misfit))
                .count()
        };
        image.outer_iter().zip(self.misfits.outer_iter()).map(of_row).collect()
    }

    /// True if a pixel keeps its value.
    pub(super) fn is_usable(&self, value: f32, is_misfit: bool) -> bool {
        value.is_finite() && !(self.is_transmission && (is_misfit || value <= 0.0))
    }
}

/// A retrieved image of all views, `[view][row][column]`, with the values that a reconstruction fills in
/// place of missing ones: NaN, and transmissions that are not above 0 or flagged as misfits. The number of
/// these pixels comes along. `columns` and `rows`: their places, as in [`ScanGeometry`].
///
/// # Errors
/// [`Error::Argument`] for images of other columns or rows, flags of another shape, and a view without any
/// value; [`Error::Memory`].
pub fn fill_images(
    [columns, rows]: [&[f64]; 2],
    quantity: Quantity,
    image: ArrayView3<'_, f32>,
    flags: Option<ArrayView3<'_, f32>>,
) -> Result<(Array3<f32>, u64)> {
    same_shape("image", image.dim(), (image.len_of(Axis(0)), rows.len(), columns.len()))?;
    if let Some(flags) = &flags {
        same_shape("flags", flags.dim(), image.dim())?;
    }
    let mut all = copy(image)?;
    let mut preparation = Preparation::of_places(columns, rows, quantity == Quantity::Mu);
    let mut filled = 0;
    for (view, mut values) in all.outer_iter_mut().enumerate() {
        preparation.flags_of_view(view, flags.as_ref());
        filled += preparation.gaps(values.view()).into_iter().sum::<usize>() as u64;
        preparation.fill(&mut values).map_err(|problem| lacking(view, problem))?;
    }
    Ok((all, filled))
}

fn copy(image: ArrayView3<'_, f32>) -> Result<Array3<f32>> {
    let mut values = reserve::room(image.len(), "sinograms")?;
    values.extend(image.iter());
    Array3::from_shape_vec(image.dim(), values)
        .map_err(|error| Error::argument("image", error.to_string(), "one shape"))
}

fn lacking(view: usize, problem: &str) -> Error {
    Error::argument("image", format!("view {view}, which {problem}"), "a value in each view")
}

/// Sinograms of a retrieved image of all views, `[view][row][column]`: −ln of a transmission for μ, and
/// every pixel with a value, filled along its row where the retrieval has none or, for μ, `flags` say
/// misfit. The numbers of these pixels come along.
///
/// # Errors
/// [`Error::Argument`] for images of another shape than the scan, and for a view without any value;
/// [`Error::Memory`].
pub fn prepare_sinograms(
    geometry: &ScanGeometry,
    quantity: Quantity,
    image: ArrayView3<'_, f32>,
    flags: Option<ArrayView3<'_, f32>>,
) -> Result<(Array3<f32>, PixelCounts)> {
    geometry.check()?;
    same_shape("image", image.dim(), geometry.dim())?;
    if let Some(flags) = &flags {
        same_shape("flags", flags.dim(), geometry.dim())?;
    }
    let mut all = copy(image)?;
    let mut preparation = Preparation::new(geometry, quantity == Quantity::Mu);
    for (view, mut values) in all.outer_iter_mut().enumerate() {
        preparation.flags_of_view(view, flags.as_ref());
        preparation.view(&mut values).map_err(|problem| lacking(view, problem))?;
    }
    Ok((all, preparation.counts()))
}

/// Fills NaN between two values linearly by ascending places, and beyond the first and the last with
/// these. Returns whether there is any value.
fn fill(values: &mut [f32], places: &[f64]) -> bool {
    let known: Vec<usize> = (0..values.len()).filter(|at| !values[*at].is_nan()).collect();
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else { return false };
    for at in 0..values.len() {
        if !values[at].is_nan() {
            continue;
        }
        let next = known.partition_point(|known| *known < at);
        values[at] = if at < first {
            values[first]
        } else if at > last {
            values[last]
        } else {
            let [before, behind] = [known[next - 1], known[next]];
            let share = (places[at] - places[before]) / (places[behind] - places[before]);
            let [a, b] = [values[before], values[behind]].map(f64::from);
            single(a + share * (b - a))
        };
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    fn geometry() -> ScanGeometry {
        let columns = vec![0.0, 1.0, 2.0, 4.0];
        ScanGeometry::new([1.0, 2.0], columns, vec![0.5, -0.5], vec![0.0, 1.0, 2.0])
    }

    #[test]
    fn pixels_without_a_value_are_filled_by_place_and_counted() {
        let geometry = geometry();
        let e = std::f32::consts::E;
        // −ln: 0, none, none, −1 and none, 1, none, none.
        let mut image = array![[1.0, f32::NAN, -0.5, e], [f32::INFINITY, 1.0 / e, 0.0, f32::NAN]];
        let mut preparation = Preparation::new(&geometry, true);
        preparation.view(&mut image.view_mut()).unwrap();
        let expected = array![[0.0_f32, -0.25, -0.5, -1.0], [1.0, 1.0, 1.0, 1.0]];
        assert!((&image - &expected).iter().all(|left| left.abs() < 1e-6), "{image}");
        let counts = preparation.counts();
        assert_eq!([counts.pixels, counts.without_answer, counts.dark], [8, 3, 2]);
    }

    #[test]
    fn rows_without_a_value_take_their_neighbours_and_views_without_one_are_refused() {
        let geometry = geometry();
        let mut preparation = Preparation::new(&geometry, false);
        let none = f32::NAN;
        let mut image = array![[none, none, none, none], [-2.0, 0.0, none, 3.0]];
        preparation.view(&mut image.view_mut()).unwrap();
        // Angles at or below 0 are values.
        assert_eq!(image, array![[-2.0, 0.0, 1.0, 3.0], [-2.0, 0.0, 1.0, 3.0]]);
        let mut image = Array2::from_elem((2, 4), none);
        assert!(preparation.view(&mut image.view_mut()).is_err());
    }

    #[test]
    fn misfits_are_filled_for_transmissions_and_kept_for_angles() {
        let geometry = geometry();
        let misfit = single(f64::from(flags::MISFIT));
        for (is_transmission, expected) in [(true, 0.0), (false, 2.0)] {
            let mut preparation = Preparation::new(&geometry, is_transmission);
            preparation.flags_of_column(1, array![misfit, 1.0].view());
            preparation.flags_of_column(3, array![1.0, misfit + 1.0].view());
            let mut image = array![[1.0, 2.0, 1.0, 1.0], [1.0, 1.0, 1.0, f32::NAN]];
            preparation.view(&mut image.view_mut()).unwrap();
            assert_eq!(image[[0, 1]].to_bits(), f32::to_bits(expected));
            let counts = preparation.counts();
            assert_eq!([counts.pixels, counts.without_answer, counts.misfits], [8, 1, 1]);
        }
    }

    #[test]
    fn filled_images_keep_their_other_pixels_and_have_values_of_sinograms_in_the_gaps() {
        let (columns, rows) = ([0.0, 1.0, 2.0, 4.0], [0.5, -0.5]);
        let (none, misfit) = (f32::NAN, single(f64::from(flags::MISFIT)));
        let image = array![[[0.8, none, -0.5, 0.2_f32], [none; 4]], [[0.5, 0.9, 0.1, 0.7]; 2]];
        let mut bits = Array3::zeros(image.dim());
        bits[[1, 0, 1]] = misfit;
        let fill = |quantity| {
            fill_images([&columns, &rows], quantity, image.view(), Some(bits.view())).unwrap()
        };
        let (found, filled) = fill(Quantity::Mu);
        assert_eq!(filled, 2 + 4 + 1);
        // Geometric means: -ln is linear between 0.8 at 0 and 0.2 at 4, and at 1 between 0.5 and 0.1.
        let first = [0.8, 0.8_f32.powf(0.75) * 0.2_f32.powf(0.25), 0.4, 0.2];
        let third = [0.5, 0.05_f32.sqrt(), 0.1, 0.7];
        for ([view, row], expected) in
            [([0, 0], first), ([0, 1], first), ([1, 0], third), ([1, 1], [0.5, 0.9, 0.1, 0.7])]
        {
            for (column, value) in expected.into_iter().enumerate() {
                let (got, kept) = (found[[view, row, column]], image[[view, row, column]]);
                let at = [view, row, column];
                assert!((got - value).abs() < 1e-6, "{at:?}: {got} for {value}");
                // A pixel with a value keeps every bit.
                let is_filled = kept.is_nan() || kept <= 0.0 || bits[at] > 0.0;
                assert!(is_filled || got.to_bits() == kept.to_bits(), "{at:?}");
            }
        }
        // Angles of misfits and angles below 0 are values.
        let (found, filled) = fill(Quantity::Delta);
        assert_eq!(filled, 1 + 4);
        assert!((found[[0, 0, 1]] - 0.15).abs() < 1e-7);
        assert_eq!(found[[1, 0, 1]].to_bits(), 0.9_f32.to_bits());
        let empty = Array3::from_elem((1, 2, 4), none);
        let refused = fill_images([&columns, &rows], Quantity::Mu, empty.view(), None);
        assert!(refused.unwrap_err().to_string().contains("view 0"));
    }
}
