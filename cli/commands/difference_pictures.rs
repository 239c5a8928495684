//! Pictures of how two stacks, runs or retrievals differ: of each series of images the one with
//! the largest difference.

use super::pictures::{PictureForm, Pictures};
use crate::failure::Failure;
use crate::numbers;
use crate::picture::image::{self, Grid, ImagePlot, Key};
use crate::picture::quantity::Quantity;
use crate::picture::scale::{Scale, pixels};
use crate::picture::text::{capital, joined, rough};
use crate::subject::trusted;
use beamlet::compare::Difference;
use beamlet::retrieve::Record;
use beamlet::scene::{Exposure, Scene};
use beamlet::stack::{Maps, OpenRun, StackFile, layout};
use ndarray::Array2;
use std::path::Path;

/// Series of two stacks that belong to no run.
const ALONE: &str = "stack";

/// One of the two, and the grid of its pixels.
enum Compared {
    Run(Box<OpenRun>),
    Images { maps: Maps, record: Box<Record> },
    Stack(StackFile),
}

impl Compared {
    fn open(path: &Path) -> Result<Self, Failure> {
        if layout::is_run(path) {
            Ok(Self::Run(Box::new(OpenRun::open(path)?)))
        } else if layout::is_retrieved(path) {
            let record = Record::read(&path.join(layout::RECORD))?;
            Ok(Self::Images { maps: Maps::open(path)?, record: Box::new(record) })
        } else {
            Ok(Self::Stack(StackFile::open(path)?))
        }
    }

    fn pitch(&self, path: &Path) -> Option<[f64; 2]> {
        match self {
            Self::Run(run) => Some(run.scene().detector.pitch),
            Self::Images { record, .. } => {
                let scene = Scene::from_toml(record.geometry.as_ref()?, path).ok()?;
                // Beamlets have no pixels.
                (record.method != "beamlet").then_some(scene.detector.pitch)
            }
            Self::Stack(_) => None,
        }
    }

    /// The image of a series at a view and step.
    fn image(
        &self,
        path: &Path,
        name: &str,
        [view, step]: [usize; 2],
    ) -> Result<Array2<f64>, Failure> {
        let frame =
            |stack: &StackFile| Ok(stack.frame(view, step, 0..stack.row_count())?.mapv(f64::from));
        match self {
            Self::Stack(stack) => frame(stack),
            Self::Images { maps, .. } => Ok(maps.map(name, step)?.mapv(f64::from)),
            Self::Run(run) => match layout::stack_named(name) {
                Some((Exposure::Flat(_), false)) => frame(&run.flat()?),
                Some((_, false)) => frame(&run.sample()?),
                Some((stack, true)) => {
                    let stack = match stack {
                        Exposure::Flat(_) => run.counts_flat()?,
                        _ => run.counts_sample()?,
                    };
                    frame(&stack.ok_or_else(|| Failure::File {
                        path: path.to_path_buf(),
                        problem: "has no counts".into(),
                    })?)
                }
                None => {
                    Ok(Maps::open(path.join(layout::RETRIEVED))?.map(name, step)?.mapv(f64::from))
                }
            },
        }
    }

    /// Flags of a view, where there are any.
    fn flags(&self, path: &Path, view: usize) -> Option<Array2<bool>> {
        let flags = match self {
            Self::Images { maps, .. } => maps.map("flags", view).ok()?,
            Self::Run(_) => {
                Maps::open(path.join(layout::RETRIEVED)).ok()?.map("flags", view).ok()?
            }
            Self::Stack(_) => return None,
        };
        Some(flags.mapv(|bits| numbers::whole::<u32>(f64::from(bits)) != 0))
    }
}

