//! Frames and retrieved images of a run as the page has them.

use super::table_of;
use super::thinning::{NOTHING, Quantised, Thinning};
use crate::failure::Failure;
use crate::picture::colour::Map;
use crate::picture::quantity::{CONTRASTS, Quantity};
use crate::picture::scale::Scale;
use crate::subject::{Subject, trusted};
use beamlet::retrieve::MaskCurve;
use serde_json::{Value, json};

const FIT: [&str; 4] = ["amplitude", "centre", "width", "background"];

/// Data of the page.
pub(super) struct Data {
    pub(super) meta: Value,
    /// Name, and `[view][step][row][column]` or less.
    pub(super) arrays: Vec<(String, Vec<u16>)>,
    /// Notes to the reader about the data.
    pub(super) notes: Vec<String>,
}

/// Names of the images of a fit to the flat or the sample.
fn fits(of: &str) -> [String; FIT.len()] {
    FIT.map(|part| format!("{of}_{part}"))
}

/// Contents of a subject in the page.
struct Contents<'a> {
    run: &'a Subject,
    /// Views, by their numbers.
    kept: Vec<usize>,
    contrasts: Vec<&'static str>,
    fitted: bool,
    thinning: Thinning,
}

impl Contents<'_> {
    /// Frames, contrasts with their 1 sigma, fits and residuals; values are appended to `arrays`.
    fn images(
        &self,
        arrays: &mut Vec<(String, Vec<u16>)>,
    ) -> Result<serde_json::Map<String, Value>, Failure> {
        let Self { run, kept, contrasts, fitted, thinning } = self;
        let mut images = serde_json::Map::new();
        if run.has_fitted() {
            let intensity = run.fitted_quantity();
            let flat = frames(run, &[None], *thinning)?;
            let views: Vec<Option<usize>> = kept.iter().copied().map(Some).collect();
            let sample = frames(run, &views, *thinning)?;
            // One scale for all steps and views: sliders show how the light changes.
            let scale = Scale::of_frames(intensity.map, &flat, &sample);
            for (name, values) in [("flat", flat), ("sample", sample)] {
                images.insert(name.into(), image(name, &values, &intensity, &scale, arrays));
            }
        }
        let trusted = self.trusted()?;
        let mut add = |name: &str, kept: &[usize], trusted: Option<&[bool]>| {
            let quantity = Quantity::of_map(name);
            let values = map(run, name, kept, &quantity, *thinning)?;
            let own = |values: &[f64]| -> Vec<f64> {
                let is_trusted = |at: usize| trusted.is_none_or(|trusted| trusted[at]);
                let all = values.iter().enumerate();
                all.filter(|(at, _)| is_trusted(*at)).map(|(_, value)| *value).collect()
            };
            let sigma = match run.sigma_of(name) {
                Some(sigma) => Some(own(&map(run, &sigma, kept, &quantity, *thinning)?)),
                None => None,
            };
            let scale = Scale::of(quantity.map, &own(&values), quantity.empty, sigma.as_deref());
            images.insert(name.into(), image(name, &values, &quantity, &scale, arrays));
            Ok::<(), Failure>(())
        };
        for name in contrasts {
            add(name, kept, trusted.as_deref())?;
            if let Some(sigma) = run.sigma_of(name) {
                add(&sigma, kept, trusted.as_deref())?;
            }
        }
        if *fitted {
            fits("flat").iter().try_for_each(|name| add(name, &kept[..1], None))?;
            fits("sample").iter().try_for_each(|name| add(name, kept, None))?;
        }
        if has_residuals(run) {
            add("residual_flat", &kept[..1], None)?;
            add("residual_sample", kept, None)?;
        }
        Ok(images)
    }

    /// Pixels of all views that may set scales, `[view][row][column]`.
    fn trusted(&self) -> Result<Option<Vec<bool>>, Failure> {
        if !self.run.has("flags") {
            return Ok(None);
        }
        let mut flagged = Vec::new();
        for view in &self.kept {
            let bits = self.thinning.joined(self.run.map("flags", *view)?.view());
            flagged.extend(bits.iter().map(|bits| *bits != 0));
        }
        Ok(trusted(&flagged))
    }
}

/// Curve of the masks in um, with the orders that a blur of at least a twentieth of its width leaves.
fn curve_of_masks(curve: &MaskCurve) -> Value {
    let size = |[even, odd]: &[f64; 2]| even.hypot(*odd);
    let most = curve.orders().iter().map(size).fold(0.0, f64::max);
    let orders: Vec<[f64; 2]> = curve
        .orders()
        .iter()
        .map(|order| order.map(|part| part / most))
        .take(60 * curve.repeats())
        .collect();
    json!({
        "period": 1e6 * curve.period(),
        "variance": 1e12 * curve.variance(),
        "mean": curve.mean() / most,
        "orders": orders,
    })
}

fn has_residuals(run: &Subject) -> bool {
    run.has("residual_flat") && run.has("residual_sample")
}

