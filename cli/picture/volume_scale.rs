//! Colour range of a volume.

use super::colour::Map;
use super::scale::Scale;
use ndarray::ArrayView2;

/// Side of a block of voxels that is a part of the sample and no outlier.
const BLOCK: usize = 3;

/// The scale of slices of the volume of a name: truth has constants of materials.
pub(crate) fn of(name: &str, map: Map, slices: &[ArrayView2<'_, f64>]) -> Scale {
    match name.ends_with("_truth") {
        true => of_constants(map, slices),
        false => of_slices(map, slices),
    }
}

/// The scale of slices of a volume: that of their values, where parts of the sample are not cut. A part has
/// a block of 3 × 3 voxels in some slice: borders, streaks and single voxels do not.
fn of_slices(map: Map, slices: &[ArrayView2<'_, f64>]) -> Scale {
    let values: Vec<f64> = slices.iter().flat_map(|slice| slice.iter().copied()).collect();
    let own = Scale::of(map, &values, None, None);
    let ends = slices.iter().filter_map(|slice| blocks(*slice));
    let [low, high] = ends
        .fold([own.low, own.high], |[low, high], [least, most]| [low.min(least), high.max(most)]);
    let [low, high] = match own.map {
        // A dark field is black at 0.
        Map::Inferno => [own.low, high],
        Map::Diverging => [-high.max(-low), high.max(-low)],
        Map::Grey | Map::Viridis => [low, high],
    };
    Scale::between(own.map, [low, high], values.into_iter())
}

/// The scale of all values, for volumes of constants of materials.
fn of_constants(map: Map, slices: &[ArrayView2<'_, f64>]) -> Scale {
    let values: Vec<f64> = slices.iter().flat_map(|slice| slice.iter().copied()).collect();
    let own = Scale::of(map, &values, None, None);
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let [low, high] = finite.fold([own.low, own.high], |[low, high], v| [low.min(v), high.max(v)]);
    Scale::between(own.map, [low, high], values.into_iter())
}

/// The least and the largest value that a block of voxels stays at or beyond throughout; `None` without a
/// block of finite values.
fn blocks(slice: ArrayView2<'_, f64>) -> Option<[f64; 2]> {
    let (rows, columns) = slice.dim();
    let block = (BLOCK.min(rows), BLOCK.min(columns));
    let ends = slice.windows(block).into_iter().filter_map(|window| {
        window.iter().try_fold([f64::NEG_INFINITY, f64::INFINITY], |[most, least], value| {
            value.is_finite().then(|| [most.max(*value), least.min(*value)])
        })
    });
    ends.reduce(|[low, high], [most, least]| [low.min(most), high.max(least)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// 100 × 100 voxels from 1 to 2, with values of 9 in voxels of a block.
    fn slice(rows: usize, columns: usize) -> Array2<f64> {
        Array2::from_shape_fn((100, 100), |(row, column)| {
            let is_part = (40..40 + rows).contains(&row) && (40..40 + columns).contains(&column);
            if is_part { 9.0 } else { 1.0 + 0.01 * ((row + 7 * column) % 100) as f64 }
        })
    }

    #[test]
    fn parts_are_in_the_range_and_outliers_are_not() {
        for (rows, columns, high) in [(3, 3, 9.0), (1, 60, 2.0), (2, 60, 2.0), (8, 8, 9.0)] {
            let values = slice(rows, columns);
            let scale = of_slices(Map::Grey, &[values.view()]);
            assert!((scale.high - high).abs() < 0.05, "{rows} {columns}: {scale:?}");
            assert_eq!(scale.beyond[1] > 0, high < 9.0, "{rows} {columns}: {scale:?}");
            let all = of_constants(Map::Grey, &[values.view()]);
            assert!((all.high - 9.0).abs() < 1e-12 && all.beyond == [0; 2], "{all:?}");
        }
        // Below as above; a dark field begins at 0, unless much of it is negative.
        let below = slice(3, 3).mapv(|value| -value);
        assert!((of_slices(Map::Grey, &[below.view()]).low + 9.0).abs() < 1e-12);
        let dark_field = of_slices(Map::Inferno, &[below.view()]);
        assert!(dark_field.map == Map::Diverging && dark_field.low < 0.0, "{dark_field:?}");
        let above = slice(3, 3);
        assert!(of_slices(Map::Inferno, &[above.view()]).low.abs() < 1e-12);
        let mut hole = slice(3, 3);
        hole[[41, 41]] = f64::NAN;
        assert!(of_slices(Map::Grey, &[hole.view()]).high < 2.0);
        let short = Array2::from_elem((1, 2), 4.0);
        assert!(of_slices(Map::Grey, &[short.view()]).high > 4.0);
    }
}
