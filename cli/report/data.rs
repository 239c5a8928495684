//! Frames and retrieved images of a run as 16-bit numbers, binned where there are too many.

use super::table_of;
use crate::failure::Failure;
use crate::numbers;
use crate::picture::colour::{Map, Scale};
use crate::picture::quantity::Quantity;
use crate::run_reader::RunReader;
use ndarray::{Array2, ArrayView2};
use serde_json::{Value, json};

/// Stands for what is not a number.
const NOTHING: u16 = u16::MAX;
/// Views are left out before pixels are binned, down to this many.
const VIEWS: usize = 24;
const CONTRASTS: [&str; 3] = ["transmission", "refraction", "dark_field"];
const FIT: [&str; 4] = ["amplitude", "centre", "width", "background"];

/// What goes into the page.
pub(super) struct Data {
    pub(super) meta: Value,
    /// Name, and `[view][step][row][column]` or less.
    pub(super) arrays: Vec<(String, Vec<u16>)>,
    /// What the reader has to know of the data.
    pub(super) notes: Vec<String>,
}

/// What of a run is kept, so that the page stays small.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Thinning {
    /// Pixels of a side that become one.
    bin: usize,
    /// Every how many views one is kept.
    every: usize,
}

impl Thinning {
    /// The least thinning with which `images` frames per view (and `more` frames beside) take no
    /// more than `most` bytes.
    fn of([views, _, rows, columns]: [usize; 4], images: usize, more: usize, most: u64) -> Self {
        let mut thinning = Self { bin: 1, every: 1 };
        loop {
            let Self { bin, every } = thinning;
            let frames = views.div_ceil(every) * images + more;
            let bytes = 2 * frames as u64 * (rows.div_ceil(bin) * columns.div_ceil(bin)) as u64;
            if bytes <= most || (bin >= rows.max(columns) && every >= views) {
                return thinning;
            }
            if views.div_ceil(every) > VIEWS || bin >= rows.max(columns) {
                thinning.every += 1;
            } else {
                thinning.bin += 1;
            }
        }
    }

    /// Means over blocks; blocks at the right and lower edge may be smaller.
    fn binned(&self, frame: ArrayView2<'_, f32>) -> Array2<f64> {
        let (rows, columns) = frame.dim();
        let bin = self.bin;
        Array2::from_shape_fn((rows.div_ceil(bin), columns.div_ceil(bin)), |(row, column)| {
            let of = |at: usize, end: usize| at * bin..((at + 1) * bin).min(end);
            let block = frame.slice(ndarray::s![of(row, rows), of(column, columns)]);
            block.iter().map(|value| f64::from(*value)).sum::<f64>() / block.len() as f64
        })
    }
}

impl Thinning {
    /// Bits of any pixel of a block.
    fn joined(&self, frame: ArrayView2<'_, f32>) -> Array2<u32> {
        let (rows, columns) = frame.dim();
        let bin = self.bin;
        let mut joined = Array2::zeros((rows.div_ceil(bin), columns.div_ceil(bin)));
        for ((row, column), flags) in frame.indexed_iter() {
            joined[[row / bin, column / bin]] |= numbers::whole::<u32>(f64::from(*flags));
        }
        joined
    }
}

/// Numbers on their way to 16 bits.
struct Quantised {
    low: f64,
    high: f64,
    words: Vec<u16>,
}

impl Quantised {
    fn of(values: &[f64]) -> Self {
        let finite = values.iter().copied().filter(|value| value.is_finite());
        let (low, high) =
            finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low > high { (0.0, 0.0) } else { (low, high) };
        let span = if high > low { high - low } else { 1.0 };
        let word = |value: &f64| match value.is_finite() {
            true => numbers::whole::<u16>(((value - low) / span * f64::from(NOTHING - 1)).round()),
            false => NOTHING,
        };
        Self { low, high: low + span, words: values.iter().map(word).collect() }
    }
}

/// Names of the images of a fit to the flat or the sample.
fn fits(of: &str) -> [String; FIT.len()] {
    FIT.map(|part| format!("{of}_{part}"))
}

