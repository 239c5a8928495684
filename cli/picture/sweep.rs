//! Scores of designs: a line over one varied key, a map over two, lines across more; and two scores with their Pareto
//! front.

use super::axes::{Axes, BELOW, LEFT, roomy};
use super::colour::{Map, SET, SMALL};
use super::drawing::{Anchor, Area, Drawing, FAINT, GREY, INK, Paint, text_width};
use super::scale::Scale;
use super::text::short;
use beamlet::cli_support::printed::with_unit;
use beamlet::sweep::{Designs, Outcome, Results, Score};

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 360.0;
/// Room for a bar with its words.
const BAR: f64 = 140.0;

/// A picture of each score by its name, and `front` of two scores or more.
pub(crate) fn draw_all(results: &Results<'_>) -> Vec<(String, Drawing)> {
    let Results { sweep, outcomes, front, best, .. } = results;
    let designs = sweep.designs();
    let column = |place: usize| -> Vec<f64> {
        let score = &sweep.scores()[place];
        let value =
            |outcome: &Outcome| outcome.values[place].map_or(f64::NAN, |v| score.in_unit(v));
        outcomes.iter().map(value).collect()
    };
    let picture = |(place, score): (usize, &Score)| {
        let plot = ScorePlot { designs, label: label(score), values: &column(place), best: *best };
        let drawing = match designs.shape().len() {
            1 => plot.line(),
            2 => plot.map(),
            _ => plot.parallel(),
        };
        (file_name(score), drawing)
    };
    let mut all: Vec<_> = sweep.scores().iter().enumerate().map(picture).collect();
    if let [first, second, ..] = sweep.scores() {
        let labels = [label(first), label(second)];
        all.push(("front".into(), scatter(&labels, [&column(0), &column(1)], front)));
    }
    all
}

fn label(score: &Score) -> String {
    with_unit(&score.name(), score.unit())
}

/// Name of the picture of a score without its ending; signs that not every folder takes are "-".
pub(crate) fn file_name(score: &Score) -> String {
    let is_plain = |sign: char| sign.is_alphanumeric() || matches!(sign, '_' | '-' | '.');
    score.name().chars().map(|sign| if is_plain(sign) { sign } else { '-' }).collect()
}

/// Range of an axis; one value has room on both sides.
fn range(values: &[f64]) -> [f64; 2] {
    roomy(values.iter().copied())
}

fn paper(title: &str, right: f64) -> (Drawing, Area) {
    let area = Area::new(LEFT + 14.0, 48.0, WIDTH, HEIGHT);
    let mut drawing = Drawing::new(area.right() + right, area.bottom() + BELOW + 8.0);
    drawing.text([area.left, 28.0], title, 17.0, INK, Anchor::Start);
    (drawing, area)
}

/// A score over the designs.
struct ScorePlot<'a> {
    designs: &'a Designs,
    label: String,
    /// In the unit of the label; NaN of a design that is refused.
    values: &'a [f64],
    best: Option<usize>,
}