/// Draws B - A of every series that was compared, but for images that hold flags.
pub(super) fn draw(
    [a, b]: [&Path; 2],
    found: &[Difference],
    form: PictureForm,
) -> Result<Pictures, Failure> {
    let mut pictures = Pictures::new(form);
    let pair = [Compared::open(a)?, Compared::open(b)?];
    for series in found.iter().filter(|series| series.name != "flags") {
        let Difference { name, largest_at: [view, step, ..], .. } = series;
        let at = [*view, *step];
        let images = [pair[0].image(a, name, at)?, pair[1].image(b, name, at)?];
        let stack = layout::stack_named(name);
        let is_map = stack.is_none() && name != ALONE;
        let quantity = match stack {
            _ if name == ALONE => Quantity { label: "value".into(), ..Quantity::intensity() },
            Some((_, true)) => Quantity::counts(),
            Some(_) => Quantity::intensity(),
            None => Quantity::of_map(name),
        }
        .of_difference();
        let flagged = if is_map { flagged(&pair, [a, b], *step) } else { None };
        let grid = Grid::of_pixels(pair[0].pitch(a), [images[0].nrows(), images[0].ncols()]);
        let values = (&images[1] - &images[0]).mapv(|value| value * quantity.factor);
        let plot = plot(series, &values, &quantity, flagged.as_ref(), [a, b]);
        let place = match stack {
            _ if is_map => format!("view_{step:04}"),
            Some((Exposure::Flat(_), _)) if *view == 0 => format!("step_{step:03}"),
            _ => format!("view_{view:04}_step_{step:03}"),
        };
        let file = format!("difference_{}_{place}", name.replace('/', "_"));
        pictures.add(file, &image::draw(&grid, &plot))?;
    }
    Ok(pictures)
}

/// Pixels that one of the two has flags of.
fn flagged(pair: &[Compared; 2], paths: [&Path; 2], view: usize) -> Option<Array2<bool>> {
    let [a, b] = [pair[0].flags(paths[0], view), pair[1].flags(paths[1], view)];
    match (a, b) {
        (Some(mut a), Some(b)) if a.dim() == b.dim() => {
            a.zip_mut_with(&b, |a, b| *a |= b);
            Some(a)
        }
        (a, b) => a.or(b),
    }
}

/// The picture of a series. `values`: B - A in its unit.
fn plot<'a>(
    series: &Difference,
    values: &'a Array2<f64>,
    quantity: &'a Quantity,
    flagged: Option<&Array2<bool>>,
    [a, b]: [&Path; 2],
) -> ImagePlot<'a> {
    let count = flagged.map_or(0, |flagged| flagged.iter().filter(|flagged| **flagged).count());
    let trusted = flagged.and_then(trusted);
    let is_trusted = |at: usize| trusted.as_ref().is_none_or(|trusted| trusted[at]);
    let setting: Vec<f64> =
        values.iter().enumerate().filter(|(at, _)| is_trusted(*at)).map(|(_, v)| *v).collect();
    let own = Scale::of(quantity.map, &setting, quantity.empty, None);
    let scale = Scale::between(own.map, [own.low, own.high], values.iter().copied());
    let unit = |value: f64| {
        format!("{} {}", rough(value * quantity.factor), quantity.unit).trim_end().to_owned()
    };
    let [view, step, row, column] = series.largest_at;
    let place = match series.images {
        1 => String::new(),
        _ if view == 0 => format!("image {step} of {}", series.images),
        _ => format!("view {view}, step {step}"),
    };
    let flags =
        if count > 0 { format!("flagged in A or B: {}", pixels(count)) } else { String::new() };
    let beyond = scale.words_beyond(quantity.unit);
    let [a, b] = [a, b].map(beamlet::cli_support::printed::path);
    let mut below = vec![
        format!(
            "{}mean {}, rms {}, largest {} (column {column}, row {row}{})",
            match series.images {
                1 => String::new(),
                count => format!("all {count} images: "),
            },
            unit(series.mean),
            unit(series.rms),
            unit(series.largest),
            if place.is_empty() { String::new() } else { format!(", {place}") },
        ),
        joined(&[flags, beyond]),
    ];
    below.retain(|line| !line.is_empty());
    ImagePlot {
        values: values.view(),
        quantity,
        key: Key::Scale(scale),
        title: capital(&quantity.label),
        note: joined(&[format!("A: {a}"), format!("B: {b}"), place]),
        below,
    }
}