/// Frames, contrasts and fits as the page has them; their values are appended to `arrays`.
fn images(
    run: &RunReader,
    kept: &[usize],
    contrasts: &[&str],
    fitted: bool,
    thinning: Thinning,
    arrays: &mut Vec<(String, Vec<u16>)>,
) -> Result<serde_json::Map<String, Value>, Failure> {
    let mut images = serde_json::Map::new();
    let intensity = run.fitted_quantity();
    let flat = frames(run, &[None], thinning)?;
    let views: Vec<Option<usize>> = kept.iter().copied().map(Some).collect();
    let sample = frames(run, &views, thinning)?;
    // One scale for all steps and views: sliders show how the light changes.
    let scale = Scale::of(intensity.map, flat.iter().chain(&sample).copied());
    for (name, values) in [("flat", flat), ("sample", sample)] {
        images.insert(name.into(), image(name, &values, &intensity, &scale, arrays));
    }
    for name in contrasts {
        let quantity = Quantity::of_map(name);
        let values = map(run, name, kept, &quantity, thinning)?;
        let scale = Scale::of(quantity.map, values.iter().copied());
        images.insert((*name).into(), image(name, &values, &quantity, &scale, arrays));
    }
    if fitted {
        for (of, kept) in [("flat", &kept[..1]), ("sample", kept)] {
            for name in fits(of) {
                let quantity = Quantity::of_map(&name);
                let values = map(run, &name, kept, &quantity, thinning)?;
                let scale = Scale::of(quantity.map, values.iter().copied());
                images.insert(name.clone(), image(&name, &values, &quantity, &scale, arrays));
            }
        }
    }
    Ok(images)
}

/// Gathers everything that the page shows as images.
pub(super) fn collect(run: &RunReader, most: u64) -> Result<Data, Failure> {
    let [all_views, steps, rows, columns] = run.shape();
    let names: Vec<&str> = run.maps().map_or(Vec::new(), |maps| maps.names().collect());
    let has = |name: &str| names.contains(&name);
    let fitted =
        run.has_gaussians() && fits("flat").iter().chain(&fits("sample")).all(|name| has(name));
    let contrasts: Vec<&str> = CONTRASTS.into_iter().filter(|name| has(name)).collect();
    let of_view =
        steps + contrasts.len() + usize::from(has("flags")) + if fitted { FIT.len() } else { 0 };
    let more = steps + if fitted { FIT.len() } else { 0 };
    let thinning = Thinning::of(run.shape(), of_view, more, most);
    let retrieved = run.maps().map_or(all_views, |maps| maps.views());
    let kept: Vec<usize> = (0..all_views.min(retrieved)).step_by(thinning.every).collect();

    let start = [run.striking_column(0, rows / 2)? / thinning.bin, rows / 2 / thinning.bin];
    let mut arrays = Vec::new();
    let images = images(run, &kept, &contrasts, fitted, thinning, &mut arrays)?;
    let mut flags = vec![String::new()];
    if has("flags") {
        arrays.push(("flags".into(), flag_indices(run, &kept, thinning, &mut flags)?));
    }
    let scene = run.scene();
    let Thinning { bin, every } = thinning;
    let angle = |view: &usize| scene.scan.angles[*view].to_degrees();
    let maps = [Map::Grey, Map::Viridis, Map::Inferno, Map::Diverging];
    let tables: serde_json::Map<String, Value> =
        maps.into_iter().map(|map| (format!("{map:?}"), table_of(map).into())).collect();
    let meta = json!({
        "views": kept,
        "angles": kept.iter().map(angle).collect::<Vec<_>>(),
        "offsets": scene.scan.mask_offsets.iter().map(|f| 1e6 * f).collect::<Vec<_>>(),
        "rows": rows.div_ceil(bin),
        "columns": columns.div_ceil(bin),
        "detector": [columns, rows],
        "bin": bin,
        "start": start,
        "pitch": scene.detector.pitch.map(|pitch| 1e3 * pitch),
        "contrasts": contrasts,
        "fitted": fitted,
        "flags": flags,
        "images": images,
        "maps": tables,
    });
    let mut notes = Vec::new();
    if bin > 1 {
        notes.push(format!(
            "Pixels are binned {bin} × {bin}: values, curves and parameters of fits are means \
             over that many pixels."
        ));
    }
    if every > 1 {
        notes
            .push(format!("Of {all_views} views every {every}th is in this page: {}.", kept.len()));
    }
    if bin > 1 || every > 1 {
        notes.push(format!(
            "The page was limited to {:.1} MiB of image data; `beamlet report --most SIZE` sets \
             another limit.",
            most as f64 / f64::from(1 << 20)
        ));
    }
    if run.beamlets().is_some() {
        notes.push(
            "The run was retrieved per beamlet; `beamlet view` draws those images, this page is of \
             pixels."
                .into(),
        );
    } else if contrasts.is_empty() {
        notes.push(format!(
            "No retrieved images: `beamlet retrieve {}` makes them; then write the report again.",
            beamlet::printed::path(run.run().path())
        ));
    }
    Ok(Data { meta, arrays, notes })
}