/// Gathers everything that the page shows as images.
pub(super) fn collect(run: &Subject, most: u64) -> Result<Data, Failure> {
    let [all_views, steps, rows, columns] = run.shape();
    let fitted =
        run.has_fits() && fits("flat").iter().chain(&fits("sample")).all(|name| run.has(name));
    let contrasts: Vec<&str> = CONTRASTS.into_iter().filter(|name| run.has(name)).collect();
    let sigmas = contrasts.iter().filter(|name| run.sigma_of(name).is_some()).count();
    let of_frames = if run.has_fitted() { steps } else { 0 };
    let of_fit = if fitted { FIT.len() } else { 0 } + usize::from(has_residuals(run));
    let of_view = of_frames + contrasts.len() + sigmas + usize::from(run.has("flags")) + of_fit;
    let thinning = Thinning::of(run.shape(), of_view, of_frames + of_fit, most);
    let retrieved = run.maps().map_or(all_views, |maps| maps.views());
    let kept: Vec<usize> = (0..all_views.min(retrieved)).step_by(thinning.every).collect();
    let start = [run.striking_column(0, rows / 2)? / thinning.bin, rows / 2 / thinning.bin];
    let contents = Contents { run, kept, contrasts, fitted, thinning };
    let mut arrays = Vec::new();
    let images = contents.images(&mut arrays)?;
    let mut flags = vec![String::new()];
    if run.has("flags") {
        arrays.push(("flags".into(), flag_indices(run, &contents.kept, thinning, &mut flags)?));
    }
    let bin = thinning.bin;
    let angle = |view: &usize| run.angles().get(*view).map(|angle| angle.to_degrees());
    let maps = [Map::Grey, Map::Viridis, Map::Inferno, Map::Diverging];
    let tables: serde_json::Map<String, Value> =
        maps.into_iter().map(|map| (format!("{map:?}"), table_of(map).into())).collect();
    let pitch = run.pitch().map(|pitch| pitch.map(|pitch| 1e3 * pitch));
    let (labels, length) = match pitch {
        Some(_) => (["x [mm]", "z [mm]"], "mm"),
        None => (["x [pixels]", "z [pixels]"], "pixels"),
    };
    let meta = json!({
        "views": contents.kept,
        "angles": contents.kept.iter().filter_map(angle).collect::<Vec<_>>(),
        "offsets": run.curve_offsets().iter().map(|f| 1e6 * f).collect::<Vec<_>>(),
        "rows": rows.div_ceil(bin),
        "columns": columns.div_ceil(bin),
        "detector": [columns, rows],
        "bin": bin,
        "start": start,
        "pitch": pitch.unwrap_or([1.0; 2]),
        "labels": labels,
        "length": length,
        "contrasts": contents.contrasts,
        "frames": run.has_fitted(),
        "fitted": fitted && run.has_fitted(),
        "curve": run.record().and_then(|record| record.curve.as_ref()).map(curve_of_masks),
        "flags": flags,
        "images": images,
        "maps": tables,
    });
    let notes = notes(&contents, most);
    Ok(Data { meta, arrays, notes })
}

/// Notes to the reader about the data.
fn notes(contents: &Contents<'_>, most: u64) -> Vec<String> {
    let Contents { run, kept, contrasts, thinning: Thinning { bin, every }, .. } = contents;
    let (bin, every, all_views) = (*bin, *every, run.views());
    let mut notes = Vec::new();
    if bin > 1 {
        notes.push(format!(
            "Pixels are binned {bin} × {bin}: values, curves and parameters of fits are means \
             over that many pixels."
        ));
    }
    if every > 1 {
        notes.push(format!(
            "This page contains every {every}th of {all_views} views: {}.",
            kept.len()
        ));
    }
    if bin > 1 || every > 1 {
        notes.push(format!(
            "The page was limited to {:.1} MiB of image data; `beamlet report --most SIZE` sets \
             another limit.",
            most as f64 / f64::from(1 << 20)
        ));
    }
    if let Some(reason) = run.without() {
        notes.push(format!("The frames of these images are not shown: {reason}"));
    }
    if run.beamlets().is_some() {
        notes.push(
            "The run was retrieved per beamlet, and this page shows pixels only; `beamlet view` \
             draws the images."
                .into(),
        );
    } else if contrasts.is_empty() {
        notes.push(format!(
            "No retrieved images: `beamlet retrieve {}` makes them; then write the report again.",
            beamlet::cli_support::printed::path(run.path())
        ));
    }
    if run.has_unused_counts() {
        notes.push(format!(
            "The images were retrieved from noise-free intensities; `beamlet retrieve {} --counts \
             --weights poisson` retrieves from the detector numbers of the run.",
            beamlet::cli_support::printed::path(run.path())
        ));
    }
    notes
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
    })
}

/// `[view][step][row][column]` of some views; `None` is the flat.
fn frames(run: &Subject, views: &[Option<usize>], thinning: Thinning) -> Result<Vec<f64>, Failure> {
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
    run: &Subject,
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
    run: &Subject,
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