impl ScorePlot<'_> {
    fn line(&self) -> Drawing {
        let (name, at) = self.designs.axis(0);
        let (mut drawing, area) = paper(&self.label, 24.0);
        let axes = Axes { area, x: range(&at), y: range(self.values), ..Axes::default() };
        axes.grid(&mut drawing);
        let points = || at.iter().zip(self.values).map(|(x, y)| [*x, *y]);
        axes.curve(&mut drawing, points(), Paint::line(SET[0], 1.8));
        axes.dots(&mut drawing, points(), Paint::fill(SET[0]));
        let best = self.best.map(|best| [at[best], self.values[best]]);
        axes.dots(&mut drawing, best.into_iter(), Paint::fill(SET[1]));
        axes.frame(&mut drawing, &name, &self.label);
        drawing
    }

    fn scale(&self) -> Scale {
        Scale::between(Map::Viridis, range(self.values), self.values.iter().copied())
    }

    fn map(&self) -> Drawing {
        let [down, across] = [0, 1].map(|axis| Cells::of(self.designs.axis(axis)));
        let (mut drawing, area) = paper(&self.label, BAR);
        let scale = self.scale();
        // Row 0 of pixels is on top, where the first axis has its last value.
        let columns = across.count;
        let place = |row: usize, column: usize| {
            let [row, column] = [down.index(down.count - 1 - row), across.index(column)];
            row * columns + column
        };
        let cells = (0..down.count).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let colours = cells.map(|(row, column)| scale.colour(self.values[place(row, column)]));
        drawing.pixels(area, columns, colours.collect());
        let axes = Axes { area, x: across.ends, y: down.ends, ..Axes::default() };
        let best = self.best.map(|best| [across.at(best % columns), down.at(best / columns)]);
        axes.dots(&mut drawing, best.into_iter(), Paint::fill(SET[1]));
        axes.frame(&mut drawing, &across.label, &down.label);
        let bar = Area::new(area.right() + 20.0, area.top + 12.0, 16.0, area.height - 24.0);
        scale.bar(&mut drawing, bar, &self.label);
        drawing
    }

    /// A line of each design across upright axes of the keys and the score, in the colour of its score.
    fn parallel(&self) -> Drawing {
        let shape = self.designs.shape();
        let mut upright: Vec<(String, Vec<f64>)> = Vec::new();
        for axis in 0..shape.len() {
            let (name, at) = self.designs.axis(axis);
            let inner: usize = shape[axis + 1..].iter().product();
            let of_design = |design: usize| at[design / inner % shape[axis]];
            upright.push((name, (0..self.values.len()).map(of_design).collect()));
        }
        upright.push((self.label.clone(), self.values.to_vec()));
        let (mut drawing, area) = paper(&self.label, BAR);
        let scale = self.scale();
        let apart = area.width / (upright.len() - 1) as f64;
        let ranges: Vec<[f64; 2]> = upright.iter().map(|(_, values)| range(values)).collect();
        let point = |(axis, (_, values)): (usize, &(String, Vec<f64>)), design: usize| {
            let [low, high] = ranges[axis];
            let share = (values[design] - low) / (high - low);
            [area.left + apart * axis as f64, area.bottom() - share * area.height]
        };
        let line = |design: usize| upright.iter().enumerate().map(|it| point(it, design)).collect();
        for (design, value) in self.values.iter().enumerate().filter(|(_, value)| value.is_finite())
        {
            drawing.path(line(design), false, Paint::line(scale.colour(*value), 0.8));
        }
        if let Some(best) = self.best {
            drawing.path(line(best), false, Paint::line(SET[1], 2.4));
        }
        for (axis, ((name, _), [low, high])) in upright.iter().zip(&ranges).enumerate() {
            let x = area.left + apart * axis as f64;
            drawing.line([x, area.top], [x, area.bottom()], Paint::line(INK, 1.0));
            for (value, y) in [(low, area.bottom() + 15.0), (high, area.top - 5.0)] {
                drawing.text([x, y], short(*value), SMALL, GREY, Anchor::Middle);
            }
            // Long names alternate in height, and stay on the paper.
            let y = area.bottom() + 32.0 + 15.0 * (axis % 2) as f64;
            let least = 4.0 + 0.5 * text_width(name, SMALL);
            drawing.text([x.max(least), y], name.clone(), SMALL, INK, Anchor::Middle);
        }
        drawing
    }
}

/// Values of an axis as cells of equal width, in ascending order.
struct Cells {
    label: String,
    count: usize,
    ends: [f64; 2],
    falls: bool,
}

impl Cells {
    /// Cells around evenly spaced values; else around the numbers of the values from 1.
    fn of((label, at): (String, Vec<f64>)) -> Self {
        let count = at.len();
        let step = if count > 1 { (at[count - 1] - at[0]) / (count - 1) as f64 } else { 1.0 };
        let is_even = |(index, value): (usize, &f64)| {
            (value - (at[0] + step * index as f64)).abs() < 1e-6 * step.abs()
        };
        match at.iter().enumerate().all(is_even) {
            true => {
                let [a, b] = [at[0] - 0.5 * step, at[count - 1] + 0.5 * step];
                Self { label, count, ends: [a.min(b), a.max(b)], falls: step < 0.0 }
            }
            false => {
                let label = format!("number of the value of {label}");
                Self { label, count, ends: [0.5, count as f64 + 0.5], falls: false }
            }
        }
    }

    /// Number of the value of a cell from the left.
    const fn index(&self, cell: usize) -> usize {
        if self.falls { self.count - 1 - cell } else { cell }
    }

    /// Middle of the cell of a value.
    fn at(&self, value: usize) -> f64 {
        let cell = self.index(value) as f64;
        self.ends[0] + (self.ends[1] - self.ends[0]) * (cell + 0.5) / self.count as f64
    }
}

/// Two scores of all designs, with the front in another colour.
fn scatter(labels: &[String; 2], [first, second]: [&[f64]; 2], front: &[bool]) -> Drawing {
    let (mut drawing, area) = paper("Pareto front", 24.0);
    let axes = Axes { area, x: range(first), y: range(second), ..Axes::default() };
    axes.grid(&mut drawing);
    let points = || first.iter().zip(second).map(|(x, y)| [*x, *y]).zip(front);
    let is_known = |point: &[f64; 2]| point.iter().all(|value| value.is_finite());
    let of = |wanted: bool| {
        points()
            .filter(move |(point, on)| **on == wanted && is_known(point))
            .map(|(point, _)| point)
    };
    axes.dots(&mut drawing, of(false), Paint::fill(FAINT));
    let mut line: Vec<[f64; 2]> = of(true).collect();
    line.sort_by(|a, b| a[0].total_cmp(&b[0]));
    axes.curve(&mut drawing, line.into_iter(), Paint::line(SET[1], 1.2));
    axes.dots(&mut drawing, of(true), Paint::fill(SET[1]));
    axes.frame(&mut drawing, &labels[0], &labels[1]);
    drawing
}
