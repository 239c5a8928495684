//! Values along a row, one panel above the other.

use super::axes::{Axes, BELOW, LEFT, roomy};
use super::colour::{Rgb, SET, SMALL};
use super::drawing::{Anchor, Area, Drawing, GREY, INK, Paint, text_width};
use super::text::cut;

/// A line of a panel.
#[derive(Debug, Clone)]
pub(crate) struct ProfileLine {
    /// In the legend; empty where the panel has one line.
    pub(crate) name: String,
    pub(crate) values: Vec<f64>,
    /// 1 sigma of the values, drawn as a band.
    pub(crate) sigma: Option<Vec<f64>>,
}

/// Lines over one axis of y.
#[derive(Debug, Clone)]
pub(crate) struct Panel {
    pub(crate) label: String,
    pub(crate) lines: Vec<ProfileLine>,
    /// True if zero has a line.
    pub(crate) zero: bool,
    /// Places that do not set the range of y, and have a mark; empty where there are none.
    pub(crate) flagged: Vec<bool>,
    /// Name of the band in the legend.
    pub(crate) band: String,
}

impl Panel {
    fn is_flagged(&self, at: usize) -> bool {
        self.flagged.get(at).copied().unwrap_or(false)
    }

    /// Values and the edges of their bands; flagged places only if all are flagged.
    fn reach(&self) -> [f64; 2] {
        let all = |with_flagged: bool| {
            let of_line = move |line: &ProfileLine| {
                let sigma = |at: usize| line.sigma.as_ref().map_or(0.0, |sigma| sigma[at]);
                let places =
                    (0..line.values.len()).filter(move |at| with_flagged || !self.is_flagged(*at));
                let edges = |at: usize| {
                    let (value, sigma) = (line.values[at], sigma(at));
                    [value, value + sigma, value - sigma]
                };
                places.flat_map(edges).collect::<Vec<f64>>()
            };
            self.lines.iter().flat_map(of_line).filter(|v| v.is_finite()).collect::<Vec<f64>>()
        };
        let clean = all(false);
        roomy(if clean.is_empty() { all(true) } else { clean }.into_iter())
    }
}

/// Opacity of a band.
const BAND: f64 = 0.28;
/// Colour of the mark of flagged places.
const FLAG: Rgb = [190, 30, 45];
const HEIGHT: f64 = 170.0;
/// Room of the title.
const TOP: f64 = 76.0;
const GAP: f64 = 26.0;

/// Draws panels over the same x; `note` is below the title.
pub(crate) fn draw([title, note]: [&str; 2], x: &[f64], across: &str, panels: &[Panel]) -> Drawing {
    let count = panels.len() as f64;
    let height = TOP + count * (HEIGHT + GAP) + BELOW - 6.0;
    let mut drawing = Drawing::new(LEFT + 14.0 + 700.0 + 24.0, height);
    drawing.text([LEFT + 14.0, 28.0], cut(title, 700.0, 17.0), 17.0, INK, Anchor::Start);
    drawing.text([LEFT + 14.0, 47.0], note, SMALL, GREY, Anchor::Start);
    let range = x.first().zip(x.last()).map_or([0.0, 1.0], |(a, b)| match a < b {
        true => [*a, *b],
        false => [a - 0.5, a + 0.5],
    });
    let mut top = TOP;
    for (index, panel) in panels.iter().enumerate() {
        let area = Area::new(LEFT + 14.0, top, 700.0, HEIGHT);
        let axes = Axes { area, x: range, y: panel.reach(), ..Axes::default() };
        axes.grid(&mut drawing);
        if panel.zero {
            let zero = [[range[0], 0.0], [range[1], 0.0]];
            axes.curve(&mut drawing, zero.into_iter(), Paint::line([90, 90, 96], 0.9));
        }
        for (line, colour) in panel.lines.iter().zip(SET) {
            band(&mut drawing, &axes, x, line, colour);
            let points = || x.iter().zip(&line.values).map(|(x, y)| [*x, *y]);
            axes.curve(&mut drawing, points(), Paint::line(colour, 1.6));
            // Few pixels are drawn as steps; a single one would be invisible otherwise.
            if x.len() <= 24 {
                axes.dots(&mut drawing, points(), Paint::fill(colour));
            }
        }
        flags(&mut drawing, &axes, x, panel);
        let last = index + 1 == panels.len();
        axes.frame(&mut drawing, if last { across } else { "" }, &panel.label);
        legend(&mut drawing, area, panel);
        top += HEIGHT + GAP;
    }
    drawing
}

/// The band of 1 sigma, in parts where values are missing.
fn band(drawing: &mut Drawing, axes: &Axes, x: &[f64], line: &ProfileLine, colour: Rgb) {
    let Some(sigma) = &line.sigma else { return };
    let paint = Paint { fill: Some((colour, BAND)), ..Paint::default() };
    drawing.clip(Some(axes.area));
    let known: Vec<bool> =
        line.values.iter().zip(sigma).map(|(v, s)| v.is_finite() && s.is_finite()).collect();
    let mut at = 0;
    for part in known.chunk_by(|a, b| a == b) {
        let places = at..at + part.len();
        at += part.len();
        if part[0] {
            let edge = |i: usize, sign: f64| axes.at([x[i], line.values[i] + sign * sigma[i]]);
            let above = places.clone().map(|i| edge(i, 1.0));
            let below = places.rev().map(|i| edge(i, -1.0));
            drawing.path(above.chain(below).collect(), true, paint);
        }
    }
    drawing.clip(None);
}

/// A mark at the lower edge of each flagged place.
fn flags(drawing: &mut Drawing, axes: &Axes, x: &[f64], panel: &Panel) {
    for (_, x) in x.iter().enumerate().filter(|(at, _)| panel.is_flagged(*at)) {
        mark(drawing, [axes.across(*x), axes.area.bottom() - 5.0]);
    }
}

fn mark(drawing: &mut Drawing, [x, y]: [f64; 2]) {
    for end in [[x + 3.0, y + 3.0], [x - 3.0, y + 3.0]] {
        drawing.line([2.0 * x - end[0], y - 3.0], end, Paint::line(FLAG, 1.4));
    }
}

/// Names of the lines, of the band and of the mark, from the right.
fn legend(drawing: &mut Drawing, area: Area, panel: &Panel) {
    let mut right = area.right() - 8.0;
    let y = area.top - 6.0;
    let mut entry = |name: &str, sign: &dyn Fn(&mut Drawing, [f64; 2])| {
        drawing.text([right, y], name, SMALL, INK, Anchor::End);
        let left = right - text_width(name, SMALL) - 6.0;
        sign(drawing, [left - 20.0, y - 4.0]);
        right = left - 34.0;
    };
    if panel.flagged.contains(&true) {
        entry("flagged", &|drawing, [x, y]| mark(drawing, [x + 14.0, y]));
    }
    for (line, colour) in panel.lines.iter().zip(SET).rev() {
        if line.sigma.is_some() {
            let fill = Paint { fill: Some((colour, BAND)), ..Paint::default() };
            entry(&panel.band, &|drawing, [x, y]| {
                drawing.area(Area::new(x, y - 5.0, 20.0, 10.0), fill);
            });
        }
        if !line.name.is_empty() {
            let paint = Paint::line(colour, 2.0);
            entry(&line.name, &|drawing, [x, y]| drawing.line([x, y], [x + 20.0, y], paint));
        }
    }
}
