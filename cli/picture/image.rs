//! An image in colours on its axes, with its bar; and sinograms.

use super::axes::{Axes, BELOW, LEFT, ticks};
use super::colour::{Rgb, SMALL};
use super::drawing::{Anchor, Area, Drawing, GREY, INK, Paint, text_width};
use super::objects::{self, Objects};
use super::quantity::Quantity;
use super::scale::Scale;
use super::text::wrapped;
use ndarray::ArrayView2;

/// Longest side of an image on paper.
const SIDE: f64 = 560.0;
/// Shortest side: images of a few rows are stretched to it.
const LEAST: f64 = 90.0;
const ABOVE: f64 = 46.0;
/// Height of a line of notes.
const LINE: f64 = 16.0;
/// Room of the bar with its words.
const BAR: f64 = 122.0;

/// Positions of the pixels of an image.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    x: [f64; 2],
    /// Places of the outer edges of the lowest and the highest row.
    y: [f64; 2],
    labels: [&'static str; 2],
    /// True if x and y have one scale.
    equal: bool,
    /// Values of y with their texts, where they are not to be round numbers.
    marks: Vec<(f64, String)>,
    /// True if a bar shows a length, in mm.
    has_bar: bool,
}

impl Grid {
    /// Pixels of a detector, in mm where their pitch (x, z; m) is known, else by their numbers.
    pub(crate) fn of_pixels(pitch: Option<[f64; 2]>, [rows, columns]: [usize; 2]) -> Self {
        let marks = Vec::new();
        match pitch {
            Some([across, up]) => {
                let half = |pitch: f64, count: usize| 1e3 * pitch * count as f64 / 2.0;
                let (x, z) = (half(across, columns), half(up, rows));
                let labels = ["x on the detector [mm]", "z [mm]"];
                Self { x: [-x, x], y: [-z, z], labels, equal: true, marks, has_bar: false }
            }
            None => {
                let x = [-0.5, columns as f64 - 0.5];
                let y = [rows as f64 - 0.5, -0.5];
                Self { x, y, labels: ["column", "row"], equal: true, marks, has_bar: false }
            }
        }
    }

    /// A slice of a volume, by the edges of its voxels along x and y of the picture, mm.
    pub(crate) fn of_slice([x, y]: [[f64; 2]; 2], labels: [&'static str; 2]) -> Self {
        Self { x, y, labels, equal: true, marks: Vec::new(), has_bar: true }
    }

    /// Images of beamlets, by their number from 0, on the rows of this grid.
    pub(crate) fn of_beamlets(self, count: usize) -> Self {
        let labels = ["beamlet", self.labels[1]];
        Self { x: [-0.5, count as f64 - 0.5], labels, equal: false, ..self }
    }

    /// A row over views, view 0 on top, over angles in degrees; where these are not evenly spaced
    /// every view is as high as any other, with its angle beside it. No angles: views by number.
    pub(crate) fn of_views(self, angles: &[f64], views: usize) -> Self {
        let shown = &angles[..views.min(angles.len())];
        let even = shown.windows(3).all(|w| ((w[2] - w[1]) - (w[1] - w[0])).abs() < 1e-6);
        let (y, marks) = match shown {
            [first, second, .., last] | [first, second @ last] if even && second > first => {
                let half = (second - first) / 2.0;
                ([last + half, first - half], Vec::new())
            }
            _ => {
                let mark = |(view, angle): (usize, &f64)| (view as f64, super::text::short(*angle));
                ([views as f64 - 0.5, -0.5], shown.iter().enumerate().map(mark).collect())
            }
        };
        let label = if shown.is_empty() { "view" } else { "angle [°]" };
        Self { y, marks, labels: [self.labels[0], label], equal: false, ..self }
    }

    /// x of the middles of columns, and the label of that axis.
    pub(crate) fn across(&self, columns: usize) -> (Vec<f64>, &'static str) {
        let step = (self.x[1] - self.x[0]) / columns as f64;
        let x = (0..columns).map(|c| self.x[0] + step * (c as f64 + 0.5)).collect();
        (x, self.labels[0])
    }
}

/// Meaning of the colours of an image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Key {
    /// Values on a scale.
    Scale(Scale),
    /// Labels of objects.
    Objects(Objects),
}

impl Key {
    fn colour(&self, value: f64) -> Rgb {
        match self {
            Self::Scale(scale) => scale.colour(value),
            Self::Objects(_) => objects::colour(value),
        }
    }