/// Adds the numbers of an image and describes them.
fn image(
    name: &str,
    values: &[f64],
    quantity: &Quantity,
    scale: &Scale,
    arrays: &mut Vec<(String, Vec<u16>)>,
) -> Value {
    let Quantised { low, high, words } = Quantised::of(values);
    arrays.push((name.to_owned(), words));
    json!({
        "label": quantity.label,
        "unit": quantity.unit,
        "low": low,
        "high": high,
        "map": format!("{:?}", scale.map),
        "scale": [scale.low, scale.high],
        "beyond": scale.beyond,
    })
}

/// `[view][step][row][column]` of some views; `None` is the flat.
fn frames(
    run: &RunReader,
    views: &[Option<usize>],
    thinning: Thinning,
) -> Result<Vec<f64>, Failure> {
    let rows = run.row_count();
    let mut values = Vec::new();
    for view in views {
        for frame in run.fitted_rows(*view, 0..rows)?.outer_iter() {
            values.extend(thinning.binned(frame));
        }
    }
    Ok(values)
}

/// `[view][row][column]` of flags as places in the list of their words; a block of pixels has
/// the flags of all of them.
fn flag_indices(
    run: &RunReader,
    views: &[usize],
    thinning: Thinning,
    words: &mut Vec<String>,
) -> Result<Vec<u16>, Failure> {
    let mut indices = Vec::new();
    for view in views {
        let map = run.map("flags", *view)?;
        for flags in thinning.joined(map.view()) {
            let text = run.flag_words(flags);
            let place = words.iter().position(|known| *known == text).unwrap_or(words.len());
            if place == words.len() {
                words.push(text);
            }
            indices.push(u16::try_from(place).unwrap_or(NOTHING));
        }
    }
    Ok(indices)
}

/// `[view][row][column]` of some views, in the shown unit.
fn map(
    run: &RunReader,
    name: &str,
    views: &[usize],
    quantity: &Quantity,
    thinning: Thinning,
) -> Result<Vec<f64>, Failure> {
    let mut values = Vec::new();
    for view in views {
        let map = run.map(name, *view)?;
        values.extend(thinning.binned(map.view()).iter().map(|value| value * quantity.factor));
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_within_the_limit_and_does_no_more_than_it_must() {
        let small = [3, 11, 128, 128];
        assert_eq!(Thinning::of(small, 14, 11, 24 << 20), Thinning { bin: 1, every: 1 });
        let large = [1, 11, 2048, 2048];
        let thinning = Thinning::of(large, 18, 15, 24 << 20);
        let side = 2048_u64.div_ceil(thinning.bin as u64);
        assert_eq!(thinning.every, 1);
        assert!(2 * 33 * side * side <= 24 << 20, "{thinning:?}");
        let coarser = 2048_u64.div_ceil(thinning.bin as u64 - 1);
        assert!(2 * 33 * coarser * coarser > 24 << 20, "{thinning:?}");
        let many = Thinning::of([3600, 7, 1, 256], 14, 11, 1 << 20);
        assert!(many.every > 1 && many.bin == 1, "{many:?}");
        // Even a limit that nothing meets ends.
        let _ = Thinning::of(large, 18, 15, 1);
    }

    #[test]
    fn bins_are_means_and_words_hold_the_values() {
        let frame = Array2::from_shape_fn((3, 5), |(r, c)| (10 * r + c) as f32);
        let binned = Thinning { bin: 2, every: 1 }.binned(frame.view());
        assert_eq!(binned.dim(), (2, 3));
        assert_eq!(binned.iter().copied().collect::<Vec<_>>(), [5.5, 7.5, 9.0, 20.5, 22.5, 24.0]);
        let values = [-1.0, f64::NAN, 0.25, 3.0];
        let Quantised { low, high, words } = Quantised::of(&values);
        assert_eq!(words[1], NOTHING);
        for (value, word) in values.iter().zip(&words).filter(|(value, _)| value.is_finite()) {
            let back = low + (high - low) * f64::from(*word) / f64::from(NOTHING - 1);
            // Half a step of the 65,534 between the ends.
            assert!((back - value).abs() <= 4.0 / 65_534.0 / 2.0 + 1e-12, "{value} {back}");
        }
    }
}