    /// Room to the right of the image and the gap beside it.
    fn width(&self) -> f64 {
        match self {
            Self::Scale(_) => 16.0 + BAR,
            Self::Objects(objects) => objects.width(),
        }
    }

    /// Height from the top of the image on that the image need not have.
    fn height(&self) -> f64 {
        match self {
            Self::Scale(_) => 0.0,
            Self::Objects(objects) => objects.height(),
        }
    }

    /// Draws bar or legend to the right of an image.
    fn draw(&self, drawing: &mut Drawing, image: Area, words: &str) {
        let left = image.right() + 20.0;
        match self {
            Self::Scale(scale) => {
                let bar = Area::new(left, image.top + 12.0, 16.0, image.height - 24.0);
                scale.bar(drawing, bar, words);
            }
            Self::Objects(objects) => objects.legend(drawing, [left, image.top]),
        }
    }
}

/// An image with its words.
#[derive(Debug, Clone)]
pub(crate) struct ImagePlot<'a> {
    /// `[row][column]`, row 0 on top, in the unit of `quantity`.
    pub(crate) values: ArrayView2<'a, f64>,
    pub(crate) quantity: &'a Quantity,
    pub(crate) key: Key,
    pub(crate) title: String,
    /// Above the image.
    pub(crate) note: String,
    /// Below it, a line each.
    pub(crate) below: Vec<String>,
}

/// Width and height of an image on paper.
fn size(grid: &Grid) -> [f64; 2] {
    let [x, y] = [grid.x, grid.y].map(|[low, high]| (high - low).abs());
    match if grid.equal { y / x } else { 0.75 } {
        ratio if ratio > 1.0 => [(SIDE / ratio).max(LEAST), SIDE],
        ratio => [SIDE, (SIDE * ratio).max(LEAST)],
    }
}

/// Draws an image.
pub(crate) fn draw(grid: &Grid, image: &ImagePlot<'_>) -> Drawing {
    let [width, height] = size(grid);
    let left = LEFT + 10.0;
    let right = (left + width + 20.0 + image.key.width()).max(left + 420.0);
    let room = right - left - 12.0;
    let notes = wrapped(&image.note, room, SMALL);
    let below: Vec<String> =
        image.below.iter().flat_map(|line| wrapped(line, room, SMALL)).collect();
    let area = Area::new(left, ABOVE + LINE * notes.len().max(1) as f64, width, height);
    let foot = area.bottom() + BELOW + 6.0;
    let lines = LINE * below.len() as f64;
    let end = foot + lines + if below.is_empty() { 0.0 } else { 6.0 };
    let mut drawing = Drawing::new(right, end.max(area.top + image.key.height()));
    let colours = image.values.iter().map(|value| image.key.colour(*value)).collect();
    drawing.pixels(area, image.values.ncols(), colours);
    let axes = Axes { area, x: grid.x, y: grid.y, marks: grid.marks.clone() };
    axes.frame(&mut drawing, grid.labels[0], grid.labels[1]);
    if grid.has_bar {
        scale_bar(&mut drawing, &axes);
    }
    drawing.text([left, 26.0], image.title.clone(), 17.0, INK, Anchor::Start);
    for (at, line) in notes.into_iter().enumerate() {
        drawing.text([left, ABOVE + LINE * at as f64], line, SMALL, GREY, Anchor::Start);
    }
    for (at, line) in below.into_iter().enumerate() {
        let y = foot + 8.0 + LINE * at as f64;
        drawing.text([left, y], line, SMALL, INK, Anchor::Start);
    }
    image.key.draw(&mut drawing, area, &image.quantity.words());
    drawing
}

/// A bar of a round length, a fifth of the width or so, with its length in words.
fn scale_bar(drawing: &mut Drawing, axes: &Axes) {
    let width = axes.x[1] - axes.x[0];
    let rounds = ticks(0.0, width, 5);
    let Some((length, _)) = rounds.into_iter().find(|(length, _)| *length > 0.0) else { return };
    let area = axes.area;
    let long = length / width * area.width;
    let words = super::text::length(1e-3 * length);
    let plate = Area::new(
        area.left + 8.0,
        area.bottom() - 34.0,
        long.max(text_width(&words, SMALL)) + 16.0,
        26.0,
    );
    drawing.area(plate, Paint { fill: Some(([255; 3], 0.75)), ..Paint::default() });
    let (left, down) = (plate.left + 8.0, plate.bottom() - 6.0);
    drawing.line([left, down], [left + long, down], Paint::line(INK, 3.0));
    drawing.text([left, down - 6.0], words, SMALL, INK, Anchor::Start);
}
